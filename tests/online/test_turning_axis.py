"""The twin where the tool's axis turns: frames, the pilot's lead, and where the cutter touches the part."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import load_cell, predict
from gcode2krl.cell import controller_axes
from gcode2krl.cell.sections import Machine, Stock
from gcode2krl.cell.sections.online import Online
from gcode2krl.online.judge import judged
from gcode2krl.online.surface import surface_of
from gcode2krl.online.twin import World, simulate, twin_of
from tests.online.test_twin import INSTANT, PERFECT

LEANING = """\
T1 M6
S13000 M3
G0 G43 H1 Z40 A-15 C0
G0 X-20 Y0
G0 Z2
G1 Z-8 F1500
G1 X60 A15
G1 X75
G0 Z40
M5
M30
"""
BOX = ((0.0, -20.0, -30.0), (40.0, 20.0, 0.0))


@pytest.fixture(scope="module")
def leaning(tmp_path_factory):
    """A slot that leans to one side where it begins and to the other where it ends."""
    file = tmp_path_factory.mktemp("twin") / "leaning.nc"
    file.write_text(LEANING)
    machine = Machine(kind="head-head", axes=("C", "A"), signs=(1, 1), tcpm=True)
    cell = load_cell().model_copy(update={"machine": machine, "stock": Stock(box_mm=BOX)})
    return predict(file, cell, dt_s=0.004)


@pytest.fixture(scope="module")
def judgement(leaning):
    return judged(leaning, Online().memory_s)


def steady(prediction):
    """Return the samples in a full cut: nothing begins or ends there."""
    x = prediction.motion.position_mm[:, 0]
    return (x > 12.0) & (x < 30.0) & (prediction.motion.position_mm[:, 2] < -7.9)


@pytest.mark.parametrize("case", ["cartesian", "axis"])
def test_without_faults_nothing_is_left(leaning, case):
    twin = twin_of(leaning, Online(**INSTANT), PERFECT)
    run = simulate(twin, case)
    assert simulate(twin, "uncompensated").normal_mm[steady(leaning)].min() > 0.8
    assert run.normal_mm[steady(leaning)].max() < 0.02


@pytest.mark.parametrize("frame", ["tcp", "base"])
def test_the_pilot_alone_finds_the_force_along_the_axes_of_base(leaning, frame):
    """With a deaf sensor: the estimate is the true force to the tolerance, wherever the tool points."""
    pilot = leaning.cell.pilot.model_copy(update={"frame": frame})
    seen = replace(leaning, cell=leaning.cell.model_copy(update={"pilot": pilot}))
    twin = twin_of(
        seen, Online(**INSTANT, lead_s=0.0, threshold_N=1.0, blend_s=0.004), replace(PERFECT, sensor_gain=0.0)
    )
    run = simulate(twin, "pilot")
    rows = steady(leaning) & (run.device.gate == 0)
    assert rows.sum() > 100
    off = np.linalg.norm(run.device.estimate_N - leaning.forces.force_base_N, axis=1)[rows]
    assert off.max() < 1.1 * twin.knots.tolerance_N
    axes = controller_axes("+z")[:3, :3]
    turned = (
        Rotation.from_quat(leaning.motion.rotation).inv().apply(np.array(leaning.forces.force_base_N)) @ axes
    )
    at = np.searchsorted(leaning.motion.time_s, twin.knots.time_s - 1e-6)
    own = turned if frame == "tcp" else leaning.forces.force_base_N
    np.testing.assert_allclose(twin.knots.force_N, own[at], atol=0.006)


def test_what_is_told_ahead_is_turned_by_the_present_orientation(leaning):
    """The force of 40 ms ahead, in the tool's frame, along axes of now: off by the turn meanwhile at most."""
    twin = twin_of(leaning, Online(**INSTANT), PERFECT)
    run = simulate(twin, "pilot")
    motion, force = leaning.motion, leaning.forces.force_base_N
    later = np.stack([np.interp(motion.time_s + 0.040, motion.time_s, column) for column in force.T], axis=1)
    rows = steady(leaning) & (run.device.gate == 0)
    turned = Rotation.from_quat(motion.rotation)
    most_rad = (turned[10:] * turned[:-10].inv()).magnitude().max()
    off = np.linalg.norm(run.device.estimate_N - later, axis=1)[rows].max()
    assert 0.005 < most_rad < 0.02
    assert off < 1.1 * twin.knots.tolerance_N + most_rad * np.linalg.norm(force, axis=1).max()


def test_the_faults_cost_as_much_as_with_a_constant_axis(leaning, judgement):
    """The paper's reduction: at least 78 % with pilot."""
    twin = twin_of(leaning, Online(), World())
    before, after = (simulate(twin, case).normal_mm[judgement.counts] for case in ("uncompensated", "pilot"))
    assert after.max() < 0.4 * before.max()
    assert np.sqrt((after**2).mean()) < 0.22 * np.sqrt((before**2).mean())


def test_a_leaning_slot_is_touched_at_both_walls_and_at_its_floor(leaning, judgement):
    """Each place is on the cutter, at its side across the way or below it; its normal points to the part."""
    touching = judgement.touching
    motion = leaning.motion
    inside = steady(leaning)[touching.row]
    row, point, normal = (column[inside] for column in touching)
    axis = Rotation.from_quat(motion.rotation[row]).apply([0.0, 0.0, 1.0])
    away = point - motion.position_mm[row]
    up = np.einsum("ij,ij->i", away, axis)
    radius = np.linalg.norm(away - up[:, None] * axis, axis=1)
    floor = radius < 1e-6
    np.testing.assert_allclose(radius[~floor], 8.0, atol=1e-9)
    assert up.min() > -1e-9
    left, right = (~floor & (sign * normal[:, 1] > 0.9) for sign in (1.0, -1.0))
    assert (floor | left | right).all()
    for kind in (floor, left, right):
        assert len(np.unique(row[kind])) > 0.9 * steady(leaning).sum()
    assert (normal[floor] @ [0.0, 0.0, 1.0] < -0.95).all()


def test_the_map_is_the_error_along_the_normals(leaning, judgement):
    twin = twin_of(leaning, Online(), World())
    run = simulate(twin, "uncompensated")
    lifted = run._replace(error_mm=np.tile([0.0, 0.2, 0.1], (len(run.time_s), 1)))
    surface = surface_of(leaning, lifted, judgement)
    normal = judgement.touching.normal[judgement.counts[judgement.touching.row]]
    np.testing.assert_allclose(surface.wall_off_mm, -normal @ [0.0, 0.2, 0.1])
    assert np.isnan(surface.floor_mm).all()
    assert surface.worst_mm == pytest.approx(np.abs(surface.wall_off_mm).max())


def test_a_place_that_is_cut_again_does_not_count(leaning, tmp_path):
    """A second slot, 2 mm deeper along the same way: its own floor alone stays."""
    body = LEANING.replace("G0 Z40\nM5", "G0 Z40\nG0 X-20 A-15\nG0 Z2\nG1 Z-10 F1500\nG1 X60 A15\nG0 Z40\nM5")
    file = tmp_path / "twice.nc"
    file.write_text(body)
    twice = predict(file, leaning.cell, dt_s=0.004)
    found = judged(twice, 0.0)
    line = twice.toolpath.source_line[twice.motion.move]
    floors = line[found.touching.row[found.touching.normal[:, 2] < -0.9]]
    assert set(floors.tolist()) <= {13, 14, 15}
