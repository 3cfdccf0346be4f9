"""Short programs, and what the reader makes of them."""

import io
from dataclasses import replace
from typing import Any, NamedTuple

import pytest

from gcode2krl import Gcode2KrlError
from gcode2krl.gcode import read as reading
from gcode2krl.gcode import read_stream
from gcode2krl.gcode import text as text_of_files


def read(text, cell=None, name="part.nc", **options):
    """Return the toolpath of a program's text."""
    return read_stream(io.BytesIO(text if isinstance(text, bytes) else text.encode()), name, cell, **options)


def errors(text, cell=None, **options):
    """Return the errors for which a program is refused, none where it is read."""
    try:
        read(text, cell, **options)
    except Gcode2KrlError as error:
        return [issue for issue in error.issues if issue.severity == "error"]
    return []


def refusal(text, cell=None, **options):
    """Return the first of the findings for which a program is refused; each has a remedy."""
    with pytest.raises(Gcode2KrlError) as caught:
        read(text, cell, **options)
    assert all(issue.remedy for issue in caught.value.issues if issue.severity == "error")
    return caught.value.issues[0]


def named(names, table):
    """Parametrise a test by a table of cases, each under its name."""
    return pytest.mark.parametrize(names, list(table.values()), ids=list(table))


def with_little_room(monkeypatch):
    """Let the reader begin with room for one row and no event, and with pieces of 20 bytes."""
    monkeypatch.setattr(reading, "_FIRST_ROWS", 1)
    monkeypatch.setattr(reading, "_FIRST_EVENTS", 0)
    monkeypatch.setattr(text_of_files, "_PIECE_BYTES", 20)


class Control(NamedTuple):
    """A control and what its programs begin and end with: a test writes the lines between, counted from 1."""

    head: str
    end: str = "M2"
    dialect: str = "linuxcnc"
    cell: Any = None

    def text(self, lines):
        return f"{self.head}{lines}\n" + ("" if self.end in lines else f"{self.end}\n")

    def read(self, lines, cell=None, **options):
        return read(self.text(lines), cell or self.cell, **{"dialect": self.dialect, **options})

    def places(self, lines, cell=None, **options):
        """Return where the rows behind the head's two end, (n, 3)."""
        return self.read(lines, cell, **options).position_mm[2:]

    def xs(self, lines, cell=None, **options):
        """Return X of the rows behind the head's two."""
        return self.places(lines, cell, **options)[:, 0].tolist()

    def errors(self, lines, cell=None, **options):
        """Return the errors for which the lines are refused, none where they are read."""
        found = errors(self.text(lines), cell or self.cell, **{"dialect": self.dialect, **options})
        return [replace(issue, line=issue.line - self.head.count("\n")) for issue in found]

    def refusal(self, lines, cell=None, **options):
        """Return the first finding for which the lines are refused."""
        found = refusal(self.text(lines), cell or self.cell, **{"dialect": self.dialect, **options})
        return replace(found, line=found.line - self.head.count("\n"))

    def refused(self, lines, cell=None, **options):
        """Return code and line of the first finding for which the lines are refused."""
        found = self.refusal(lines, cell, **options)
        return found.code, found.line
