"""What the written programs do, by an independent replay (`replay`), against the Toolpath."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from gcode2krl import load_cell, read_gcode, set_targets, solve_joints, write_krl
from gcode2krl.cell import resolve_cell
from tests.conftest import EXAMPLES
from tests.krl.replay import Kr300, frame, read_program, replay_joints

pytestmark = pytest.mark.slow

THINNED = {"raster_finish": 10}
POSITION_MM, ROTATION_DEG, FEED_MM_MIN, JOINT_DEG = 0.002, 0.001, 0.1, 0.01
RAPID_MM_S = 200.0


@pytest.fixture(scope="module", params=EXAMPLES, ids=lambda part: part.stem)
def run(request, tmp_path_factory):
    """Translate an example with the default cell and replay it."""
    part, folder = request.param, tmp_path_factory.mktemp("replayed")
    cell = load_cell()
    toolpath = read_gcode(part, cell)
    targets = set_targets(toolpath, cell)
    written = write_krl(targets, folder / f"{part.stem}.src", cell)
    program = read_program(written.files[0])
    robot = Kr300()
    rows, joints = replay_joints(program, robot, THINNED.get(part.stem, 1))
    return SimpleNamespace(
        cell=cell,
        toolpath=toolpath,
        targets=targets,
        program=program,
        motions=program.motions,
        robot=robot,
        rows=rows,
        joints=joints,
        paired=pair(toolpath, program.motions, cell.clearance_z_mm),
    )


def pair(toolpath, motions, clearance_mm):
    """Return Toolpath row → motion for the rows that are positions; -1 for moves of no length.

    The motions must run through these rows in order; what lies between is on the clearance plane or above.
    """
    tips = np.array([[m.values.get(key, np.nan) for key in "XYZ"] for m in motions])
    positions = toolpath.known.all(axis=1) & ~toolpath.machine
    positions[0] = False
    paired, at = {}, 0
    for row in np.flatnonzero(positions):
        here = toolpath.position_mm[row]
        off = np.linalg.norm(tips[at : at + 2] - here, axis=1)
        if off[0] <= POSITION_MM and not (len(off) > 1 and off[1] < off[0]):
            paired[row] = -1
            continue
        start = at + 1
        at = next((k for k in range(start, len(tips)) if np.linalg.norm(tips[k] - here) <= POSITION_MM), None)
        assert at is not None, f"the position of line {toolpath.source_line[row]} is not reached"
        between = tips[start:at]
        assert (np.isnan(between) | (between >= [-np.inf, -np.inf, clearance_mm - POSITION_MM])).all()
        paired[row] = at
    rest = tips[at + 1 :]
    assert (np.isnan(rest) | (rest >= [-np.inf, -np.inf, clearance_mm - POSITION_MM])).all()
    return paired


def test_tips_run_through_the_programmed_positions(run):
    """`pair` has walked the text; here the tips come back from the joints."""
    moved = {motion: row for row, motion in run.paired.items() if motion >= 0}
    assert len(moved) > 0.9 * len(run.paired)
    compared = 0
    for row, joints in zip(run.rows, run.joints, strict=True):
        if row not in moved:
            continue
        motion = run.motions[row]
        tip = motion.base.inv() * run.robot.forward(joints) * motion.tool
        assert tip.translation == pytest.approx(run.toolpath.position_mm[moved[row]], abs=POSITION_MM)
        off = tip.rotation.as_matrix()[:, 2] @ run.toolpath.axis[moved[row]]
        assert np.degrees(np.arccos(min(1.0, off))) < ROTATION_DEG
        assert np.degrees(tip.rotation.magnitude()) < ROTATION_DEG  # 3 axes, spin 0: A = B = C = 0
        compared += 1
    assert compared > 100


def test_speed_is_the_programmed_feed(run):
    for row, motion in run.paired.items():
        if motion < 0:
            continue
        wanted = RAPID_MM_S if run.toolpath.rapid[row] else run.toolpath.feed_mm_s[row]
        assert run.motions[motion].speed_m_s * 60000 == pytest.approx(wanted * 60, abs=FEED_MM_MIN)
    added = set(range(len(run.motions))) - set(run.paired.values())
    for motion in added:
        if run.motions[motion].kind == "LIN":
            assert run.motions[motion].speed_m_s * 1000 == pytest.approx(RAPID_MM_S)


def test_joints_are_within_the_limits(run):
    low, high = run.robot.limits_deg.T
    assert (run.joints >= low).all()
    assert (run.joints <= high).all()


def test_joints_agree_with_solve_joints(run):
    joints = solve_joints(run.targets, run.cell)
    assert len(joints) == len(run.motions)
    assert np.abs(np.degrees(joints.q_rad[run.rows]) - run.joints).max() < JOINT_DEG


def test_status_and_turn_of_ptp(run):
    """S and T of each pose PTP name exactly one set of joints, near to HOME: no axis turns for nothing."""
    poses = [k for k, motion in enumerate(run.motions) if motion.kind == "PTP" and motion.joints_deg is None]
    assert poses
    for row in poses:
        joints = run.joints[np.flatnonzero(run.rows == row)[0]]
        assert int(run.motions[row].values["S"]) == run.robot.status(joints)
        assert np.abs(joints - run.cell.home.q_deg).max() < 180


def test_begins_and_ends_at_home(run):
    for motion in (run.motions[0], run.motions[-1]):
        assert motion.kind == "PTP"
        assert motion.joints_deg == pytest.approx(run.cell.home.q_deg)


def test_no_ptp_below_the_clearance_plane(run):
    for motion in run.motions:
        if motion.kind == "PTP" and motion.joints_deg is None:
            assert motion.values["Z"] >= run.cell.clearance_z_mm
        elif motion.kind == "PTP":
            base, tool = run.motions[1].base, run.motions[1].tool
            tip = base.inv() * run.robot.forward(motion.joints_deg) * tool
            assert tip.translation[2] >= run.cell.clearance_z_mm


def test_no_ptp_leaves_from_below_the_clearance_plane(run):
    for before, motion in zip(run.motions, run.motions[1:], strict=False):
        if motion.kind == "PTP" and before.joints_deg is None:
            assert before.values["Z"] >= run.cell.clearance_z_mm


def test_ptp_does_not_dip_below_the_clearance_plane(run):
    """On its way, too: the joints run straight, the tip does not."""
    for row, motion in enumerate(run.motions[1:], start=1):
        if motion.kind != "PTP":
            continue
        start, end = run.joints[np.searchsorted(run.rows, [row - 1, row])]
        tips = [
            motion.base.inv() * run.robot.forward(start + part * (end - start)) * motion.tool
            for part in np.linspace(0, 1, 41)
        ]
        assert min(tip.translation[2] for tip in tips) > run.cell.clearance_z_mm - 0.01


def test_no_approximation_between_rapid_and_feed(run):
    rapid = np.ones(len(run.motions), dtype=bool)
    for row, motion in run.paired.items():
        if motion >= 0:
            rapid[motion] = run.toolpath.rapid[row]
    for row in np.flatnonzero(rapid[1:] != rapid[:-1]):
        assert not run.motions[row].blend, run.motions[row].line


def test_no_approximation_before_a_standstill(run):
    """Nothing but a plain motion may follow ``C_DIS``: no WAIT, HALT, output, message or PTP."""
    for before, motion in zip(run.motions, run.motions[1:], strict=False):
        if before.blend:
            assert motion.before == ()
            assert motion.kind == "LIN"
    assert not run.motions[-1].blend
    assert not any(motion.blend for motion in run.motions if motion.kind == "PTP")


def test_approximation_has_a_distance(run):
    assert all(motion.cdis_mm > 0 for motion in run.motions if motion.blend)


# --- a cell unlike the default one ----------------------------------------------------------------------

BASE = {"x_mm": 1400.0, "y_mm": -300.0, "z_mm": 900.0, "a_deg": 25.0, "b_deg": -4.0, "c_deg": 3.0}
TOOL = {"x_mm": 240.0, "y_mm": 12.0, "z_mm": 260.0, "a_deg": 3.0, "b_deg": -80.0, "c_deg": 5.0}
AXES = {f"{sign}{letter}": int(f"{sign}1") * np.eye(3)[k] for k, letter in enumerate("xyz") for sign in "+-"}
PART = """G21 G90 G54 T1 M6
S8000 M3
G0 X0 Y0
G43 H1 Z30
G1 Z-2 F600
X40 Y10 F1234.5
Y40 Z-3
G0 Z30
M30
"""


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("spin_deg", [0.0, -35.0])
def test_any_base_tool_and_spin(tmp_path, axis, spin_deg):
    """A turned $BASE, a tilted $TOOL by number and each axis a controller's tool may point along."""
    along = AXES[axis]
    inner = frame(dict(zip("XYZABC", TOOL.values(), strict=True)))
    # the controller's frame, whose own `axis` points where the inner z does: the shortest turn, -z about x
    half_turn = Rotation.from_euler("x", 180, degrees=True)
    turn = half_turn if axis == "-z" else Rotation.align_vectors([along], [[0, 0, 1]])[0]
    controller = inner * RigidTransform.from_rotation(turn.inv())
    a, b, c = controller.rotation.as_euler("ZYX", degrees=True)
    x, y, z = controller.translation
    tool = {"x_mm": x, "y_mm": y, "z_mm": z, "a_deg": a, "b_deg": b, "c_deg": c}
    cell = resolve_cell(
        {
            "based_on": "demonstration",
            "frames": {"base": BASE, "base_data": 3, "spin": spin_deg},
            "tool": {"1": {"tool_data": 7, "axis": axis, "frame": tool}},
        }
    )
    part = tmp_path / "part.nc"
    part.write_text(PART)
    toolpath = read_gcode(part, cell)
    written = write_krl(set_targets(toolpath, cell), tmp_path / "part.src", cell)
    base = frame(dict(zip("XYZABC", BASE.values(), strict=True)))
    program = read_program(written.files[0], {3: base}, {7: controller})
    robot = Kr300()
    _, joints = replay_joints(program, robot)
    wanted_z = toolpath.axis[-1]
    for motion, angles in zip(program.motions, joints, strict=True):
        tip = base.inv() * robot.forward(angles) * controller
        if motion.joints_deg is None:
            assert tip.translation == pytest.approx([motion.values[key] for key in "XYZ"], abs=POSITION_MM)
            assert tip.rotation.apply(along) == pytest.approx(wanted_z, abs=np.radians(ROTATION_DEG))
            if axis == "+z":
                spun = tip.rotation * Rotation.from_euler("z", -spin_deg, degrees=True)
                assert np.degrees(spun.magnitude()) < ROTATION_DEG
    pair(toolpath, program.motions, cell.clearance_z_mm)
