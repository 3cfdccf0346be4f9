"""Which parts a batch translates: folders, patterns, files, lists of files, and a cell for each folder."""

import glob
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from gcode2krl.errors import Gcode2KrlError, Issue, NotUnderstoodError, input_error
from gcode2krl.files.program_names import ENDINGS, PACKED_ENDING, is_program_file
from gcode2krl.files.toml_guard import NotTomlError, read_bounded_toml

_SIGN_OF_LIST = "@"
_FORMAT = "see docs/batch.md for the format"
_KEYS = ("path", "cell", "job")


@dataclass(frozen=True)
class BatchPart:
    """A part of a batch."""

    key: str
    """Its name in the batch and its place in the output folder: a path with ``/``, below the folder given."""
    file: Path
    cell: Path | None = None
    job: Path | None = None

    @property
    def folder(self) -> str:
        """The folder of its outputs, below the output folder and with ``/`` at its end, or empty."""
        return self.key.rpartition("/")[0] + "/" if "/" in self.key else ""


def find_parts(words: Iterable[str], cell: Path | None = None, job: Path | None = None) -> list[BatchPart]:
    """Return the parts that words name, sorted by their keys.

    A word is a folder (all files in it with an ending of programs, however deep), a pattern such as
    ``a/**/*.nc``, a file, ``@parts.txt`` with a word a line, or a TOML file with a cell for each folder.
    ``cell`` and ``job`` serve those that have none of their own. Raises `NotUnderstoodError` where a word
    names nothing, or two parts have one key.
    """
    named = list(words)
    several = len(named) > 1
    all_parts = [part for word in named for part in _of_word(word, Path(), cell, job, several)]
    parts: dict[str, BatchPart] = {}
    for part in sorted(all_parts, key=lambda one: one.key):
        other = parts.setdefault(part.key, part)
        if other.file.resolve() != part.file.resolve() or (other.cell, other.job) != (part.cell, part.job):
            _refuse_alike(other.file, part.file, part.key)
    if not parts:
        raise input_error("file-unreadable", "no part is named", "name a folder with G-code")
    return list(parts.values())


def _of_word(
    word: str, folder: Path, cell: Path | None, job: Path | None, several: bool
) -> Iterator[BatchPart]:
    """Yield the parts of a word; relative names begin at ``folder``."""
    if word.startswith(_SIGN_OF_LIST) and not (folder / word).exists():
        yield from _of_list(Path(folder / word[1:]), cell, job)
        return
    place = folder / word
    if place.is_dir():
        yield from _of_folder(place, cell, job, several)
    elif place.suffix.lower() == ".toml":
        yield from _of_table(place)
    elif place.is_file():
        yield BatchPart(place.name if not folder.parts else _below(word), place, cell, job)
    elif glob.has_magic(word):
        yield from _of_pattern(word, folder, cell, job)
    else:
        sentence = "no such file or folder"
        raise input_error(
            "file-unreadable", sentence, "name a folder, a file or a pattern", source=str(place)
        )


def _of_folder(folder: Path, cell: Path | None, job: Path | None, several: bool) -> Iterator[BatchPart]:
    files = [file for file in folder.rglob("*") if is_program_file(file.name) and file.is_file()]
    if not files:
        sentence = "no G-code in this folder"
        endings = " ".join(sorted(ENDINGS))
        raise input_error(
            "file-unreadable",
            sentence,
            f"files end in {endings}, or in these with {PACKED_ENDING}",
            source=str(folder),
        )
    name = folder.resolve().name
    for file in files:
        below = file.relative_to(folder).as_posix()
        yield BatchPart(f"{name}/{below}" if several and name else below, file, cell, job)


def _of_pattern(word: str, folder: Path, cell: Path | None, job: Path | None) -> Iterator[BatchPart]:
    """Yield the files of a pattern; shells on Windows leave it to the program."""
    steps = PurePath(word).parts
    plain = next(k for k, step in enumerate(steps) if glob.has_magic(step))
    root = folder.joinpath(*steps[:plain])
    files = [file for file in root.glob(str(PurePath(*steps[plain:]))) if file.is_file()]
    if not files:
        sentence = "no file is named like this"
        raise input_error("file-unreadable", sentence, "correct the pattern", source=str(folder / word))
    for file in files:
        yield BatchPart(file.relative_to(root).as_posix(), file, cell, job)


def _of_list(file: Path, cell: Path | None, job: Path | None) -> Iterator[BatchPart]:
    """Yield the parts of a list: a word a line, relative to the list; ``#`` begins a comment."""
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "not UTF-8"
        remedy = "name a text file with a part a line"
        raise input_error("file-unreadable", f"cannot read: {why}", remedy, source=str(file)) from None
    for number, line in enumerate(text.splitlines(), start=1):
        word = line.strip()
        if not word or word.startswith("#"):
            continue
        try:
            yield from _of_word(word, file.parent, cell, job, True)
        except Gcode2KrlError as error:
            raise _in_line(error, file, number) from None


def _in_line(error: Gcode2KrlError, file: Path, number: int) -> NotUnderstoodError:
    first = error.issues[0]
    message = f"{error.source}: {first.message}" if error.source else first.message
    return NotUnderstoodError(Issue("error", first.code, number, message, first.remedy), str(file))


def _of_table(file: Path) -> Iterator[BatchPart]:
    """Yield the parts of a TOML file of ``[[folder]]``, each with its ``path``, ``cell`` and ``job``."""
    try:
        table = read_bounded_toml(file)
    except NotTomlError as error:
        raise input_error("not-toml", str(error), _FORMAT, source=str(file)) from None
    except OSError as error:
        raise input_error(
            "file-unreadable", f"cannot read: {error.strerror}", "name the right file", source=str(file)
        ) from None
    folders = table.get("folder")
    if not isinstance(folders, list) or not folders or set(table) != {"folder"}:
        raise _wrong_table(file, "it has no [[folder]], or something beside it")
    for number, entry in enumerate(folders, start=1):
        yield from _of_entry(entry, number, file)


def _of_entry(entry: Any, number: int, file: Path) -> Iterator[BatchPart]:
    place = f"[[folder]] number {number}"
    if not isinstance(entry, dict) or not isinstance(entry.get("path"), str):
        raise _wrong_table(file, f"{place} has no path")
    for key, value in entry.items():
        if key not in _KEYS or not isinstance(value, str):
            raise _wrong_table(file, f"{place}: {key} is no key with a text; allowed: {', '.join(_KEYS)}")
    cell, job = (file.parent / entry[key] if key in entry else None for key in ("cell", "job"))
    for part in _of_word(entry["path"], file.parent, cell, job, False):
        is_folder = (file.parent / entry["path"]).is_dir()
        key = f"{_below(entry['path'])}/{part.key}" if is_folder else part.key
        yield BatchPart(key.removeprefix("./"), part.file, cell, job)


def _wrong_table(file: Path, what: str) -> NotUnderstoodError:
    return input_error("batch-table", what, _FORMAT, source=str(file))


def _below(word: str) -> str:
    """Return a relative path as a key; one that leads elsewhere is its last step."""
    path = PurePath(word)
    return path.name if path.is_absolute() or ".." in path.parts else path.as_posix()


def _refuse_alike(first: Path, second: Path, name: str) -> None:
    sentence = f"{first} and {second} would both be written as {name}"
    raise input_error("output-is-input", sentence, "rename one, or give each folder its own batch")
