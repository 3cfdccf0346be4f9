"""What the library lacks is not given the name of what imitates it, and what it has keeps its name."""

import functools
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest

from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.answer.causes import depends_on
from gcode2krl.gap.compare.links import FORCE, MECHANICS
from gcode2krl.gap.compare.pair import pairs_of
from gcode2krl.gap.compare.trace import Context
from gcode2krl.gap.posterior.examination import question_of
from gcode2krl.gap.posterior.judgement import judge
from tests.gap.synthetic import LIBRARY, applied, refined, runs

pytestmark = pytest.mark.slow

START = datetime(2026, 1, 5, 8, 0)
NAMES = {
    MECHANICS: ("thermal", "base_frame", "tool_frame", "mastering"),
    FORCE: ("force_offset", "force_drift", "tool_weight"),
}


def judged(link, effects=(), extra=None, seed=3):
    """Return what a link says of three runs, with the effects that could imitate what was done to them."""
    made = [
        replace(run, head=run.head.model_copy(update={"started": START + number * timedelta(minutes=30)}))
        for number, run in enumerate(runs(list(effects), 3, seed, extra=extra, controller=False))
    ]
    pairs = tuple(pairs_of(refined(), made))
    others = frozenset(LIBRARY) - set(NAMES[link])
    examined = frozenset({"force", "mechanics"})
    context = Context(pairs, 3, LIBRARY, Mismatch(), exclude=others, examined=examined)
    traces = link.traces(pairs)
    return judge(link, traces, [], question_of(link, traces, context))


def names(judgement):
    return [each.effect.name for each in judgement.applied]


def moved(form):
    """Return a change of the tip by a form (n, 3) of the stamps and the number of the run."""

    def extra(name, values, stamps, signals, number):
        return values + form(stamps, number) if name == "position_mm" else values

    return extra


@functools.cache
def slip():
    way = np.array([0.6, -0.2, 0.1])

    def form(stamps, number):
        share = np.clip((stamps - 8.0) / 0.04, 0.0, 1.0) if number == 0 else np.ones(len(stamps))
        return share[:, None] * way

    return judged(MECHANICS, extra=moved(form)), way


def test_a_fixture_that_slips_is_no_warming_up():
    found, _ = slip()
    assert found.verdict == "unexplained"
    assert names(found) == []


def test_the_slip_is_told_with_its_moment_size_and_direction():
    found, way = slip()
    best, _ = next(iter(depends_on(found)))
    assert (best.at, best.form, best.run) == ("tip", "step", "run-1")
    assert best.at_time_s == pytest.approx(8.0, abs=0.1)
    assert best.size == pytest.approx(np.linalg.norm(way), rel=0.1)
    assert best.direction == pytest.approx(way / np.linalg.norm(way), abs=0.1)


def test_a_tool_that_grows_in_each_run_is_no_frame():
    """From 0 at every start to -0.1 mm after some seconds; a frame is off from the start."""

    def form(stamps, number):
        return np.outer(0.12 * np.expm1(-stamps / 4.0), [0.0, 0.0, 1.0])

    found = judged(MECHANICS, extra=moved(form))
    assert names(found) == []
    best, _ = next(iter(depends_on(found)))
    assert best.on in ("time since the run's start", "spindle speed", "metres cut")
    assert abs(best.direction[2]) > 0.9


def test_a_cable_that_pulls_with_travel_is_no_offset():
    """0 N at every start, then more with the travel of A1."""

    def extra(name, values, stamps, signals, number):
        if name != "force_N":
            return values
        travel = np.interp(stamps, signals.time_s, np.abs(signals.q_cmd_rad[:, 0] - signals.q_cmd_rad[0, 0]))
        return values + np.outer(40.0 * travel / travel.max(), [0.2, 0.9, -0.4])

    found = judged(FORCE, extra=extra)
    assert "force_offset" not in names(found)
    assert found.verdict in ("unexplained", "partly_explained")


def test_a_tool_that_is_pulled_out_is_no_frame():
    """It creeps out of its holder while it cuts in the first run, and stays there."""

    def form(stamps, number):
        out = np.clip((stamps - 4.0) / 8.0, 0.0, 1.0) if number == 0 else np.ones(len(stamps))
        return np.outer(0.3 * out, [0.0, 0.0, -1.0])

    found = judged(MECHANICS, extra=moved(form))
    assert names(found) == []
    best, _ = next(iter(depends_on(found)))
    assert best.at in ("tip", "A2")  # A2 moves it up and down too, with one number instead of three
    assert best.on not in ("place", "constant")
    assert abs(best.direction[2]) > 0.9


@pytest.mark.parametrize(
    ("link", "effect"),
    [
        (MECHANICS, "thermal:mm_per_h=0.5,time_constant_h=1.0,direction_x=0,direction_y=0.6,direction_z=0.8"),
        (MECHANICS, "base_frame:x_mm=0.3,y_mm=-0.2,c_deg=0.02"),
        (FORCE, "force_offset:fx_N=25,fy_N=-10,fz_N=0"),
    ],
)
def test_right_names_stay(link, effect):
    found = judged(link, applied(effect))
    assert names(found) == [effect.partition(":")[0]]
    assert found.verdict == "explained"
    (cause,) = found.causes
    assert cause.features.conditions_failed == 0
