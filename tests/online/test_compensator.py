"""The whole chain: one sample at a time and as a stream, and against a second implementation of its parts."""

from dataclasses import fields

import numpy as np
import pytest

from gcode2krl import frames as fr
from gcode2krl import robot
from gcode2krl.cell.sections.online import Online
from gcode2krl.compliance import deflection_of
from gcode2krl.compliance.sensor import Calibration, unloaded
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.online.compensator import (
    Corrections,
    CycleInputs,
    build_compensator,
    joints_at,
    sensor_in_flange,
    start,
    step,
    stream,
)
from gcode2krl.online.pilot_gate import Announced
from gcode2krl.units import RAD_PER_DEG
from tests.online import pilot_of

COUNT = 400
CALIBRATION = Calibration(
    weight_N=400.0,
    centre_mm=(10.0, -5.0, 120.0),
    force_offset_N=(3.0, -2.0, 5.0),
    moment_offset_Nmm=(100.0, 50.0, -70.0),
    force_terms_N=tuple((0.1 * k, 0.2, -0.1) for k in range(10)),
)


def pilot():
    force_N = [[0, 0, 0], [0, 400, 50], [0, 400, 50], [0, 0, 0]]
    return pilot_of([0.2, 0.5, 1.2, 1.3], force_N, frame="tcp", checksum=99)


def samples(cell, seed=1):
    rng = np.random.default_rng(seed)
    time_s = 0.004 * np.arange(COUNT)
    position = np.zeros((COUNT, 3))
    position[:, 0] = 25.0 * time_s
    level = np.array([0.0, 0.0, 0.0, 1.0])
    q = robot.inverse(position, np.tile(level, (COUNT, 1)), cell, 1)[:, 2]
    load = rng.normal(0.0, 20.0, (COUNT, 6)) + np.array([0.0, 300.0, -80.0, 0.0, 0.0, 2000.0])
    load[200:204] = np.nan
    knot = np.searchsorted(np.array([0.16, 0.46, 1.16, 1.26]), time_s, side="right") - 1.0
    full = np.ones(COUNT)
    told = Announced(knot, 99.0 * full, 100.0 * full, 0.0 * full)
    return CycleInputs(
        time_s=time_s, load=load, q_rad=q + 1e-4, q_command_rad=q, position_mm=position, announced=told
    )


@pytest.mark.parametrize(("mode", "frame"), [("cartesian", "base"), ("axis", "tcp"), ("axis", "sensor")])
def test_sample_by_sample_gives_the_bits_of_the_stream(cell, mode, frame):
    knots, header = pilot()
    device = build_compensator(
        cell,
        Online(mode=mode),
        load_frame=frame,
        knots=knots,
        header=header,
        calibration=CALIBRATION if frame == "sensor" else None,
    )
    taken = samples(cell)
    _, whole = stream(device, start(device), taken)
    state, rows = start(device), []
    for k in range(COUNT):
        state, out = step(device, state, taken.rows(k, k + 1))
        rows.append(out)
    for spec in fields(Corrections):
        parts = np.concatenate([getattr(row, spec.name) for row in rows])
        assert np.array_equal(parts, getattr(whole, spec.name)), spec.name
    assert (whole.gate == 0).any()


def test_a_steady_force_is_corrected_by_what_the_compliance_says(cell):
    device = build_compensator(cell, Online(), load_frame="base")
    taken = samples(cell)
    load = np.tile([0.0, 300.0, -80.0, 0.0, 0.0, 2000.0], (COUNT, 1))
    taken = CycleInputs(**{f.name: getattr(taken, f.name) for f in fields(CycleInputs)} | {"load": load})
    _, out = stream(device, start(device), taken)
    _, exact = deflection_of(taken.q_rad, load[:, :3], load[:, 3:], [1.0, 0.0, 0.0], cell, 1)
    np.testing.assert_allclose(out.correction[50:], exact[50:], atol=1e-9)
    assert np.abs(out.correction[50:, 0]).max() < 1e-9  # nothing along the feed


def test_axis_corrections_move_the_tip_as_the_cartesian_ones_do(cell):
    taken = samples(cell)
    quick = {"rate_mm_s": 1e4, "step_mm": 10.0, "axis_rate_deg_s": (1e4,) * 6}
    found = {}
    for mode in ("cartesian", "axis"):
        device = build_compensator(cell, Online(mode=mode, **quick), load_frame="base")
        found[mode] = stream(device, start(device), taken)[1]
    before, turned = robot.forward(taken.q_command_rad, cell, 1)
    after, turned_after = robot.forward(taken.q_command_rad + found["axis"].correction, cell, 1)
    np.testing.assert_allclose(after - before, found["cartesian"].correction, atol=1e-8)
    assert fr.angle_between(turned, turned_after).max() < 1e-8


def test_a_sensor_with_weight_and_offset_gives_the_load_at_the_tip(cell):
    """The reading is built forwards: load at the tip, carried to the sensor, plus what it shows unloaded."""
    device = build_compensator(cell, Online(), load_frame="sensor", calibration=CALIBRATION)
    taken = samples(cell)
    force, moment = np.array([120.0, 300.0, -80.0]), np.array([500.0, -300.0, 2000.0])
    tool = fr.invert(sensor_in_flange(cell)) @ cell.tool_matrix(1)
    _, turned = robot.forward(taken.q_rad, cell, 1)
    of_tool = cell.base_matrix()[:3, :3] @ fr.rotation_from_quaternion(turned)
    of_sensor = of_tool @ tool[:3, :3].T
    shown = []
    for rotation in of_sensor:
        f = rotation.T @ cell.base_matrix()[:3, :3] @ force
        m = rotation.T @ cell.base_matrix()[:3, :3] @ moment + np.cross(tool[:3, 3], f)
        own = unloaded(fr.quaternion_from_rotation(rotation), CALIBRATION)
        shown.append(np.concatenate([f + own[0][0], m + own[1][0]]))
    taken = CycleInputs(
        **{f.name: getattr(taken, f.name) for f in fields(CycleInputs)} | {"load": np.array(shown)}
    )
    _, out = stream(device, start(device), taken)
    np.testing.assert_allclose(out.measured[0], [*force, *moment], atol=1e-6)
    np.testing.assert_allclose(out.measured[-1], [*force, *moment], atol=1e-6)


def test_pilot_knots_of_the_tool_frame_are_turned_to_the_base(cell):
    knots, header = pilot()
    device = build_compensator(cell, Online(), load_frame="base", knots=knots, header=header)
    _, out = stream(device, start(device), samples(cell))
    used = out.gate == 0
    _, turned = robot.forward(samples(cell).q_rad[used][:1], cell, 1)
    exact = fr.rotation_from_quaternion(turned)[0] @ np.array([0.0, 400.0, 50.0])
    np.testing.assert_allclose(out.estimate_N[used][0], exact, atol=1e-9)


def test_a_joint_limit_ahead_holds_the_correction(cell):
    low = cell.robot.limits.q_deg[2][0]
    q = np.array([0.0, -95.0, low + 0.5, 0.0, 65.0, 0.0]) * RAD_PER_DEG
    taken = samples(cell)
    here = np.tile(q, (COUNT, 1))
    taken = CycleInputs(
        **{f.name: getattr(taken, f.name) for f in fields(CycleInputs)}
        | {"q_rad": here, "q_command_rad": here}
    )
    device = build_compensator(cell, Online(), load_frame="base")
    _, out = stream(device, start(device), taken)
    wanted = joints_at(here, out.wanted_mm, cell)
    towards = wanted[:, 2] < here[:, 2]
    assert out.blocked[towards].all()
    assert towards.any() != (~towards).all() or not out.blocked[~towards].any()
    assert np.abs(np.diff(out.correction[towards], axis=0)).max(initial=0.0) < 1e-12 or not towards.all()


def test_a_pose_out_of_reach_holds_it_too(cell):
    q = np.array([0.0, -10.0, 2.0, 0.0, 5.0, 0.0]) * RAD_PER_DEG  # the arm nearly stretched
    shift = np.array([[400.0, 0.0, 0.0]])
    assert np.isnan(joints_at(q[None], shift, cell)).all()


def test_a_cell_without_stiffness_is_refused(cell):
    soft = cell.model_copy(update={"compliance": cell.compliance.model_copy(update={"virtual_joints": {}})})
    with pytest.raises(NotUnderstoodError, match="stiffness"):
        build_compensator(soft, Online())
