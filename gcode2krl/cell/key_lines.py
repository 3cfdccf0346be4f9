"""In which line of a cell file each key stands, so that a finding can name it: `tomllib` keeps no places.

The text must be TOML that `tomllib` has read: what is not TOML ends the search without an error.
"""

import contextlib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from gcode2krl.errors import Issue

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_PART = re.compile(r"""[ \t]*(?:([A-Za-z0-9_-]+)|"((?:[^"\\\n]|\\.)*)"|'([^'\n]*)')[ \t]*""")
_TEXTS = (
    re.compile(r'"{3}(?:[^"\\]|\\.|"{1,2}(?!"))*"{3,5}', re.S),
    re.compile(r"'{3}(?:[^']|'{1,2}(?!'))*'{3,5}", re.S),
    re.compile(r'"(?:[^"\\\n]|\\.)*"'),
    re.compile(r"'[^'\n]*'"),
)
_PLAIN = re.compile(r"[^,\]}\n#]*")
_Path = tuple[str, ...]


class _NotTomlError(Exception):
    pass


def lines_of_keys(text: str) -> dict[str, int]:
    """Return dotted key → line (1-based) of each key, table and element of a list, ``guard_inputs.0``."""
    scanner = _Scanner(text.removeprefix("\ufeff"))
    with contextlib.suppress(_NotTomlError, RecursionError):
        scanner.document()
    return scanner.lines


def lines_of_table(text: str, name: str) -> set[int]:
    """Return the lines (1-based) on which a table of the top level stands: headers, keys and values."""
    scanner = _Scanner(text.removeprefix("\ufeff"))
    with contextlib.suppress(_NotTomlError, RecursionError):
        scanner.document()
    return {line for table, first, last in scanner.spans if table == name for line in range(first, last + 1)}


def with_lines(issues: Iterable[Issue], text: str) -> tuple[Issue, ...]:
    """Return findings on a cell file with their lines in its text.

    A key that the file does not state has the line of the table that lacks it, or of ``based_on``.
    """
    issues = tuple(issues)
    lines = lines_of_keys(text) if any(issue.key for issue in issues) else {}
    return tuple(
        replace(issue, line=_line(issue.key, lines)) if issue.key and not issue.line else issue
        for issue in issues
    )


def _line(key: str, lines: dict[str, int]) -> int:
    place = key
    while place and place not in lines:
        place = place.rpartition(".")[0]
    return lines.get(place, lines.get("based_on", 0))


@dataclass
class _Scanner:
    """A place in the text, and the lines found so far."""

    text: str
    at: int = 0
    line: int = 1
    lines: dict[str, int] = field(default_factory=dict)
    counts: dict[_Path, int] = field(default_factory=dict)
    spans: list[tuple[str, int, int]] = field(default_factory=list)
    """Table of the top level, first and last line of each header and each pair."""

    def document(self) -> None:
        table: _Path = ()
        self._skip_blank()
        while self.at < len(self.text):
            if self.text[self.at] == "[":
                table = self._header()
            else:
                self._pair(table)
            self._skip_blank()

    def _header(self) -> _Path:
        """Read ``[a.b]`` or ``[[a.b]]``; the tables of a list are counted from 0."""
        line, is_list = self.line, self.text.startswith("[[", self.at)
        self.at += 2 if is_list else 1
        *above, last = self._key()
        path: _Path = ()
        for part in above:
            path = (*path, part)
            if path in self.counts:
                path = (*path, str(self.counts[path] - 1))
        path = (*path, last)
        self._expect("]]" if is_list else "]")
        self.spans.append((path[0], line, self.line))
        self._note(path, line)
        if is_list:
            self.counts[path] = self.counts.get(path, 0) + 1
            path = (*path, str(self.counts[path] - 1))
            self._note(path, line)
        return path

    def _pair(self, table: _Path) -> None:
        line = self.line
        path = table
        for part in self._key():
            path = (*path, part)
            self._note(path, line)
        self._expect("=")
        self._value(path)
        self.spans.append((path[0], line, self.line))

    def _key(self) -> _Path:
        parts: list[str] = []
        while True:
            match = _PART.match(self.text, self.at)
            if match is None:
                raise _NotTomlError
            parts.append(next(part for part in match.groups() if part is not None))
            self.at = match.end()
            if not self.text.startswith(".", self.at):
                return tuple(parts)
            self.at += 1

    def _value(self, path: _Path) -> None:
        self._skip_blank()
        first = self.text[self.at : self.at + 1]
        if first == "[":
            self._list(path)
        elif first == "{":
            self._inline_table(path)
        else:
            kinds = _TEXTS if first in ('"', "'") else (_PLAIN,)
            match = next((matched for kind in kinds if (matched := kind.match(self.text, self.at))), None)
            if match is None:
                raise _NotTomlError
            self._move_to(match.end())

    def _list(self, path: _Path) -> None:
        self.at += 1
        self._skip_blank()
        count = 0
        while not self.text.startswith("]", self.at):
            place = (*path, str(count))
            self._note(place, self.line)
            self._value(place)
            count += 1
            self._skip_blank()
            if not self.text.startswith("]", self.at):
                self._expect(",")
                self._skip_blank()
        self.at += 1

    def _inline_table(self, path: _Path) -> None:
        self.at += 1
        self._skip_blank()
        while not self.text.startswith("}", self.at):
            self._pair(path)
            self._skip_blank()
            if not self.text.startswith("}", self.at):
                self._expect(",")
                self._skip_blank()
        self.at += 1

    def _note(self, path: _Path, line: int) -> None:
        self.lines.setdefault(".".join(path), line)

    def _expect(self, mark: str) -> None:
        if not self.text.startswith(mark, self.at):
            raise _NotTomlError
        self.at += len(mark)

    def _skip_blank(self) -> None:
        match = _BLANK.match(self.text, self.at)
        self._move_to(match.end() if match else self.at)

    def _move_to(self, end: int) -> None:
        self.line += self.text.count("\n", self.at, end)
        self.at = end
