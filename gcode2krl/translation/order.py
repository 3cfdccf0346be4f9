"""What is to be translated, and how: the options of ``gcode2krl translate`` as plain values."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from gcode2krl.files.program_names import DIALECT_NAMES
from gcode2krl.translation.project import Project

_NOT_OPTIONS = frozenset({"part", "output", "cell_path", "project"})
"""Fields that a record names elsewhere."""


@dataclass(frozen=True)
class Order:
    """A part and the options of its translation; it can be pickled.

    Each field is named as the option's destination in the command, with the option's default.
    """

    part: str | Path
    """The G-code, ``-`` for standard input."""
    output: str | Path | None = None
    """The ``.src``, its folder, None for beside the part, ``-`` for no file."""
    cell_path: str | Path | None = None
    job_path: str | Path | None = None
    tools_path: str | Path | None = None
    """A library with tools that the cell does not have."""
    name: str | None = None
    tolerance_mm: float | None = None
    chord_tolerance_mm: float = 0.01
    block_delete: bool = False
    dialect: str = DIALECT_NAMES[0]
    search: tuple[str, ...] = ()
    """Folders with subprograms, beside that of the part."""
    allow: tuple[str, ...] = ()
    strict: bool = False
    no_guard: bool = False
    split: Literal["defs", "files"] = "defs"
    max_lines: int | None = None
    compensate: Literal["offline"] | None = None
    compensate_plot: str | Path | None = None
    no_forces: bool = False
    pilot: Literal["index", "values", "none"] | None = None
    online: str | None = None
    both: bool = False
    report: str | Path | None = None
    """The page to write, also of a refused program."""
    comment_every: int | None = None
    from_line: int | None = None
    simplify_mm: float | None = None
    project: Project = Project()
    """Which of these options a file of the folder states."""

    def options(self) -> dict[str, Any]:
        """Return the options that differ from their defaults, as plain values of a record."""
        stated = ((field.name, getattr(self, field.name), field.default) for field in fields(self))
        return {
            name: _plain(value)
            for name, value, default in stated
            if name not in _NOT_OPTIONS and value != default
        }


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    return list(value) if isinstance(value, tuple) else value
