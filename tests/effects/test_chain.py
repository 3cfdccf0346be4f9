"""The chain: nominal, nothing at zero, measured inputs, settings that span an effect."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import robot
from gcode2krl.compliance import deflection_of
from gcode2krl.effects import Applied, arm, drives, forces, parse, simulate
from gcode2krl.errors import NotUnderstoodError
from tests.effects import KNOWN

SIGNALS = (
    "q_cmd_rad",
    "q_act_rad",
    "q_load_rad",
    "q_true_rad",
    "tcp_base_mm",
    "force_base_N",
    "moment_base_Nmm",
    "force_meas_base_N",
    "moment_meas_base_Nmm",
)


def test_nominal_is_the_commanded_tip_and_the_deflection(milling, part):
    signals = simulate(milling)
    wanted = part.motion.position_mm + part.deflection.deflection_base_mm
    np.testing.assert_allclose(signals.tcp_base_mm, wanted, atol=1e-6)
    np.testing.assert_array_equal(signals.q_load_rad, part.joints.q_rad)
    np.testing.assert_array_equal(signals.force_meas_base_N, part.forces.force_base_N)
    assert np.abs(part.deflection.deflection_base_mm).max() > 0.1


def test_nominal_orientation_is_the_commanded_one_where_nothing_pulls(swinging):
    free = replace(
        swinging,
        force_base_N=np.zeros_like(swinging.force_base_N),
        moment_base_Nmm=np.zeros_like(swinging.force_base_N),
    )
    found = simulate(free, rotation=True).tcp_rotation
    np.testing.assert_allclose(np.abs(np.sum(found * free.rotation, axis=1)), 1.0, atol=1e-12)


def _effects(cell, skip=()):
    for name, effect in sorted(KNOWN.items()):
        for target in effect.targets(cell):
            if name not in skip:
                yield effect.at(target), target


def test_drives_and_forces_are_those_of_the_whole_chain(milling):
    texts = ("servo_lag:target=A1,tau_s=0.02", "backlash:target=A2,gap_deg=0.02", "tool_wear:growth_per_m=1")
    clock = "clock:target=q_load,offset_s=0.01"
    applied = [parse(text, KNOWN, milling.cell) for text in (*texts, "force_offset:fz_N=7", clock)]
    whole = simulate(milling, applied)
    for part_of, names in (
        (drives(milling, applied), ("q_cmd_rad", "q_act_rad", "q_load_rad")),
        (forces(milling, applied), ("force_base_N", "force_meas_base_N", "moment_meas_base_Nmm")),
    ):
        for name in names:
            np.testing.assert_array_equal(part_of.seen(name), whole.seen(name), err_msg=name)


def test_a_measured_tip_is_bent_once_and_right(swinging):
    """The tip of measured joints is the same whether an effect makes the chain compute it anew or not."""
    measured = replace(swinging, q_act_rad=swinging.q_cmd_rad + 1e-4, load_base_N=1.5 * swinging.force_base_N)
    plain = simulate(measured).tcp_base_mm
    anew = simulate(measured, [parse("stiffness:target=A2,scale=1", KNOWN, measured.cell)])
    np.testing.assert_allclose(plain, anew.tcp_base_mm, atol=1e-12)
    bent, _ = arm.bend(
        measured.q_act_rad,
        measured.load_base_N,
        measured.moment_base_Nmm,
        measured.softness,
        measured.cell,
        measured.tool,
    )
    np.testing.assert_allclose(plain, robot.forward(measured.q_act_rad, measured.cell)[0] + bent, atol=1e-9)


def test_nominal_values_change_nothing(milling):
    before = simulate(milling)
    for effect, target in _effects(milling.cell, ("other_program", "tool_number")):
        values = {p.name: p.start if p.nominal is None else p.nominal for p in effect.parameters}
        after = simulate(milling, [Applied(effect, target, values)])
        for name in SIGNALS:
            np.testing.assert_array_equal(
                getattr(after, name), getattr(before, name), err_msg=f"{effect.name} {target} {name}"
            )
        assert after.radius_offset_mm == 0.0


def test_typical_values_change_something(milling, swinging):
    """Every effect shows in one of the two runs, and changes no array it was given."""
    before = {id(run): simulate(run) for run in (milling, swinging)}
    for effect, target in _effects(milling.cell, ("other_program", "tool_number", "clock")):
        changed = False
        for run in (milling, swinging):
            if not effect.needs <= run.offers:
                continue
            after = simulate(run, [Applied(effect, target, effect.start(run, target))], rotation=True)
            changed |= len(after.time_s) != len(run) or after.radius_offset_mm != 0.0
            changed |= after.part_shift_mm is not None
            changed |= any(
                not np.array_equal(getattr(after, name), getattr(before[id(run)], name)) for name in SIGNALS
            )
        assert changed, f"{effect.name} {target}"
    for run in (milling, swinging):
        for name in SIGNALS:
            np.testing.assert_array_equal(getattr(simulate(run), name), getattr(before[id(run)], name))


def test_links_downstream_start_from_what_was_measured(swinging):
    rng = np.random.default_rng(5)
    q_act = swinging.q_cmd_rad + rng.normal(0, 1e-4, swinging.q_cmd_rad.shape)
    measured = replace(swinging, q_act_rad=q_act)
    lagging = parse("servo_lag:target=A2,tau_s=0.05", KNOWN, swinging.cell)
    np.testing.assert_array_equal(simulate(measured, [lagging]).tcp_base_mm, simulate(measured).tcp_base_mm)
    np.testing.assert_array_equal(simulate(measured).q_load_rad, q_act)
    np.testing.assert_array_equal(simulate(measured).q_act_rad, swinging.q_cmd_rad)  # still the model's
    gap = parse("backlash:target=A2,gap_deg=0.05", KNOWN, swinging.cell)
    apart = simulate(measured, [gap]).q_load_rad - q_act
    assert np.abs(apart[:, 1]).max() == pytest.approx(np.radians(0.025))
    q_load = q_act + 1e-3
    behind = replace(measured, q_load_rad=q_load)
    np.testing.assert_array_equal(simulate(behind, [gap]).q_true_rad, q_load)


def test_a_measured_force_bends_the_arm(swinging):
    load = 2.0 * swinging.force_base_N + 10.0
    signals = simulate(replace(swinging, load_base_N=load))
    bent, _ = deflection_of(swinging.q_cmd_rad, load, swinging.moment_base_Nmm, np.zeros(3), swinging.cell, 1)
    np.testing.assert_allclose(signals.tcp_base_mm, swinging.position_mm + bent, atol=1e-9)
    np.testing.assert_array_equal(signals.force_base_N, swinging.force_base_N)
    worn = parse("tool_wear:growth_per_m=0.5", KNOWN, swinging.cell)
    both = simulate(replace(swinging, load_base_N=load), [worn])
    np.testing.assert_array_equal(both.tcp_base_mm, signals.tcp_base_mm)


def test_an_arm_of_unknown_stiffness_and_class_does_not_bend(swinging):
    compliance = swinging.cell.compliance.model_copy(update={"virtual_joints": {}})
    payload = swinging.cell.robot.payload.model_copy(update={"reach_mm": None})
    robot = swinging.cell.robot.model_copy(update={"payload": payload})
    unknown = {"compliance": compliance, "robot": robot}
    rigid = replace(swinging, cell=swinging.cell.model_copy(update=unknown))
    np.testing.assert_array_equal(simulate(rigid).tcp_base_mm, swinging.position_mm)
    with pytest.raises(NotUnderstoodError):
        parse("stiffness:target=A1,scale=0.5", KNOWN, rigid.cell)


def test_settings_span_the_effect(swinging):
    """Twice one setting and half another, by `combined`, is what their differences add up to."""
    before = simulate(swinging)
    for name, target, signal in (
        ("base_frame", None, "tcp_base_mm"),
        ("thermal", None, "tcp_base_mm"),
        ("force_drift", None, "force_meas_base_N"),
        ("hose_pack", None, "force_meas_base_N"),
        ("gravity", None, "tcp_base_mm"),
        ("stiffness", "A3", "tcp_base_mm"),
    ):
        effect = KNOWN[name]
        settings = effect.settings(swinging, target)
        parts = [
            getattr(simulate(swinging, [Applied(effect, target, v)]), signal) - getattr(before, signal)
            for v in settings
        ]
        coefficients = 0.3 + 0.1 * np.arange(len(settings))
        values = effect.combined(coefficients, swinging, target)
        whole = getattr(simulate(swinging, [Applied(effect, target, values)]), signal)
        added = sum(c * part for c, part in zip(coefficients, parts, strict=True))
        found = whole - getattr(before, signal)
        assert np.abs(found - added).max() < 0.2 * np.abs(found).max(), name
        if name not in ("stiffness", "base_frame", "gravity"):
            np.testing.assert_allclose(found, added, atol=1e-9, err_msg=name)


def test_shapes_and_sizes(swinging):
    assert len(KNOWN["transmission"].shapes()) == 4
    assert KNOWN["backlash"].shapes() == ({},)
    vibration = KNOWN["vibration"]
    assert len(vibration.settings(swinging)) == 3
    values = vibration.combined(np.array([0.3, 0.0, 0.1]), swinging)
    direction = [values[name] for name in ("direction_x", "direction_y", "direction_z")]
    np.testing.assert_allclose(direction, np.sqrt([0.75, 0.0, 0.25]))
    assert values["participation"] == pytest.approx(0.4 * vibration.start(swinging)["participation"])


def test_what_is_not_measured_shows_downstream():
    gap, wear = KNOWN["backlash"], KNOWN["tool_wear"]
    assert gap.visible_links(frozenset({"gear", "mechanics"})) == {"gear"}
    assert gap.visible_links(frozenset({"servo", "mechanics"})) == {"mechanics"}
    assert gap.visible_links(frozenset({"servo"})) == frozenset()
    assert wear.visible_links(frozenset({"mechanics"})) == {"mechanics"}
    assert KNOWN["clock"].links_at("force") == {"force"}
