"""The head of a command's record: command, options, inputs and cell, noted as they are read."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcode2krl.errors import Issue
from gcode2krl.result import cell_of, hashes_of, input_of, record_of

if TYPE_CHECKING:
    from gcode2krl.cell import Cell

_NOT_OPTIONS = frozenset({"as_json", "quiet", "verbose", "output", "cell_path"})
"""Options that say how a command prints, or that its record names elsewhere."""


@dataclass
class Heading:
    """Filled in while a command works; hashes are computed when the record is printed."""

    command: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    inputs: dict[str, Mapping[str, Any] | None] = field(default_factory=dict)
    """By their names; None where a file is still to be hashed."""
    cell: "Cell | None" = None
    cell_path: str | Path | None = None

    def reads(self, *paths: str | Path | None) -> None:
        """Note inputs, the most important one first."""
        for path in paths:
            if path is not None:
                self.inputs.setdefault(str(path), None)

    def has_cell(self, cell: "Cell", path: str | Path | None) -> None:
        """Note the cell, with its file where it is from one."""
        self.cell, self.cell_path = cell, path

    def record(
        self,
        figures: Mapping[str, Any],
        issues: Iterable[Issue] = (),
        *,
        exit_code: int = 0,
        files: Iterable[str | Path] = (),
    ) -> dict[str, Any]:
        """Return the record of the command; several inputs are listed under ``inputs`` too."""
        known = [entry or input_of(name) for name, entry in self.inputs.items()]
        inputs = [entry for entry in known if entry is not None]
        return record_of(
            self.command,
            {**({"inputs": inputs} if len(inputs) > 1 else {}), **figures},
            issues,
            exit_code=exit_code,
            input=inputs[0] if inputs else None,
            cell=None if self.cell is None else cell_of(self.cell, self.cell_path),
            options={name: value for name, value in self.options.items() if not self._is_input(value)},
            files=hashes_of(files),
        )

    def _is_input(self, value: Any) -> bool:
        names = value if isinstance(value, list) else [value]
        return all(str(name) in self.inputs for name in names)


def heading() -> Heading:
    """Return the heading of the command that runs; a new one where none does."""
    context = click.get_current_context(silent=True)
    if context is None:
        return Heading()
    heading = context.ensure_object(Heading)
    heading.command = context.command_path.removeprefix("gcode2krl ")
    heading.options = _options_of(context)
    return heading


def _options_of(context: click.Context) -> dict[str, Any]:
    """Return the options and arguments of a command that differ from their defaults, as plain values."""
    given = {
        option.name: context.params[option.name]
        for option in context.command.params
        if option.name in context.params
        and option.name not in _NOT_OPTIONS
        and context.params[option.name] != option.get_default(context)
    }
    return {str(name): _plain(value) for name, value in given.items() if value not in (None, (), False)}


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return str(value)
    return [_plain(each) for each in value] if isinstance(value, tuple) else value
