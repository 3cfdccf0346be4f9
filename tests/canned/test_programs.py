"""The canned programs: what they do, read from what is written."""

from pathlib import Path

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.canned import NAMES, REPEAT, draft_of, gcode_of, minutes_of, place_of, predicted, targets_of
from gcode2krl.canned.catalogue import PROGRAMS, SPINDLE_SHARES, WEIGHT_N
from gcode2krl.canned.draft import DIAGONAL, GESTURE_MM, REFERENCES
from gcode2krl.canned.trial import trials_of
from gcode2krl.cell import load_cell
from gcode2krl.cli import make_test
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.gcode import read_gcode
from gcode2krl.pipeline import set_targets, solve_joints

CELL = load_cell()
PLACE = place_of(CELL)
PART = Path(__file__).parents[2] / "examples" / "test_piece.nc"


def draft_for(name, place=PLACE):
    part = None
    if PROGRAMS[name].takes_part:
        part = PART.read_text("ascii")
    return draft_of(name, place, part)


def points_of(targets):
    programmed = targets.move >= 0
    return targets.position_mm[programmed] - np.array(PLACE.origin_mm), targets.wait_s[programmed]


def test_the_command_knows_every_program():
    assert (make_test.CONTROLLER, *NAMES) == make_test.NAMES
    said = {"size": make_test._SIZE_MM, "percent": make_test._PERCENT}
    assert said == {"size": PLACE.size_mm, "percent": PLACE.percent}


@pytest.mark.parametrize("name", NAMES)
def test_a_program_begins_and_ends_with_the_gesture_and_the_three_points(name):
    targets = targets_of(draft_for(name), CELL)
    assert not [issue for issue in targets.issues if issue.severity == "error"]
    point, wait_s = points_of(targets)
    strokes = np.maximum(GESTURE_MM, 0.0)[:, None] * DIAGONAL
    first = 1 + len(GESTURE_MM)
    np.testing.assert_allclose(point[1:first], strokes, atol=2e-3)
    np.testing.assert_allclose(point[-len(GESTURE_MM) :], strokes, atol=2e-3)
    references = PLACE.size_mm * np.array(REFERENCES)
    np.testing.assert_allclose(point[first : first + 2], references[1:], atol=2e-3)
    last = point[-len(GESTURE_MM) - 3 : -len(GESTURE_MM)]
    np.testing.assert_allclose(last[:2], references[1:], atol=2e-3)
    assert (wait_s[first - 1 : first + 2] >= 3.0).all()  # the first reference is where the gesture ends


@pytest.mark.parametrize("name", [name for name in NAMES if name != "repeat"])
def test_a_program_stays_in_its_air(name):
    point, _ = points_of(targets_of(draft_for(name), CELL))
    size = PLACE.size_mm
    assert point.min() > -0.6 * size
    assert point.max() < 1.1 * size
    assert point[:, 2].min() > -0.3 * size
    assert point[:, 2].max() < 0.26 * size


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("form", ["src", "nc"])
def test_both_forms_are_written_verified_and_translate(run, tmp_path, name, form):
    part = [str(make_part(tmp_path))] if PROGRAMS[name].takes_part else []
    file = f"test.{form}"
    assert "min" in run("make-test", name, *part, "-o", file, code=0).out
    if form == "nc":
        run(file, "-o", "other.src", code=0)
        file = "other.src"
    text = (tmp_path / file).read_text("ascii")
    assert text.index("PTP") < text.index("LIN")


def make_part(folder):
    file = folder / "part.nc"
    file.write_text(
        "%\nG21 G90\nT1 M6\nS9000 M3\nG0 G43 H1 Z20\nG0 X0 Y0\nG1 Z5 F600\nG1 X50\nG1 Y20\nG0 Z40\nM30\n%\n"
    )
    return file


def test_minutes_are_those_of_the_predicted_motion_and_the_people():
    still = draft_for("dwell")
    motion = predicted(still, CELL).motion
    assert minutes_of(still, targets_of(still, CELL), CELL) == pytest.approx(
        motion.time_s[-1] / 60.0, rel=1e-3
    )
    assert 30.0 < motion.time_s[-1] / 60.0 < 33.0
    hung = draft_for("weights")
    assert minutes_of(hung, targets_of(hung, CELL), CELL) > hung.halts


def test_a_single_joint_moves_alone():
    prediction = predicted(draft_for("single-joint"), CELL, dt_s=0.012)
    q = np.degrees(prediction.joints.q_rad)
    rest = prediction.motion.speed_mm_s < 1e-6
    home = q[np.flatnonzero(rest)[-1]]
    moved = np.abs(q - home)
    reversed_joints = set()
    turning = np.flatnonzero(prediction.motion.move == np.bincount(prediction.motion.move).argmax())
    arrived = turning[np.flatnonzero(moved[turning].max(axis=1) < 1e-3)[0]]
    for row in turning[turning > arrived]:
        largest = int(moved[row].argmax())
        if moved[row, largest] > 0.4:
            others = np.delete(moved[row], largest)
            assert others.max() < 0.02, row
            reversed_joints.add(largest)
    assert reversed_joints == set(range(6))


def test_orientation_changes_about_the_same_points():
    targets = targets_of(draft_for("orientation"), CELL)
    held = targets.wait_s >= 3.0
    place = np.round(targets.position_mm[held], 3)
    axis = np.stack([_third_axis(rotation) for rotation in targets.rotation[held]])
    for point in PLACE.size_mm * np.array(REFERENCES) + np.array(PLACE.origin_mm):
        at = np.linalg.norm(place - point, axis=1) < 2e-3
        assert len(np.unique(np.round(axis[at], 4), axis=0)) >= 5


def test_the_tool_turns_as_far_as_limits_and_wrist_allow():
    def turned_deg(cell):
        targets = targets_of(draft_of("orientation", place_of(cell)), cell)
        assert not [issue for issue in targets.issues if issue.severity == "error"]
        half = np.arccos(np.clip(np.abs(targets.rotation @ targets.rotation[-1]), 0.0, 1.0))
        return np.degrees(2.0 * half[targets.wait_s >= 3.0]).max()

    assert turned_deg(CELL) == pytest.approx(90.0, abs=0.01)
    limits = list(CELL.robot.limits.q_deg)
    limits[4] = (-90.0, 90.0)
    narrow = CELL.robot.limits.model_copy(update={"q_deg": tuple(limits)})
    robot = CELL.robot.model_copy(update={"limits": narrow})
    assert turned_deg(CELL.model_copy(update={"robot": robot})) == pytest.approx(60.0, abs=0.01)


def _third_axis(quaternion):
    x, y, z, w = quaternion
    return 2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)


def test_the_part_is_repeated_as_it_is():
    whole = targets_of(draft_for("repeat"), CELL)
    alone = set_targets(read_gcode(PART, CELL), CELL)
    own = alone.move >= 0
    own[np.flatnonzero(own)[0]] = False  # led to from elsewhere
    count = int(own.sum())
    programmed = np.flatnonzero(whole.move >= 0)
    lines = whole.source_line[programmed]
    shift = draft_for("repeat").lines.index("G49 G64")  # the part's own first line, %, is left out
    there = programmed[np.isin(lines - shift, alone.source_line[own])][-count:]
    np.testing.assert_allclose(whole.position_mm[there], alone.position_mm[own])
    np.testing.assert_allclose(whole.cdis_mm[there][:-1], alone.cdis_mm[own][:-1])
    np.testing.assert_allclose(whole.speed_mm_s[there], alone.speed_mm_s[own])


def test_the_robot_never_moves_with_a_weight_on_it_and_its_spindle_stands():
    draft = draft_for("weights")
    assert not any(line.endswith("M3") or line.startswith("G1") for line in draft.lines)
    lines = draft.lines
    for before, after in zip(draft.states, draft.states[1:], strict=False):
        if any(before.pull_N):
            assert after.line == before.line  # no move between them
            assert after.stood_s > before.stood_s
    assert not any(draft.states[-1].pull_N)
    assert lines.count("M0") == len(draft.states)
    sizes = {round(float(np.linalg.norm(state.pull_N))) for state in draft.states}
    assert sizes == {0, round(WEIGHT_N)}


def test_the_circle_is_round_and_slow():
    prediction = predicted(draft_for("circle"), CELL, dt_s=0.012)
    cruise = (np.abs(prediction.motion.speed_mm_s - 25.0) < 0.1) & (
        prediction.motion.acceleration_mm_s2 < 20.0
    )
    from_centre = prediction.motion.position_mm - np.array(PLACE.origin_mm) - [50.0, 0.0, 0.0]
    assert cruise.sum() * 0.012 > 4 * np.pi * 100.0 / 25.0 * 0.9
    np.testing.assert_allclose(np.linalg.norm(from_centre[cruise], axis=1), 50.0, atol=0.05)


def test_place_size_and_speed_are_obeyed():
    place = place_of(CELL, (200.0, 50.0, 40.0), 40.0, 50.0)
    text = gcode_of(draft_of("reversals", place))
    assert "G0 X240.000 Y50.000 Z40.000" in text
    assert "F150\n" in text  # 5 mm/s, halved
    with pytest.raises(NotUnderstoodError, match="size"):
        place_of(CELL, None, 5000.0)
    with pytest.raises(NotUnderstoodError, match="speed"):
        place_of(CELL, None, 100.0, 150.0)
    with pytest.raises(NotUnderstoodError, match="clearance"):
        place_of(CELL, (0.0, 0.0, 900.0))


def test_out_of_reach_is_refused(run):
    made = run("make-test", "circle", "-o", "test.src", "--at", "2500", "0", "50")
    assert made.code != 0
    assert "reach" in made.err


@pytest.mark.parametrize(("name", "part"), [("repeat", None), ("circle", "G0 X0\n")])
def test_a_part_belongs_to_repeat_alone(name, part):
    with pytest.raises(NotUnderstoodError, match="G-code"):
        draft_of(name, PLACE, part)


def test_a_cell_without_a_mounted_tool_is_refused():
    with pytest.raises(RefusedError, match="mounted"):
        place_of(CELL.model_copy(update={"mounted_tool": None}))


def test_turns_are_checked_like_everything_else():
    far = place_of(CELL, (100.0, 0.0, 60.0), 600.0)
    targets = targets_of(draft_of("single-joint", far), CELL)
    joints = solve_joints(targets, CELL)
    assert np.isfinite(joints.q_rad).all()
    lever = robot.jacobian(joints.q_rad[3:4], CELL, 1)[0, :3, 0]
    assert np.linalg.norm(lever) > 500.0


TRIALS = {trial.name: trial for trial in trials_of(CELL)}


def test_every_program_but_the_repetition_can_be_tried():
    assert set(TRIALS) == set(PROGRAMS) - {REPEAT}
    assert trials_of(CELL) is trials_of(load_cell())  # remembered


@pytest.mark.parametrize("name", sorted(TRIALS))
def test_a_trial_is_whole(name):
    inputs = TRIALS[name].inputs
    assert np.isfinite(inputs.q_cmd_rad).all()
    assert (np.diff(inputs.time_s) > 0.0).all()
    assert TRIALS[name].minutes >= inputs.time_s[-1] / 60.0
    assert len(inputs) < 6000


def test_weights_pull_only_while_the_robot_stands():
    inputs = TRIALS["weights"].inputs
    pulled = np.linalg.norm(inputs.force_base_N, axis=1) > 0.0
    assert set(np.round(np.linalg.norm(inputs.force_base_N[pulled], axis=1))) == {WEIGHT_N}
    step_mm = np.linalg.norm(np.diff(inputs.position_mm, axis=0), axis=1)
    assert step_mm[pulled[1:] & pulled[:-1]].max() < 1e-9
    directions = {tuple(row) for row in np.round(inputs.force_base_N[pulled] / WEIGHT_N)}
    assert len(directions) == 3
    seconds = pulled.sum() * np.median(np.diff(inputs.time_s))
    assert seconds == pytest.approx(3 * 3 * 10.0, rel=0.05)
    assert inputs.deflection_mm[pulled].any(axis=1).all()


def test_the_spindle_turns_at_its_four_speeds_and_then_stands():
    inputs = TRIALS["spindle"].inputs
    rpm = np.round(inputs.spindle_rad_s * 60.0 / (2.0 * np.pi))
    most = place_of(CELL).most_rpm
    assert set(rpm) == {0.0, *(share * most for share in SPINDLE_SHARES)}
    assert rpm[0] == rpm[-1] == 0.0
    step_s = np.median(np.diff(inputs.time_s))
    for share in SPINDLE_SHARES:
        assert (rpm == share * most).sum() * step_s == pytest.approx(20.0, rel=0.05)
    assert draft_of("spindle", place_of(CELL)).starts == 2 * len(SPINDLE_SHARES)


def test_what_cannot_run_is_left_out():
    assert trials_of(CELL.model_copy(update={"mounted_tool": None})) == ()
