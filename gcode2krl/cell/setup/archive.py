"""The data lists in an archive of a controller: a folder, or the zip that *File > Archive* writes.

An archive is foreign: nothing of it is unpacked to disk, and sizes and counts are bounded.
"""

import os
import struct
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from gcode2krl.errors import Gcode2KrlError, input_error

WANTED = ("$config.dat", "$machine.dat")
"""TOOL_DATA, BASE_DATA, LOAD_DATA and XHOME; the robot's name, limits, lengths and mounting."""
VERSION = "am.ini"
"""Of the archive itself, at its top: which KSS wrote it."""
MOST_FILES = 50_000
"""An archive of everything has some thousand files."""
MOST_ARCHIVE_BYTES = 2_000_000_000
MOST_DIRECTORY_BYTES = 16_000_000
"""Of the list of files in a zip; `zipfile` holds all of it in memory."""
MOST_BYTES = 4_000_000
"""Of a data list; the largest have 0.1 MB."""
_END, _END_64 = b"PK\x05\x06", b"PK\x06\x07"
_END_BYTES, _LOCATOR_BYTES, _MOST_COMMENT = 22, 20, 65_535
_BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError, OSError, ValueError)
"""What `zipfile` raises on damaged, encrypted and unknown members."""


@dataclass(frozen=True)
class DataList:
    """A data list: its path in the archive, and its text."""

    path: str
    text: str


def read_archive(path: Path) -> dict[str, DataList]:
    """Return name → data list of those in `WANTED` that a folder or zip has, and its `VERSION` beside them.

    Raises `NotUnderstoodError` where there is none, where those of several robots differ, and where the
    archive is damaged or too large.
    """
    try:
        entries = _of_folder(path) if path.is_dir() else _of_zip(path)
    except OSError as error:
        raise _refused(path, f"cannot read: {error.strerror or error}", "name a folder or a zip") from None
    found = {name: _only_one(name, entries, path) for name in WANTED}
    lists = {name: one for name, one in found.items() if one is not None}
    if not lists:
        sentence = f"no {' and no '.join(WANTED)} in it"
        raise _refused(path, sentence, "archive with File > Archive > USB (KUKA) > All, and name that zip")
    own = [one for one in entries if PurePosixPath(one.path).name.lower() == VERSION]
    top = min(own, key=lambda one: one.path.count("/"), default=None)
    return lists if top is None else {**lists, VERSION: top}


def _only_one(name: str, entries: Iterable[DataList], path: Path) -> DataList | None:
    """Return the data list of that name, of the robot rather than of the controller's own ``STEU``."""
    alike = [one for one in entries if PurePosixPath(one.path).name.lower() == name]
    of_robot = [one for one in alike if "r1" in one.path.lower().split("/")] or alike
    if len({one.text for one in of_robot}) > 1:
        places = ", ".join(sorted(one.path for one in of_robot)[:4])
        raise _refused(path, f"several {name} that differ: {places}", "name the folder of one of them")
    return of_robot[0] if of_robot else None


def _of_folder(folder: Path) -> list[DataList]:
    lists = []
    for count, file in enumerate(_files(folder)):
        if count >= MOST_FILES:
            raise _refused(folder, f"more than {MOST_FILES:,} files", "name the folder of the archive alone")
        if file.name.lower() in (*WANTED, VERSION):
            with file.open("rb") as stream:
                lists.append(
                    _data_list(file.relative_to(folder).as_posix(), stream.read(MOST_BYTES + 1), folder)
                )
    return lists


def _files(folder: Path) -> Iterator[Path]:
    """Yield the files below a folder; links to folders are not followed."""
    for place, _, names in os.walk(folder, followlinks=False):
        yield from (Path(place) / name for name in names)


def _of_zip(path: Path) -> list[DataList]:
    _refuse_large_zip(path)
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            if len(members) > MOST_FILES:
                raise _refused(path, f"more than {MOST_FILES:,} files", "archive the controller anew")
            wanted = [one for one in members if _name_in_zip(one).lower() in (*WANTED, VERSION)]
            lists = []
            for member in wanted[: 3 * MOST_LISTS]:
                with archive.open(member) as stream:
                    lists.append(_data_list(_path_in_zip(member), stream.read(MOST_BYTES + 1), path))
            return lists
    except Gcode2KrlError:
        raise
    except _BROKEN as error:
        raise _refused(path, f"not a zip that can be read: {error}"[:200], "archive anew") from None


MOST_LISTS = 16
"""Most data lists of a name; a controller has two."""


def _path_in_zip(member: zipfile.ZipInfo) -> str:
    return member.filename.replace("\\", "/")


def _name_in_zip(member: zipfile.ZipInfo) -> str:
    return PurePosixPath(_path_in_zip(member)).name


def _refuse_large_zip(path: Path) -> None:
    """Raise if the zip, or the list of its files, is larger than any archive: before `zipfile` reads it."""
    size = path.stat().st_size
    if size > MOST_ARCHIVE_BYTES:
        raise _refused(
            path, f"more than {MOST_ARCHIVE_BYTES // 10**9} GB", "name the archive of one controller"
        )
    with path.open("rb") as stream:
        stream.seek(max(0, size - _END_BYTES - _MOST_COMMENT - _LOCATOR_BYTES))
        tail = stream.read()
    end = tail.rfind(_END)
    if end < 0 or end + _END_BYTES > len(tail):
        raise _refused(path, "neither a folder nor a zip", "name a folder or a zip")
    (directory_bytes,) = struct.unpack_from("<L", tail, end + 12)
    if _END_64 in tail[:end] or directory_bytes > MOST_DIRECTORY_BYTES:
        raise _refused(path, f"more than {MOST_FILES:,} files", "name the archive of one controller")


def _data_list(path: str, content: bytes, archive: Path) -> DataList:
    if len(content) > MOST_BYTES:
        sentence = f"{path[:100]}: more than {MOST_BYTES // 10**6} MB: not a data list"
        raise _refused(archive, sentence, "archive anew")
    return DataList(path, content.decode("latin-1"))


def _refused(path: Path, sentence: str, remedy: str) -> Gcode2KrlError:
    return input_error("archive", sentence, remedy, source=str(path))
