"""Writing several files that belong together, all or none; never over an input, no half-written file left.

All are written beside their places first, then renamed. What a killed run left beside them is removed by the
next run that writes the same files: their names state host and process.
"""

import contextlib
import contextvars
import os
import platform
import re
import shutil
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from gcode2krl.compiled.threads import in_background
from gcode2krl.errors import NotUnderstoodError, input_error

if TYPE_CHECKING:
    from concurrent.futures import Future

Content = bytes | Iterable[bytes] | Callable[[Path], object]
"""The content of a file, its pieces, or a function that writes it to a path."""
SURELY_LEFT_S = 86400.0
"""No run takes a day to write a file: an older temporary file is a leftover of whatever process."""
_MOST_WAIT_S = 20.0
"""Renaming takes milliseconds: a marker that is older was left by a run that was killed in them."""
_MARKER = ".gcode2krl.taking"
_Stamp = tuple[int, int] | None
"""When a file was last written (ns) and its size in bytes; None where there is none."""
_BEGUN_WITH: contextvars.ContextVar["_Begun | None"] = contextvars.ContextVar(
    "outputs when a run began", default=None
)
_HOST = f"{zlib.crc32(platform.node().encode()):08x}"
_MOST_INPUTS = 10_000
"""Most files of an input folder that outputs are compared with."""


def write_together(files: Mapping[Path, Content], inputs: Iterable[str | Path] = ()) -> None:
    """Write all files or none.

    Raises `NotUnderstoodError` where a file is one of the inputs, a folder does not exist, or the disk
    refuses; nothing half-written stays.
    """
    refuse_inputs(files, inputs)
    with Staging() as staging:
        for place in files:
            staging.expect(place)
        for place, content in files.items():
            staging.write(place, content)
        staging.take_places()


class _Begun:
    """What stood at places, or anywhere in a folder, when a run began; what it writes itself is kept up."""

    def __init__(self, places: Iterable[Path], folder: Path | None) -> None:
        self.folder = None if folder is None else _full_name(folder) + os.sep
        self.stamps = {_full_name(place): _stamp(place) for place in places}

    def knows(self, name: str) -> bool:
        return name in self.stamps or (self.folder is not None and name.startswith(self.folder))


@contextlib.contextmanager
def watched(places: Iterable[Path] = (), folder: Path | None = None) -> Iterator[None]:
    """Refuse to write these places, or any in a folder, where another process writes them from now on."""
    inside = () if folder is None else folder.rglob("*")
    begun = _BEGUN_WITH.set(_Begun((*places, *inside), folder))
    try:
        yield
    finally:
        _BEGUN_WITH.reset(begun)


class Staging:
    """Files that are written beside their places, and take them together; left without that, they go."""

    def __init__(self) -> None:
        """Begin without a file."""
        self._temporary: dict[Path, Path] = {}
        self._on_disk: dict[Path, Future[None]] = {}
        self._begun_with: dict[str, _Stamp] = {}

    def __enter__(self) -> "Staging":
        return self

    def __exit__(self, *_: object) -> None:
        self.discard()

    def write(self, place: Path, content: Content) -> Path:
        """Write what will stand at a place, and return where it stands until then.

        It can be read at once; `take_places` waits until the disk has it. Raises `NotUnderstoodError` where
        folder or disk refuse.
        """
        _remove(leftovers(place))
        self.expect(place)
        try:
            self._temporary[place], kept = _write_beside(place, content)
        except OSError as error:
            raise unwritable(place, error.strerror or str(error)) from None
        if kept is not None:
            self._on_disk[place] = in_background(partial(_sync, kept))
        return self._temporary[place]

    def expect(self, place: Path) -> None:
        """Take what stands at a place now, or when `watched` looked, as what may be overwritten."""
        name = _full_name(place)
        if name not in self._begun_with:
            run = _BEGUN_WITH.get()
            known = run is not None and run.knows(name)
            self._begun_with[name] = run.stamps.get(name) if run is not None and known else _stamp(place)

    def take_places(self) -> None:
        """Put all files in their places, or none.

        Raises `NotUnderstoodError` where the disk refuses, or another process has written one of them since.
        """
        for place, done in self._on_disk.items():
            try:
                done.result()
            except OSError as error:
                raise unwritable(place, error.strerror or str(error)) from None
        with contextlib.ExitStack() as stack:
            for folder in sorted({place.parent.resolve() for place in self._temporary}):
                stack.enter_context(_alone_in(folder))
            for place in self._temporary:
                now = _stamp(place)
                if now is not None and now != self._begun_with[_full_name(place)]:
                    raise written_meanwhile(place)
            self._replace()
            run = _BEGUN_WITH.get()
            if run is not None:
                names = {_full_name(place): place for place in self._temporary}
                run.stamps |= {name: _stamp(place) for name, place in names.items() if run.knows(name)}
        self._begun_with.clear()

    def _replace(self) -> None:
        kept: dict[Path, Path] = {}
        place = next(iter(self._temporary))
        try:
            for place, written in self._temporary.items():
                if place.exists():
                    kept[place] = _keep(place, written.with_suffix(".old"))
            for place, written in self._temporary.items():
                written.replace(place)
        except BaseException as error:
            _restore(self._temporary, kept)
            if isinstance(error, OSError):
                raise unwritable(place, error.strerror or str(error)) from None
            raise
        _remove(kept.values())

    def discard(self) -> None:
        """Remove the files that have not taken their places."""
        for done in self._on_disk.values():
            done.exception()  # waited for: not everywhere can an open file be removed
        self._on_disk.clear()
        _remove(self._temporary.values())
        self._temporary.clear()


def refuse_inputs(outputs: Iterable[Path], inputs: Iterable[str | Path]) -> None:
    """Raise `NotUnderstoodError` where an output is an input by whatever name, or two outputs are one file.

    An input may be a folder: then every file in it counts.
    """
    seen: dict[str, Path] = {}
    existing: list[Path] = []
    for output in outputs:
        name = str(output.parent.resolve() / output.name).casefold()  # Windows ignores case
        other = seen.setdefault(name, output)
        if other is not output:
            sentence = f"{output.name} would be written twice, with different content"
            raise input_error("output-is-input", sentence, "choose different names", source=str(output))
        if output.exists():
            existing.append(output)
    if not existing:
        return
    for file in _files_of(inputs):
        for output in existing:
            if _is_same(output, file):
                sentence = f"{output.name} is an input and would be overwritten"
                raise input_error(
                    "output-is-input", sentence, "choose another name with -o", source=str(output)
                )


def _files_of(inputs: Iterable[str | Path]) -> Iterable[Path]:
    for path in map(Path, inputs):
        if not path.is_dir():
            yield path
            continue
        for count, file in enumerate(path.rglob("*")):
            if count == _MOST_INPUTS:
                break
            yield file


def _is_same(output: Path, file: Path) -> bool:
    """Tell whether two paths are one file: other spelling, symbolic or hard link."""
    try:
        return output.samefile(file)
    except OSError:
        return False


def make_folder(folder: Path) -> None:
    """Make a folder if its parent exists; raises `NotUnderstoodError` where that is not possible."""
    try:
        folder.mkdir(exist_ok=True)
    except FileExistsError:
        raise input_error(
            "output-unwritable", "this is a file", "name a folder", source=str(folder)
        ) from None
    except OSError as error:
        raise unwritable(folder, error.strerror or str(error)) from None


def unwritable(target: Path, why: str) -> NotUnderstoodError:
    """Return the error for an output that cannot be written."""
    return input_error(
        "output-unwritable", f"cannot write: {why}", "check folder, rights and space", source=str(target)
    )


def written_meanwhile(place: Path) -> NotUnderstoodError:
    """Return the error for an output that another process has written since this one began."""
    sentence = f"another process has written {place.name} meanwhile; nothing of this run was written"
    return input_error(
        "output-changed", sentence, "run it again, or choose another name with -o", source=str(place)
    )


# --- leftovers of killed runs -----------------------------------------------------------------------------


def leftovers(target: Path) -> list[Path]:
    """Return the temporary files of a target that dead processes have left."""
    pattern = re.compile(
        rf"\.{re.escape(target.name)}\.(?:([0-9a-f]{{8}})-(\d+)-)?[0-9a-z_]{{8}}\.(?:part|old)"
    )
    leftover = []
    with contextlib.suppress(OSError):
        for file in target.parent.iterdir():
            match = pattern.fullmatch(file.name)
            if match and _is_left(file, match[1], match[2]):
                leftover.append(file)
    return leftover


def _is_left(file: Path, host: str | None, process: str | None) -> bool:
    """Tell whether a temporary file is a leftover; a file of another host is judged by its age."""
    if host == _HOST and process is not None and int(process) != os.getpid() and not _lives(int(process)):
        return True
    with contextlib.suppress(OSError):
        return time.time() - file.lstat().st_mtime > SURELY_LEFT_S
    return False


def _lives(process: int) -> bool:
    """Tell whether a process of this host is alive, or may be."""
    if sys.platform == "win32":
        import ctypes

        synchronize, still_running = 0x00100000, 0x102
        windows = ctypes.windll.kernel32
        handle = windows.OpenProcess(synchronize, False, process)
        if not handle:
            return bool(windows.GetLastError() == 5)  # access denied: it is somebody else's
        lives = windows.WaitForSingleObject(handle, 0) == still_running
        windows.CloseHandle(handle)
        return bool(lives)
    try:
        os.kill(process, 0)  # asks only
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


# --- two processes that write the same files --------------------------------------------------------------


def _full_name(place: Path) -> str:
    return os.path.normcase(place.parent.resolve() / place.name)


def _stamp(place: Path) -> _Stamp:
    try:
        state = place.stat()
    except OSError:
        return None
    return state.st_mtime_ns, state.st_size  # no inode: network shares make them up


@contextlib.contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder's marker for the moment of looking and renaming; raises where it does not come free."""
    marker, begun_s = folder / _MARKER, time.monotonic()
    while True:
        try:
            descriptor = os.open(marker, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
            break
        except FileExistsError:
            if _is_left_marker(marker, time.monotonic() - begun_s):
                _remove([marker])
            else:
                time.sleep(0.01)
        except PermissionError as error:  # Windows: it is just being removed
            if time.monotonic() - begun_s > 1.0:
                raise unwritable(folder, error.strerror or str(error)) from None
            time.sleep(0.01)
        except OSError as error:
            raise unwritable(folder, error.strerror or str(error)) from None
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(f"{_HOST}-{os.getpid()}".encode("ascii"))
        yield
    finally:
        _remove([marker])


def _is_left_marker(marker: Path, waited_s: float) -> bool:
    """Tell whether a marker is that of a killed run: its process is dead, or it has stood far too long."""
    with contextlib.suppress(OSError, ValueError):
        host, _, process = marker.read_text("ascii").partition("-")
        if host == _HOST and process and not _lives(int(process)):
            return True
    return waited_s > _MOST_WAIT_S


# --- one file ---------------------------------------------------------------------------------------------


def _keep(target: Path, place: Path) -> Path:
    """Keep a file under a second name: a hard link, or a copy where the disk has no links."""
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


def _write_beside(target: Path, content: Content) -> tuple[Path, int | None]:
    """Write a file beside its place; return its path, and for `_sync` a descriptor of what has pieces."""
    if target.is_dir():
        raise IsADirectoryError(0, "this is a folder")
    prefix = f".{target.name}.{_HOST}-{os.getpid()}-"
    descriptor, name = tempfile.mkstemp(prefix=prefix, suffix=".part", dir=target.parent)
    written, kept = Path(name), None
    try:
        with os.fdopen(descriptor, "wb") as stream:
            if not callable(content):
                stream.writelines([content] if isinstance(content, bytes) else content)
                kept = os.dup(descriptor)
        if callable(content):
            content(written)
        mode = target.stat().st_mode if target.exists() else 0o666 & ~_umask()
        written.chmod(mode & 0o777)
    except BaseException:
        with contextlib.suppress(OSError):
            if kept is not None:
                os.close(kept)
            written.unlink()
        raise
    return written, kept


def _sync(descriptor: int) -> None:
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
