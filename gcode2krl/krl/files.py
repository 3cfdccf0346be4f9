"""Writing several files that belong together: all beside their places first, then renamed, or none."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from gcode2krl.errors import NotUnderstoodError, input_error


def write_together(files: Mapping[Path, bytes]) -> None:
    """Write all files or none.

    Raises `NotUnderstoodError` where a folder does not exist or the disk refuses; nothing half-written stays.
    """
    temporary: dict[Path, Path] = {}
    kept: dict[Path, Path] = {}
    try:
        for target, content in files.items():
            temporary[target] = _write_beside(target, content)
        for target, written in temporary.items():
            if target.exists():
                kept[target] = _keep(target, written.with_suffix(".old"))
        for target, written in temporary.items():
            written.replace(target)
    except OSError as error:
        _restore(temporary, kept)
        raise unwritable(next(iter(files)), error.strerror or str(error)) from None
    else:
        _remove(kept.values())
    finally:
        _remove(temporary.values())


def _keep(target: Path, place: Path) -> Path:
    """Keep a file under a second name: a hard link, or a copy where the disk knows none."""
    try:
        place.hardlink_to(target)
    except (OSError, NotImplementedError):
        shutil.copyfile(target, place)
    return place


def _restore(temporary: Mapping[Path, Path], kept: Mapping[Path, Path]) -> None:
    """Put the old files back and take new ones away; an old file that cannot be put back stays kept."""
    for target, written in temporary.items():
        replaced = not written.exists()
        with contextlib.suppress(OSError):
            if replaced and target in kept:
                shutil.copyfile(kept[target], target)
            elif replaced:
                target.unlink()
            if target in kept:
                kept[target].unlink()


def _remove(files: Iterable[Path]) -> None:
    for file in files:
        with contextlib.suppress(OSError):
            file.unlink(missing_ok=True)


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
