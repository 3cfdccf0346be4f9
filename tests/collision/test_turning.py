"""What a turning table carries, beside a dense sampling in which the table simply stands at each place."""

import numpy as np
import pytest
import trimesh

from gcode2krl import predict
from gcode2krl.cell.carried import standing
from gcode2krl.collision.bodies import capsules_of, parts_of
from gcode2krl.collision.gaps import obstacle_gaps, placed
from gcode2krl.collision.surroundings import pairs_of, surroundings_of
from gcode2krl.collision.watch import Turning
from tests.test_clearance import cell_with
from tests.test_external_axes import BASE, ON_TABLE, RAIL, TABLE, TABLE_MACHINE, cone

TILT = {**TABLE, "kind": "tilt", "axis": "y", "limits": [-120.0, 120.0]}
ON_TILT = {**TABLE, "origin": {**BASE, "x_mm": 40.0, "z_mm": 60.0}}


def cell_of(seed, tmp_path):
    """A table, a tilt-turn table, or a table before a robot on a rail, with three things on it."""
    ball = trimesh.creation.icosphere(2, 60.0)
    ball.apply_translation((-120.0, 150.0, 60.0))
    ball.export(tmp_path / "ball.stl")
    obstacles = [
        {"name": "clamp", "box_mm": [[100.0, -30, -60], [150, 30, 60]]},
        {"name": "ball", "mesh": str(tmp_path / "ball.stl")},
        {"name": "side", "plane": {"point_mm": [0.0, -320, 0], "normal": [0.0, 1, 0]}},
        {"name": "post", "frame": "world", "box_mm": [[1500.0, 300, 0], [1600, 400, 900]]},
    ]
    external = [{"E2": TABLE}, {"E2": TILT, "E3": ON_TILT}, {"E1": RAIL, "E2": TABLE}][seed % 3]
    return cell_with(*obstacles, external=external, frames={"base": ON_TABLE})


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(9))
def test_hits_and_gaps_are_those_of_a_dense_sampling(seed, tmp_path):
    rng = np.random.default_rng([3, seed])
    cell = cell_of(seed, tmp_path)
    parts = [part for part in parts_of(cell, 1) if part.kind in ("spindle", "cutter")]
    geometry = cell.robot.geometry.array()
    bodies, around = (
        capsules_of(parts, geometry),
        surroundings_of(cell, lambda file: trimesh.load(file).triangles),
    )
    pairs = [
        pair
        for pair in pairs_of(parts, around.names)
        if pair[1] >= 0 and around.names[pair[1]] in around.carried
    ]
    rows = np.linspace(0.0, 1.0, 24)[:, None]
    start = np.radians([0.0, -75.0, 105.0, 0.0, 60.0, 0.0]) + rng.normal(size=6) * 0.05
    q = start + rng.normal(size=6) * 0.12 * rows
    external = (
        cell.external_rest() + np.array([200.0 * (seed % 3 == 2), 140, -90 * (seed % 3 == 1), 0, 0, 0]) * rows
    )
    turning = Turning(cell, bodies, around.shapes, pairs, near_mm=5.0, horizon_mm=60.0)
    found = turning.take(q, external)
    for row in range(1, 24, 2):
        share = np.linspace(0.0, 1.0, 13)[:, None]
        least = np.inf
        for angles, at in zip(
            q[row - 1] + share * (q[row] - q[row - 1]),
            external[row - 1] + share * (external[row] - external[row - 1]),
            strict=True,
        ):
            least = min(least, gap_standing(cell, parts, pairs, bodies, around.names, angles, at))
        if found.gap_mm[row] <= 0.0:
            assert least < 1.0
        elif least < 60.0:
            assert found.gap_mm[row] == pytest.approx(least, abs=1.0 + 0.1 * least)
        assert not (least < -0.01 and found.gap_mm[row] > 0.0)
        if found.gap_mm[row] >= 60.0:
            assert least > 60.0 - 1e-6


def gap_standing(cell, parts, pairs, bodies, names, q_rad, external):
    """Return the least gap in the cell whose axes stand there, from the arm's side."""
    there = standing(cell, external)
    around = surroundings_of(there, lambda file: trimesh.load(file).triangles)
    ends = placed(q_rad[None], there.robot.geometry.array(), bodies)[0]
    least = np.inf
    for body, obstacle, _ in pairs:
        own = slice(obstacle, obstacle + 1)
        shape = around.shapes._replace(
            kind=around.shapes.kind[own], numbers=around.shapes.numbers[own], tree=around.shapes.tree[own]
        )
        gap, _ = obstacle_gaps(ends[body : body + 1], float(bodies.radius_mm[body]), shape)
        least = min(least, float(gap[0]))
    return least


@pytest.mark.parametrize(("low", "lines"), [([-15.0, 64, 15], True), ([-15.0, -150, 15], False)])
def test_a_clamp_on_a_table_that_follows_is_hit_at_its_line(low, lines, tmp_path):
    """Beside the circle at 90 degrees, which is its 20th chord; the other where the tool never comes."""
    clamp = {"name": "clamp", "box_mm": [low, [low[0] + 30.0, low[1] + 20.0, 60.0]]}
    external, frames = {"E2": {**TABLE, "follows": "tool"}}, {"base": {**ON_TABLE, "x_mm": 0.0}}
    cell = cell_with(clamp, external=external, machine=TABLE_MACHINE, frames=frames)
    prediction = predict(cone(tmp_path), cell, forces=False)
    assert np.ptp(prediction.motion.external[:, 1]) > 200.0
    hits = {
        issue.line for issue in prediction.issues if issue.code == "collision" and "clamp" in issue.message
    }
    assert bool(hits) is lines
    if lines:
        assert 18 <= min(hits) <= 26 <= max(hits) <= 34
    nearest = np.nanmin(prediction.clearance.clearance_mm)
    assert bool(nearest <= 0.0) is lines
