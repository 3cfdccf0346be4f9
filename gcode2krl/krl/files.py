"""Writing several files that belong together: all beside their places first, then renamed, or none."""

import contextlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from gcode2krl.errors import NotUnderstoodError, input_error


def write_together(files: Mapping[Path, bytes]) -> None:
    """Write all files or none.

    Raises `NotUnderstoodError` where a folder does not exist or the disk refuses; nothing half-written stays.
    """
    temporary: dict[Path, Path] = {}
    aside: dict[Path, Path] = {}
    try:
        for target, content in files.items():
            temporary[target] = _write_beside(target, content)
        for target, written in temporary.items():
            if target.exists():
                old = written.with_suffix(".old")
                target.replace(old)
                aside[target] = old
            written.replace(target)
    except OSError as error:
        _restore(temporary, aside)
        raise unwritable(next(iter(files)), error.strerror or str(error)) from None
    finally:
        for leftover in (*temporary.values(), *aside.values()):
            with contextlib.suppress(OSError):
                leftover.unlink(missing_ok=True)


def _restore(temporary: Mapping[Path, Path], aside: Mapping[Path, Path]) -> None:
    """Put the old files back, and take new ones away that have none."""
    for target, written in temporary.items():
        with contextlib.suppress(OSError):
            if target in aside:
                os.replace(aside[target], target)  # noqa: PTH105 - not the call that has just failed
            elif not written.exists():
                target.unlink(missing_ok=True)


def unwritable(target: Path, why: str) -> NotUnderstoodError:
    """Return the error for an output that cannot be written."""
    return input_error(
        "output-unwritable", f"cannot write: {why}", "check folder, rights and space", source=str(target)
    )


def _write_beside(target: Path, content: bytes) -> Path:
    descriptor, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
    written = Path(name)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        mode = target.stat().st_mode if target.exists() else 0o666 & ~_umask()
        written.chmod(mode & 0o777)
    except BaseException:
        with contextlib.suppress(OSError):
            written.unlink()
        raise
    return written


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
