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
    try:
        for target, content in files.items():
            temporary[target] = _write_beside(target, content)
        for target, written in temporary.items():
            written.replace(target)
    except OSError as error:
        place = str(error.filename or next(iter(files)))
        raise unwritable(next(iter(files)), error.strerror or place) from None
    finally:
        for written in temporary.values():
            with contextlib.suppress(OSError):
                written.unlink(missing_ok=True)


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
