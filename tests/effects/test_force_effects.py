"""Cutting force, sensor and part: each effect against its stated form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl.cell.sections import Kienzle, Stock
from gcode2krl.cutting import cut, no_forces
from gcode2krl.effects import inputs_of, parse, simulate
from gcode2krl.effects.apply import remembered
from gcode2krl.errors import NotUnderstoodError
from tests.effects import KNOWN, run


def with_material(cell, **change):
    return cell.model_copy(update={"material": cell.material.model_copy(update=change)})


def edges(cell, **factors):
    law = cell.material.linear_edge
    change = {name: (getattr(law, name) or 0.0) * factor for name, factor in factors.items()}
    return with_material(cell, linear_edge=law.model_copy(update=change))


def assert_same_cut(actual, wanted):
    """Another law is read at other nodes, between which the force is interpolated (docs/cutting.md)."""
    apart = np.sqrt(np.mean((actual - wanted) ** 2))
    assert apart < 0.005 * np.sqrt(np.mean(np.asarray(wanted) ** 2))


PARTS = {"tangential": ("Ktc", "Kte"), "radial": ("Krc", "Kre"), "axial": ("Kac", "Kae")}


@pytest.mark.parametrize("part_name", PARTS)
def test_force_scale_is_the_cut_with_scaled_coefficients(part, milling, part_name):
    signals = run(milling, f"force_scale:target={part_name},scale=1.35")
    scaled = edges(part.cell, **dict.fromkeys(PARTS[part_name], 1.35))
    wanted = cut(part.toolpath, part.motion, scaled)
    assert_same_cut(signals.force_base_N, wanted.force_base_N)
    assert_same_cut(signals.moment_base_Nmm, wanted.moment_base_Nmm)
    assert np.abs(signals.force_base_N - part.forces.force_base_N).max() > 0.5
    np.testing.assert_array_equal(signals.force_meas_base_N, signals.force_base_N)


def test_force_scale_under_kienzle(part):
    law = Kienzle(kc11=700.0, mc=0.25, radial_ratio=0.4, axial_ratio=0.2)
    cell = with_material(part.cell, linear_edge=None, kienzle=law)
    forces = cut(part.toolpath, part.motion, cell)
    inputs = inputs_of(replace(part, cell=cell, forces=forces))
    together = run(inputs, *(f"force_scale:target={name},scale=1.5" for name in PARTS))
    assert_same_cut(together.force_base_N, 1.5 * forces.force_base_N)
    radial = run(inputs, "force_scale:target=radial,scale=1.5")
    more = law.model_copy(update={"radial_ratio": 0.6})
    wanted = cut(part.toolpath, part.motion, with_material(cell, kienzle=more))
    assert_same_cut(radial.force_base_N, wanted.force_base_N)
    with pytest.raises(NotUnderstoodError, match="no linear edge coefficients"):
        parse("edge_force:scale=2", KNOWN, cell)


def test_edge_force(part, milling):
    signals = run(milling, "edge_force:scale=2.5")
    wanted = cut(part.toolpath, part.motion, edges(part.cell, Kte=2.5, Kre=2.5, Kae=2.5))
    assert_same_cut(signals.force_base_N, wanted.force_base_N)


def test_the_tip_follows_the_true_force(milling):
    signals = run(milling, "edge_force:scale=2.5")
    moved = np.abs(signals.tcp_base_mm - simulate(milling).tcp_base_mm).max()
    assert moved > 0.05


def test_tool_wear(swinging):
    signals = run(swinging, "tool_wear:growth_per_m=0.2")
    step = np.diff(swinging.path_mm, prepend=0.0)
    metres, factor = 0.0, []
    for length, force in zip(step, swinging.force_base_N, strict=True):
        metres += length / 1000.0 if force.any() else 0.0
        factor.append(1.0 + 0.2 * metres)
    wanted = swinging.force_base_N * np.array(factor)[:, None]
    np.testing.assert_allclose(signals.force_base_N, wanted, rtol=1e-12)
    assert factor[-1] > 1.05


@pytest.mark.parametrize("offset_mm", [1.5, -0.75])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_stock_offset_is_the_cut_of_a_block_that_lies_elsewhere(part, milling, axis, offset_mm):
    signals = run(milling, f"stock_offset:target={axis},offset_mm={offset_mm}")
    shift = offset_mm * np.eye(3)["xy".index(axis)]
    box = tuple(tuple(np.add(corner, shift)) for corner in part.cell.stock.box_mm)
    block = Stock(box_mm=box, resolution_mm=part.cell.stock.resolution_mm)
    wanted = cut(part.toolpath, part.motion, part.cell.model_copy(update={"stock": block}))
    apart = np.abs(signals.force_base_N - wanted.force_base_N).max(axis=1)
    assert np.quantile(apart, 0.99) < 1e-6  # rounding decides whether a last sliver is there: some samples
    assert np.abs(signals.force_base_N - part.forces.force_base_N).max() > 10.0


def test_tool_diameter(part, milling):
    signals = run(milling, "tool_diameter:offset_mm=0.4")
    tool = part.cell.tool[1]
    larger = {**part.cell.tool, 1: tool.model_copy(update={"diameter_mm": tool.diameter_mm + 0.4})}
    wanted = cut(part.toolpath, part.motion, part.cell.model_copy(update={"tool": larger}))
    np.testing.assert_allclose(signals.force_base_N, wanted.force_base_N, atol=1e-9)
    assert signals.radius_offset_mm == pytest.approx(0.2)


def idle_edge_force(runout, angle_rad, f_z, teeth, a_p, k_te, k_re, k_ae, start, end):
    """Edge force of idle teeth by walking each tooth over the arc, feed, normal, axial in N."""
    radius = runout * np.cos(2 * np.pi * np.arange(teeth) / teeth + angle_rad)
    width = (end - start) / 20000
    phi = start + (np.arange(20000) + 0.5) * width
    total = np.zeros(3)
    for tooth in range(teeth):
        left = np.full(len(phi), np.inf)  # what the teeth before have left of the chip
        for back in range(1, 4 * teeth + 1):
            own = back * f_z * np.sin(phi) + radius[tooth] - radius[(tooth - back) % teeth]
            left = np.minimum(left, own)
        idle = left <= 0.0
        feed = np.sum((-k_te * np.cos(phi) - k_re * np.sin(phi))[idle])
        normal = np.sum((k_te * np.sin(phi) - k_re * np.cos(phi))[idle])
        total += np.array([feed, normal, k_ae * np.count_nonzero(idle)])
    return total * a_p * width / (2 * np.pi)


@pytest.mark.parametrize("angle_deg", [0.0, 60.0, 100.0])
@pytest.mark.parametrize("runout_mm", [0.005, 0.02, 0.08])
@pytest.mark.parametrize(("start", "end"), [(0.0, np.pi), (0.0, np.pi / 2), (np.pi / 2, np.pi)])
def test_runout_drops_the_edge_force_of_idle_teeth(part, runout_mm, angle_deg, start, end):
    """A straight cut along +x with 13,000 rpm, 25 mm/s: f_z = 0.0385 mm with three teeth."""
    count, tool = 5, part.cell.tool[1]
    rows = slice(100, 100 + count)
    motion = replace(
        part.motion,
        **{name: getattr(part.motion, name)[rows] for name in vars(part.motion) if name != "issues"},
    )
    straight = np.array(motion.position_mm)
    straight[:] = np.arange(count)[:, None] * [0.3, 0.0, 0.0]
    motion = replace(motion, position_mm=straight, speed_mm_s=np.full(count, 25.0))
    phi = np.full((count, 2), np.nan)
    phi[:, 0], phi[:, 1] = start, end
    forces = replace(no_forces(motion), a_p_mm=np.full(count, 2.0), phi_rad=phi)
    whole = inputs_of(part)
    inputs = replace(
        whole,
        motion=motion,
        forces=forces,
        time_s=motion.time_s,
        tool=motion.tool,
        position_mm=straight,
        rotation=motion.rotation,
        spindle_rad_s=np.full(count, 13000 * np.pi / 30),
        q_cmd_rad=whole.q_cmd_rad[rows],
        path_mm=whole.path_mm[rows],
        move=whole.move[rows],
        source_line=whole.source_line[rows],
        force_base_N=np.zeros((count, 3)),
        moment_base_Nmm=np.zeros((count, 3)),
    )
    signals = run(inputs, f"runout:runout_mm={runout_mm},angle_deg={angle_deg}")
    law, f_z = part.cell.material.linear_edge, 25.0 / (13000 / 60) / tool.teeth
    feed, normal, axial = idle_edge_force(
        runout_mm, np.radians(angle_deg), f_z, tool.teeth, 2.0, law.Kte, law.Kre, law.Kae or 0.0, start, end
    )
    wanted = -np.array([feed, normal, -axial])  # +x, its left is +y, axial is downwards
    np.testing.assert_allclose(signals.force_base_N, np.tile(wanted, (count, 1)), atol=0.05)


def flange(inputs):
    """Rotation of the flange in $BASE from the joints, by the tool's own."""
    tool = inputs.cell.tool_matrix(1)[:3, :3]
    return Rotation.from_quat(inputs.rotation).as_matrix() @ tool.T


def test_force_offset_is_along_the_flange(swinging):
    signals = run(swinging, "force_offset:fx_N=5,fy_N=-3,fz_N=8")
    wanted = np.einsum("nij,j->ni", flange(swinging), [5.0, -3.0, 8.0])
    np.testing.assert_allclose(signals.force_meas_base_N - swinging.force_base_N, wanted, atol=1e-9)
    np.testing.assert_array_equal(signals.force_base_N, swinging.force_base_N)
    np.testing.assert_array_equal(signals.tcp_base_mm, simulate(swinging).tcp_base_mm)


def test_force_drift(swinging):
    later = replace(swinging, hours=2.0)
    signals = run(later, "force_drift:N_per_h=4,direction=3/0/4")
    along = np.einsum("nij,j->ni", flange(swinging), [0.6, 0.0, 0.8])
    wanted = 4.0 * (2.0 + swinging.time_s / 3600.0)[:, None] * along
    np.testing.assert_allclose(signals.force_meas_base_N - swinging.force_base_N, wanted, atol=1e-9)


def test_tool_weight(swinging):
    apart = run(swinging, "tool_weight:weight_N=40").force_meas_base_N - swinging.force_base_N
    np.testing.assert_allclose(apart, np.tile([0.0, 0.0, -40.0], (len(apart), 1)), atol=1e-12)


def test_hose_pack(swinging):
    h0, slope = [10.0, 0.0, -5.0], [[30.0, 0.0, 5.0], [0.0, -20.0, 0.0], [7.0, 0.0, 40.0]]
    numbers = "/".join(str(value) for row in slope for value in row)
    signals = run(swinging, f"hose_pack:h0_N=10/0/-5,H_N_rad={numbers}")
    pose = Rotation.from_quat(swinging.rotation)
    pull = np.array(h0) + (pose * pose[0].inv()).as_rotvec() @ np.array(slope).T
    wanted = np.einsum("nij,nj->ni", flange(swinging), pull)
    np.testing.assert_allclose(signals.force_meas_base_N - swinging.force_base_N, wanted, atol=1e-9)


def test_force_delay(swinging):
    signals = run(swinging, "force_delay:delay_s=0.03")
    np.testing.assert_allclose(
        signals.force_meas_base_N[10:, 0],
        np.interp(swinging.time_s[10:] - 0.03, swinging.time_s, swinging.force_base_N[:, 0]),
    )
    np.testing.assert_array_equal(signals.force_base_N, swinging.force_base_N)
    assert not signals.clocks


def test_without_forces_there_is_a_word_about_it(part):
    bare = inputs_of(replace(part, forces=None, deflection=None))
    assert bare.offers == {"plan"}
    with pytest.raises(NotUnderstoodError, match="how the part is cut"):
        run(bare, "force_scale:target=radial,scale=2")
    assert run(bare, "tool_diameter:offset_mm=1").radius_offset_mm == 0.5


def test_the_material_is_removed_once(part):
    calls = []

    def count(motion, cell):
        calls.append(cell.name)
        return cut(part.toolpath, motion, cell)

    inputs = inputs_of(part, cut=count)
    for _ in range(3):
        inputs.recut(edges(part.cell, Kte=2.0))
    assert len(calls) == 1
    inputs.recut(edges(part.cell, Kte=3.0))
    inputs.recut(shift_mm=np.array([0.1, 0.0, 0.0]))
    assert len(calls) == 3
    for bound in ({"most": 1}, {"most_rows": 1}):
        few, before = remembered(count, **bound), len(calls)
        for cell in (part.cell, part.cell, edges(part.cell, Kte=2.0), part.cell):
            few(part.motion, cell)
        assert len(calls) == before + 3


def test_a_collision_is_half_a_sine_that_bends_the_arm(swinging):
    """2 kN for 50 ms, its impulse 2·T/pi·F whatever the samples, in the run of its time and in no other."""
    for hours, at_s in ((0.0, 8.003), (0.5, 1808.003)):
        inputs = replace(swinging, hours=hours)
        text = f"collision:at_s={at_s},size_N=2000,lasts_s=0.05,direction=0/0/-3"
        signals = run(inputs, text)
        push = signals.force_meas_base_N - inputs.force_base_N
        assert not push[:, :2].any()
        t = inputs.time_s
        assert not push[(t < 7.99) | (t > 8.066)].any()
        assert push[:, 2].min() < -1900.0
        assert np.sum(push[:, 2]) * 0.012 == pytest.approx(-2000.0 * 2.0 * 0.05 / np.pi, rel=1e-9)
        pushed = simulate(replace(inputs, load_base_N=inputs.force_base_N + push))
        np.testing.assert_allclose(signals.tcp_base_mm, pushed.tcp_base_mm, atol=1e-9)
    elsewhere = run(replace(swinging, hours=0.25), text)
    np.testing.assert_array_equal(elsewhere.force_meas_base_N, swinging.force_base_N)


def test_a_collision_leaves_a_step_where_one_is_stated(swinging):
    texts = ("collision:at_s=8,size_N=1150,direction=1/0/0", "step:target=A2,at_s=8,size_deg=0.0225")
    signals = run(swinging, *texts)
    later = swinging.time_s > 8.2
    np.testing.assert_allclose(
        (signals.q_load_rad - swinging.q_cmd_rad)[later, 1], 0.0225 * np.pi / 180.0, atol=1e-12
    )
    np.testing.assert_array_equal(signals.force_base_N[later], swinging.force_base_N[later])


def test_a_spindle_that_droops_cuts_thicker_chips(part, milling):
    """The material removed again with every sample's own speed, by the law at the thicker chip."""
    signals = run(milling, "spindle_droop:percent_per_Nm=8")
    torque = part.forces.torque_Nmm / 1000.0
    cuts = part.forces.force_base_N.any(axis=1)
    assert torque.max() > 0.3
    # of a linear edge law the part that goes with the chip grows by 1/(1 - droop), the edge force does not
    edge = np.array(milling.recut(edges(part.cell, Ktc=0.0, Krc=0.0, Kac=0.0))[0])
    share = (1.0 - 0.08 * torque)[:, None]
    wanted = edge + (part.forces.force_base_N - edge) / share
    np.testing.assert_allclose(
        signals.force_base_N[cuts], wanted[cuts], atol=0.02 * np.abs(part.forces.force_base_N).max()
    )
    more = np.linalg.norm(signals.force_base_N - part.forces.force_base_N, axis=1)
    told = np.linalg.norm(wanted - part.forces.force_base_N, axis=1)
    assert more[cuts].sum() == pytest.approx(told[cuts].sum(), rel=0.03)
    np.testing.assert_array_equal(signals.force_base_N[~cuts], part.forces.force_base_N[~cuts])
    with pytest.raises(NotUnderstoodError, match="allowed: 0 or more"):
        parse("spindle_droop:percent_per_Nm=-1", KNOWN, part.cell)


def test_a_sensor_reads_more_on_the_way_back(swinging):
    """Up to ± 400 N and back: without a load it reads 1 % of that too much, or too little."""
    t = swinging.time_s
    up = np.interp(t, [0.0, 4.0, 8.0, 12.0, 16.0], [0.0, 400.0, 0.0, -400.0, 0.0])
    turned = np.einsum("nij,j->ni", swinging.sensor_rotation, [0.0, 1.0, 0.0]) * up[:, None]
    inputs = replace(swinging, force_base_N=turned)
    signals = run(inputs, "force_hysteresis:loss_percent=2")
    seen = np.einsum("nji,nj->ni", inputs.sensor_rotation, signals.force_meas_base_N)
    np.testing.assert_allclose(seen[:, [0, 2]], 0.0, atol=1e-9)
    lost = up - seen[:, 1]
    assert np.interp(3.0, t, lost) == pytest.approx(4.0, abs=0.05)  # the play is 200 N behind
    assert np.interp(8.0, t, lost) == pytest.approx(-4.0, abs=0.05)
    assert np.interp(16.0, t, lost) == pytest.approx(4.0, abs=0.05)
    assert np.ptp(lost) == pytest.approx(0.02 * 400.0, rel=0.01)
    np.testing.assert_array_equal(signals.force_base_N, turned)


def test_a_reading_in_steps_is_the_nearest_one(swinging):
    signals = run(swinging, "force_steps:step_N=20")
    seen = np.einsum("nji,nj->ni", swinging.sensor_rotation, signals.force_meas_base_N)
    true = np.einsum("nji,nj->ni", swinging.sensor_rotation, swinging.force_base_N)
    np.testing.assert_allclose(seen / 20.0, np.round(true / 20.0), atol=1e-9)
    rows = np.abs(true).max(axis=1) > 60.0
    assert np.sqrt(np.mean((seen - true)[rows] ** 2)) == pytest.approx(20.0 / np.sqrt(12.0), rel=0.1)
    assert not KNOWN["force_steps"].searched("force", None, frozenset({"force"}))
