"""Whole programs compared byte for byte; after an intended change: ``python tests/golden/make.py``."""

from pathlib import Path

import pytest

from gcode2krl import load_cell, read_gcode, set_targets, write_krl

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PROGRAMS = [
    *sorted((HERE / "programs").glob("*.nc")),
    ROOT / "examples" / "test_piece.nc",
    ROOT / "examples" / "cam_style.nc",
]


@pytest.mark.parametrize("part", PROGRAMS, ids=lambda path: path.stem)
def test_same_bytes(part, tmp_path):
    own = part.with_suffix(".toml")
    cell = load_cell(own if own.exists() else None)
    program = write_krl(set_targets(read_gcode(part, cell), cell), tmp_path / f"{part.stem}.src", cell)
    for name, text in program.texts.items():
        assert text == (HERE / "krl" / name).read_bytes(), f"{name} has changed"
