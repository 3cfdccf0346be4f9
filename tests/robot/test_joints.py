"""Joints along a program: one branch, the right turns, and findings with the line they belong to."""

import io
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform

from gcode2krl import set_targets, solve_joints
from gcode2krl.gcode import read_stream
from gcode2krl.robot import forward
from tests.cells import over_demonstration
from tests.krl.replay import Kr300, frame

HEAD = "G21 G90 G54\nT1 M6\nS8000 M3\nG43 H1\n"
SQUARE = HEAD + "G0 X0 Y0\nG0 Z5\nG1 Z0 F1000\nG1 X200\nG1 Y200\nG1 X0\nG1 Y0\nG0 Z50\nM30\n"
ACROSS = HEAD + "G0 X0 Y{0}\nG0 Z5\nG1 Z0 F1000\n(across)\nG1 Y{1} F6000\nG0 Z50\nM30\n"
LOW, HIGH = Kr300.limits_deg.T


def solve(text, **data):
    """Plan a piece of G-code in a cell and solve its joints."""
    cell = over_demonstration(data)
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", cell)
    targets = set_targets(toolpath, cell)
    joints = solve_joints(targets, cell)
    errors = [issue for issue in targets.issues if issue.severity == "error"]
    return SimpleNamespace(
        cell=cell, targets=targets, joints=joints, q_deg=np.degrees(joints.q_rad), errors=errors
    )


def base(**values):
    place = dict.fromkeys("xyzabc", 0.0) | values
    return {
        "base": {f"{key}_{'mm' if key in 'xyz' else 'deg'}": float(value) for key, value in place.items()}
    }


def found(made):
    """Return code and line of the errors."""
    return {(issue.code, issue.line) for issue in made.errors}


def test_home_is_as_in_the_cell():
    made = solve(SQUARE)
    assert made.q_deg[0] == pytest.approx(made.cell.home.q_deg)
    assert made.q_deg[-1] == pytest.approx(made.cell.home.q_deg)
    assert np.isnan(made.joints.qd_rad_s).all()


@pytest.mark.parametrize("spin", [-300, -60, 0, 45, 300])
def test_one_branch_and_no_jump(spin):
    made = solve(SQUARE, frames={"spin": float(spin)})
    assert not made.errors
    path = ~made.targets.home
    assert len(set(made.joints.status[path])) == 1
    assert np.abs(np.diff(made.q_deg[path], axis=0)).max() < 45
    position, rotation = forward(made.joints.q_rad, made.cell)
    assert position == pytest.approx(made.targets.position_mm, abs=1e-6)
    assert np.abs(np.sum(rotation * made.targets.rotation, axis=1)) == pytest.approx(1)


@pytest.mark.parametrize("spin", range(-360, 361, 30))
def test_whatever_is_accepted_is_within_the_limits(spin):
    made = solve(SQUARE, frames={"spin": float(spin)})
    within = ((made.q_deg >= LOW) & (made.q_deg <= HIGH)).all()
    assert within or made.errors
    margin = np.minimum(made.q_deg - LOW, HIGH - made.q_deg).min(axis=1)
    assert np.degrees(made.joints.limit_margin_rad) == pytest.approx(margin)


def test_status_and_turn_bits():
    robot = Kr300()
    for spin in (-60, 0, 60):
        made = solve(SQUARE, frames={"spin": float(spin)})
        for q_deg, status, turn in zip(
            made.q_deg[1:-1], made.joints.status[1:-1], made.joints.turn[1:-1], strict=True
        ):
            assert status == robot.status(q_deg)
            assert turn == sum(1 << k for k in range(6) if q_deg[k] < 0)


@pytest.mark.parametrize("a6_deg", [-300, -200, 190, 300])
def test_turn_of_a_wrist_wound_at_home(a6_deg):
    """A6 is the turn nearest to HOME, so the approach never unwinds a whole turn; T says which it is."""
    made = solve(SQUARE, home={"q_deg": [0, -90, 90, 0, 0, a6_deg]})
    assert not made.errors
    assert abs(made.q_deg[1, 5] - a6_deg) <= 180 + 1e-6
    assert made.joints.turn[1] >> 5 & 1 == (made.q_deg[1, 5] < 0)
    position, _ = forward(made.joints.q_rad[1:-1], made.cell)
    assert position == pytest.approx(made.targets.position_mm[1:-1], abs=1e-6)


def test_turn_that_would_leave_the_limits_is_not_taken():
    """HOME at A4 = 349: the nearest turn of A4 would exceed 350 somewhere, so another one is taken."""
    made = solve(SQUARE, home={"q_deg": [0, -90, 90, 349, 0, 0]})
    assert not made.errors
    assert (made.q_deg[:, 3] <= 350).all()
    assert (made.joints.limit_margin_rad > 0).all()


# --- findings -------------------------------------------------------------------------------------------


def line_of(text, start):
    return 1 + next(k for k, line in enumerate(text.splitlines()) if line.startswith(start))


@pytest.mark.parametrize("move", ["G1 X1600", "G1 Y3000", "G1 Z-2500", "G1 X400 Y100 Z-3000"])
def test_out_of_reach_in_its_line(move):
    text = SQUARE.replace("G1 Y200\n", move + "\nG1 X200 Y200 Z0\n")
    made = solve(text)
    line = line_of(text, move)
    assert ("out-of-reach", line) in found(made)
    assert {where for code, where in found(made) if code == "out-of-reach"} <= {line, line + 1}
    row = np.flatnonzero(made.targets.source_line == line)[0]
    assert np.isnan(made.q_deg[row]).all()
    assert np.isfinite(made.q_deg[row + 1]).all()


@pytest.mark.parametrize("height", [400, 700])
def test_limit_in_the_middle_of_a_long_line(height):
    """Both ends are fine, the robot's own foot is in the way between them; an independent solver agrees."""
    made = solve(ACROSS.format(-1000, 1000), frames=base(x=1000, y=0, z=height))
    assert (made.joints.limit_margin_rad > 0).all()
    assert found(made) == {("joint-limit", 9)}
    assert "A3" in made.errors[0].message
    robot, tool = Kr300(), made.cell.tool_matrix(1)
    tool_frame = RigidTransform.from_matrix(tool)
    origin = frame({"X": 1000, "Y": 0, "Z": height, "A": 0, "B": 0, "C": 0})
    q_deg = made.q_deg[4]
    worst = -np.inf
    for y in np.linspace(-1000, 1000, 201):
        tip = RigidTransform.from_translation([0.0, y, 0.0])
        q_deg = robot.nearest(origin * tip * tool_frame.inv(), q_deg)
        worst = max(worst, (q_deg - HIGH).max())
    assert worst > 0.5


def test_limit_on_the_way_is_found_in_the_approach_too():
    """A rapid is a LIN like any other."""
    text = ACROSS.format(-1000, 1000).replace("G1 Y1000 F6000", "G0 Y1000")
    assert found(solve(text, frames=base(x=1000, y=0, z=400))) == {("joint-limit", 9)}


def test_singular_wrist_in_its_line():
    made = solve(ACROSS.format(-200, 200), frames=base(x=1300, y=0, z=1400))
    assert found(made) == {("singularity", 9)}
    assert "A5" in made.errors[0].message
    assert np.abs(made.q_deg[2:-1, 4]).min() > 10, "nothing to be seen at the ends"


def test_same_place_without_the_singularity():
    assert not solve(ACROSS.format(-200, 200), frames=base(x=1300, y=0, z=1000)).errors


def test_home_beyond_a_limit():
    assert ("home-limit", 0) in found(solve(SQUARE, home={"q_deg": [0, 0, 90, 0, 0, 0]}))


def test_robot_whose_limits_nobody_knows():
    assert ("limits-unknown", 0) in found(solve(SQUARE, robot={"limits": {"q_deg": None}}))


def test_robot_whose_speeds_nobody_knows():
    """Singularities are then judged by A5 alone."""
    made = solve(
        ACROSS.format(-200, 200), frames=base(x=1300, y=0, z=1400), robot={"speeds": {"qd_deg_s": None}}
    )
    assert found(made) == {("singularity", 9)}
    assert "joint-speeds-unknown" in {issue.code for issue in made.targets.issues}


def test_too_fast_a_joint_is_a_warning():
    """Away from singularities a joint that is too slow only makes the move slower."""
    text = ACROSS.format(-300, 300).replace("F6000", "F110000")
    made = solve(text, frames=base(x=1000, y=0, z=900), controller={"vel_cp_m_s": 2.0})
    kinds = {
        (issue.severity, issue.code, issue.line) for issue in made.targets.issues if issue.severity != "note"
    }
    assert kinds == {("warning", "joint-speed", 9)}


# --- spin = "auto" --------------------------------------------------------------------------------------

TIGHT = [
    {"x": 600, "y": 900, "z": 800, "a": 90},
    {"x": 900, "y": 0, "z": 800, "a": 0},
    {"x": 900, "y": -900, "z": 800, "a": 90},
    {"x": 1200, "y": -900, "z": 800, "a": 180},
]


@pytest.mark.parametrize("place", TIGHT, ids=str)
def test_auto_finds_a_spin_where_zero_is_impossible(place):
    frames = base(**place)
    assert "joint-limit" in {code for code, _ in found(solve(SQUARE, frames=frames | {"spin": 0.0}))}
    made = solve(SQUARE, frames=frames | {"spin": "auto"})
    assert not made.errors
    assert (made.joints.limit_margin_rad > 0).all()
    assert len(set(made.joints.status[~made.targets.home])) == 1
    z = np.array([[0, 0, 1.0]])
    planned = ~made.targets.home
    turned = frame_axes(made.targets.rotation[planned])
    assert turned == pytest.approx(np.repeat(z, planned.sum(), axis=0), abs=1e-12)


def frame_axes(quaternion):
    """Return z of each tool frame."""
    x, y, z, w = quaternion.T
    return np.column_stack([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)])


def test_auto_is_not_worse_where_zero_is_fine():
    auto = solve(SQUARE, frames={"spin": "auto"})
    zero = solve(SQUARE)
    assert not auto.errors
    assert auto.joints.limit_margin_rad[1:-1].min() >= min(
        np.radians(5), zero.joints.limit_margin_rad[1:-1].min()
    )
