"""How a program begins: exact stops at both ends of the motion, who applied the lengths of tools."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import load_cell, read_gcode, set_targets, write_krl
from gcode2krl.errors import RefusedError
from tests.krl.replay import read_program


def ends(targets):
    """Rows of the first and the last programmed position."""
    return np.flatnonzero(targets.move >= 0)[[0, -1]]


def test_the_ends_of_the_predicted_motion_are_exact_stops(make):
    made = make(data={"clearance": {"z_mm": 60.0}})
    motions = read_program(made.src).motions
    first, last = ends(made.targets)
    assert motions[first].kind == motions[first + 1].kind == motions[last].kind == "LIN"
    assert not motions[first].blend
    assert not motions[last].blend
    assert motions[last + 1].values["Z"] == 60.0
    assert made.targets.cdis_mm[[first, last]].tolist() == [0.0, 0.0]


def test_verify_refuses_a_program_that_blends_over_its_first_position(make):
    made = make()
    motion = read_program(made.src).motions[ends(made.targets)[0]]
    lines = made.src.read_bytes().split(b"\r\n")
    lines[motion.line - 1] += b" C_DIS"
    made.src.write_bytes(b"\r\n".join(lines))
    report = made.verified()
    found = [issue for issue in report.issues if issue.code == "verify-start"]
    assert [(issue.severity, issue.line) for issue in found] == [("error", motion.line)]
    assert "translate again" in found[0].remedy


def test_targets_that_blend_over_their_first_position_are_not_written(make, tmp_path):
    """As a prediction has them that was saved by an older version."""
    made = make()
    cdis = made.targets.cdis_mm.copy()
    cdis[ends(made.targets)[0]] = 0.1
    with pytest.raises(RefusedError, match="verify-start"):
        write_krl(replace(made.targets, cdis_mm=cdis), tmp_path / "old.src", made.cell)
    assert not (tmp_path / "old.src").exists()


PART = "G21 G90\nT1 M6\nS9000 M3\nG0 X0 Y0 Z20\nG1 Z-1 F300\nX20\nG0 Z20\nM5\nM30\n"


@pytest.mark.parametrize("from_table", [True, False])
def test_the_header_tells_lengths_from_the_table(tmp_path, from_table):
    path, part = tmp_path / "cell.toml", tmp_path / "part.nc"
    key = '[program]\ntool_length = "from_table"\n' if from_table else ""
    path.write_text(f'based_on = "demonstration"\n{key}', encoding="ascii")
    part.write_text(PART if from_table else PART.replace("M6", "M6 G43"), encoding="ascii")
    cell = load_cell(path)
    write_krl(set_targets(read_gcode(part, cell), cell), tmp_path / "part.src", cell)
    header = (tmp_path / "part.src").read_text(encoding="ascii").split(";ENDFOLD")[0]
    assert ('tool_length = "from_table"' in header) is from_table
