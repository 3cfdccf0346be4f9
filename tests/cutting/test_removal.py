"""Removal and engagement against exact geometry, exact booleans and closed forms."""

import functools
import itertools
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl.cell.sections import Tool
from gcode2krl.compiled import core
from gcode2krl.compiled.core import FLOAT, FLOATS, OUT_FLOATS, core_function
from gcode2krl.cutting.cutter import outline
from gcode2krl.cutting.engagement import engage, outlines_of
from gcode2krl.cutting.force import mean_force
from gcode2krl.cutting.height_field import HeightField
from gcode2krl.cutting.slices import arc_force
from tests.cutting import scenes
from tests.cutting.scenes import LAW

FLAT = Tool(diameter_mm=16, teeth=3, flute_length_mm=30)
BULL = Tool(kind="bull-nose", diameter_mm=16, corner_radius_mm=3, teeth=3, flute_length_mm=30)
BALL = Tool(kind="ball", diameter_mm=16, teeth=3, corner_radius_mm=8, flute_length_mm=30)
TAPERED = Tool(kind="tapered", diameter_mm=6, taper_deg=10, corner_radius_mm=1, teeth=3, flute_length_mm=15)
DRILL = Tool(kind="drill", diameter_mm=8, point_deg=118, teeth=2, flute_length_mm=40)
COEFFICIENTS = LAW[1:7]
ROOT = Path(__file__).parents[2]

linear_edge = core_function("cutting_linear_edge", FLOATS, *(FLOAT,) * 4, FLOATS, OUT_FLOATS)
outline_height = core_function("cutting_outline_height", FLOAT, FLOATS, returns=FLOAT)


def block(low, high, cell_mm=0.1):
    low, high = np.array(low, float), np.array(high, float)
    count = np.ceil((high - low)[:2] / cell_mm - 1e-9).astype(int)
    return HeightField(np.full(count[::-1], high[2], np.float32), low[:2], (high - low)[:2] / count, low[2])


def run(field, position, tool=FLAT, rapid=None, threads=1, law=LAW, f_z_mm=0.1):
    count = len(position)
    rapid = np.zeros(count, bool) if rapid is None else rapid
    feed = np.full(count, f_z_mm)
    return engage(
        field,
        position,
        np.zeros(count, np.int32),
        rapid,
        feed,
        [tool],
        law,
        threads,
        nodes_per_diameter=math.inf,
    )


def local(position, force):
    """Feed, normal and axial parts; the heading is that of the step that leads to the sample."""
    step = np.diff(position, axis=0)
    step = np.concatenate([step[:1], step])[:, :2]
    step /= np.linalg.norm(step, axis=1)[:, None]
    feed = force[:, 0] * step[:, 0] + force[:, 1] * step[:, 1]
    normal = force[:, 1] * step[:, 0] - force[:, 0] * step[:, 1]
    return np.stack([feed, normal, -force[:, 2]], axis=1)


def straight(start, end, step_mm=0.5):
    start, end = np.array(start, float), np.array(end, float)
    count = math.ceil(np.linalg.norm(end - start) / step_mm)
    return start + np.linspace(0, 1, count + 1)[:, None] * (end - start)


@functools.cache
def measured(name, cell_mm=0.1, most=100):
    """A scene's samples: way, force found, force wanted."""
    scene = next(one for one in scenes.transitions() + scenes.steady_scenes() if one.name == name)
    position, way = scene.samples()
    found = local(position, run(scene.field(cell_mm), position).force_N)
    rows = np.arange(1, len(way), max(1, len(way) // most))
    wanted = np.array([scene.exact(way[row]) for row in rows])
    return scene, way[rows], found[rows], wanted


# --- engagement ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [scene.name for scene in scenes.transitions()])
def test_entry_and_exit_of_a_slot_at_every_sample(name):
    _, _, found, wanted = measured(name)
    peak = np.linalg.norm(wanted, axis=1).max()
    assert np.linalg.norm(found - wanted, axis=1).max() < 0.10 * peak
    assert np.linalg.norm(wanted, axis=1).min() == 0.0  # the way begins and ends in air


@pytest.mark.parametrize("name", [scene.name for scene in scenes.transitions() + scenes.steady_scenes()])
def test_steady_force(name):
    scene, way, found, wanted = measured(name)
    steady = (way >= scene.steady[0]) & (way <= scene.steady[1])
    size = np.linalg.norm(wanted[steady], axis=1)
    assert size.min() > 5.0
    assert (np.linalg.norm(found[steady] - wanted[steady], axis=1) / size).max() < 0.05


@pytest.mark.parametrize("radius_share", [0.05, 0.3, 0.7, 1.0, 1.6])
def test_transition_follows_the_closed_form(radius_share):
    """Entry at d: asin(1 - d/R)..pi - asin(1 - d/R); exit at s: 0..asin(s/R) and pi - asin(s/R)..pi."""
    radius = 8.0
    field = block((0, -20, -20), (30, 20, 0))
    advance = radius_share * radius
    entry = advance - radius
    position = straight((-20, 0, -5), (40, 0, -5), 0.25)
    position = np.sort(np.unique(np.concatenate([position[:, 0], [entry, 30 - advance]])))
    position = np.stack([position, 0 * position, 0 * position - 5], axis=1)
    phi = run(field, position).phi_rad
    at_entry = phi[np.argmin(np.abs(position[:, 0] - entry))]
    angle = math.asin(1 - radius_share) if radius_share < 1 else 0.0
    assert at_entry[:2] == pytest.approx([angle, math.pi - angle], abs=0.01)
    if radius_share < 1:
        at_exit = phi[np.argmin(np.abs(position[:, 0] - (30 - advance)))]
        angle = math.asin(radius_share)
        assert at_exit[:4] == pytest.approx([0, angle, math.pi - angle, math.pi], abs=0.01)


@pytest.mark.parametrize(
    ("tool", "a_p_mm"), [(FLAT, 4.0), (BULL, 1.3), (BULL, 6.0), (BALL, 2.0), (BALL, 9.0)]
)
@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_slot_of_round_cutters_is_the_closed_form(tool, a_p_mm, degrees):
    position = scenes.turn(straight((-30, 0.013, -a_p_mm), (30, 0.013, -a_p_mm)), degrees)
    result = run(block((-30, -30, -20), (30, 30, 0)), position, tool)
    middle = len(position) // 2
    wanted = mean_force(
        [0.0, math.pi], a_p_mm, 0.1, 3, tool.diameter_mm, tool.corner_radius_mm, COEFFICIENTS
    )[0]
    found = local(position, result.force_N)[middle]
    assert np.linalg.norm(found - wanted) < 0.01 * np.linalg.norm(wanted)
    assert result.a_p_mm[middle] == pytest.approx(a_p_mm, abs=1e-3)
    if a_p_mm < tool.corner_radius_mm:
        wide = 2 * math.sqrt(2 * tool.corner_radius_mm * a_p_mm - a_p_mm**2)
        wide += tool.diameter_mm - 2 * tool.corner_radius_mm
        assert result.a_e_mm[middle] == pytest.approx(wide, rel=0.1)
    else:
        assert result.a_e_mm[middle] == pytest.approx(tool.diameter_mm, rel=0.01)


@pytest.mark.parametrize("tool", [FLAT, BULL, BALL])
@pytest.mark.parametrize("ramp_deg", [5.0, 20.0])
def test_ramp_down_is_the_closed_form(tool, ramp_deg):
    """A ramp that has left virgin stock behind it: the whole front and, below the slope, the bottom cut."""
    slope = math.tan(math.radians(ramp_deg))
    position = straight((-10, 0.013, 1.0), (20, 0.013, 1.0 - 30 * slope), 0.3)
    result = run(block((-60, -30, -30), (60, 30, 0)), position, tool)
    row = len(position) * 2 // 3
    depth = -position[row, 2]
    level = result.ramp_rad[row]
    assert level == pytest.approx(math.radians(ramp_deg))
    wanted = mean_force(
        [-math.pi / 2, 1.5 * math.pi], depth, 0.1, 3, 16.0, tool.corner_radius_mm, COEFFICIENTS, level
    )[0]
    found = local(position, result.force_N)[row]
    assert np.linalg.norm(found - wanted) < 0.05 * np.linalg.norm(wanted)
    assert result.centre_mm[row] > 0


@pytest.mark.parametrize("tool", [FLAT, BALL, DRILL])
def test_plunge_has_no_lateral_force_and_retract_none(tool):
    down = straight((0.03, 0.02, 3), (0.03, 0.02, -12), 0.3)
    position = np.concatenate([down, down[::-1]])
    result = run(block((-20, -20, -30), (20, 20, 0)), position, tool)
    row = len(down) - 2
    assert result.ramp_rad[row] == pytest.approx(math.pi / 2)
    assert result.force_N[row, 2] > 100.0  # pushed up
    assert np.abs(result.force_N[row, :2]).max() < 0.01 * result.force_N[row, 2]
    assert np.ptp(result.phi_rad[row, :2]) == pytest.approx(2 * math.pi)
    assert result.torque_Nmm[row] > 0
    assert not result.force_N[len(down) :].any()
    assert np.isnan(result.phi_rad[len(down) + 1 :]).all()


def test_drill_is_the_closed_form():
    """The point cuts all around: h = f_z·cos kappa, kappa = 90° less half the point angle."""
    position = straight((0.03, 0.02, 3), (0.03, 0.02, -12), 0.3)
    result = run(block((-20, -20, -30), (20, 20, 0)), position, DRILL)
    half = math.radians(59)
    width = 4.0 / math.sin(half)
    kappa = math.pi / 2 - half
    sin, cos = math.sin(kappa), math.cos(kappa)
    h = 0.1 * cos
    axial = (sin * (222.0 * h + 1.4) - cos * (168.8 * h + 30.8)) * width * 2
    tangential = (796.1 * h + 27.7) * width * 2
    row = len(position) - 3
    assert -result.force_N[row, 2] == pytest.approx(axial, rel=0.01)
    assert result.torque_Nmm[row] == pytest.approx(tangential * 2.0, rel=0.01)


def test_moment_is_height_times_force_and_torque():
    position = straight((-30, 0, -6), (30, 0, -6))
    result = run(block((-30, -30, -20), (30, 30, 0)), position)
    force, moment = result.force_N[len(position) // 2], result.moment_Nmm[len(position) // 2]
    assert moment[:2] == pytest.approx([-3.0 * force[1], 3.0 * force[0]])
    assert moment[2] == pytest.approx(result.torque_Nmm[len(position) // 2])
    assert moment[2] == pytest.approx(4703 * 6 / 5, rel=1e-3)  # the worked example, 5 mm deep: 4.703 Nm


def test_only_what_stands_above_the_bottom_is_cut():
    """A plate of 4 mm, the tip 3 mm below it: the force of a slot of 4 mm, its lever from 3 to 7 mm."""
    position = straight((-30, 0, -7), (30, 0, -7))
    result = run(block((-30, -30, -4), (30, 30, 0)), position)
    middle = len(position) // 2
    wanted = mean_force([0.0, math.pi], 4.0, 0.1, 3, 16.0, 0.0, COEFFICIENTS)[0]
    assert local(position, result.force_N)[middle] == pytest.approx(wanted, rel=1e-3)
    assert result.a_p_mm[middle] == pytest.approx(4.0)
    assert result.moment_Nmm[middle, 1] == pytest.approx(5.0 * result.force_N[middle, 0], rel=1e-3)


def test_kienzle_goes_the_same_way():
    law = np.array([1.0, 780.0, 0.23, 0.4, 0.2, 0, 0, 0])
    position = straight((-30, 0, -4), (30, 0, -4))
    for tool, close in ((FLAT, 1e-3), (BALL, 0.02)):
        field = block((-30, -30, -20), (30, 30, 0))
        found = local(position, run(field, position, tool, law=law).force_N)[len(position) // 2]
        edge = np.zeros(4)
        depth = 4.0
        if tool is FLAT:
            arc_force(0.0, math.pi, 1.0, 0.0, 0.1, 0.0, 1.0, law, edge)
            edge *= depth * 3 / (2 * math.pi)
        else:
            part = np.zeros(4)
            count = 400
            top = math.acos(1 - depth / 8)
            for kappa in (np.arange(count) + 0.5) * top / count:
                part[:] = 0
                arc_force(0.0, math.pi, math.sin(kappa), math.cos(kappa), 0.1, 0.0, 1.0, law, part)
                edge += part * 8 * top / count * 3 / (2 * math.pi)
        assert np.linalg.norm(found - edge[:3]) < close * np.linalg.norm(edge[:3])


@given(st.floats(0, 3), st.floats(0.05, 3), st.floats(0.05, 1.5), st.floats(0, 1.5), st.floats(0.01, 0.3))
@settings(max_examples=50, deadline=None)
def test_integrals_give_the_force_of_an_arc(start, width, kappa, gamma, f_z_mm):
    stop = min(start + width, math.pi)
    wanted, found = np.zeros(4), np.zeros(4)
    chip = (f_z_mm, math.sin(gamma), math.cos(gamma))
    arc_force(start, stop, math.sin(kappa), math.cos(kappa), *chip, LAW, wanted)
    integrals = np.array(
        [
            stop - start,
            math.cos(start) - math.cos(stop),
            math.sin(stop) - math.sin(start),
            0.5 * (stop - start) - 0.25 * (math.sin(2 * stop) - math.sin(2 * start)),
            0.5 * (math.sin(stop) ** 2 - math.sin(start) ** 2),
        ]
    )
    swing, offset = (math.sin(kappa) * math.cos(gamma), math.cos(kappa) * math.sin(gamma))
    linear_edge(integrals, math.sin(kappa), math.cos(kappa), f_z_mm * swing, f_z_mm * offset, LAW, found)
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9)


# --- air -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tool", [FLAT, BULL, BALL, TAPERED])
@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_air_is_exactly_zero(tool, degrees):
    """Above the stock, along its face, and a second time through the same slot."""
    slot = straight((-40, 0.017, -3), (40, 0.017, -3))
    high = np.array([0, 0, 20])
    again = np.concatenate([slot, slot[-1:] + high, slot[:1] + high, slot])
    top = tool.diameter_mm / 2 if tool is not TAPERED else 8.0
    shape = scenes.turned(scenes.box((-25, -20), (25, 20)), degrees)
    field = scenes.Scene("", shape, (-33, -33), (33, 33), slot).field(0.1)
    beside = straight((-40, 20 + top + 0.15, -3), (40, 20 + top + 0.15, -3))
    above = straight((-40, 0, 0), (40, 0, 0))
    for position in (above, beside):
        result = run(field.copy(), scenes.turn(position, degrees), tool)
        assert not result.force_N.any()
        assert not result.torque_Nmm.any()
        assert np.isnan(result.phi_rad).all()
    before = field.volume_mm3
    result = run(field, scenes.turn(again, degrees), tool)
    assert field.volume_mm3 < before
    assert np.linalg.norm(result.force_N[: len(slot)], axis=1).max() > 50.0
    assert not result.force_N[len(slot) :].any()
    assert not result.a_p_mm[len(slot) :].any()


def test_standing_still_and_feed_zero_give_no_force():
    position = np.concatenate([straight((-30, 0, -5), (0, 0, -5)), np.tile([[0.0, 0, -5]], (5, 1))])
    assert not run(block((-30, -30, -20), (30, 30, 0)), position).force_N[-4:].any()
    assert not run(block((-30, -30, -20), (30, 30, 0)), position, f_z_mm=0.0).force_N.any()


def test_no_samples():
    assert run(block((0, 0, -1), (1, 1, 0)), np.zeros((0, 3))).force_N.shape == (0, 3)


# --- volume ----------------------------------------------------------------------------------------------


def solid(tool, length_mm=60.0, count=256):
    """The cutter and its shank as an exact body of revolution, tip at the origin."""
    import manifold3d

    r, z = outline(tool)
    profile = np.concatenate([[[0.0, length_mm]], np.stack([r, z], axis=1)[:: max(1, len(r) // 24)]])
    profile = np.concatenate([profile, [[r[-1], z[-1]], [r[-1], length_mm]]])
    if r[0] > 0:
        profile = np.insert(profile, 1, [0.0, 0.0], axis=0)
    return manifold3d.CrossSection([profile[::-1]], manifold3d.FillRule.NonZero).revolve(count)


@pytest.mark.parametrize(
    "tool",
    [FLAT, *(pytest.param(tool, marks=pytest.mark.slow) for tool in (BALL, BULL, TAPERED, DRILL))],
    ids=lambda tool: tool.kind,
)
def test_volume_against_exact_booleans(tool):
    """Plunge, slot, ramps down and up, a corner, a diagonal: each sweep is a hull of two convex bodies."""
    import manifold3d

    corners = [(-15, -9, 5), (-15, -9, -4), (12.3, -9, -4), (12.3, 7.1, -6.5), (-9, 11.7, -3), (4, 0.3, -7)]
    field = block((-30, -25, -20), (30, 25, 0), 0.1)
    before = field.volume_mm3
    points = [straight(a, b, 0.7)[1:] for a, b in itertools.pairwise(corners)]
    position = np.concatenate([np.array(corners[:1], float), *points])
    run(field, position, tool)
    body = solid(tool)
    stock = manifold3d.Manifold.cube([60, 50, 20]).translate([-30, -25, -20])
    whole = stock.volume()
    for a, b in itertools.pairwise(corners):
        stock -= manifold3d.Manifold.batch_hull([body.translate(a), body.translate(b)])
    wanted = whole - stock.volume()
    assert before == pytest.approx(whole)
    assert before - field.volume_mm3 == pytest.approx(wanted, rel=0.005)


@pytest.mark.parametrize("tool", [FLAT, BULL, BALL, TAPERED, DRILL], ids=lambda tool: tool.kind)
def test_outline_is_that_of_the_cutter(tool):
    r, z = outline(tool)
    own = outlines_of([tool])[0]
    assert [outline_height(radius, own) for radius in r] == pytest.approx(z, abs=1e-6)


# --- builds ----------------------------------------------------------------------------------------------

DIGEST = """
import hashlib
import numpy as np
from tests.cutting.test_removal import BALL, BULL, FLAT, TAPERED, bits
print(hashlib.sha256(b"".join(bits(tool) for tool in (FLAT, BULL, BALL, TAPERED))).hexdigest())
"""


def bits(tool):
    """Every result along a path of steep, level and upright moves, and the field that is left."""
    corners = [
        (-30, -5, 2),
        (25, 3, -5),
        (25, 3, -6),
        (-20, 9.3, -5),
        (-20, 9.3, 5),
        (0, -8, -3),
        (14, 6, -7),
    ]
    points = [straight(a, b, 0.7) for a, b in itertools.pairwise(np.array(corners, float))]
    field, position = block((-40, -20, -20), (40, 20, 0), 0.2), np.concatenate(points)
    result = run(field, position, tool)
    return b"".join(column.tobytes() for column in (*result, field.height_mm))


def test_every_build_gives_the_same_bits():
    """That for any processor and the one for processors with wider registers."""
    environments = [os.environ | {core.BUILD_VARIABLE: build} for build in ("plain", "")]
    plain, chosen = (
        subprocess.run(
            [sys.executable, "-c", DIGEST],
            capture_output=True,
            text=True,
            env=environment,
            check=True,
            cwd=ROOT,
        ).stdout
        for environment in environments
    )
    assert plain == chosen


# --- threads ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tool", [FLAT, BULL, BALL], ids=lambda tool: tool.kind)
def test_threads_do_not_change_a_bit(tool):
    chance = np.random.default_rng(3)
    corners = np.column_stack(
        [chance.uniform(-70, 70, 60), chance.uniform(-20, 20, 60), chance.uniform(-6, 3, 60)]
    )
    points = [straight(a, b, 0.8) for a, b in itertools.pairwise(corners)]
    position = np.concatenate(points)
    rapid = chance.random(len(position)) < 0.1
    results = []
    for threads in (1, 2, 3):
        field = block((-60.03, -25, -20), (60, 25, 0), 0.25)
        results.append((run(field, position, tool, rapid, threads), field.height_mm))
    for result, height in results[1:]:
        assert np.array_equal(height, results[0][1])
        for name, column in result._asdict().items():
            assert np.array_equal(column, getattr(results[0][0], name), equal_nan=True), name


def test_chopping_a_way_finer_does_not_change_the_part():
    corners = straight((-30, -5, -3), (30, 9, -3), 6.0)
    fine = straight((-30, -5, -3), (30, 9, -3), 0.1)
    for tool in (FLAT, BULL, BALL):
        one, other = block((-30, -25, -20), (30, 25, 0)), block((-30, -25, -20), (30, 25, 0))
        run(one, corners, tool)
        run(other, fine, tool)
        apart = np.abs(one.height_mm - other.height_mm)
        assert (
            apart.max() < 0.02
        )  # at the rim of a corner the outline is upright: there 1 µm aside is so much
        assert np.quantile(apart, 0.999) < 1e-4
        assert one.volume_mm3 == pytest.approx(other.volume_mm3, rel=1e-6)


# --- collisions ------------------------------------------------------------------------------------------


def test_a_rapid_through_material_is_found_even_between_samples():
    """A rib of 1 mm, samples 6 mm apart."""
    rib = scenes.box((10.0, -20.0), (11.0, 20.0))
    field = scenes.Scene("", rib, (-20, -20), (40, 20), np.zeros((1, 3))).field(0.1)
    position = straight((-25, 0, -2), (45, 0, -2), 6.0)
    rapid = np.ones(len(position), bool)
    assert run(field, position, rapid=rapid).overlap_mm[:, 0].max() == pytest.approx(2.0)
    assert not run(field, position, rapid=rapid).overlap_mm.any()  # it is gone


def test_rapids_in_air_and_out_of_a_slot_meet_nothing():
    slot = straight((-30, 0, -5), (10, 0, -5))
    out = straight((10, 0, -5), (10, 0, 20))[1:]
    home = straight((10, 0, 0), (-40, 0, 0))
    position = np.concatenate([slot, out, home])
    rapid = np.arange(len(position)) >= len(slot)
    assert not run(block((-30, -30, -20), (30, 30, 0)), position, rapid=rapid).overlap_mm.any()


def test_shank_and_holder_in_the_stock():
    tool = Tool(
        diameter_mm=6,
        teeth=2,
        flute_length_mm=4,
        shank_diameter_mm=10,
        stick_out_mm=12,
        holder_diameter_mm=30,
    )
    position = straight((-25, 0, -15), (-5, 0, -15))
    result = run(block((-20, -20, -30), (20, 20, 0)), position, tool)
    assert result.overlap_mm[-1, 1] == pytest.approx(11.0)
    assert result.overlap_mm[-1, 2] == pytest.approx(3.0)
    assert result.overlap_mm[0, 1] == 0.0  # 5 mm beside the stock the shank is free, the holder is not
    assert result.overlap_mm[0, 2] == pytest.approx(3.0)
    shallow = run(block((-20, -20, -30), (20, 20, 0)), position + np.array([0, 0, 11.5]), tool)
    assert not shallow.overlap_mm.any()
    assert result.a_p_mm[-1] == pytest.approx(15.0)


def test_a_change_of_tool_is_no_sweep():
    """Two tools at two ends of the stock: nothing between them is cut."""
    first = straight((-30, -15, -5), (-10, -15, -5))
    second = straight((30, 15, -5), (10, 15, -5))
    position = np.concatenate([first, second])
    tool = np.repeat(np.array([0, 1], np.int32), [len(first), len(second)])
    field = block((-30, -30, -20), (30, 30, 0))
    small = Tool(diameter_mm=8, teeth=3, flute_length_mm=30)
    engage(field, position, tool, np.zeros(len(tool), bool), np.full(len(tool), 0.1), [FLAT, small], LAW)
    assert field.height_mm[300, 300] == 0.0
    assert field.height_mm[450, 500] == -5.0
    removed = 60 * 60 * 20 - field.volume_mm3
    wanted = 5 * (20 * 16 + math.pi * 32 + 20 * 8 + math.pi * 8)
    assert removed == pytest.approx(wanted, rel=0.005)
