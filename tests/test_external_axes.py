"""Rails and tables through the whole chain: beside a cell that simply stands there, and sample by sample."""

import re

import numpy as np
import pytest

from gcode2krl import compliance, load_cell, predict, read_gcode, set_targets, verify_krl, write_krl
from gcode2krl.cell.carried import standing
from gcode2krl.clearance import watch_of
from gcode2krl.errors import NotUnderstoodError, RefusedError
from gcode2krl.frames import abc_from_rotation, rotation_from_quaternion
from gcode2krl.robot import inverse
from tests.cells import over_demonstration
from tests.conftest import ROOT

BASE = {"x_mm": 1500.0, "y_mm": 0.0, "z_mm": 800.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}
RAIL = {"kind": "rail", "axis": "y", "limits": [-500.0, 9500.0], "speed": 1200.0, "acceleration": 1500.0}
TABLE = {
    "kind": "turntable",
    "axis": "z",
    "origin": {**BASE, "x_mm": 1550.0, "z_mm": 700.0},
    "limits": [-360.0, 360.0],
    "speed": 60.0,
    "acceleration": 120.0,
    "machine_def": 2,
}
ON_TABLE = {**BASE, "x_mm": -50.0, "z_mm": 100.0}
TABLE_MACHINE = {"kind": "table-table", "axes": ["A", "C"], "signs": [-1, -1], "tcpm": True}
HEAD = ["G21 G90 G17", "T1 M6", "S8000 M3", "G0 X0 Y0 Z20", "G43 H1 Z20"]


def written(folder, lines, name="part.nc"):
    file = folder / name
    file.write_text("\n".join([*HEAD, *lines, "M30"]) + "\n")
    return file


def square(folder):
    cut = ["G0 X10 Y10 Z5", "G1 Z-2 F600", "G1 X60 F1500", "G1 Y50", "G1 X10", "G1 Y10", "G0 Z20"]
    return written(folder, cut)


def long_cut(folder):
    return written(folder, ["G0 Z5", "G1 Z-1 F500", "G1 Y8000 F30000", "G1 X10 F3000", "G1 Y7000", "G0 Z20"])


def passes(folder):
    lines = [
        line
        for y in range(0, 8000, 1500)
        for line in (f"G0 X0 Y{y}", "G0 Z5", "G1 Z-1 F500", "G1 X100 F1500", f"G1 Y{y + 300}", "G0 Z20")
    ]
    return written(folder, lines)


def cone(folder):
    """A cone around Z on a table machine, three quarters of a turn."""
    lines = ["G0 X60 Y0 Z40 A0 C0", "G43.4 H1"]
    lines += [
        f"G1 X{60 * np.cos(a):.4f} Y{60 * np.sin(a):.4f} Z5 A-20 C{-np.degrees(a) - 90:.4f} F2000"
        for a in np.linspace(0.0, 1.5 * np.pi, 60)
    ]
    file = folder / "cone.nc"
    file.write_text("\n".join([*HEAD[:3], *lines, "G49", "G0 Z60", "M30"]) + "\n")
    return file


def six(matrix):
    a, b, c = np.degrees(abc_from_rotation(matrix[:3, :3]))
    x, y, z = matrix[:3, 3]
    return dict(
        zip(("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"), map(float, (x, y, z, a, b, c)), strict=True)
    )


def obstacles():
    return [
        {"name": "post", "frame": "world", "box_mm": [[1900.0, 300.0, 0.0], [2000.0, 420.0, 1300.0]]},
        {"name": "vice", "frame": "base", "box_mm": [[70.0, 0.0, -40.0], [120.0, 60.0, 10.0]]},
    ]


@pytest.mark.parametrize("at", [(0.0, 0.0), (400.0, 90.0), (-300.0, -200.0)])
def test_axes_that_stay_are_as_a_cell_that_stands_there(at, tmp_path):
    part = square(tmp_path)
    external = {
        "E1": {**RAIL, "axis": [0.2, 1.0, 0.0], "position": at[0]},
        "E2": {**TABLE, "position": at[1]},
    }
    cell = over_demonstration({"external": external, "frames": {"base": ON_TABLE}, "obstacle": obstacles()})
    root = np.eye(4)
    root[:3, 3] = at[0] * np.array([0.2, 1.0, 0.0]) / np.hypot(0.2, 1.0)
    plain = over_demonstration(
        {"frames": {"base": six(cell.base_in_world()), "robroot": six(root)}, "obstacle": obstacles()}
    )
    one, other = predict(part, cell), predict(part, plain)
    assert np.allclose(one.motion.position_mm, other.motion.position_mm)
    assert np.allclose(one.joints.q_rad, other.joints.q_rad, equal_nan=True, atol=1e-9)
    assert np.allclose(one.forces.force_base_N, other.forces.force_base_N)
    assert np.allclose(one.deflection.deflection_base_mm, other.deflection.deflection_base_mm, atol=1e-9)
    assert np.allclose(one.clearance.clearance_mm, other.clearance.clearance_mm, equal_nan=True, atol=1e-6)
    other_issues = [
        issue for issue in other.issues if issue.code != "mode-coupling"
    ]  # not judged beside a rail
    assert [(i.code, i.line) for i in one.issues] == [(i.code, i.line) for i in other_issues]
    assert (one.motion.external[:, :2] == at).all()


def rail_cell(**more):
    return over_demonstration({"external": {"E1": {**RAIL, "home": 0.0}}, "frames": {"base": BASE}, **more})


def test_a_part_longer_than_the_arm_needs_the_rail(tmp_path):
    part = passes(tmp_path)
    without = over_demonstration({"frames": {"base": BASE}})
    assert any(i.code == "out-of-reach" for i in set_targets(read_gcode(part, without), without).issues)
    cell = rail_cell()
    targets = set_targets(read_gcode(part, cell), cell)
    assert not [i for i in targets.issues if i.severity == "error"]
    e1 = targets.external[:, 0]
    changed = np.flatnonzero(np.diff(e1)) + 1
    assert len(changed) >= 3
    assert (targets.position_mm[changed, 2] >= 20.0).all()  # above the work only
    assert (targets.cdis_mm[changed] == 0.0).all()
    assert (targets.cdis_mm[changed - 1] == 0.0).all()
    assert e1[0] == e1[-1] == 0.0  # HOME


def test_one_place_for_long_moves_and_another_at_home(tmp_path):
    cell = rail_cell(frames={"base": {**BASE, "y_mm": 2500.0}})
    part = written(tmp_path, ["G0 Z5", "G1 Z-1 F500", "G1 Y900 F3000", "G1 Y0", "G0 Z20"])
    e1 = set_targets(read_gcode(part, cell), cell).external[:, 0]
    assert e1[0] == e1[-1] == 0.0
    assert np.ptp(e1[1:-1]) == 0.0
    assert e1[1] > 1000.0


def test_axes_stay_while_the_tool_leaves_the_part(tmp_path):
    """All is cut at one height, so that the retract begins at the height of the highest cut."""
    example = ROOT / "examples" / "external" / "long_part.nc"
    on_rail = load_cell(ROOT / "examples" / "external" / "robot_on_rail.toml")
    for file, cell in ((passes(tmp_path), rail_cell()), (example, on_rail)):
        targets = set_targets(read_gcode(file, cell), cell)
        z, e1 = targets.position_mm[1:-2, 2], targets.external[1:-2, 0]
        leaves = np.flatnonzero((z[:-1] < 0.0) & (z[1:] > 0.0))
        assert len(leaves)
        assert np.abs(e1[leaves + 1] - e1[leaves]).max() < 5.0


def test_axes_stay_while_the_tool_leaves_a_cut_at_its_height(tmp_path):
    """The rapid at the height of the highest cut would be the first at which they may move."""
    lines = [
        line
        for y in range(0, 8000, 1500)
        for line in (f"G1 X0 Y{y} Z5 F5000", f"G1 Y{y + 300} F1500", f"G0 Y{y + 1500}", "G0 Z20")
    ]
    cell = rail_cell()
    targets = set_targets(read_gcode(written(tmp_path, lines), cell), cell)
    changed = np.flatnonzero(np.diff(targets.external[:, 0])[1:-1]) + 2
    assert len(changed)
    assert (targets.position_mm[changed, 2] >= 20.0 - 1e-6).all()


def test_joints_and_deflection_along_a_moving_rail(tmp_path):
    cell = rail_cell()
    prediction = predict(long_cut(tmp_path), cell)
    motion, q_rad = prediction.motion, prediction.joints.q_rad
    assert np.ptp(motion.external[:, 0]) > 4000.0
    for row in np.linspace(0, len(motion) - 1, 40).astype(int):
        there = standing(cell, motion.external[row])
        pose = motion.position_mm[row : row + 1], motion.rotation[row : row + 1]
        found = inverse(*pose, there)[0]
        assert np.nanmin(np.abs(found - q_rad[row]).max(axis=1)) < 1e-9
        load = prediction.forces.force_base_N[row : row + 1], prediction.forces.moment_base_Nmm[row : row + 1]
        bent, _ = compliance.deflection_of(q_rad[row : row + 1], *load, motion.direction[row], there, 1)
        assert np.allclose(bent[0], prediction.deflection.deflection_base_mm[row], atol=1e-9)


def test_the_robot_bends_less_than_from_the_nearest_place(tmp_path):
    part, base = square(tmp_path), {**BASE, "x_mm": 1300.0, "y_mm": 1400.0}
    cell = rail_cell(frames={"base": base})
    near = rail_cell(
        frames={"base": base}, external={"E1": {**RAIL, "home": 0.0, "position": 0.0}}
    )  # a good place too
    chosen, nearest = predict(part, cell), predict(part, near)
    assert not [i for one in (chosen, nearest) for i in one.issues if i.severity == "error"]
    assert np.ptp(chosen.motion.external[1:-1, 0]) < 1200.0  # HOME apart, one place
    bent, bent_near = (np.sqrt((p.deflection.deflection_base_mm**2).sum(axis=1)) for p in (chosen, nearest))
    assert np.sqrt(np.mean(bent**2)) < 0.95 * np.sqrt(np.mean(bent_near**2))


def test_no_axis_is_faster_than_it_may_be(tmp_path):
    cell = rail_cell()
    for part in (long_cut(tmp_path), passes(tmp_path)):
        motion = predict(part, cell, forces=False).motion
        speed = np.diff(motion.external[:, 0]) / np.diff(motion.time_s)
        assert np.abs(speed).max() <= 1200.0 * (1.0 + 1e-6)
        acceleration = np.abs(np.diff(speed)) / np.diff(motion.time_s[1:])
        assert np.quantile(acceleration, 0.99) <= 1500.0 * 1.1  # corners between moves apart
    slow = rail_cell()
    slow = slow.model_copy(
        update={"external": {"E1": slow.external["E1"].model_copy(update={"speed": 50.0})}}
    )
    motion = predict(passes(tmp_path), slow, forces=False).motion
    assert np.abs(np.diff(motion.external[:, 0]) / np.diff(motion.time_s)).max() <= 50.0 * (1.0 + 1e-6)


def test_correction_is_across_the_feed_on_the_part(tmp_path):
    prediction = predict(long_cut(tmp_path), rail_cell())
    motion, correction = prediction.motion, prediction.deflection.correction_base_mm
    straight = ~motion.corner & (motion.speed_mm_s > 100.0)
    along = np.einsum("ni,ni->n", motion.direction[straight], correction[straight])
    assert np.abs(along).max() < 1e-3


# --- the program ------------------------------------------------------------------------------------------


def test_every_target_states_the_axes_and_is_read_back(tmp_path):
    cell, part = rail_cell(), passes(tmp_path)
    prediction = predict(part, cell)
    program = write_krl(prediction, tmp_path / "PART.src")
    text = program.texts["PART.src"].decode("ascii")
    motions = [line for line in text.splitlines() if line.startswith(("LIN", "PTP"))]
    assert all(",E1 " in line for line in motions)
    assert not any(",E2 " in line for line in motions)
    assert program.report.max_deviation_mm < 0.001
    assert verify_krl(tmp_path / "PART.src", prediction.toolpath, cell).ok
    assert "$EX_AX_NUM<1" in text
    assert "$AXIS_ACT.E1-" in text
    assert "GK_DIFF=GK_INV:$ROBROOT_C" in text
    assert "E1 rail: moves from" in text


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        (",E1 {at:.3f}", ",E1 {off:.3f}", "verify-external"),
        (",E1 {at:.3f}}}", "}}", "verify-external"),
        (",E1 {at:.3f}}}", ",E1 {at:.3f},E2 0.0}}", "krl-external"),
    ],
)
def test_an_edited_axis_is_told(old, new, code, tmp_path):
    cell, part = rail_cell(), passes(tmp_path)
    prediction = predict(part, cell, forces=False)
    write_krl(prediction, tmp_path / "PART.src", pilot="none")
    file = tmp_path / "PART.src"
    text = file.read_text()
    at = float(re.search(r"LIN .*,E1 ([\d.]+)\}", text)[1])
    old, new = (each.format(at=at, off=at + 1.0) for each in (old, new))
    assert old in text
    file.write_text(text.replace(old, new, 1), newline="")
    report = verify_krl(file, prediction.toolpath, cell)
    assert not report.ok
    assert code in {issue.code for issue in report.issues}


def test_a_coupled_table_is_named_by_ek(tmp_path):
    external = {"E2": {**TABLE, "home": 0.0}}
    cell = over_demonstration({"external": external, "frames": {"base": ON_TABLE}})
    program = write_krl(predict(square(tmp_path), cell, forces=False), tmp_path / "PART.src")
    text = program.texts["PART.src"].decode("ascii")
    assert "DECL FRAME GK_BASE" in text
    assert "GK_BASE={X -50.000,Y 0.000,Z 100.000,A 0.0000,B 0.0000,C 0.0000}" in text
    assert "$BASE=EK(MACHINE_DEF[2].ROOT,MACHINE_DEF[2].MECH_TYPE,GK_BASE)" in text


def test_axes_that_the_controller_does_not_couple_are_in_the_base(tmp_path):
    table = {key: value for key, value in TABLE.items() if key != "machine_def"}
    cell = over_demonstration({"external": {"E2": {**table, "position": 90.0}}, "frames": {"base": ON_TABLE}})
    text = write_krl(predict(square(tmp_path), cell, forces=False), tmp_path / "A.src").texts["A.src"]
    assert b"$BASE={X 1550.000,Y -50.000,Z 800.000,A 90.0000,B 0.0000,C 0.0000}" in text
    rail = {**RAIL, "coupled": False, "position": 400.0}
    cell = over_demonstration({"external": {"E1": rail}, "frames": {"base": BASE}})
    text = write_krl(predict(square(tmp_path), cell, forces=False), tmp_path / "B.src").texts["B.src"]
    assert b"$BASE={X 1500.000,Y -400.000,Z 800.000,A 0.0000,B 0.0000,C 0.0000}" in text
    assert b"$ROBROOT" not in text


def test_an_axis_that_is_not_coupled_does_not_move_in_a_program(tmp_path):
    rail = {**RAIL, "coupled": False}
    cell = over_demonstration({"external": {"E1": rail}, "frames": {"base": BASE}})
    prediction = predict(passes(tmp_path), cell, forces=False)
    with pytest.raises(RefusedError, match="external-uncoupled"):
        write_krl(prediction, tmp_path / "PART.src")


@pytest.mark.parametrize(
    ("axes", "key"),
    [
        ({"E1": RAIL, "E3": {**RAIL, "axis": "x", "coupled": False}}, "external.E3.coupled"),
        ({"E2": {**TABLE, "kind": "tilt", "machine_def": None}, "E3": TABLE}, "external.E2.machine_def"),
        ({"E1": {**RAIL, "coupled": False, "position": 0.0}, "E2": TABLE}, "external.E1.coupled"),
    ],
)
def test_axes_that_no_base_can_express_are_refused(axes, key):
    axes = {name: {k: v for k, v in axis.items() if v is not None} for name, axis in axes.items()}
    with pytest.raises(NotUnderstoodError, match=key):
        over_demonstration({"external": axes, "frames": {"base": BASE}})


def test_a_table_that_follows_turns_with_the_tool_and_the_arm_does_not(tmp_path):
    """A cone around Z on a table machine: with the table following, A1 and A6 hardly turn."""
    part, more = cone(tmp_path), {"machine": TABLE_MACHINE, "frames": {"base": {**ON_TABLE, "x_mm": 0.0}}}
    turned = {}
    for name, follows in (("follows", {"follows": "tool"}), ("stays", {"position": 0.0})):
        cell = over_demonstration({"external": {"E2": {**TABLE, **follows}}, **more})
        prediction = predict(part, cell, forces=False)
        assert not [i for i in prediction.issues if i.severity == "error"], prediction.issues
        turned[name] = np.ptp(prediction.joints.q_rad[:, 3:], axis=0).max()
        axis = rotation_from_quaternion(prediction.motion.rotation)[:, :, 2]
        tilted = np.hypot(axis[:, 0], axis[:, 1]) > 0.3
        if name == "follows":
            angle = np.radians(prediction.motion.external[tilted, 1])
            seen = angle + np.arctan2(axis[tilted, 1], axis[tilted, 0])
            assert np.abs(np.angle(np.exp(1j * (seen - seen[0])))).max() < np.radians(0.5)
            assert np.ptp(prediction.motion.external[:, 1]) > 200.0
    assert turned["follows"] < 0.5 * turned["stays"]


# --- collisions -------------------------------------------------------------------------------------------


def test_what_stands_beside_the_rail_is_hit_on_the_way_only(tmp_path):
    post = [{"name": "post", "frame": "world", "box_mm": [[300.0, 3000.0, 0.0], [900.0, 3100.0, 3000.0]]}]
    part = passes(tmp_path)
    cell = rail_cell(obstacle=post)
    found = [i for i in predict(part, cell, forces=False).issues if i.code == "collision"]
    assert found
    assert all("post" in issue.message for issue in found)
    away = [{**post[0], "box_mm": [[-3000.0, 3000.0, 0.0], [-2800.0, 3100.0, 3000.0]]}]
    assert not [
        i for i in predict(part, rail_cell(obstacle=away), forces=False).issues if i.code == "collision"
    ]


def test_clearances_along_a_moving_rail_are_those_of_the_poses(tmp_path):
    """Sample by sample: the least distance of the arm where it stands, in a cell that stands there."""
    wall = [
        {
            "name": "wall",
            "frame": "world",
            "plane": {"point_mm": [-560.0, 0.0, 0.0], "normal": [1.0, 0.004, 0.0]},
        }
    ]
    cell = rail_cell(obstacle=wall)
    prediction = predict(long_cut(tmp_path), cell, forces=False)
    motion, gap = prediction.motion, prediction.clearance.clearance_mm
    rows = np.flatnonzero(gap < 50.0)[::25]
    assert len(rows) > 20
    for row in rows:
        there = watch_of(standing(cell, motion.external[row]))
        alone = there.poses(prediction.joints.q_rad[row : row + 1], 1, 50.0)[0]
        assert gap[row] <= alone + 1e-6  # since the sample before, so no more
        assert gap[row] > alone - 25.0


def test_the_map_of_turns_is_that_of_the_arm_where_it_stands(tmp_path):
    from gcode2krl.pose import spin_map

    cell = rail_cell()
    prediction = predict(long_cut(tmp_path), cell, forces=False)
    seen = spin_map(prediction.motion, prediction.joints, cell)
    chosen = int(np.argmin(np.abs(seen.spin_rad)))
    assert np.abs(seen.chosen_rad).max() < 1e-9
    assert (seen.quality.free_margin()[chosen] > 0.0).all()


@pytest.mark.parametrize(
    "external",
    [{"E1": RAIL}, {"E2": TABLE}, {"E1": RAIL, "E2": TABLE}],
    ids=["rail", "table", "rail and table"],
)
def test_distances_of_single_poses_are_those_where_the_axes_stand(external):
    """Rows far from each other in E1 and E2, beside the cell that stands there."""
    base = {"base": ON_TABLE} if "E2" in external else {"base": BASE}
    cell = over_demonstration({"external": external, "frames": base, "obstacle": obstacles()})
    draw = np.random.default_rng(7)
    q_rad = np.radians([0.0, -75.0, 105.0, 0.0, 60.0, 0.0]) + draw.normal(size=(40, 6)) * 0.25
    at = np.zeros((40, 6))
    at[:, 0] = draw.uniform(-400.0, 600.0, 40) if "E1" in external else 0.0
    at[:, 1] = draw.uniform(-170.0, 170.0, 40) if "E2" in external else 0.0
    found = watch_of(cell).poses(q_rad, 1, 300.0, at)
    alone = [watch_of(standing(cell, e)).poses(q[None], 1, 300.0)[0] for q, e in zip(q_rad, at, strict=True)]
    np.testing.assert_allclose(np.minimum(found, 300.0), alone, atol=1e-6)
    assert (np.array(alone) < 0.0).any()
    assert (np.array(alone) > 100.0).any()


def test_a_post_that_the_rail_passes_turns_the_tool(tmp_path):
    post = {"name": "post", "frame": "base", "box_mm": [[-260.0, 3940.0, 60], [-190, 4060, 225]]}
    part, searched = long_cut(tmp_path), {"frames": {"base": BASE, "spin": "auto"}}

    def hits(cell):
        issues = predict(part, cell, forces=False).issues
        return [each for each in issues if each.code == "collision" and " on the " not in each.message]

    assert hits(rail_cell(obstacle=[post]))
    assert hits(rail_cell(obstacle=[post], **searched)) == []


def test_a_thin_post_beside_a_moving_rail_turns_the_tool(tmp_path):
    """The rail moves with the tool, so that the arm sees the tool stand while the post passes by."""
    part, searched = long_cut(tmp_path), {"frames": {"base": BASE, "spin": "auto"}}
    for y in (3987.0, 4100.0):
        post = {"name": "post", "frame": "base", "box_mm": [[-200.0, y - 3.0, 60], [-194, y + 3.0, 225]]}
        for cell, hit in (
            (rail_cell(obstacle=[post]), True),
            (rail_cell(obstacle=[post], **searched), False),
        ):
            issues = predict(part, cell, forces=False).issues
            assert hit is any(i.code == "collision" and " on the " not in i.message for i in issues)


def test_what_the_arm_would_hit_with_the_rail_at_rest_does_not_turn_it(tmp_path):
    """A low post that the tool passes when the rail has moved on; see `test_the_map_of_turns`."""
    post = {"name": "post", "frame": "world", "box_mm": [[1240.0, -560.0, 860], [1310, -440, 1025]]}
    searched, part = {"frames": {"base": BASE, "spin": "auto"}}, long_cut(tmp_path)
    with_post, without = (
        set_targets(read_gcode(part, cell), cell)
        for cell in (rail_cell(obstacle=[post], **searched), rail_cell(**searched))
    )
    assert (with_post.rotation == without.rotation).all()
