"""Offline compensation while the tool's axis turns: each place against eq. 10, all of it as one body."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import compliance, write_krl
from gcode2krl.cell.sections import Machine, Tool
from gcode2krl.compensation.intended_path import MOST_SLOPE, Placed, Ways, deviation_from
from gcode2krl.compensation.iteration import compensate
from gcode2krl.errors import RefusedError
from gcode2krl.gcode import read_gcode
from gcode2krl.pipeline import plan_motion, set_targets, solve_joints
from tests.cells import over_demonstration
from tests.compensation import below, corrected, read, stages
from tests.test_external_axes import ON_TABLE, TABLE, TABLE_MACHINE, cone

IN_TOOL = np.array([300.0, 450.0, -150.0])
"""A force that stays as it is for somebody who sits on the tool."""
LEANING = "G1 Z-2 F600\nG1 X100 A16 F1500\n"
TWISTING = "G1 Z-2 F600\nG1 X40 Y10 A10 C0 F1500\nX80 Y40 A20 C40\nX90 Y80 A20 C80\n"


@pytest.fixture
def head(cell):
    """A robot under a program for a head that turns about its tip."""
    machine = Machine(kind="head-head", axes=("C", "A"), signs=(1, 1), tcpm=True)
    return cell.model_copy(update={"machine": machine})


def in_tool(motion):
    """The constant force of a tool's frame, along ``$BASE``; in air none."""
    return np.where(below(motion), Rotation.from_quat(motion.rotation).apply(IN_TOOL), 0.0)


def growing(motion):
    size = np.clip(motion.path_mm - 60.0, 0.0, 100.0)[:, None] / 60.0
    return size * in_tool(motion)


@pytest.mark.parametrize("body", [LEANING, TWISTING])
def test_each_target_is_moved_by_the_deflection_at_its_own_orientation(head, body):
    """Eq. 10, with the orientation of the moved target, where neither a ramp nor a corner is near."""
    done = corrected(body, head, in_tool)
    moved, intended = done.targets, done.intended
    q = solve_joints(moved, head).q_rad
    base = head.base_matrix()[:3, :3]
    force = Rotation.from_quat(moved.rotation).apply(IN_TOOL)
    bent = compliance.displace(q, force @ base.T, np.zeros(3), head, 1)[0] @ base
    way = np.diff(intended.position_mm, axis=0, prepend=intended.position_mm[:1])
    length = np.linalg.norm(way, axis=1)
    unit = way / np.where(length > 0.0, length, 1.0)[:, None]
    behind = np.roll(unit, -1, axis=0)
    straight = (np.einsum("ij,ij->i", unit, behind) > 1.0 - 1e-9) & (intended.position_mm[:, 2] == -2.0)
    straight &= np.cumsum(np.where(intended.position_mm[:, 2] == -2.0, length, 0.0)) > 12.0
    rows = np.flatnonzero(straight)
    assert len(rows) > 5
    turn = Rotation.from_quat(moved.rotation[rows[0]]).inv() * Rotation.from_quat(moved.rotation[rows[-1]])
    assert np.degrees(turn.magnitude()) > 10.0
    wanted = -compliance.project_normal(bent, unit)[rows]
    shift = (moved.position_mm - intended.position_mm)[rows]
    assert np.linalg.norm(wanted, axis=1).max() > 0.8
    np.testing.assert_allclose(shift, wanted, atol=6e-3)
    assert done.figures["change_mm"] <= 1e-3


def test_what_remains_is_found_again_from_the_written_targets(head):
    """The moved targets planned, bent and measured anew, by the distance of the tip to the line of Y0 Z-2."""
    done = corrected(LEANING, head, in_tool)
    motion, _, deflection = stages(done.targets, head, in_tool)
    bent = motion.position_mm + deflection.deflection_base_mm
    on_line = below(motion)[:, 0] & (bent[:, 0] > 12.0) & (bent[:, 0] < 98.0)
    assert np.hypot(bent[on_line, 1], bent[on_line, 2] + 2.0).max() < 8e-3
    before, _, was = stages(read(LEANING, head)[1], head, in_tool)
    bent = before.position_mm + was.deflection_base_mm
    assert np.hypot(bent[:, 1], bent[:, 2] + 2.0)[below(before)[:, 0]].max() > 1.0


QUARTER = Rotation.from_matrix([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
ANY = Rotation.from_rotvec([0.4, -0.7, 1.1])


def turned_cell(cell, turn):
    """The same robot and the same room, ``$BASE`` turned back by as much as the program is turned."""
    base = cell.base_matrix()[:3, :3] @ turn.inv().as_matrix()
    abc = Rotation.from_matrix(base).as_euler("ZYX", degrees=True)
    stated = dict(zip(("a_deg", "b_deg", "c_deg"), map(float, abc), strict=True))
    frames = cell.frames.model_copy(update={"base": cell.frames.base.model_copy(update=stated)})
    return cell.model_copy(update={"frames": frames})


@pytest.mark.parametrize(("turn", "all_over"), [(QUARTER, True), (ANY, False)])
def test_a_part_turned_as_one_body_is_corrected_as_one_body(head, turn, all_over):
    """Ramps are bounded along X, Y and Z, so they are turned by a quarter alone."""
    toolpath, targets = read(TWISTING, head)
    done = corrected(TWISTING, head, growing)
    other_cell = turned_cell(head, turn)
    other = replace(
        targets,
        position_mm=turn.apply(np.array(targets.position_mm)),
        rotation=(turn * Rotation.from_quat(np.array(targets.rotation))).as_quat(),
        issues=(),
    )
    moved = {name: turn.apply(np.array(getattr(toolpath, name))) for name in ("position_mm", "axis")}
    _, forces, _ = stages(targets, head, growing)
    forces = replace(forces, force_base_N=turn.apply(np.array(forces.force_base_N)))
    again = compensate(replace(toolpath, **moved), other, other_cell, plan_motion(other, other_cell), forces)
    assert len(again.targets) == len(done.targets)
    shift = turn.inv().apply(again.targets.position_mm - again.intended.position_mm)
    off = np.linalg.norm(shift - (done.targets.position_mm - done.intended.position_mm), axis=1)
    assert done.figures["max_correction_mm"] > 1.0
    assert off.max() < (1e-3 if all_over else 6e-3)
    assert again.after.rms_mm == pytest.approx(done.after.rms_mm, abs=1e-3)


def drawn_edge(seed, tool):
    """Return one sample of a turning tool: its line's way and turn per mm, its axis, depth, and a shift."""
    chance = np.random.default_rng(seed)
    axis = Rotation.from_rotvec(chance.uniform(-0.5, 0.5, 3)).apply([0.0, 0.0, 1.0])
    unit = np.cross(axis, chance.normal(size=3))  # across the axis, as a flank cuts
    unit /= np.linalg.norm(unit)
    return axis, unit, chance.normal(size=3) * 0.03, chance.uniform(3.0, 14.0), chance.normal(size=3)


def surface_errors(tool, axis, unit, turn, depth_mm, shift):
    """Return how far a shift moves the surface, (k,) along its normals, by points all over the cutter.

    The surface is where the cutter moves along itself: n·(u + turn x p) changes its sign.
    """
    first = np.cross(axis, unit)
    angle = np.linspace(0.0, 2.0 * np.pi, 7201)
    ring = np.cos(angle)[:, None] * np.cross(first, axis) + np.sin(angle)[:, None] * first
    radius, errors = tool.diameter_mm / 2.0, []
    for share in np.linspace(0.0, 1.0, 41):
        if tool.kind == "ball":
            polar = 0.5 * np.pi * share
            normal = np.sin(polar) * ring - np.cos(polar) * axis
            place = radius * (normal + axis)
        else:
            normal, place = ring, radius * ring + share * depth_mm * axis
        speed = np.einsum("ij,ij->i", normal, unit + np.cross(turn, place))
        at = np.flatnonzero(speed[1:] * speed[:-1] <= 0.0)
        errors.append(np.abs(normal[at] @ shift))
    return np.concatenate(errors)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("kind", ["flat", "ball"])
def test_the_deviation_is_that_of_the_surface_which_the_edge_leaves(cell, kind, seed):
    corner = {"corner_radius_mm": 8.0} if kind == "ball" else {}
    tool = Tool(kind=kind, diameter_mm=16.0, teeth=2, flute_length_mm=20.0, **corner)
    axis, unit, turn, depth_mm, shift = drawn_edge(seed, tool)
    turn -= (turn @ axis) * axis
    errors = surface_errors(tool, axis, unit, turn, depth_mm, shift)
    off = np.linalg.norm(deviation_of_one(cell, tool, axis, unit, turn, depth_mm, shift))
    upright = abs(shift @ axis) if kind == "flat" else 0.0  # the bottom is no flank
    assert errors.max() <= off * 1.002
    assert off <= 1.01 * np.hypot(errors.max(), upright) + 1e-9


def deviation_of_one(cell, tool, axis, unit, turn, depth_mm, shift):
    """Return the offset (3,) that `deviation_from` gives for a single sample, 5 mm along a line of 10 mm."""
    known = cell.model_copy(update={"tool": {1: tool}})
    path, targets = read("G1 Z-2 F600\nG1 X10 F1500\n", cell)
    motion, forces, deflection = stages(targets, cell, lambda motion: np.tile(IN_TOOL, (len(motion), 1)))
    ways = Ways.of(path, targets, known)
    row = int(np.flatnonzero(ways.cuts)[-1])
    swing = Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0].as_quat()
    at = int(np.flatnonzero(motion.move == targets.move[row])[0])
    ways = replace(
        ways,
        unit=np.where(np.arange(len(targets))[:, None] == row, unit, ways.unit),
        turn=np.where(np.arange(len(targets))[:, None] == row, turn, 0.0),
        blend_mm=np.zeros(len(targets)),
    )
    count, here = len(motion), np.arange(len(motion)) == at
    placed = Placed(np.where(here, row, -1), np.full(count, ways.begin_mm[row] + 5.0))
    position = np.tile(ways.start_mm[row] + 5.0 * unit, (count, 1))
    evaluated = (
        replace(motion, position_mm=position, rotation=np.tile(swing, (count, 1))),
        None,
        replace(forces, a_p_mm=np.full(count, depth_mm)),
        replace(deflection, deflection_base_mm=np.tile(shift, (count, 1))),
    )
    return deviation_from(ways, evaluated, placed, np.zeros(count, bool)).offset_mm[at]


def test_a_ball_that_turns_about_its_middle_has_no_way_to_be_off_along(cell):
    """Its tip moves, the surface does not: a shift is a deviation, also what lies along the tip's way."""
    tool = Tool(kind="ball", diameter_mm=16.0, corner_radius_mm=8.0, teeth=2, flute_length_mm=20.0)
    unit, axis, shift = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.array([0.3, 0.0, 0.0])
    turn = np.cross(axis, -unit / 8.0)
    off = deviation_of_one(cell, tool, axis, unit, turn, 1.0, shift)
    np.testing.assert_allclose(off, shift, atol=1e-12)


@pytest.mark.parametrize("lean", ["A12 C30", "A0 C0"])
def test_a_constant_axis_has_no_turn(head, lean):
    toolpath, targets = read(f"{lean}\nG1 Z-2 F600\nG1 X50 Y5 F1500\nX70 Y40\n".replace("A", "G0 A", 1), head)
    cut = targets.source_line > 9
    assert not Ways.of(toolpath, targets, head).turn[cut].any()
    spun = Rotation.from_quat(targets.rotation) * Rotation.from_euler(
        "z", np.arange(len(targets))[:, None] / 20.0
    )
    assert not Ways.of(toolpath, replace(targets, rotation=spun.as_quat()), head).turn[cut].any()


def test_ramps_and_sizes_keep_their_limits(head):
    done = corrected(TWISTING, head, in_tool)
    shift = done.targets.position_mm - done.intended.position_mm
    way = np.linalg.norm(np.diff(done.intended.position_mm, axis=0), axis=1)
    step = np.abs(np.diff(shift, axis=0)).max(axis=1)
    cuts = (done.intended.position_mm[1:, 2] == -2.0) & (done.intended.position_mm[:-1, 2] == -2.0)
    assert (step[cuts] / way[cuts]).max() <= MOST_SLOPE * (1.0 + 1e-6)
    assert not shift[done.intended.position_mm[:, 2] > 0.0].any()
    assert any(issue.code == "compensation-rest" for issue in done.issues)
    with pytest.raises(RefusedError, match="compensation-large"):
        corrected(LEANING, head, lambda motion: 20.0 * in_tool(motion))


def test_divided_lines_turn_as_the_whole_ones_did_and_are_no_slower(head):
    _, targets = read(LEANING, head)
    done = corrected(LEANING, head, growing, tolerance_mm=0.002)
    assert done.figures["rows_added"] > 3
    whole, pieces = plan_motion(targets, head), done.evaluated[0]
    at = np.linspace(10.0, 90.0, 50)
    tilts, times = [], []
    for motion in (whole, pieces):
        on = below(motion)[:, 0] & (motion.position_mm[:, 0] > 1.0) & (motion.position_mm[:, 0] < 99.0)
        tilt = Rotation.from_quat(motion.rotation[on]).as_euler("ZYX", degrees=True)[:, 2]
        tilts.append(np.interp(at, motion.position_mm[on, 0], tilt))
        times.append(np.interp(at, motion.position_mm[on, 0], motion.time_s[on]))
    np.testing.assert_allclose(tilts[1], tilts[0], atol=0.02)
    np.testing.assert_allclose(times[1], times[0], atol=0.012)


def rounding(lines, turn_deg):
    """A polygon whose axis turns: each side is several collinear pieces, as the turn is divided."""
    words = ["G1 Z-2 F600"]
    for k in range(1, lines + 1):
        angle = np.radians(6.0 * k)
        words.append(
            f"X{30 * np.sin(angle):.3f} Y{30 - 30 * np.cos(angle):.3f} A{turn_deg * k / lines:.3f} F1200"
        )
    return "\n".join(words) + "\n"


def test_no_piece_of_a_polygon_runs_backwards(head):
    """Corners of 6° move along the curve by most of the deflection, and so do the places between them."""
    done = corrected(rounding(24, 60.0), head, lambda motion: 2.2 * in_tool(motion))
    before, after = (np.diff(each.position_mm, axis=0) for each in (done.intended, done.targets))
    cuts = (done.intended.position_mm[1:, 2] == -2.0) & (done.intended.position_mm[:-1, 2] == -2.0)
    share = np.einsum("ij,ij->i", before, after)[cuts] / np.einsum("ij,ij->i", before, before)[cuts]
    along = np.einsum(
        "ij,ij->i", done.targets.position_mm - done.intended.position_mm, np.vstack([before, before[-1:]])
    )
    assert np.abs(along).max() > 1.0
    assert share.min() > 0.5
    assert share.max() < 1.6
    assert done.after.rms_mm < 0.4 * done.before.rms_mm


def test_a_turn_on_the_spot_is_refused_in_material_alone(head):
    body = "G1 Z-2 F600\nG1 X40 F1500\nG1 A10 F600\nG1 X80 F1500\n"
    with pytest.raises(RefusedError, match="on the spot") as caught:
        corrected(body, head, in_tool)
    assert (caught.value.issues[0].code, caught.value.issues[0].line) == ("axis-turns", 10)
    in_air = "G1 Z-2 F600\nG1 X40 F1500\nG1 Z5\nG1 A10 F600\nG1 Z-2\nG1 X80 F1500\n"
    assert corrected(in_air, head, in_tool).figures["max_correction_mm"] > 0.5


@pytest.mark.parametrize("table", [{"follows": "tool"}, {"position": 75.0}])
def test_a_table_that_turns_the_part_turns_the_force_with_it(tmp_path, table):
    """What remains is by the deflection of the whole chain, which knows where the table stands."""
    stated = {"external": {"E2": {**TABLE, **table}}, "frames": {"base": ON_TABLE}, "machine": TABLE_MACHINE}
    cell = over_demonstration(stated)
    toolpath = read_gcode(cone(tmp_path), cell)
    targets = set_targets(toolpath, cell)
    motion, forces, _ = stages(targets, cell, lambda motion: np.tile(0.5 * IN_TOOL, (len(motion), 1)))
    done = compensate(toolpath, targets, cell, motion, forces)
    assert done.figures["change_mm"] <= 1e-3
    assert done.after.steady_max_mm < 0.03
    assert done.after.rms_mm < 0.15 * done.before.rms_mm


def test_a_compensated_program_verifies(head, tmp_path):
    done = corrected(TWISTING, head, in_tool)
    written = write_krl(done.targets, tmp_path / "part.src", head)
    assert written.report.ok
    assert written.report.max_deviation_mm < 0.002
    assert written.report.max_rotation_deg < 0.01
