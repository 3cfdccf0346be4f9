"""The hashes with which a program's header remembers its cell, a section each, and what has changed since."""

import hashlib
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from gcode2krl.cell import Cell
from gcode2krl.cell.fingerprint import section_hashes, values_by_section
from gcode2krl.errors import Issue
from gcode2krl.krl.read import KrlProgram

_NO_WORD_AND_NO_CHECK = frozenset(
    {
        "effects",
        "program.max_lines",
        "program.comment_every",
        "program.memory_moves",
        "program.warn_size_mb",
    }
)
"""What neither a motion, an output nor a check depends on: how the text is split, when its size is told."""
_OF_A_FILE = (".mesh", ".calibration")
"""Keys that name a file: what it holds counts, not where it lies."""
_WITH_PILOT_OR_RSI = frozenset({"pilot", "online"})
"""Sections that reach a program only where it carries a pilot force, or is corrected online."""
_ALONG_A_LINE = 4
_HEAD = "cell hash: "
_LINES = re.compile(rb"^; (?:cell hash|options|findings released by hand): .*$", re.MULTILINE)
_ENTRY = re.compile(r"([\w.]+) ([0-9a-f]{12})")
_END, _LONGEST = b";ENDFOLD", 1_000_000
"""Where the header ends, and how many bytes of a file are searched for that."""
_OPTIONS = "options"
"""The entry for the lines of options and released findings, which `verify` takes from the header."""
_RELEASED = re.compile(r"([a-z0-9-]+(?::(?:[^:]+:)?[0-9]{1,9})?)(?: \(whole file, ([0-9]{1,9})\))?(?:, |$)")
"""A release in the header, and for how many findings it was."""
_REMEDY = (
    "look at what it would do with the cell as it is, and translate again; "
    "verify with --job what was made with it"
)


def hashes_of_sections(cell: Cell, tools: Iterable[int]) -> dict[str, str]:
    """Return section → hash of what a program with these tools, or a check of it, may depend on."""
    used = {f"tool.{number}" for number in tools}
    counted = {
        section: {key: _value(key, value) for key, value in leaves.items() if _counts(key)}
        for section, leaves in values_by_section(cell).items()
        if not section.startswith("tool.") or section in used
    }
    return section_hashes({section: leaves for section, leaves in counted.items() if leaves})


def hash_lines(
    cell: Cell, tools: Iterable[int], options: str, released: str, *, pilot: bool, online: bool
) -> list[str]:
    """Return the comment lines; ``options`` and ``released`` are what their lines in the header say."""
    has = {"pilot": pilot, "online": online}
    entries = [
        f"{section} {digits}"
        for section, digits in hashes_of_sections(cell, tools).items()
        if has.get(section, True)
    ]
    entries.append(f"{_OPTIONS} {_options_hash(options, released)}")
    return [_HEAD + ", ".join(entries[k : k + _ALONG_A_LINE]) for k in range(0, len(entries), _ALONG_A_LINE)]


class StatedCell:
    """What the header of a program says of its cell, its options and its released findings."""

    def __init__(self, program: KrlProgram) -> None:
        """Read the fold at the beginning of the main file."""
        head = program.texts[program.file[0]][:_LONGEST].partition(_END)[0]
        self.line = 0
        self.hashes: dict[str, str] = {}
        self.is_malformed = False
        said = dict.fromkeys(("options", "findings released by hand"), "")
        for match in _LINES.finditer(head):
            key, _, words = match[0].decode("ascii", "replace")[2:].strip().partition(": ")
            if key in said:
                said[key] = words
                continue
            self.line = self.line or head.count(b"\n", 0, match.start()) + 1
            for entry in words.split(", "):
                matched = _ENTRY.fullmatch(entry)
                self.is_malformed |= matched is None
                if matched is not None:
                    self.hashes[matched[1]] = matched[2]
        self._said_hash = _options_hash(*said.values())
        self._released = said["findings released by hand"]

    def releases(self) -> dict[str, int | None]:
        """Return the releases ``CODE:LINE`` or ``CODE``, and of these for how many findings each was."""
        if self._released == "none":
            return {}
        return {word: int(count) if count else None for word, count in _RELEASED.findall(self._released)}

    def changes(self, cell: Cell, tools: Iterable[int] = ()) -> Iterator[Issue]:
        """Yield the sections that are not as when the program was written: of its tools, and of these."""
        if not self.hashes and not self.is_malformed:
            sentence = "no cell hash in its header: what has changed in the cell since then is not known"
            yield Issue("warning", "verify-cell-unknown", 0, sentence)
            return
        if self.is_malformed or self.hashes.get(_OPTIONS) != self._said_hash:
            sentence = "the lines of options, released findings and cell hashes are not as they were written"
            yield Issue("error", "verify-header", self.line, sentence)
        listed = (section.split(".")[1] for section in self.hashes if section.startswith("tool."))
        now = hashes_of_sections(cell, {*tools, *(int(number) for number in listed if number.isdecimal())})
        for section in sorted((self.hashes.keys() | now.keys()) - {_OPTIONS}):
            before, after = self.hashes.get(section), now.get(section)
            if before == after or (before is None and section in _WITH_PILOT_OR_RSI):
                continue
            how = "not as" if before and after else "not yet there" if after else "not there any more, as"
            sentence = f"{section}: {how} when the program was written"
            yield Issue("error", "verify-cell-changed", self.line, sentence, _REMEDY, key=section)


def _options_hash(options: str, released: str) -> str:
    return section_hashes({_OPTIONS: {"options": options, "released": released}})[_OPTIONS]


def _counts(key: str) -> bool:
    section = key.partition(".")[0]
    return not {key, section} & _NO_WORD_AND_NO_CHECK and not key.endswith("_source")


def _value(key: str, value: Any) -> Any:
    """Return a value, or the hash of the file that it names."""
    if not key.endswith(_OF_A_FILE) or not isinstance(value, str):
        return value
    try:
        with Path(value).open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:  # whoever reads it says so
        return "unreadable"
