"""A motion that is cut in blocks of samples, of whatever size, gives what it gives as a whole, to the bit."""

import io
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import load_cell, plan_motion, read_gcode
from gcode2krl.cell import resolve_cell
from gcode2krl.cutting import way
from gcode2krl.cutting.milling import remove
from gcode2krl.gcode import read_stream

REPOSITORY = Path(__file__).parents[2]
GOLDEN = REPOSITORY / "tests" / "golden" / "programs"
STOCK = {"box_mm": [[-20.0, -20.0, -10.0], [60.0, 60.0, 0.0]]}
HEAD = "G21 G90 G17 G94 G54 G64\nT1 M6\nS6000 M3\nG0 X-15 Y0 Z5\n"
PROGRAMS = {
    "dwells and rapids through stock": "G1 Z-3 F600\nX10 F900\nG4 P2\nX20 Y10\nG0 X30 Z-2\nX40 Z5\n"
    "G0 X0 Y20 Z5\n"
    "G1 Z-2 F300\nG2 X20 Y20 I10 J0 F900\nG4 P0.5\nG0 Z20\n",
    "drilling": "G0 Z2\nG1 Z-8 F200\nG0 Z2\nX20 Y10\nG1 Z-8\nG4 P0.5\nG0 Z2\nX40 Y40\nG1 Z-8\nG0 Z20\n",
    "change of tool": "G1 Z-4 F600\nX30 F900\nG0 Z20\nT2 M6\nS9000 M3\nG0 X0 Y5\nG1 Z-6 F400\nX40 Y30\n"
    "G0 Z20\n",
    "stopped spindle, too fast a plunge": "G1 Z-4 F6000\nM5\nG1 X30 F900\nM3\nX40 Y20\nG0 Z20\n",
}


def found(toolpath, motion, cell, rows):
    """Return every column of the forces, the findings and what is left, and how many samples there are."""
    removal = remove(toolpath, motion, cell, rows=rows)
    columns = {spec.name: getattr(removal.forces, spec.name) for spec in fields(removal.forces)}
    return columns | {"part": removal.material.height_mm}


def same(one, other):
    for name, values in one.items():
        if isinstance(values, np.ndarray):
            assert values.tobytes() == other[name].tobytes(), name
        else:
            assert values == other[name], name


def compared(toolpath, cell, sizes):
    motion = plan_motion(toolpath, cell)
    whole = found(toolpath, motion, cell, len(motion))
    assert np.isfinite(whole["phi_rad"][:, 0]).any()
    for rows in sizes:
        same(found(toolpath, motion, cell, rows), whole)


@pytest.mark.parametrize("title", PROGRAMS)
def test_programs_with_stops_rapids_and_changes(title):
    cell = resolve_cell({"based_on": "demonstration", "stock": STOCK})
    text = HEAD + PROGRAMS[title] + "M5\nM30\n"
    compared(read_stream(io.BytesIO(text.encode()), "part.nc", cell), cell, (7, 100, 1000))


def test_the_golden_program_with_its_tools():
    cell = load_cell(GOLDEN / "everything.toml")
    compared(read_gcode(GOLDEN / "everything.nc", cell), cell, (1000,))


@pytest.mark.parametrize("name", ["test_piece.nc", "cam_style.nc"])
def test_examples(name):
    cell = load_cell()
    compared(read_gcode(REPOSITORY / "examples" / name, cell), cell, (1000,))


def test_corners_that_nothing_refers_to_are_dropped_without_a_trace(monkeypatch):
    cell = load_cell()
    toolpath = read_gcode(REPOSITORY / "examples" / "test_piece.nc", cell)
    motion = plan_motion(toolpath, cell)
    whole = found(toolpath, motion, cell, len(motion))
    monkeypatch.setattr(way, "_FEW_CORNERS", 50)
    kept = []
    keep = way._Corners.keep

    def counted(corners, wanted):
        kept.append(np.count_nonzero(wanted) / len(wanted))
        keep(corners, wanted)

    monkeypatch.setattr(way._Corners, "keep", counted)
    same(found(toolpath, motion, cell, 300), whole)
    assert min(kept) < 0.8


def test_findings_of_rapids_do_not_depend_on_blocks():
    """What a rapid cuts off is known only some samples later, and is that of the sample that it led to."""
    cell = resolve_cell({"based_on": "demonstration", "stock": STOCK})
    toolpath = read_stream(
        io.BytesIO((HEAD + PROGRAMS["dwells and rapids through stock"] + "M5\nM30\n").encode()),
        "part.nc",
        cell,
    )
    motion = plan_motion(toolpath, cell)
    issues = remove(toolpath, motion, cell, rows=11).forces.issues
    assert [issue.line for issue in issues if issue.code == "rapid-in-stock"] == [9]
    assert issues == remove(toolpath, replace(motion), cell).forces.issues
