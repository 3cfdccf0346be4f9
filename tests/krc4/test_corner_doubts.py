"""The note on corners between unequal lines: told where it changes path or time, with the right figures."""

import re

import numpy as np
import pytest

from gcode2krl import load_cell, set_targets
from gcode2krl.krc4 import build_chain, corner_issues, plan
from tests.conftest import ROOT
from tests.krl.conftest import read

HEAD = "G21 G90 G17 G54\nT1 M6\nS9000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG0 Z2\n"
FOOT = "G0 Z20\nM30\n"


def note_of(cut, cell=None):
    """Return the note on a program with these cuts, or None; and its chain."""
    cell = cell if cell is not None else load_cell()
    targets = set_targets(read(f"{HEAD}{cut}{FOOT}", cell), cell)
    chain = build_chain(targets, cell)
    issues = corner_issues(targets, chain, plan(chain, cell), plan(chain, cell, look_ahead=False), cell)
    assert len(issues) <= 1
    return issues[0] if issues else None


def figures(note, unit):
    return [
        (float(a), float(b))
        for a, b in re.findall(rf"([\d.]+) {unit}\b.*?instead of ([\d.]+) {unit}", note.message)
    ]


def test_equal_lines_and_small_corners_are_not_worth_a_word():
    equal = "G64 P2\nG1 Z0 F600\nG1 X60\nG1 Y60\nG1 X0\n"
    assert note_of(equal) is None
    small = "G64 P0.03\nG1 Z0 F600\nG1 X60\nG1 X100 Y40 F650\nG1 X60 Y90 F600\n"
    assert note_of(small) is None


def test_the_smaller_of_two_cdis():
    """Both corners are of 90 degrees; P is met within the levels of CDIS, which round down."""
    note = note_of("G1 Z0 F600\nG64 P1\nG1 X60\nG64 P0.05\nG1 Y60\nG1 X0\n")
    assert note.severity == "note"
    assert note.line == 9
    assert note.message.startswith("1 corner joins unequal CDIS")
    ((other_mm, assumed_mm),) = figures(note, "mm")
    assert assumed_mm == pytest.approx(1.0, abs=0.3)
    assert other_mm == pytest.approx(0.05, abs=0.015)


def test_the_time_of_a_change_of_speed_is_that_of_the_law():
    """A change within the corner saves half of |Δv| over the ramp |Δv|/a + k, made up at the faster speed."""
    controller = load_cell().controller.model_copy(update={"advance": "unlimited"})
    cell = load_cell().model_copy(update={"controller": controller})
    ways = "".join(f"G1 X{5 * k + 5} Y{k % 2} F{600 + 600 * (k % 2)}\n" for k in range(20))
    cut = f"G64 P0.001\nG1 Z0 F600\n{ways}"
    targets = set_targets(read(f"{HEAD}{cut}{FOOT}", cell), cell)
    assumed_s, changing_s = (
        plan(build_chain(targets, cell, each), cell).total_s for each in ("never", "always")
    )
    a_mm_s2, k_s = 1e3 * controller.acc_cp_m_s2, controller.k_s
    saved_s = 19 * 0.5 * (10.0 / a_mm_s2 + k_s) * 10.0 / 20.0
    assert assumed_s - changing_s == pytest.approx(saved_s, rel=0.02)
    note = note_of(cut, cell)
    assert "19 corners join unequal speeds" in note.message
    assert figures(note, "s") == [pytest.approx((changing_s, assumed_s), abs=0.051)]


def test_unequal_accelerations_of_a_turning_tool():
    """`$ACC.ORI` lowers the acceleration of moves that turn the tool."""
    cell = load_cell(ROOT / "examples" / "five_axis" / "cell.toml")
    text = (ROOT / "examples" / "five_axis" / "five_axis.nc").read_text(encoding="utf-8")
    targets = set_targets(read(text, cell), cell)
    chain = build_chain(targets, cell)
    (note,) = corner_issues(targets, chain, plan(chain, cell), plan(chain, cell, look_ahead=False), cell)
    assert "unequal accelerations" in note.message
    ((other_s, assumed_s),) = figures(note, "s")
    assert other_s > assumed_s
    assert np.ptp(chain.acceleration_mm_s2 * chain.scale) > 0.0


def test_a_program_without_a_line_leaves_nothing_open():
    cell = load_cell()
    targets = set_targets(read("G21 G90 G17 G54\nT1 M6\nG43 H1\nG0 X10 Y10 Z150\nM30\n", cell), cell)
    chain = build_chain(targets, cell)
    assert corner_issues(targets, chain, plan(chain, cell), plan(chain, cell, look_ahead=False), cell) == ()
