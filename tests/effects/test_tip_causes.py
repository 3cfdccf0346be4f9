"""Geometry, compliance and instruments at the tip: each new cause against its stated form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import robot
from gcode2krl.effects import Applied, parse, simulate
from tests.effects import KNOWN, moved_by, run


def tilted_tip(q, lengths, tilts):
    """Eq. 1 of the arm, with a turn written out at each axis: {joint: in the frame of the link before}."""
    a1, a2, c1, c2, c3, c4 = lengths
    ways = ([0, 0, 0], [a1, 0, c1], [c2, 0, 0], [c3, 0, -a2], [0, 0, 0], [0, 0, 0])
    axes = ("z", "y", "y", "x", "y", "x")
    signs = (-1, 1, 1, -1, 1, -1)
    place, turn = np.zeros(3), Rotation.identity()
    for joint in range(6):
        place = place + turn.apply(ways[joint])
        turn = turn * tilts.get(joint, Rotation.identity())
        turn = turn * Rotation.from_euler(axes[joint], signs[joint] * q[joint])
    return place, turn, c4


@pytest.mark.parametrize("joint", [1, 2, 3, 4, 5])
def test_an_axis_is_tilted_at_right_angles_to_itself_and_the_one_before(swinging, joint):
    """The same arm, multiplied out with a turn at that axis."""
    cell, angle = swinging.cell, 0.8e-3
    moved = moved_by(swinging, f"axis_parallelism:target=A{joint + 1},mrad=0.8")
    assert np.abs(moved).max() > 0.02
    tool, to_base = cell.tool_matrix(1), np.linalg.inv(cell.base_matrix())
    lengths = cell.robot.geometry.array()
    for row in (0, 400, 1200):
        q = swinging.q_cmd_rad[row]
        # along the axes of the link before: -z x y, upper arm x y, y x -x, -x x y, y x -x
        lines = {1: [1, 0, 0], 2: [0, 0, 1], 3: [0, 0, 1], 4: [0, 0, -1], 5: [0, 0, 1]}
        tilt = {joint: Rotation.from_rotvec(angle * np.array(lines[joint]))}
        tips = []
        for tilts in (tilt, {}):
            place, turn, c4 = tilted_tip(q, lengths, tilts)
            flange = turn * Rotation.from_euler("y", np.pi / 2)
            root = place + turn.apply([c4, 0, 0]) + flange.apply(tool[:3, 3])
            tips.append(to_base[:3, :3] @ root + to_base[:3, 3])
        # the deflection turns along: a thousandth of it
        np.testing.assert_allclose(moved[row], tips[0] - tips[1], atol=1e-3)


def test_a_tilted_axis_turns_the_tool_by_its_angle(swinging):
    before = Rotation.from_quat(simulate(swinging, rotation=True).tcp_rotation)
    signals = run(swinging, "axis_parallelism:target=A3,mrad=1.5", rotation=True)
    turned = (Rotation.from_quat(signals.tcp_rotation) * before.inv()).magnitude()
    np.testing.assert_allclose(turned, 1.5e-3, rtol=1e-6)


def test_a_cutter_is_a_cantilever(swinging):
    moved = moved_by(swinging, "cutter_bending:um_per_N=1.4")
    axis = swinging.tool_rotation[:, :, 2]
    np.testing.assert_allclose(np.sum(moved * axis, axis=1), 0.0, atol=1e-9)
    lateral = np.cross(axis, np.cross(swinging.force_base_N, axis))
    np.testing.assert_allclose(moved, 1.4e-3 * lateral, atol=1e-9)
    signals = run(swinging, "cutter_bending:um_per_N=1.4")
    np.testing.assert_array_equal(signals.q_true_rad, swinging.q_cmd_rad)


def test_a_cutter_bends_under_the_measured_force_where_the_arm_does(swinging):
    measured = replace(swinging, load_base_N=2.0 * swinging.force_base_N)
    np.testing.assert_allclose(
        moved_by(measured, "cutter_bending:um_per_N=1"),
        2.0 * moved_by(swinging, "cutter_bending:um_per_N=1"),
        atol=1e-9,
    )


def test_a_payload_does_not_bend_the_cutter(swinging):
    texts = ("gravity:payload_kg=30", "cutter_bending:um_per_N=1")
    alone = sum(moved_by(swinging, text) for text in texts)
    np.testing.assert_allclose(moved_by(swinging, *texts), alone, atol=1e-9)


def test_a_yielding_part_shows_in_the_part_alone(swinging):
    signals = run(swinging, "fixture_compliance:um_per_N=0.5/1/2")
    np.testing.assert_array_equal(signals.tcp_base_mm, simulate(swinging).tcp_base_mm)
    # pushed to +x by the part, the tool pushes the part to -x: on the part it is further towards +x
    np.testing.assert_allclose(
        signals.tip_on_part_mm - signals.tcp_base_mm,
        swinging.force_base_N * [0.5e-3, 1e-3, 2e-3],
        atol=1e-12,
    )
    np.testing.assert_array_equal(simulate(swinging).tip_on_part_mm, simulate(swinging).tcp_base_mm)


@pytest.mark.parametrize(("foot_mm", "own_weight"), [(0.0, 1.0), (600.0, 1.0), (600.0, 0.0)])
def test_a_pedestal_tilts_by_the_moment_about_its_foot(swinging, foot_mm, own_weight):
    soft = f"x_mrad_per_kNm=0.05,y_mrad_per_kNm=0.03,foot_mm={foot_mm},own_weight={own_weight}"
    moved = moved_by(swinging, f"pedestal_compliance:{soft}")
    root = np.linalg.inv(swinging.cell.base_matrix())
    foot = root[:3, 3] - foot_mm * root[:3, 2]
    lever, force = swinging.position_mm - foot, swinging.force_base_N
    moment = np.cross(lever, force) + swinging.moment_base_Nmm
    arms = swinging.bodies.centre_mm - foot
    moment += own_weight * np.cross(arms, swinging.bodies_push_N).sum(axis=1)
    softness = root[:3, :3] @ np.diag([0.05e-9, 0.03e-9, 0.0]) @ root[:3, :3].T
    turn = Rotation.from_rotvec(moment @ softness)
    np.testing.assert_allclose(moved, turn.apply(lever) - lever, atol=1e-4)
    assert np.ptp(moved, axis=0).max() > 0.001


def test_weight_does_not_turn_a_pedestal_about_the_vertical(swinging):
    pushed = replace(swinging, force_base_N=np.zeros_like(swinging.force_base_N))
    pushed = replace(pushed, moment_base_Nmm=np.tile([0.0, 0.0, 1e6], (len(swinging), 1)))
    free = replace(pushed, moment_base_Nmm=np.zeros_like(swinging.force_base_N))
    text = "pedestal_compliance:x_mrad_per_kNm=0.05,y_mrad_per_kNm=0.05,foot_mm=0"
    np.testing.assert_allclose(moved_by(pushed, text), moved_by(free, text), atol=1e-9)


def test_a_spindle_grows_from_nothing_in_every_run(swinging):
    text = "spindle_growth:um_per_krpm=4,time_constant_s=6"
    krpm = 1000.0 * 60.0 / (2.0 * np.pi) / 1000.0
    t = swinging.time_s
    for hours in (0.0, 2.0):
        moved = moved_by(replace(swinging, hours=hours), text)
        out = -np.sum(moved * swinging.tool_rotation[:, :, 2], axis=1)
        np.testing.assert_allclose(out, 4e-3 * krpm * (1.0 - np.exp(-t / 6.0)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), np.abs(out), atol=1e-9)


def test_a_spindle_that_starts_later_grows_later(swinging):
    on = np.where(swinging.time_s < 5.0, 0.0, 1000.0)
    moved = moved_by(replace(swinging, spindle_rad_s=on), "spindle_growth:um_per_krpm=4,time_constant_s=6")
    out = -np.sum(moved * swinging.tool_rotation[:, :, 2], axis=1)
    assert not out[swinging.time_s < 4.98].any()
    krpm = 1000.0 * 60.0 / (2.0 * np.pi) / 1000.0
    assert out[-1] == pytest.approx(
        4e-3 * krpm * (1.0 - np.exp(-(swinging.time_s[-1] - 5.0) / 6.0)), rel=2e-3
    )


def test_a_tracker_drifts_and_the_part_does_not(swinging):
    later = replace(swinging, hours=1.5)
    moved = moved_by(later, "tracker_drift:mm_per_h=0.04,direction=0/0/-2")
    hours = 1.5 + swinging.time_s / 3600.0
    np.testing.assert_allclose(moved, 0.04 * hours[:, None] * [0.0, 0.0, -1.0], atol=1e-9)
    effect = KNOWN["tracker_drift"]
    assert effect.visible_links(frozenset({"mechanics", "part"})) == {"mechanics"}
    assert effect.visible_links(frozenset({"part"})) == frozenset()
    assert effect.learned(parse("tracker_drift:mm_per_h=0.04", KNOWN, swinging.cell), "mechanics") is None


def test_a_beam_bends_towards_the_cold_air(swinging):
    """By Snell's law in layers of air, integrated from the tracker: the ray to where the tip seems to be."""
    up = -swinging.gravity
    np.testing.assert_allclose(up, [0.0, 0.0, 1.0], atol=1e-12)
    moved = moved_by(swinging, "tracker_refraction:K_per_m=8,tracker_x_m=9,tracker_y_m=-2")
    assert not moved[:, :2].any()
    away_m = np.hypot(*(swinging.position_mm[:, :2] / 1000.0 - [9.0, -2.0]).T)
    row = 300
    slope = -0.93e-6 * 8.0  # dn/dz
    z, dz, step = 0.0, 0.0, away_m[row] / 20000
    for _ in range(20000):  # eikonal equation of a nearly level ray: z'' = dn/dz / n
        dz += slope / 1.00027 * step
        z += dz * step
    # a ray that leaves level arrives lower by -z: seen along its end, the tip is too high by as much
    assert moved[row, 2] == pytest.approx(-z * 1000.0, rel=1e-3)
    assert moved[row, 2] == pytest.approx(away_m[row] ** 2 / 2 * 0.93e-6 * 8.0 * 1000.0, rel=1e-9)


def test_a_cable_pulls_with_the_travel_of_its_joint(swinging):
    signals = run(swinging, "cable_pull:target=A1,N_per_deg=0.6,direction=0/-1/0")
    pull = signals.force_meas_base_N - swinging.force_base_N
    along = np.einsum("nji,nj->ni", swinging.sensor_rotation, pull)
    travel = np.degrees(swinging.q_cmd_rad[:, 0] - swinging.q_cmd_rad[0, 0])
    np.testing.assert_allclose(along[:, 1], -0.6 * travel, atol=1e-9)
    np.testing.assert_allclose(along[:, [0, 2]], 0.0, atol=1e-9)
    assert not pull[0].any()


def test_what_pulls_at_the_tool_bends_the_arm(swinging):
    """Left out, the bend of 60 N of cable was named as an axis that is not parallel."""
    signals = run(swinging, "cable_pull:target=A1,N_per_deg=2,direction=0/-1/0")
    pull = signals.force_meas_base_N - swinging.force_base_N
    pulled = simulate(replace(swinging, load_base_N=swinging.force_base_N + pull))
    np.testing.assert_allclose(signals.tcp_base_mm, pulled.tcp_base_mm, atol=1e-9)
    bend = np.linalg.norm(signals.tcp_base_mm - simulate(swinging).tcp_base_mm, axis=1)
    assert bend[0] < 1e-9
    assert bend.max() > 0.005


def test_later_links_take_over_a_cable_and_no_error_of_the_sensor():
    cable, zero = KNOWN["cable_pull"], KNOWN["force_offset"]
    pulls = Applied(cable, "A1", {})
    assert cable.learned(pulls, "force") is pulls
    assert zero.learned(Applied(zero, None, {}), "force") is None


def test_axes_are_where_the_kinematics_have_them(swinging):
    """A turn about an axis leaves its own point where it is: the tip's way is a cross product."""
    step = 1e-6
    for joint in range(6):
        q = np.array(swinging.q_cmd_rad)
        q[:, joint] += step
        way = (robot.forward(q, swinging.cell)[0] - swinging.position_mm) / step
        along = swinging.jacobian[:, 3:, joint]
        lever = swinging.position_mm - swinging.axes_mm[:, joint]
        np.testing.assert_allclose(np.cross(along, lever), way, atol=2e-2)


def test_a_tracker_that_averages_is_late_and_cuts_corners(swinging):
    """50 mm/s along x, then along y: behind by tau·v, and 0.51·tau·v inside the corner."""
    t, v, tau = swinging.time_s, 50.0, 0.1
    way = v * (t - 9.0)
    tip = swinging.position_mm[0] + np.stack([np.minimum(way, 0.0), np.maximum(way, 0.0), 0.0 * t], axis=1)
    free = np.zeros_like(tip)
    inputs = replace(swinging, position_mm=tip, force_base_N=free, moment_base_Nmm=free, kept={})
    signals = run(inputs, f"tracker_filter:tau_s={tau}")
    seen = signals.tcp_base_mm
    np.testing.assert_allclose((seen - tip)[600:740], [[-tau * v, 0.0, 0.0]] * 140, atol=1e-6)
    nearest = np.linalg.norm(seen - swinging.position_mm[0], axis=1).min()
    assert nearest == pytest.approx(0.509 * tau * v, rel=0.02)
    np.testing.assert_array_equal(signals.q_true_rad, swinging.q_cmd_rad)
    effect = KNOWN["tracker_filter"]
    assert effect.visible_links(frozenset({"mechanics", "part"})) == {"mechanics"}
    assert effect.learned(parse("tracker_filter:tau_s=0.1", KNOWN, swinging.cell), "mechanics") is None


def test_a_floor_shakes_on_between_runs(swinging):
    for hours in (0.0, 0.25):
        moved = moved_by(
            replace(swinging, hours=hours),
            "floor_vibration:target=y,hz=7.3,amplitude_mm=0.03,phase=0.4",
        )
        turn = 2.0 * np.pi * 7.3 * (hours * 3600.0 + swinging.time_s) + 0.4
        np.testing.assert_allclose(moved[:, 1], 0.03 * np.sin(turn), atol=1e-9)
        np.testing.assert_allclose(moved[:, [0, 2]], 0.0, atol=1e-9)


def test_a_clamp_slips_each_time_the_cut_is_hard(swinging):
    size = np.linalg.norm(swinging.force_base_N, axis=1)
    high = size > 250.0
    cuts = np.flatnonzero(high[1:] & ~high[:-1]) + 1  # bursts, with air between them
    count = np.searchsorted(cuts, np.arange(len(size)), side="right")
    assert count[-1] > 3
    numbers = "step_mm=0.01,threshold_N=250,direction=0/3/4"
    way = 0.01 * count[:, None] * [0.0, 0.6, 0.8]
    moved = moved_by(swinging, f"bolt_ratchet:target=tip,{numbers}")
    np.testing.assert_allclose(moved, way, atol=1e-9)
    part = run(swinging, f"bolt_ratchet:target=fixture,{numbers}")
    np.testing.assert_array_equal(part.tcp_base_mm, simulate(swinging).tcp_base_mm)
    np.testing.assert_allclose(part.part_shift_mm, way, atol=1e-12)
    ratchet = KNOWN["bolt_ratchet"]
    links = {target: ratchet.at(target).links_at(target) for target in ("tip", "fixture", "A3")}
    assert links == {"tip": {"mechanics"}, "fixture": {"part"}, "A3": {"gear"}}


@pytest.mark.parametrize("joint", range(6))
def test_a_bearing_tilts_what_it_carries(swinging, joint):
    """The tilt of every bearing is a turn of the tip by the stated angle, about a line across the axis."""
    moved = moved_by(
        swinging, f"bearing_wobble:target=A{joint + 1},amplitude_mrad=0.2,per_turn=7.5,phase=0.3"
    )
    axis = swinging.jacobian[:, 3:, joint]
    lever = simulate(swinging).tcp_base_mm - swinging.axes_mm[:, joint]
    along = np.sum(axis * lever, axis=1)
    assert np.abs(moved).max() > 0.01
    np.testing.assert_allclose(np.sum(moved * lever, axis=1), 0.0, atol=1e-6)
    # a point on the axis goes round in a circle: across it, by angle times distance along it
    across = moved - np.sum(moved * axis, axis=1, keepdims=True) * axis
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), 0.2e-3 * np.abs(along), atol=1e-6)


def test_a_wobble_goes_round_so_often_a_turn_of_its_joint(swinging):
    """Half a turn of the line, 180/7.5 degrees of A1, and the tip is tilted the other way."""
    still = np.tile(swinging.q_cmd_rad[:1], (3, 1))
    still[1, 0] += np.pi / 7.5
    still[2, 0] += 2.0 * np.pi / 7.5
    position, rotation = robot.forward(still, swinging.cell)
    rows = {
        name: getattr(swinging, name)[:3] for name in ("time_s", "move", "source_line", "path_mm", "tool")
    }
    inputs = replace(
        swinging,
        **rows,
        q_cmd_rad=still,
        position_mm=position,
        rotation=rotation,
        spindle_rad_s=np.zeros(3),
        force_base_N=np.zeros((3, 3)),
        moment_base_Nmm=np.zeros((3, 3)),
        kept={},
    )
    moved = moved_by(inputs, "bearing_wobble:target=A1,amplitude_mrad=0.2,per_turn=7.5")
    angles = np.arctan2(moved[:, 1], moved[:, 0])  # A1 is upright: what moves the tip sideways is the tilt
    assert np.cos(angles[1] - angles[0]) == pytest.approx(-1.0, abs=1e-6)
    assert np.cos(angles[2] - angles[0]) == pytest.approx(1.0, abs=1e-6)


def test_a_slow_spindle_wobbles_and_a_fast_one_does_not(swinging):
    text = "bearing_wobble:target=spindle,amplitude_mm=0.02,per_turn=0.43"
    slow = moved_by(replace(swinging, spindle_rad_s=np.full(len(swinging), 6.0)), text)
    x, y = swinging.tool_rotation[:, :, 0], swinging.tool_rotation[:, :, 1]
    angle = np.unwrap(np.arctan2(np.sum(slow * y, axis=1), np.sum(slow * x, axis=1)))
    np.testing.assert_allclose(np.diff(angle)[:-1], 0.43 * 6.0 * 0.012, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(slow, axis=1), 0.02, rtol=1e-3)
    fast = moved_by(replace(swinging, spindle_rad_s=np.full(len(swinging), 1361.0)), text)
    assert np.linalg.norm(fast[:-1], axis=1).max() < 0.02 * 0.15
