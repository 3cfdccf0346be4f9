"""The guessed top of the stock: a mistake in the program does not change it."""

import io
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import cut, plan_motion
from gcode2krl.cell import resolve_cell
from gcode2krl.cutting.raw_part import height_field_of
from gcode2krl.gcode import read_stream

CELL = resolve_cell({"based_on": "demonstration", "stock": {"resolution_mm": 0.5}})
HEAD = "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\n"


def read(body):
    text = HEAD + body + "M5\nM30\n"
    return read_stream(io.BytesIO(text.encode()), "part.nc", CELL)


def top(body, cell=CELL):
    field = height_field_of(read(body), cell, np.eye(3), [cell.tool[1]])
    return float(field.height_mm.max())


def run(body, cell=CELL):
    toolpath = read(body)
    return cut(toolpath, plan_motion(toolpath, cell), cell)


def largest_N(forces):
    return float(np.linalg.norm(forces.force_base_N, axis=1).max())


def findings(forces, code):
    return [(issue.severity, issue.line) for issue in forces.issues if issue.code == code]


def line_of(body, words):
    return (HEAD + body).splitlines().index(words) + 1


POCKET = "G0 X0 Y0\nG0 Z2\nG1 Z-5 F600\nG1 X60\nG0 Z30\nG0 X0 Y40\nG0 Z2\nG1 Z-5\nG1 X60\nG0 Z30\n"


# --- sound programs --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "wanted"),
    [
        (POCKET, 0.0),
        # several depths, and feed heights over the last floor
        (
            "G0 X0 Y0\nG0 Z5\nG1 Z-2 F600\nX60\nG0 Z-1\nX0\nG1 Z-4\nX60\nG0 Z-3\nX0\nG1 Z-6\nX60\nG0 Z30\n",
            0.0,
        ),
        # a ramp from above, and a helix of chords
        ("G0 X0 Y0\nG0 Z2\nG1 X20 Z-3 F600\nX0\nX60\nG0 Z30\n", 0.0),
        # zero on the underside: the first pass is as deep as the next
        ("G0 X0 Y0\nG0 Z25\nG1 Z15 F600\nX60\nX0\nZ10\nX60\nX0\nZ5\nX60\nX0\nZ0\nX60\nG0 Z30\n", 20.0),
        # zero on the underside, one pass: at most to where the feed begins
        ("G0 X0 Y0\nG0 Z12\nG1 Z6 F600\nX60\nG0 Z30\n", 12.0),
        # facing above the finished top
        ("G0 X0 Y0\nG0 Z5\nG1 Z1 F600\nX60\nG0 Z10\nG0 X0 Y0\nG1 Z0\nX60\nG0 Z30\n", 2.0),
        # holes only: from the plane where the feed begins, or zero
        ("G0 X0 Y0\nG0 Z22\nG1 Z0 F600\nG0 Z22\nG0 X60\nG1 Z0\nG0 Z30\n", 22.0),
        ("G0 X0 Y0\nG0 Z2\nG1 Z-9 F600\nG0 Z2\nG0 X60\nG1 Z-9\nG0 Z30\n", 0.0),
        # a zero far above the work is not its top
        ("G0 X0 Y0\nG0 Z-91\nG1 Z-100 F600\nX60\nX0\nZ-105\nX60\nG0 Z30\n", -95.0),
    ],
)
def test_the_top_of_sound_programs(body, wanted):
    assert top(body) == pytest.approx(wanted)
    assert not findings(run(body), "rapid-in-stock")


def test_a_program_that_stays_at_one_height_above_zero_moves_in_the_air():
    text = "G21 G90\nT1 M6\nS9000 M3\nG43 H1\nG0 X0 Y0 Z60\nG1 X60 F600\nY20\nM5\nM30\n"
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", CELL)
    forces = cut(toolpath, plan_motion(toolpath, CELL), CELL)
    assert largest_N(forces) == 0.0
    assert not findings(forces, "rapid-in-stock")


def test_holes_that_nothing_is_above_end_where_the_tool_comes_from():
    """A feed that only rises, in small steps: no rapid and no entry above it."""
    rising = "".join(f"G1 Z{0.1 * step:.1f} F20\n" for step in range(1, 31))
    assert top(f"G0 X0 Y0 Z0.05\n{rising}") == pytest.approx(3.0)


def test_a_rapid_in_a_pocket_that_is_cut_already_is_sound():
    body = "G0 X0 Y0\nG0 Z2\nG1 Z-5 F600\nX60\nG0 X0\nG1 Z-8\nX60\nG0 X10\nG0 Z30\n"
    assert not findings(run(body), "rapid-in-stock")


def test_zero_means_nothing_along_a_turned_axis():
    turn = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    field = height_field_of(read(POCKET), CELL, turn, [CELL.tool[1]])
    assert float(field.height_mm.max()) != 0.0


# --- mistakes --------------------------------------------------------------------------------------------


def test_a_level_rapid_at_cutting_depth_is_seen_and_takes_no_force_away():
    body = "G0 X0 Y0\nG0 Z5\nG1 Z-5 F600\nG1 X60\nG0 X0 Y60\nG1 X60\nG0 Z30\n"
    sound = body.replace("G0 X0 Y60\n", "G0 Z5\nG0 X0 Y60\nG1 Z-5\n")
    wrong, right = run(body), run(sound)
    assert findings(wrong, "rapid-in-stock") == [("warning", line_of(body, "G0 X0 Y60"))]
    assert findings(right, "rapid-in-stock") == []
    assert largest_N(wrong) >= 0.99 * largest_N(right) > 100.0


def test_a_first_entry_below_the_material_is_seen():
    body = POCKET.replace(
        "G0 Z2\nG1 Z-5 F600\nG1 X60\nG0 Z30\nG0 X0 Y40", "G0 Z-5\nG1 X60 F600\nG0 Z30\nG0 X0 Y40"
    )
    forces = run(body)
    assert findings(forces, "rapid-in-stock") == [("warning", line_of(body, "G0 Z-5"))]
    assert largest_N(forces) >= 0.99 * largest_N(run(POCKET)) > 100.0  # samples lie elsewhere


def test_the_approach_to_a_first_position_in_the_material_is_seen():
    text = "G21 G90\nT1 M6\nS9000 M3\nG43 H1\nG0 X0 Y0 Z-5\nG1 X60 F600\nG0 Z30\nM5\nM30\n"
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", CELL)
    forces = cut(toolpath, plan_motion(toolpath, CELL), CELL)
    assert ("warning", 5) in findings(forces, "rapid-in-stock")
    stated = resolve_cell(
        {
            "based_on": "demonstration",
            "stock": {"box_mm": [[-10, -10, -9], [70, 10, 0]], "resolution_mm": 0.5},
        }
    )
    assert ("error", 5) in findings(cut(toolpath, plan_motion(toolpath, stated), stated), "rapid-in-stock")
    beside = text.replace("X0 Y0 Z-5", "X-30 Y0 Z-5")
    beside = read_stream(io.BytesIO(beside.encode()), "part.nc", stated)
    assert findings(cut(beside, plan_motion(beside, stated), stated), "rapid-in-stock") == []


def test_a_program_that_never_rises_is_seen():
    body = "G0 X0 Y0\nG0 Z-4\nG1 X60 F600\nG0 X0 Y40\nG1 X60\n"
    forces = run(body)
    assert line_of(body, "G0 X0 Y40") in [line for _, line in findings(forces, "rapid-in-stock")]
    assert largest_N(forces) > 100.0


def slots(depths, retract, plunge):
    """Slots beside each other, several depths each."""
    lines = []
    for k, depth in itertools.product(range(3), depths):
        lines += [f"G0 Z{retract}", f"G0 X0 Y{20 * k}", f"G0 Z{plunge}", f"G1 Z{depth:.3f} F600", "G1 X50"]
    return [*lines, f"G0 Z{retract}"]


@settings(max_examples=12, deadline=None)
@given(
    step=st.sampled_from([1.0, 2.5, 4.0]),
    passes=st.integers(1, 3),
    zero=st.sampled_from([0.0, 15.0]),
    slip=st.integers(1, 2),
    deeper=st.sampled_from([0.0, 0.5]),
)
def test_a_forgotten_retract_changes_neither_the_top_nor_the_largest_force(step, passes, zero, slip, deeper):
    depths = [zero - step * (k + 1) for k in range(passes)]
    sound = slots(depths, zero + 15, zero + 2)
    row = next(k for k, line in enumerate(sound) if line.endswith(f"Y{20 * slip}"))
    low = depths[-1] + deeper * step
    # the retract before the slot is left out, or ends far too low
    wrong = [*sound[: row - 1], *([f"G0 Z{low:.3f}"] if deeper else []), *sound[row:]]
    bodies = ["\n".join(lines) + "\n" for lines in (sound, wrong)]
    assert top(bodies[1]) == top(bodies[0])
    right, mistaken = (run(body) for body in bodies)
    assert findings(right, "rapid-in-stock") == []
    assert [line for _, line in findings(mistaken, "rapid-in-stock")] == [
        (HEAD + bodies[1]).splitlines().index(f"G0 X0 Y{20 * slip}") + 1
    ]
    assert largest_N(mistaken) >= 0.99 * largest_N(right) > 0.0
