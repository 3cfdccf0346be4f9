"""Every effect of the plant: it shows in the signals, states its parameters, and matches its definition."""

import json

import numpy as np
import pytest

from tests.plant import instruments, truth
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN, Draw
from tests.plant.robot import Run, fast, joints_for, simulate
from tests.plant.scene import World
from tests.plant.waypoints import PROGRAMS, Waypoints

WORLD = World()
ALL = {**LIBRARY, **SLIPS, **{f"open:{name}": kind for name, kind in UNKNOWN.items()}}
EVERYTHING = instruments.Instruments(drop_outs=False)
FORMS = [
    pytest.param(kind, build, id=f"{name}-{build.__name__}")
    for name, kind in ALL.items()
    for build in (kind.same, *kind.others)
]
NO_MATTER_OF_DEGREE = {  # a stop, a skew, another curve or window is there or is not
    "advance_stop",
    "advance_stop_anywhere",
    "advance_crawl",
    "clock",
    "corner_of_fourth_degree",
    "velocity_in_three_averages",
    *SLIPS,
}


LATE = (
    "step",
    "tool_chips",
    "crane_passes",
    "collision",
    "cable_jerks_free",
)  # in one of the runs, or from one of them on

FAR = dict.fromkeys(
    ("encoder_drop_out", "collision", "bolt_ratchet", "cable_jerks_free", "preload_jump"), "slots"
)  # not to be seen on two rows


def two_rows() -> Waypoints:
    """The start of a program: dive, a row along y, a step, the row back."""
    way = PROGRAMS["zigzag"]().waypoints()
    cdis = way.cdis_mm[:7].copy()
    cdis[-1] = 0.0
    return Waypoints(way.position_mm[:7], way.speed_mm_s[:7], cdis, way.hold_s[:7], way.cutting[:7])


def driven(hooks: dict, number: int = 0, program: str | None = None) -> Run:
    way = two_rows() if program is None else PROGRAMS[program]().waypoints()
    return simulate(way, WORLD, [hooks], age_s=3600.0, number=number)


def middle(kind) -> float:
    return float(np.sqrt(max(kind.sizes[0], 1e-3 * kind.sizes[1]) * kind.sizes[1]))


@pytest.fixture(scope="module")
def untouched() -> dict:
    return instruments.clean(driven({}), EVERYTHING)


@pytest.mark.parametrize(("kind", "build"), FORMS)
def test_every_form_of_every_effect_shows_and_tells_its_parameters(kind, build, untouched):
    target, at = build(Draw(5))
    values, hooks = at(middle(kind))
    json.dumps(values)
    assert values
    assert target is None or isinstance(target, str)
    if kind.name in FAR:
        untouched = instruments.clean(driven({}, program=FAR[kind.name]), EVERYTHING)
    runs = [driven(hooks, number, FAR.get(kind.name)) for number in (range(3) if kind.name in LATE else (0,))]
    tables = [instruments.clean(run, EVERYTHING) for run in runs]
    for table in (table for run in tables for table in run.values()):
        assert all(np.isfinite(column).all() for column in table.values())
    sized = truth.sizes([truth.differences(run, untouched) for run in tables], EVERYTHING)
    if kind.signal == "scan":
        sized["scan"] = truth.scan_size(runs, [driven({}) for _ in runs], EVERYTHING)
    kind.depends_of(build.__name__, target)
    assert max(entry["ratio"] for entry in sized.values()) > 0.02
    if kind.signal in sized:
        assert sized[kind.signal]["rms"] > 0.0


@pytest.mark.parametrize(
    ("kind", "build"), [f for f in FORMS if f.values[1].__name__ not in NO_MATTER_OF_DEGREE]
)
def test_an_effect_of_size_near_nothing_is_near_nothing(kind, build, untouched):
    hooks = build(Draw(5))[1](1e-9)[1]
    tables = instruments.clean(driven(hooks), EVERYTHING)
    sized = truth.sizes([truth.differences(tables, untouched)], EVERYTHING)
    assert max(entry["ratio"] for entry in sized.values()) < 0.01, kind.name


def test_a_third_of_the_library_has_another_form_and_many_effects_are_in_no_library():
    assert sum(bool(kind.others) for kind in LIBRARY.values()) >= len(LIBRARY) / 3
    assert len(UNKNOWN) >= 20
    assert not set(UNKNOWN) & set(LIBRARY)


def only(name: str, size: float, target: str | None = None) -> Run:
    return driven(LIBRARY[name].same(Draw(1, target))[1](size)[1])


def test_clock_stamps_are_late_by_the_offset():
    run = driven({})
    run.clocks["tracker"] = (0.05, 1e-3)
    late = instruments.clean(run, EVERYTHING)["tracker"]
    true_s = (late["t_s"] - 0.05) / 1.001
    np.testing.assert_allclose(late["x_mm"], np.interp(true_s, run.t_s, run.tip_mm[:, 0]))


def test_a_compensated_run_bends_less():
    run = driven(SLIPS["rsi_on"].same(Draw(1))[1](1.0)[1])
    bare = driven({})
    deep = fast(bare, bare.cut.depth_mm[:, None])[:, 0] > 2.5
    across = [0, 2]  # the rows run along y
    after = np.linalg.norm((run.tip_mm - run.place_mm)[deep][:, across], axis=1)
    before = np.linalg.norm((bare.tip_mm - bare.place_mm)[deep][:, across], axis=1)
    assert np.median(after) < 0.5 * np.median(before)


def test_absolute_accuracy_leaves_the_place_right():
    run = driven(SLIPS["absolute_accuracy"].same(Draw(1))[1](1.0)[1])
    assert np.abs(run.tip_mm - run.place_mm - fast(run, run.bending_mm)).max() < 1e-8
    assert np.abs(run.q_cmd - joints_for(WORLD, run.place_mm)).max() > 1e-4
