"""Mode coupling and lobes against closed forms and differences of the force, and where they are told."""

import numpy as np
import pytest

from gcode2krl import load_cell
from gcode2krl.cell import resolve_cell
from gcode2krl.cell.sections import VIRTUAL_JOINTS, TapMode
from gcode2krl.compliance import displace
from gcode2krl.compliance.mode_coupling import DAMPING, MOST_GAIN, coupling_index, tip_flexibility
from gcode2krl.cutting.force import cutting_load
from gcode2krl.cutting.law import KIENZLE, law_array, linear_edge_law
from gcode2krl.cutting.lobes import depth_limit
from gcode2krl.cutting.stiffness import process_stiffness
from gcode2krl.frames import rotation_from_quaternion
from gcode2krl.pose.chatter import coupling_along
from gcode2krl.pose.spin import stiffest_spin
from tests.cells import over_demonstration
from tests.pose.test_spin import PATH, judge_by
from tests.pose.two_modes import draw, index_of, simulate

SIX = np.array([796.1, 168.8, 222.0, 27.7, 30.8, 1.4])
PLACE = {"x_mm": 1200.0, "y_mm": -300.0, "z_mm": 400.0, "a_deg": 30.0, "b_deg": 10.0, "c_deg": -20.0}
Q_RAD = np.radians([[0.0, -90.0, 90.0, 0.0, 45.0, 0.0], [20.0, -70.0, 100.0, 30.0, 60.0, -40.0]])


def test_the_tips_flexibility_is_that_of_small_loads():
    cell = over_demonstration({"frames": {"base": PLACE}})
    soft, to_root = tip_flexibility(Q_RAD, cell, 13), cell.base_matrix()[:3, :3]
    force = np.array([12.0, -7.0, 5.0])
    bent = displace(Q_RAD, to_root @ (force * 1e-3), np.zeros(3), cell, 13)[0] @ to_root * 1e3
    np.testing.assert_allclose(soft @ force, bent, rtol=1e-6)
    assert (np.linalg.eigvalsh(soft) > 0.0).all()


def test_a_rigid_arm_does_not_couple():
    rigid = {name: {"k_c": 9.9e99, "k_b": 9.9e99, "k_a": 9.9e99} for name in VIRTUAL_JOINTS}
    cell = over_demonstration({"compliance": {"virtual_joints": rigid}})
    process = np.full((2, 3, 3), 100.0)
    np.testing.assert_array_equal(coupling_index(tip_flexibility(Q_RAD, cell), process), [0.0, 0.0])
    assert np.isnan(coupling_index(tip_flexibility(Q_RAD * np.nan, cell), process)).all()


@pytest.mark.parametrize(
    ("coupling", "apart", "damping"), [(60.0, 0.1, 0.02), (200.0, 0.4, 0.01), (30.0, 0.0, 0.05)]
)
def test_two_modes_flutter_where_the_closed_form_says(coupling, apart, damping):
    """Roots of l² - (k1 + k2)·l + k1·k2 + g²·c² are complex from g·c = (k2 - k1)/2 on; damping adds."""
    k1, k2 = 400.0, 400.0 * (1.0 + apart)
    process = np.zeros((1, 3, 3))
    process[0, 0, 1], process[0, 1, 0] = coupling, -coupling
    flexibility = np.linalg.inv(np.diag([k1, k2, 1e5]))[None]
    undamped = (k2 - k1) / 2.0 / coupling
    found = coupling_index(flexibility, process, 1e-7)[0]
    if apart:
        assert 1.0 / found == pytest.approx(undamped, rel=0.02)
    mean = (k1 + k2) / 2.0
    damped = np.hypot(undamped, 2.0 * damping * mean / coupling)  # Im l = 2·zeta·k on the border, equal drag
    assert 1.0 / coupling_index(flexibility, process, damping)[0] == pytest.approx(damped, rel=0.03)


def test_the_index_is_where_a_root_crosses_the_imaginary_axis():
    generator = np.random.default_rng(5)
    mixed = generator.normal(size=(200, 3, 3))
    stiffness = mixed @ mixed.transpose(0, 2, 1) * 200.0 + 20.0 * np.eye(3)
    process = generator.normal(size=(200, 3, 3)) * 100.0
    index = coupling_index(np.linalg.inv(stiffness), process)
    values, modes = np.linalg.eigh(stiffness)
    drag = 2.0 * DAMPING * (modes * np.sqrt(values)[:, None, :]) @ modes.transpose(0, 2, 1)

    def fastest(gain):
        left = stiffness - gain[:, None, None] * process
        system = np.zeros((200, 6, 6))
        system[:, :3, 3:], system[:, 3:, :3], system[:, 3:, 3:] = np.eye(3), -left, -drag
        return np.linalg.eigvals(system).real.max(axis=1)

    swings = index > 0.0
    assert swings.sum() > 100
    gain = 1.0 / index[swings]
    at, before = np.zeros(200), np.zeros(200)
    at[swings], before[swings] = gain, 0.99 * gain
    assert (fastest(at)[swings] > -1e-9).all()
    assert (fastest(before)[swings] < 0.0).all()
    for few in np.linspace(0.1, 15.9, 20):
        assert (fastest(np.full(200, few))[~swings] < 0.0).all()


def test_a_symmetric_process_pulls_in_where_it_is_as_large_as_the_stiffness():
    flexibility = np.linalg.inv(np.diag([300.0, 500.0, 900.0]))[None]
    pulls = np.zeros((1, 3, 3))
    pulls[0, 1, 1] = 250.0
    assert coupling_index(flexibility, pulls)[0] == pytest.approx(0.5, rel=0.02)
    assert coupling_index(flexibility, -pulls)[0] == 0.0
    assert coupling_index(flexibility, pulls / 100.0)[0] < 1.0 / MOST_GAIN
    assert np.isnan(coupling_index(flexibility * np.nan, pulls)[0])


def changed(arcs, depth, chip, tool, law):
    """Return the process stiffness along feed, normal and axis where the force is 0."""
    samples = np.array(arcs), np.array([depth]), np.array([chip]), np.zeros((1, 3))
    way = np.array([[2.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.0, 1.0]])
    return process_stiffness(*samples, *way, tool.teeth, tool.diameter_mm, law)[0]


KIENZLE_LAW = np.array([KIENZLE, 1200.0, 0.25, 0.4, 0.2, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("law", [linear_edge_law(SIX), KIENZLE_LAW])
@pytest.mark.parametrize("is_up", [True, False])
def test_a_step_sideways_changes_the_force_as_a_wider_cut_does(is_up, law):
    tool, depth, chip, width, step = load_cell().tool[1], 5.0, 0.1, 6.0, 0.1

    def arc(wide):
        angle = np.arccos(1.0 - 2.0 * wide / tool.diameter_mm)
        return [[0.0, angle] if is_up else [np.pi - angle, np.pi]]

    def force(wide):
        return cutting_load(tool, law, arc(wide), depth, chip, peak=False).force_N[0]

    towards = 1.0 if is_up else -1.0  # the wall that the mill leaves is on this side
    wanted = (force(width + towards * step) - force(width - towards * step)) / (2.0 * step)
    found = changed(arc(width), depth, chip, tool, law)
    np.testing.assert_allclose(found[:, 1] * [1.0, 1.0, -1.0], wanted, rtol=1e-2, atol=0.1)
    assert not found[:, [0, 2]].any()


def test_a_slot_does_not_change_sideways():
    assert not changed([[0.0, np.pi]], 5.0, 0.1, load_cell().tool[1], linear_edge_law(SIX)).any()


def test_the_process_turns_with_the_tool():
    """Along other axes it is the same matrix, and displacements along feed and axis see what they should."""
    generator = np.random.default_rng(8)
    turn = generator.normal(size=4)
    rotation = rotation_from_quaternion(turn / np.linalg.norm(turn))
    feed, force = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0), np.array([20.0, -30.0, 40.0])
    dives = feed - np.array([0.0, 0.0, 0.7])
    normal, arcs = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2.0), np.array([[0.0, 1.1, np.nan, np.nan]])
    one, law = (np.array([4.0]), np.array([0.1])), law_array(load_cell().material)

    def found(axes, quaternion):
        way = (axes @ force)[None], (axes @ dives)[None], quaternion[None]
        return process_stiffness(arcs, *one, *way, 3, 16.0, law)[0]

    upright = found(np.eye(3), np.array([0.0, 0.0, 0.0, 1.0]))
    np.testing.assert_allclose(upright @ [0.0, 0.0, 1.0], -force / 4.0)
    np.testing.assert_allclose(upright @ feed, 0.0, atol=1e-12)
    assert np.linalg.norm(upright @ normal) > 1.0
    turned = found(rotation, turn / np.linalg.norm(turn))
    np.testing.assert_allclose(turned, rotation @ upright @ rotation.T, atol=1e-10)


def test_the_index_agrees_with_a_simulation_in_time():
    cases = draw(60, seed=3)
    told, swings = index_of(cases) >= 1.0, simulate(cases)
    assert np.mean(told == swings) >= 0.90
    assert 0.2 < swings.mean() < 0.8


def test_the_lowest_lobe_of_one_mode_is_its_closed_form():
    """Of one mode along the feed: 2·pi/(N·K_t·|alpha|·max(-Re G)), where -Re G = 1/(4·k·z·(1 + z))."""
    mode = TapMode(tool=1, direction="x", frequency_hz=600.0, stiffness_N_mm=9000.0, damping=0.03)
    teeth, tangential, ratio = 3, 800.0, 0.2
    alpha = abs(0.5 * -2.0 * ratio * np.pi)  # alpha_xx of a slot
    least = 2.0 * np.pi / (teeth * tangential * alpha) * 4.0 * 9000.0 * 0.03 * 1.03
    limits = [
        depth_limit([mode], np.array([1.0, 0.0]), (0.0, np.pi), teeth, rpm * np.pi / 30.0, tangential, ratio)
        for rpm in np.linspace(4000.0, 9000.0, 150)
    ]
    assert min(limits) == pytest.approx(least, rel=0.01)
    assert max(limits) > 2.0 * least


def test_of_turns_about_as_stiff_the_one_off_mode_coupling_is_taken():
    def bending(rows, spin):
        return np.full((len(rows), 2), 1.0 + abs(spin) / 10.0)

    def coupling(rows, spin):
        return np.full((len(rows), 2), 2.0 if abs(np.degrees(spin)) < 12.0 else 0.2)

    judge = judge_by(lambda rows, spin: np.ones((len(rows), 2)), bending)
    assert stiffest_spin(PATH, judge) == 0.0
    assert abs(np.degrees(stiffest_spin(PATH, judge._replace(coupling=coupling)))) == pytest.approx(15.0)


UP = """G21 G90 G94
T1 M6
S8000 M3
G0 X-20 Y{y} Z20
G1 Z-{deep} F1500
G1 X{to} F1500
G0 Z20
M5
M30
"""


def found(cell, tmp_path, deep=8.0, y=-2.0):
    from gcode2krl import predict

    part = tmp_path / "part.nc"
    part.write_text(UP.format(y=y, deep=deep, to=120.0), encoding="ascii")
    return predict(part, cell)


def test_deep_up_milling_is_told_with_its_band_and_a_better_turn(tmp_path):
    cell = over_demonstration({"stock": {"box_mm": [[0, -60, -20], [100, 0, 0]]}})
    prediction = found(cell, tmp_path)
    along = coupling_along(
        prediction.toolpath, prediction.motion, prediction.joints.q_rad, prediction.forces, cell, spins=True
    )
    notes = [issue for issue in prediction.issues if issue.code == "mode-coupling"]
    assert bool(notes) == bool(along.coupling.max() >= 1.0)
    assert along.over_spin.shape == (72, len(along.row))
    unturned = along.over_spin[np.argmin(np.abs(along.spin_rad))]
    np.testing.assert_allclose(unturned, along.coupling, rtol=1e-6, atol=1e-9)


def test_a_cut_above_the_lobes_of_a_tap_test_is_told(tmp_path):
    soft = {"tool": 1, "direction": "y", "frequency_hz": 700.0, "stiffness_N_mm": 1500.0, "damping": 0.02}
    cell = resolve_cell(
        {
            "based_on": "demonstration",
            "stock": {"box_mm": [[0, -60, -20], [100, 60, 0]]},
            "compliance": {"tap_modes": [soft]},
        }
    )
    issues = {issue.code: issue for issue in found(cell, tmp_path, 6.0, 0.0).issues}
    assert issues["lobes"].severity == "note"
    assert "6.00 mm deep at 8000/min, stable up to" in issues["lobes"].message
    assert "lobes" not in {issue.code for issue in found(load_cell(), tmp_path, 6.0, 0.0).issues}
