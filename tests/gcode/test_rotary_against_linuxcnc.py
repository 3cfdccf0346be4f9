"""Modes, units, homes and feeds of rotary words against LinuxCNC's own interpreter (tests/reference/rs274).

`rs274` takes A and C as plain axes; what a machine makes of them is computed here with scipy.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import load_cell, read_gcode
from gcode2krl.cell.sections import Machine

REFERENCE = Path(__file__).parents[1] / "reference" / "rs274"
EXPECTED = json.loads((REFERENCE / "expected_rotary.json").read_text(encoding="ascii"))
CENTRE_MM = (300.0, -200.0, -100.0)
TABLE = Machine(kind="table-table", axes=("A", "C"), signs=(1, -1), tcpm=False, centre_mm=CENTRE_MM)


def in_part(move):
    """Return tip and axis of a move of `rs274` on the table."""
    _, x, y, z, a, _, c, _ = move
    back = (Rotation.from_euler("x", a, degrees=True) * Rotation.from_euler("z", -c, degrees=True)).inv()
    return back.apply(np.array([x, y, z]) - CENTRE_MM) + CENTRE_MM, back.apply([0.0, 0.0, 1.0])


@pytest.mark.parametrize("name", EXPECTED)
def test_rotary_words_mean_what_they_mean_to_linuxcnc(name):
    cell = load_cell().model_copy(update={"machine": TABLE})
    toolpath = read_gcode(REFERENCE / "programs_rotary" / name, cell, chord_tolerance_mm=0.001)
    row = 0
    for move in EXPECTED[name]:
        tip, axis = in_part(move)
        off = np.linalg.norm(toolpath.position_mm[row + 1 :] - tip, axis=1)
        off += 100.0 * np.linalg.norm(toolpath.axis[row + 1 :] - axis, axis=1)
        there = np.flatnonzero(off < 1e-5)
        assert len(there), move
        end = row + 1 + int(there[0])
        assert toolpath.rapid[row + 1 : end + 1].tolist() == [move[0] == "rapid"] * (end - row)
        if move[-1] is not None:
            way = np.linalg.norm(np.diff(toolpath.position_mm[row : end + 1], axis=0), axis=1)
            assert (way / toolpath.feed_mm_s[row + 1 : end + 1]).sum() == pytest.approx(move[-1], rel=1e-4)
        row = end
    assert row == len(toolpath) - 1
