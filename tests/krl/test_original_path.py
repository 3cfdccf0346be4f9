"""A program that leaves out corners is refused where it leaves its G-code, whatever made its targets."""

import io
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gcode2krl import Prediction, predict, read_gcode, set_targets, verify_krl, write_krl
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.gcode import read_stream
from gcode2krl.krl.composition import TextLayout, compose
from gcode2krl.krl.read import read_texts
from gcode2krl.krl.verify import compare
from gcode2krl.robot import ptp_joints
from gcode2krl.tables import Simplified, rows_at
from tests.cells import over_demonstration

CELL = over_demonstration()
PART = """G21 G90 G17 G40 G49 G80 G94
G54 G64
T1 M6
S8000 M3
G0 G43 H1 Z20
G0 X0 Y0
G0 Z2
G1 Z-1 F600
G1 X10 F1500
X20
X20.005 Y0.005
X30 Y0
Y10
M8
Y20
X20 Y20.004
X10 Y20
G4 P0.5
X5
X0
F1000
Y15
Y10
Y5.004
Y5
Y0.004
Y0.008
Y0
G0 Z20
G0 X5 Y5
G0 Z2
G1 Z-1 F600
G1 X15 F1500
G0 Z20
M9
M5
M30
"""


def toolpath_of(text=PART):
    return read_stream(io.BytesIO(text.encode()), "part.nc", CELL)


TOOLPATH = toolpath_of()
WHOLE = set_targets(TOOLPATH, CELL)


def row_of(x, y, z=-1.0):
    (row,) = np.flatnonzero((np.abs(WHOLE.position_mm - [x, y, z]) < 1e-6).all(axis=1) & ~WHOLE.ptp)
    return int(row)


def without(*rows, tolerance_mm=0.01, **columns):
    """Return the targets without some rows, their events at the rows before, and other columns changed."""
    keep = np.ones(len(WHOLE), dtype=bool)
    keep[list(rows)] = False
    place = np.cumsum(keep) - 1
    events = tuple(event._replace(row=int(place[event.row])) for event in WHOLE.events)
    fewer = rows_at(replace(WHOLE, **columns), np.flatnonzero(keep))
    return replace(fewer, events=events, simplified=Simplified(tolerance_mm))


def refused(targets):
    with pytest.raises(RefusedError) as caught:
        write_krl(targets, None, CELL, name="PART", toolpath=TOOLPATH)
    return {issue.code: issue.message for issue in caught.value.issues if issue.severity == "error"}


def test_what_merging_leaves_out_is_accepted():
    targets = set_targets(TOOLPATH, CELL, None, 0.01)
    program = write_krl(targets, None, CELL, name="PART", toolpath=TOOLPATH)
    figures = program.report.original
    assert figures.left_out == targets.simplified.left_out > 0
    assert figures.max_deviation_mm == pytest.approx(targets.simplified.largest_mm, abs=0.001)
    assert figures.max_deviation_mm <= figures.limit_mm == 0.011


def test_a_corner_on_a_line_may_be_left_out_by_anybody():
    program = write_krl(without(row_of(10, 0)), None, CELL, name="PART", toolpath=TOOLPATH)
    assert program.report.original.left_out == 1


@pytest.mark.parametrize(
    ("targets", "says"),
    [
        (
            lambda: without(row_of(20, 0), row_of(20.005, 0.005), tolerance_mm=0.003),
            "mm off, 0.0040 are allowed",
        ),
        (lambda: without(row_of(30, 0)), "a corner of the G-code is 7.0"),
        (lambda: without(row_of(30, 10)), "more than a corner is left out"),  # M8 comes on earlier
        (lambda: without(row_of(10, 20)), "dwells of|more than a corner"),
        (lambda: without(row_of(0, 20)), "a corner of the G-code is"),
        (lambda: without(row_of(0, 0.008), row_of(0, 0.004)), "goes back by 0.0040 mm"),
        (lambda: without(len(WHOLE) - 3), "a move of the G-code is left out"),
        (lambda: without(row_of(15, 5)), "more than a corner"),
    ],
)
def test_a_program_that_leaves_out_too_much_is_refused(targets, says):
    found = refused(targets())
    assert re.search(says, found["verify-original"]), found


def test_a_program_that_leaves_out_rapids_is_refused():
    rapid = row_of(5, 5, 20)
    assert "verify-original" in refused(without(rapid))


def swapped(column, a, b):
    values = np.array(getattr(WHOLE, column))
    values[[a, b]] = values[[b, a]]
    return values


def test_another_order_is_refused():
    a, b = row_of(20, 20.004), row_of(10, 20)
    moved = without(row_of(10, 0), position_mm=swapped("position_mm", a, b))
    assert "mm off the end of its G-code move" in refused(moved)["verify-original"]
    claimed = without(row_of(10, 0), position_mm=swapped("position_mm", a, b), move=swapped("move", a, b))
    assert "order" in refused(claimed)["verify-original"]


def test_another_feed_is_refused():
    speed = np.array(WHOLE.speed_mm_s)
    speed[row_of(20, 0)] *= 1.01
    found = refused(without(row_of(10, 0), speed_mm_s=speed))
    assert "speed 25.250 mm/s, 25.000 in the G-code" in found["verify-original"]


def test_merging_over_a_change_of_feed_is_refused():
    text = PART.replace("X20\nX20.005", "F1400 X20\nF1500 X20.005")
    speed = np.array(WHOLE.speed_mm_s)
    speed[row_of(20, 0)] *= 1400 / 1500
    with pytest.raises(RefusedError, match=r"speed 23\.333 mm/s, 25\.000 in the G-code"):
        write_krl(
            without(row_of(10, 0), speed_mm_s=speed), None, CELL, name="PART", toolpath=toolpath_of(text)
        )


def test_another_tool_is_refused():
    tool = np.full(len(WHOLE), 2, dtype=np.int32)
    with pytest.raises(RefusedError, match="not with T1 of the G-code"):
        write_krl(without(tool=tool), None, CELL, name="PART", toolpath=TOOLPATH)


@pytest.mark.parametrize("shift", [-2, 3])
def test_an_event_at_another_place_is_refused(shift):
    targets = without(row_of(10, 0))
    events = list(targets.events)
    (at,) = [k for k, event in enumerate(events) if event.kind == "coolant" and event.values["m"] == 8]
    events[at] = events[at]._replace(row=events[at].row + shift)
    exact = np.array(targets.cdis_mm)
    exact[events[at].row] = 0.0
    found = refused(replace(targets, events=tuple(events), cdis_mm=exact))
    assert "coolant is switched at another place" in found["verify-original"]


def test_a_missing_event_and_one_too_many_are_refused():
    targets = without(row_of(10, 0))
    coolant = [event for event in targets.events if event.kind == "coolant"]
    missing = tuple(event for event in targets.events if event is not coolant[0])
    assert "coolant is not switched" in refused(replace(targets, events=missing))["verify-original"]
    twice = tuple(sorted((*targets.events, coolant[0]), key=lambda event: event.row))
    assert "once more" in refused(replace(targets, events=twice))["verify-original"]


def test_a_motion_too_many_is_refused():
    row = row_of(20, 0)
    order = np.insert(np.arange(len(WHOLE)), row, row)
    more = rows_at(WHOLE, order)
    position, move = np.array(more.position_mm), np.array(more.move)
    position[row], move[row] = [15.0, 3.0, -1.0], -1
    events = tuple(event._replace(row=event.row + (event.row >= row)) for event in WHOLE.events)
    extra = replace(more, position_mm=position, move=move, events=events, simplified=Simplified(0.01))
    assert "a motion that the G-code does not have" in refused(extra)["verify-original"]


def test_targets_that_leave_out_corners_are_not_written_without_their_toolpath():
    with pytest.raises(NotUnderstoodError, match="toolpath"):
        write_krl(set_targets(TOOLPATH, CELL, None, 0.01), None, CELL, name="PART")


_NUMBER = st.integers(0, 40).map(lambda mm: f"{mm}")
_NEAR = st.integers(0, 60).map(lambda um: f"{um / 1000:.3f}")
_BLOCKS = st.one_of(
    st.tuples(_NUMBER, _NEAR).map(lambda p: f"G1 X{p[0]} Y{p[1]}"),
    st.lists(st.tuples(st.integers(1, 300), _NEAR), min_size=2, max_size=12).map(
        lambda steps: "\n".join(["G91 G1", *(f"X{x / 1000:.3f} Z{z}" for x, z in steps), "G90"])
    ),
    st.sampled_from(
        [
            *("G0 Z5\nG0 X3 Y3\nG1 Z-1", "F900", "F1500", "M8", "M9", "G4 P0.2", "G61", "G64", "G64 P0.02"),
            *("S9000", "G91\nG2 X5 Y0 I2.5 J0\nG90", "G28 Z0\nG0 X1 Y1 Z5\nG1 Z-1", "G1 X5\nX6\nX7\nX8"),
            "G0 Z20\nT2 M6\nS8000 M3\nG0 G43 H2 Z20\nG0 X2 Y2\nG1 Z-1",
            "G0 Z20\nT1 M6\nS8000 M3\nG1 G43 H1 X2 Y2 Z-1",
        ]
    ),
)


@pytest.mark.slow
@settings(deadline=None, max_examples=80)
@example(
    ["G91 G1\n" + "X0.001 Z0.000\n" * 3 + "G90", "G61", "G91 G1\n" + "X0.001 Z0.000\n" * 2 + "G90"], 0.001
)
@example(["G1 X5", "G1 X6\nX7", "G61", "G1", "G64", "X8\nX9"], 0.01)
@given(st.lists(_BLOCKS, min_size=2, max_size=14), st.sampled_from([0.001, 0.01, 0.05, 0.5]))
def test_no_simplified_program_is_refused(blocks, simplify_mm):
    """Whatever stands between the moves, what merging leaves out passes the comparison with the G-code."""
    body = "\n".join(blocks)
    head = "\n".join(PART.split("\n")[:8])
    toolpath = toolpath_of(f"{head}\nF1200\n{body}\nG0 Z20\nM5\nM30\n")
    targets = set_targets(toolpath, CELL, None, simplify_mm)
    joints = ptp_joints(targets, CELL)
    files = compose(targets, joints, CELL, "PART", TextLayout())
    texts = {name: b"".join(pieces) for name, pieces in files.items()}
    report = compare(read_texts(texts, "PART.src"), targets, joints, CELL, original=toolpath)
    assert not [issue for issue in report.issues if issue.code == "verify-original"]
    assert report.original.left_out >= targets.simplified.left_out
    assert report.original.max_deviation_mm <= simplify_mm + 0.001


# --- on disk ---------------------------------------------------------------------------------------------


@pytest.fixture
def written(tmp_path):
    part = tmp_path / "part.nc"
    part.write_text(PART)
    prediction = predict(part, CELL, simplify_mm=0.01)
    program = write_krl(prediction, tmp_path / "part.src", pilot="index")
    return part, prediction, program


def verified(part, program, **options):
    return verify_krl(program.files[0], read_gcode(part, CELL), CELL, forces=False, **options)


def test_a_written_program_agrees_with_the_original(written):
    part, prediction, program = written
    report = verified(part, program, simplify_mm=0.01)
    assert report.ok, report.issues
    assert report.original.left_out > 0
    assert report.as_dict()["original"]["max_deviation_mm"] <= 0.011
    assert verified(part, program, prediction=prediction).ok


def test_a_saved_prediction_is_written_and_verified_as_before(written, tmp_path):
    part, prediction, program = written
    prediction.save(tmp_path / "saved")
    loaded = Prediction.load(tmp_path / "saved")
    assert loaded.inputs["simplify_mm"] == 0.01
    assert loaded.targets.simplified == prediction.targets.simplified
    again = write_krl(loaded, tmp_path / "again.src", pilot="index", name="AGAIN")
    report = verified(part, again, simplify_mm=0.01)
    assert report.ok, report.issues
    assert report.original == again.report.original == program.report.original


@pytest.mark.parametrize("options", [{}, {"simplify_mm": 0.02}])
def test_the_tolerance_has_to_be_named(written, options):
    part, _, program = written
    with pytest.raises(NotUnderstoodError) as caught:
        verified(part, program, **options)
    assert "leaves out corners within 0.01 mm" in caught.value.issues[0].message
    assert "--simplify 0.01" in caught.value.issues[0].remedy


def test_a_whole_program_is_not_verified_as_a_simplified_one(tmp_path):
    part = tmp_path / "part.nc"
    part.write_text(PART)
    program = write_krl(predict(part, CELL, forces=False), tmp_path / "part.src")
    with pytest.raises(NotUnderstoodError, match="leaves out no corners"):
        verified(part, program, simplify_mm=0.01)


def test_other_g_code_is_refused(written):
    part, _, program = written
    part.write_text(PART.replace("X20.005 Y0.005", "X20.005 Y0.02"))
    assert not verified(part, program, simplify_mm=0.01).ok


def test_other_g_code_than_that_of_a_prediction_is_refused(written):
    part, prediction, program = written
    lines = PART.split("\n")
    part.write_text("\n".join(lines[:9] + lines[-5:]))
    report = verified(part, program, prediction=prediction)
    assert [issue.code for issue in report.issues if issue.severity == "error"] == ["verify-original"]
    part.write_text(PART.replace("X30 Y0", "X31 Y0"))
    assert not verified(part, program, prediction=prediction).ok


@pytest.mark.parametrize("edit", ["delete", "move", "swap"])
def test_an_edited_program_is_refused(written, edit):
    part, _, program = written
    src = program.files[0]
    lines = src.read_text().split("\n")
    lin = [k for k, line in enumerate(lines) if line.startswith("LIN {X 30.000,Y 0.000,Z -1")]
    if edit == "delete":
        del lines[lin[0]]
    elif edit == "move":
        lines[lin[0]] = lines[lin[0]].replace("X 30.000", "X 30.020")
    else:
        other = lin[0] + 1
        lines[lin[0]], lines[other] = lines[other], lines[lin[0]]
    src.write_text("\n".join(lines))
    assert not verified(part, program, simplify_mm=0.01).ok


def test_the_material_is_cut_along_the_merged_path(written):
    _, prediction, _ = written
    merged = np.setdiff1d(WHOLE.move[WHOLE.move >= 0], prediction.targets.move)
    assert len(merged)
    assert not np.isin(prediction.motion.move, merged).any()
