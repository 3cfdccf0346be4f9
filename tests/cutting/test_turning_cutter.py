"""What a turning cutter feels in untouched stock, against every bit of its edge as a rigid body in space.

The oracle knows of no feed per height: a bit of the edge has a place, an outward normal and the velocity of a
rigid body there, v + ω x p. Its chip is that velocity along the normal in the time of a tooth; its force is
tangential, along the inward normal and along the edge.
"""

import numpy as np
import pytest

from gcode2krl.cutting.cutter import shape_of
from gcode2krl.cutting.dexels import dexel_block
from gcode2krl.cutting.turned import TurnedEngagement
from tests.cutting import scenes, turning_scenes

FLAT, BALL, BULL, TAPERED = turning_scenes.TOOLS
ANGLES = 360
BOX = np.array([[-40.0, -40.0, -30.0], [40.0, 40.0, 0.0]])
TIP = np.array([0.31, 0.17, -3.3])
FEED_MM = 0.08
HOLLOW = 0.035
"""Descent below which a bottom touches nothing, 2°."""


def edge_of(tool, bits=400):
    """Return radii, heights and outward normals (r, z) of bits (k) of an edge, and their lengths."""
    shape = shape_of(tool)
    kappa = np.linspace(0.0, shape.kappa_rad, bits + 1)
    bottom = np.linspace(0.0, shape.bottom_mm, bits + 1)
    r = [bottom[:-1], shape.bottom_mm + shape.corner_mm * np.sin(kappa)]
    z = [np.zeros(bits), shape.corner_mm * (1.0 - np.cos(kappa))]
    up = np.linspace(0.0, 24.0 - z[1][-1], bits + 1)[1:]
    r.append(r[1][-1] + up / np.tan(shape.kappa_rad))
    z.append(z[1][-1] + up)
    r, z = np.concatenate(r), np.concatenate(z)
    dr, dz = np.diff(r), np.diff(z)
    length = np.hypot(dr, dz)
    keep = length > 1e-9
    dr, dz, length = dr[keep], dz[keep], length[keep]
    middle = (r[1:] + r[:-1])[keep] / 2.0, (z[1:] + z[:-1])[keep] / 2.0
    return *middle, dz / length, -dr / length, length


def brute_force(tool, axis, feed, swing, top_mm=0.0):
    """Return the mean force (3,) and moment about the tip (3,) of a tool that has come into a half space."""
    r, z, out_r, out_z, length = edge_of(tool)
    any_way = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = np.cross(axis, any_way) / np.linalg.norm(np.cross(axis, any_way))
    second = np.cross(axis, first)
    turn = np.cross(axis, swing)  # of a tool that does not turn about itself
    force, moment = np.zeros(3), np.zeros(3)
    for angle in (np.arange(ANGLES) + 0.5) * 2.0 * np.pi / ANGLES:
        radial = np.cos(angle) * first + np.sin(angle) * second
        ahead = np.cross(radial, axis)  # clockwise, seen from the holder
        at = r[:, None] * radial + z[:, None] * axis
        outward = out_r[:, None] * radial + out_z[:, None] * axis
        along = np.cross(ahead, outward)
        chip = np.einsum("ij,ij->i", feed + np.cross(turn, at), outward)
        cuts = (chip > 1e-9) & (TIP[2] + at[:, 2] < top_mm)
        level = np.linalg.norm(feed - (feed @ axis) * axis)
        cuts &= (out_r > 0.0) | (chip > HOLLOW * level)
        h, db = chip[cuts, None], length[cuts, None]
        tangential, inward, axial = ((scenes.LAW[1 + q] * h + scenes.LAW[4 + q]) * db for q in range(3))
        part = -tangential * ahead - inward * outward[cuts] - axial * along[cuts]
        force += part.sum(axis=0)
        upright = (part @ axis)[:, None] * axis  # whose offset from the axis is left out
        moment += np.cross(at[cuts], part - upright).sum(axis=0)
    return tool.teeth / ANGLES * force, tool.teeth / ANGLES * moment


def read(tool, axis, feed, swing):
    """Return the same as it is read from dexels."""
    pose = turning_scenes.Case("", tool, TIP[None, :] + [[0, 0, 0], 0.1 * feed], np.repeat([axis], 2, axis=0))
    points = turning_scenes.points_of(pose)
    points = points._replace(feed_mm=np.repeat([feed], 2, axis=0), swing=np.repeat([swing], 2, axis=0))
    engagement = TurnedEngagement(dexel_block(BOX, tool.diameter_mm / 40.0), [tool], scenes.LAW)
    found = engagement.take(points, ends=True).result
    return found.force_N[0], found.moment_Nmm[0]


def drawn(seed):
    """Return an axis, a feed of the tip and a swing across the axis; per tooth."""
    chance = np.random.default_rng(seed)
    axis = turning_scenes.tilted(*chance.uniform(-25.0, 25.0, 2))
    feed = chance.normal(size=3)
    feed *= FEED_MM / np.linalg.norm(feed)
    swing = np.cross(axis, chance.normal(size=3))
    return axis, feed, swing * chance.choice([0.0, 0.002, 0.01, 0.03]) / np.linalg.norm(swing)


@pytest.mark.parametrize("tool", [FLAT, BALL, BULL, TAPERED], ids=lambda tool: tool.kind)
@pytest.mark.parametrize("seed", range(4))
def test_every_bit_of_the_edge_has_the_velocity_of_a_rigid_body(tool, seed):
    axis, feed, swing = drawn(seed)
    force, moment = read(tool, axis, feed, swing)
    wanted, wanted_moment = brute_force(tool, axis, feed, swing)
    assert np.linalg.norm(force - wanted) < 0.03 * np.linalg.norm(wanted) + 3.0
    about = np.linalg.norm(moment - wanted_moment)
    assert about < 0.02 * np.linalg.norm(wanted_moment) + 3.0 * tool.diameter_mm


def test_a_ball_that_turns_about_its_middle_cuts_nothing():
    """Its tip moves as fast as it swings, the other way: no bit of its edge goes into the stock."""
    swing = np.array([0.02, 0.0, 0.0])
    force, _ = read(BALL, np.array([0.0, 0.0, 1.0]), -BALL.diameter_mm / 2.0 * swing, swing)
    assert np.linalg.norm(force) < 1e-6
