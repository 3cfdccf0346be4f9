import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl.cell.sections import Kienzle, LinearEdge, Material, Tool
from gcode2krl.cutting.cutter import shape_of
from gcode2krl.cutting.force import cutting_load, mean_force, peak_force
from gcode2krl.cutting.law import law_array, linear_edge_law, spindle_power
from gcode2krl.errors import NotUnderstoodError
from tests.cutting import brute_force as brute

pi = math.pi
AL = (796.1, 168.8, 222.0, 27.7, 30.8, 1.4)
LI = (958.86, 250.86, 146.36, 15.758, 19.434, 18.2075)
HALF, QUARTER = pi / 2, math.acos(0.5)


@pytest.mark.parametrize(
    ("arc", "expected"),
    [
        ((0, pi), (-210.359, 430.795, 116.497)),
        ((0, HALF), (-266.336, 121.719, 58.249)),
        ((HALF, pi), (55.977, 309.076, 58.249)),
        ((0, QUARTER), (-177.680, 12.639, 29.999)),
        ((pi - QUARTER, pi), (79.400, 170.219, 29.999)),
    ],
)
def test_worked_example_to_the_printed_digit(arc, expected):
    force = mean_force([arc], 5.0, 0.1, 3, 16.0, 0.0, AL)
    assert force.shape == (1, 3)
    np.testing.assert_allclose(force[0], expected, atol=5e-4)


def test_torque_of_the_worked_example():
    tool = Tool(diameter_mm=16, teeth=3, flute_length_mm=40)
    load = cutting_load(tool, linear_edge_law(AL), [[0, pi]], 5.0, 0.1)
    assert load.torque_Nmm[0] == pytest.approx(4703, abs=0.5)
    assert spindle_power(load.torque_Nmm, 100.0)[0] == pytest.approx(470.3, abs=0.05)


# flat D 25, N 2, helix 45°, slot, a_p 3 mm, 6000 rpm; revolution means of the raw signals published at
# github.com/leekunhwee/ForceCalculation (coefficients fitted by the experimenter)
MEASURED = {
    0.025: (-39.8, 63.0, 55.7),
    0.050: (-60.1, 107.1, 70.9),
    0.075: (-71.6, 137.7, 82.6),
    0.100: (-76.8, 171.3, 85.2),
    0.125: (-78.5, 210.7, 83.5),
}


@pytest.mark.parametrize("f_z", MEASURED)
def test_the_authors_coefficients_on_the_slots_that_they_were_fitted_to(f_z):
    force = mean_force([[0, pi]], 3.0, f_z, 2, 25.0, 0.0, LI)[0]
    measured = MEASURED[f_z]
    assert math.hypot(*force[:2]) == pytest.approx(math.hypot(*measured[:2]), rel=0.10)
    assert force[2] == pytest.approx(measured[2], rel=0.11)


def lag_of(tool):
    return math.tan(math.radians(tool.helix_deg)) * 2 / tool.diameter_mm


CUTTERS = {
    "flat": (Tool(diameter_mm=16, teeth=3, helix_deg=30, flute_length_mm=40), brute.flat(16, 4.0), 4.0),
    "flat without helix": (
        Tool(diameter_mm=10, teeth=2, helix_deg=0, flute_length_mm=40),
        brute.flat(10, 2.0),
        2.0,
    ),
    "bull-nose": (
        Tool(kind="bull-nose", diameter_mm=16, corner_radius_mm=3, teeth=2, helix_deg=25, flute_length_mm=40),
        brute.bull_nose(16, 3, 5.0),
        5.0,
    ),
    "bull-nose, corner only": (
        Tool(kind="bull-nose", diameter_mm=16, corner_radius_mm=3, teeth=3, helix_deg=45, flute_length_mm=40),
        brute.bull_nose(16, 3, 1.0),
        1.0,
    ),
    "ball": (
        Tool(kind="ball", diameter_mm=10, corner_radius_mm=5, teeth=2, helix_deg=30, flute_length_mm=40),
        brute.bull_nose(10, 5, 2.0),
        2.0,
    ),
    "ball, deep": (
        Tool(kind="ball", diameter_mm=6, corner_radius_mm=3, teeth=4, helix_deg=30, flute_length_mm=40),
        brute.bull_nose(6, 3, 4.0),
        4.0,
    ),
    "tapered": (
        Tool(kind="tapered", diameter_mm=3, taper_deg=5, teeth=3, helix_deg=30, flute_length_mm=12),
        brute.cone(1.5, math.radians(5), 6.0),
        6.0,
    ),
    "drill": (
        Tool(kind="drill", diameter_mm=8, point_deg=118, teeth=2, flute_length_mm=60),
        brute.cone(0, math.radians(59), 4 / math.tan(math.radians(59))),
        4 / math.tan(math.radians(59)),
    ),
}
ARCS = {
    "up": [(0, HALF)],
    "down": [(2 * pi / 3, pi)],
    "slot": [(0, pi)],
    "all round": [(0, 2 * pi)],
    "several": [(0, pi / 6), (pi / 2, 2 * pi / 3), (5 * pi / 6, pi)],
}
RAMPS = {
    "level": 0.0,
    "ramp": math.radians(8),
    "steep": math.radians(50),
    "up-hill": math.radians(-8),
    "plunge": HALF,
}
CASES = [
    *[(cutter, arcs, "level") for cutter in CUTTERS for arcs in ("up", "several") if cutter != "drill"],
    *[(cutter, arcs, "level") for cutter in ("flat", "ball") for arcs in ("down", "slot", "all round")],
    *[(cutter, "all round", ramp) for cutter in CUTTERS for ramp in ("ramp", "plunge")],
    *[(cutter, "several", ramp) for cutter in ("flat", "bull-nose", "ball") for ramp in ("steep", "up-hill")],
    *[("ball", "all round", ramp) for ramp in ("steep", "up-hill")],
]


def every_second(first):
    """The cases, every second of them slow: those that are quick for means are slow for peaks."""
    return [
        pytest.param(*case, marks=[pytest.mark.slow] if number % 2 == first else [])
        for number, case in enumerate(CASES)
    ]


@pytest.mark.parametrize(("cutter", "arcs", "ramp"), every_second(0))
def test_mean_is_that_of_a_revolution_in_small_steps(cutter, arcs, ramp):
    tool, edge, depth = CUTTERS[cutter]
    gamma = RAMPS[ramp]
    force, torque = brute.revolution(
        edge, ARCS[arcs], 0.08, tool.teeth, brute.linear_edge(AL), gamma, lag_of(tool)
    )
    load = cutting_load(tool, linear_edge_law(AL), [np.ravel(ARCS[arcs])], depth, 0.08, gamma)
    expected = force.mean(axis=0)
    assert np.linalg.norm(load.force_N[0] - expected) < 1e-3 * np.linalg.norm(expected)
    assert load.torque_Nmm[0] == pytest.approx(torque.mean(), rel=1e-3)
    if ramp == "plunge":
        assert np.abs(load.force_N[0, :2]).max() < 1e-9 * abs(load.force_N[0, 2])
    if tool.kind in ("flat", "bull-nose", "ball"):
        public = mean_force(
            [np.ravel(ARCS[arcs])],
            depth,
            0.08,
            tool.teeth,
            tool.diameter_mm,
            tool.corner_radius_mm,
            AL,
            gamma,
        )
        np.testing.assert_allclose(public, load.force_N, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("cutter", CUTTERS)
def test_mean_of_kienzle(cutter):
    tool, edge, depth = CUTTERS[cutter]
    material = Material(kienzle=Kienzle(kc11=641, mc=0.27, radial_ratio=0.4, axial_ratio=0.1))
    gamma = HALF if tool.kind == "drill" else math.radians(5)
    arcs = [(0, 2 * pi)]
    force, torque = brute.revolution(
        edge, arcs, 0.06, tool.teeth, brute.kienzle(641, 0.27, 0.4, 0.1), gamma, lag_of(tool)
    )
    load = cutting_load(tool, law_array(material), [np.ravel(arcs)], depth, 0.06, gamma)
    expected = force.mean(axis=0)
    assert np.linalg.norm(load.force_N[0] - expected) < 1e-3 * np.linalg.norm(expected)
    assert load.torque_Nmm[0] == pytest.approx(torque.mean(), rel=1e-3)


FINE = {
    "flat": brute.flat(16, 4.0, 400),
    "flat without helix": brute.flat(10, 2.0, 40),
    "bull-nose": brute.bull_nose(16, 3, 5.0, 300),
    "bull-nose, corner only": brute.bull_nose(16, 3, 1.0, 300),
    "ball": brute.bull_nose(10, 5, 2.0, 300),
    "ball, deep": brute.bull_nose(6, 3, 4.0, 300),
    "tapered": brute.cone(1.5, math.radians(5), 6.0, 600),
    "drill": CUTTERS["drill"][1],
}


@pytest.mark.parametrize(("cutter", "arcs", "ramp"), every_second(1))
def test_peak_is_within_3_percent(cutter, arcs, ramp):
    tool, _, depth = CUTTERS[cutter]
    lag = 0.0 if tool.kind == "drill" else lag_of(tool)
    force, _ = brute.revolution(
        FINE[cutter], ARCS[arcs], 0.08, tool.teeth, brute.linear_edge(AL), RAMPS[ramp], lag, angles=1440
    )
    load = cutting_load(tool, linear_edge_law(AL), [np.ravel(ARCS[arcs])], depth, 0.08, RAMPS[ramp])
    assert load.peak_N[0] == pytest.approx(np.linalg.norm(force, axis=1).max(), rel=0.03)
    assert load.peak_N[0] >= np.linalg.norm(load.force_N[0]) * (1 - 1e-9)
    silent = cutting_load(tool, linear_edge_law(AL), [np.ravel(ARCS[arcs])], depth, 0.08, peak=False)
    assert np.isnan(silent.peak_N).all()
    alone = peak_force(tool, linear_edge_law(AL), [np.ravel(ARCS[arcs])], depth, 0.08, RAMPS[ramp])
    assert load.peak_N == np.maximum(alone, np.linalg.norm(load.force_N, axis=1))


def test_torque_is_cutting_pressure_times_volume():
    """Without edge terms the work of a turn is Ktc times the volume removed in it."""
    law = linear_edge_law([800, 300, 100, 0, 0, 0])
    segment = 8**2 * math.acos(5 / 8) - 5 * math.sqrt(39)  # of the ball's circle, 3 mm high
    for kind, corner, width in (("flat", 0, 16 * 3.0), ("ball", 8, segment)):
        tool = Tool(kind=kind, diameter_mm=16, corner_radius_mm=corner, teeth=3, flute_length_mm=40)
        torque = cutting_load(tool, law, [[0, pi]], 3.0, 0.1).torque_Nmm[0]
        assert torque == pytest.approx(800 * width * 0.1 * 3 / (2 * pi), rel=1e-6)
    drill = Tool(kind="drill", diameter_mm=8, teeth=2, flute_length_mm=60)
    torque = cutting_load(drill, law, [[0, 2 * pi]], 10.0, 0.1, HALF).torque_Nmm[0]
    assert torque == pytest.approx(800 * pi * 4**2 * 0.2 / (2 * pi), rel=1e-9)


def test_flat_mill_plunging_is_pushed_back_by_its_bottom():
    force = mean_force([[0, 2 * pi]], 3.0, 0.05, 2, 10.0, 0.0, AL, HALF)[0]
    assert force[2] == pytest.approx(-2 * 5 * (168.8 * 0.05 + 30.8))  # both teeth, radial turned upwards
    assert mean_force([[0, 2 * pi]], 3.0, 0.05, 2, 10.0, 0.0, AL, HALF)[0, 2] == pytest.approx(
        mean_force([[0, 2 * pi]], 9.0, 0.05, 2, 10.0, 0.0, AL, HALF)[0, 2]
    )


def test_rounding_of_a_direction_is_no_ramp():
    level = mean_force([[0, pi]], 3.0, 0.05, 2, 10.0, 0.0, AL)
    np.testing.assert_allclose(mean_force([[0, pi]], 3.0, 0.05, 2, 10.0, 0.0, AL, 1e-7), level, rtol=1e-6)


def test_small_corner_tends_to_a_flat_mill():
    flat = mean_force([[0, 2.0]], 4.0, 0.05, 3, 16.0, 0.0, AL)
    np.testing.assert_allclose(mean_force([[0, 2.0]], 4.0, 0.05, 3, 16.0, 1e-6, AL), flat, rtol=1e-5)


angle = st.floats(0, 2 * pi)
positive = st.floats(0.01, 1.0)
corner = st.sampled_from([0.0, 2.0, 8.0])
ramp = st.sampled_from([0.0, 0.1, 1.0, HALF, -0.3])


def force_of(arcs, depth=2.0, f_z=0.1, corner=0.0, coefficients=AL, gamma=0.0):
    return mean_force([np.ravel(arcs)], depth, f_z, 3, 16.0, corner, coefficients, gamma)[0]


@settings(max_examples=60, deadline=None)
@given(st.lists(angle, min_size=3, max_size=3), corner, ramp)
def test_arcs_add_up(angles, corner, ramp):
    a, b, c = sorted(angles)
    whole = force_of([a, c], corner=corner, gamma=ramp)
    in_one = force_of([a, b, np.nan, np.nan, b, c], corner=corner, gamma=ramp)
    parts = force_of([a, b], corner=corner, gamma=ramp) + force_of([b, c], corner=corner, gamma=ramp)
    np.testing.assert_allclose(in_one, parts, rtol=1e-9, atol=1e-9)
    # a split only changes the rounding, unless it falls on the edge of the chip inside a quadrature
    np.testing.assert_allclose(whole, parts, rtol=1e-9, atol=1e-7)


@settings(max_examples=60, deadline=None)
@given(angle, angle, corner, ramp, st.lists(st.floats(0, 1000), min_size=12, max_size=12))
def test_linear_in_the_coefficients(a, b, corner, ramp, numbers):
    one, two = np.reshape(numbers, (2, 6))
    arc = sorted((a, b))
    together = force_of(arc, coefficients=2 * one + 3 * two, corner=corner, gamma=ramp)
    apart = 2 * force_of(arc, coefficients=one, corner=corner, gamma=ramp) + 3 * force_of(
        arc, coefficients=two, corner=corner, gamma=ramp
    )
    np.testing.assert_allclose(together, apart, rtol=1e-9, atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(angle, angle, corner, ramp)
def test_mirrored_at_the_feed(a, b, corner, ramp):
    """Up-milling is down-milling in a mirror: the tangential part turns its feed force, the radial its
    normal."""
    start, end = sorted((a, b))
    mirror = (3 * pi - end, 3 * pi - start)
    for coefficients, sign in (((700, 0, 0, 20, 0, 0), (-1, 1, 1)), ((0, 300, 100, 0, 20, 5), (1, -1, 1))):
        here = force_of((start, end), coefficients=coefficients, corner=corner, gamma=ramp)
        there = force_of(mirror, coefficients=coefficients, corner=corner, gamma=ramp)
        np.testing.assert_allclose(here, np.array(sign) * there, rtol=1e-9, atol=1e-7)


@settings(max_examples=40, deadline=None)
@given(angle, angle, positive, positive)
def test_turns_and_scales(a, b, depth, f_z):
    arc = np.array(sorted((a, b)))
    force = force_of(arc, depth, f_z)
    np.testing.assert_allclose(force_of(arc + 2 * pi, depth, f_z), force, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(force_of(arc - 2 * pi, depth, f_z), force, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(force_of(arc, 3 * depth, f_z), 3 * force, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("corner", [0.0, 2.0, 8.0])
def test_nothing_engaged_is_exactly_no_force(corner):
    for arcs in ([np.nan, np.nan], [1.0, 1.0], [pi, 2 * pi]):
        assert (force_of(arcs, corner=corner) == 0).all()
    assert (force_of([0, pi], depth=0.0, corner=corner) == 0).all()
    assert (force_of([0, pi], f_z=0.0, corner=corner) == 0).all()
    assert (force_of([0, pi], corner=corner, gamma=-HALF) == 0).all()
    tool = Tool(diameter_mm=16, corner_radius_mm=corner, teeth=3)
    load = cutting_load(tool, linear_edge_law(AL), [[np.nan, np.nan]], 2.0, 0.1)
    assert load.torque_Nmm[0] == 0
    assert load.peak_N[0] == 0


def test_rows_broadcast_and_parts_do_not_matter():
    rng = np.random.default_rng(3)
    n = 45_000
    arcs = np.sort(rng.uniform(0, pi, (n, 2)), axis=1)
    depth, f_z = rng.uniform(0.1, 4, n), rng.uniform(0.01, 0.2, n)
    many = mean_force(arcs, depth, f_z, 3, 16.0, 0.0, AL)
    some = rng.integers(0, n, 50)
    alone = mean_force(arcs[some], depth[some], f_z[some], 3, 16.0, 0.0, AL)
    np.testing.assert_array_equal(alone, many[some])
    assert mean_force([0, pi], depth, 0.1, 3, 16.0, 0.0, AL).shape == (n, 3)
    assert mean_force(np.zeros((0, 2)), 1.0, 0.1, 3, 16.0, 0.0, AL).shape == (0, 3)
    locked = arcs.copy()
    locked.setflags(write=False)
    np.testing.assert_array_equal(mean_force(locked, depth, f_z, 3, 16.0, 0.0, AL), many)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"phi_rad": [[0, 1, 2]]}, "phi_rad"),
        ({"phi_rad": [[2.0, 1.0]]}, "row 0, arc 0"),
        ({"phi_rad": [[0.0, 1.0], [1.0, np.nan]]}, "row 1, arc 0"),
        ({"phi_rad": [[0.0, 7.0]]}, "one turn"),
        ({"phi_rad": [["a", "b"]]}, "phi_rad"),
        ({"a_p_mm": [1.0, -1.0]}, "a_p_mm: row 1"),
        ({"a_p_mm": np.nan}, "a_p_mm"),
        ({"a_p_mm": [[1.0]]}, "a_p_mm"),
        ({"f_z_mm": -0.1}, "f_z_mm"),
        ({"a_p_mm": [1, 2, 3], "f_z_mm": [1, 2]}, "rows"),
        ({"teeth": 0}, "teeth"),
        ({"teeth": 2.5}, "teeth"),
        ({"diameter_mm": 0}, "diameter_mm"),
        ({"corner_radius_mm": 9}, "corner_radius_mm"),
        ({"coefficients": [1, 2, 3]}, "coefficients"),
        ({"coefficients": [1, 2, 3, 4, 5, np.inf]}, "coefficients"),
        ({"ramp_rad": 2.0}, "ramp_rad"),
    ],
)
def test_wrong_input_is_named(change, named):
    good = {
        "phi_rad": [[0.0, 1.0]],
        "a_p_mm": 1.0,
        "f_z_mm": 0.1,
        "teeth": 3,
        "diameter_mm": 16.0,
        "corner_radius_mm": 0.0,
        "coefficients": AL,
        "ramp_rad": 0.0,
    }
    with pytest.raises(NotUnderstoodError, match="allowed") as caught:
        mean_force(**{**good, **change})
    assert named in str(caught.value)


def test_edges_end_at_the_flutes():
    tool = Tool(diameter_mm=16, teeth=3, flute_length_mm=10)
    law = law_array(Material(linear_edge=LinearEdge(Ktc=700, Krc=200, Kte=20, Kre=20)))
    deep, full = (cutting_load(tool, law, [[0, pi]], depth, 0.1).force_N for depth in (30.0, 10.0))
    np.testing.assert_array_equal(deep, full)
    assert shape_of(tool).flute_mm == 10
