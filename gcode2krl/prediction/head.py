"""The record of a prediction, as the table ``[result]`` of ``prediction.toml`` (docs/record.md)."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from gcode2krl.cell import Cell
from gcode2krl.errors import Issue
from gcode2krl.files import Content
from gcode2krl.files.program_names import DIALECT_NAMES
from gcode2krl.result import cell_of, record_of, sha256_of

CHORD_MM = 0.01
"""Default of ``--chord-tolerance``; a test compares it with `gcode.CHORD_TOLERANCE_MM`."""
_NOT_OPTIONS = frozenset({"program", "program_sha256", "program_size_bytes", "version"})


def head_of(
    inputs: Mapping[str, Any],
    issues: tuple[Issue, ...],
    cell: Cell,
    figures: Mapping[str, Any],
    files: Mapping[str, str],
) -> dict[str, Any]:
    """Return the record without its findings, which stand beside it; TOML has no null, so it is left out.

    ``files`` are name → SHA-256 of the tables.
    """
    record = record_of(
        "predict",
        figures,
        issues,
        input=_input(inputs),
        cell=cell_of(cell, None),
        options=_options(inputs, cell),
        files=files,
    )
    del record["issues"]
    record["cell"] = {key: value for key, value in record["cell"].items() if value is not None}
    return {key: value for key, value in record.items() if value is not None}


def _options(inputs: Mapping[str, Any], cell: Cell) -> dict[str, Any]:
    """Return the settings that differ from their defaults."""
    defaults = {
        "dt_s": cell.controller.cycle_s,
        "chord_tolerance_mm": CHORD_MM,
        "block_delete": False,
        "dialect": DIALECT_NAMES[0],
    }
    return {
        key: value for key, value in inputs.items() if key not in _NOT_OPTIONS and value != defaults.get(key)
    }


def hashed(files: Mapping[Path, Content], hashes: dict[str, str]) -> dict[Path, Content]:
    """Return files that leave the SHA-256 of what is written in ``hashes``, by their names."""
    return {
        file: partial(_write_hashed, write, file.name, hashes) if callable(write) else write
        for file, write in files.items()
    }


def _write_hashed(write: Callable[[Path], object], name: str, hashes: dict[str, str], place: Path) -> None:
    write(place)
    hashes[name] = sha256_of(place)


def _input(inputs: Mapping[str, Any]) -> dict[str, Any] | None:
    keys = {"file": "program", "sha256": "program_sha256", "size_bytes": "program_size_bytes"}
    known = {name: inputs[key] for name, key in keys.items() if key in inputs}
    return known if len(known) == len(keys) else None
