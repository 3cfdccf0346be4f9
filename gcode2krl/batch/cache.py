"""What was computed before, in plain files: a ZIP an entry, named by the hash of what it was computed from.

An entry holds ``record.json`` and the files that were written. It appears whole by being renamed, so two
processes may use one folder at once; an entry that cannot be read is none. The entries that were used longest
ago go first when the folder grows beyond its size.
"""

import contextlib
import hashlib
import json
import os
import re
import sys
import tempfile
import time
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcode2krl.files import SURELY_LEFT_S, unwritable

FOLDER_VARIABLE = "GCODE2KRL_CACHE"
"""In the environment: the folder of the cache."""
DEFAULT_GB = 2.0
_ENTRY = re.compile(r"[0-9a-f]{64}\.zip")
_BEGUN = re.compile(r"\.entry-.*\.part")
_RECORD = "record.json"
_FILES = "files/"
_QUICK = 1
"""Level of deflate: KRL is a seventh at once, and hardly less at the highest."""
_A_DAY_LONG_AGO = (1980, 1, 1, 0, 0, 0)
_DAMAGED = (OSError, zipfile.BadZipFile, zlib.error, ValueError, KeyError, EOFError, NotImplementedError)


def default_folder() -> Path:
    """Return the folder of the cache: what the environment names, or the user's on this platform."""
    named = os.environ.get(FOLDER_VARIABLE)
    if named:
        return Path(named)
    home = Path.home()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "gcode2krl" / "Cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "gcode2krl"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "gcode2krl"


@dataclass(frozen=True)
class Entry:
    """What became of a part: its record, and the names of its files, which are read when they are needed."""

    place: Path
    record: dict[str, Any]
    names: tuple[str, ...]

    def content(self, name: str, sha256: str) -> bytes:
        """Return a file; raises `ValueError` where it is not what it was."""
        try:
            with zipfile.ZipFile(self.place) as archive:
                content = archive.read(_FILES + name)
        except _DAMAGED as error:
            raise ValueError(f"{self.place}: {error}") from None
        if hashlib.sha256(content).hexdigest() != sha256:
            raise ValueError(f"{self.place}: {name} is not what was written")
        return content


_CLEARED = (FileNotFoundError, FileExistsError)
"""Another process has taken the folder away, before a file in it is made or while `mkdir` looks for it."""
_TRIES = 5


@dataclass(frozen=True)
class Cache:
    """Entries in a folder; ``most_bytes`` is what `prune` leaves."""

    folder: Path
    most_bytes: int

    def get(self, key: str) -> Entry | None:
        """Return an entry, None where there is none or it is damaged."""
        place = self._place(key)
        try:
            with zipfile.ZipFile(place) as archive:
                record = json.loads(archive.read(_RECORD))
                names = tuple(n.removeprefix(_FILES) for n in archive.namelist() if n.startswith(_FILES))
            if not isinstance(record, dict):
                return None
        except _DAMAGED:
            return None
        with contextlib.suppress(OSError):
            os.utime(place)  # the entries used longest ago go first
        return Entry(place, record, names)

    def put(self, key: str, record: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
        """Keep an entry; raises `NotUnderstoodError` where the folder cannot be written."""
        place = self._place(key)
        try:
            for _ in range(_TRIES - 1):
                with contextlib.suppress(*_CLEARED):
                    return self._write(place, record, files)
            self._write(place, record, files)
        except PermissionError:
            if not place.exists():  # Windows: another process reads the entry, which is the same
                raise unwritable(self.folder, "no rights to write there") from None
        except OSError as error:
            raise unwritable(self.folder, error.strerror or str(error)) from None

    def entries(self) -> list[tuple[Path, os.stat_result]]:
        """Return all entries, those that were used longest ago first."""
        return sorted(self._files(_ENTRY), key=lambda entry: entry[1].st_mtime)

    def prune(self) -> int:
        """Remove entries until the rest fits, and what killed processes left; return how many bytes went."""
        entries, gone = self.entries(), 0
        too_many = sum(about.st_size for _, about in entries) - self.most_bytes
        for place, about in entries:
            if gone >= too_many:
                break
            gone += _removed(place, about)
        for place, about in self._files(_BEGUN):
            if time.time() - about.st_mtime > SURELY_LEFT_S:
                gone += _removed(place, about)
        return gone

    def clear(self) -> int:
        """Remove all entries and nothing else; return how many bytes went."""
        gone = sum(_removed(*entry) for entry in [*self._files(_ENTRY), *self._files(_BEGUN)])
        for folder in self._folders():
            with contextlib.suppress(OSError):  # something else is in it
                folder.rmdir()
        return gone

    def _write(self, place: Path, record: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
        place.parent.mkdir(parents=True, exist_ok=True)
        descriptor, begun = tempfile.mkstemp(prefix=".entry-", suffix=".part", dir=place.parent)
        try:
            with os.fdopen(descriptor, "wb") as stream, zipfile.ZipFile(stream, "w") as archive:
                _add(archive, _RECORD, json.dumps(record, allow_nan=False).encode())
                for name, content in files.items():
                    _add(archive, _FILES + name, content)
            Path(begun).replace(place)
        except BaseException:
            with contextlib.suppress(OSError):
                Path(begun).unlink()
            raise

    def _place(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.zip"

    def _folders(self) -> list[Path]:
        try:
            return [place for place in self.folder.iterdir() if re.fullmatch(r"[0-9a-f]{2}", place.name)]
        except OSError:
            return []

    def _files(self, pattern: re.Pattern[str]) -> Iterator[tuple[Path, os.stat_result]]:
        for folder in self._folders():
            with contextlib.suppress(OSError):
                for place in folder.iterdir():
                    if pattern.fullmatch(place.name):
                        with contextlib.suppress(OSError):  # another process removed it
                            yield place, place.stat()


def _add(archive: zipfile.ZipFile, name: str, content: bytes) -> None:
    about = zipfile.ZipInfo(name, _A_DAY_LONG_AGO)
    about.compress_type = zipfile.ZIP_DEFLATED
    archive.writestr(about, content, compresslevel=_QUICK)


def _removed(place: Path, about: os.stat_result) -> int:
    """Remove a file; return its size, 0 where it is in use or already gone."""
    try:
        place.unlink()
    except OSError:
        return 0
    return about.st_size
