"""The order of the tests for slips: the first finding is the only one, clocks come besides."""

from dataclasses import replace

import pytest

from gcode2krl.effects import inputs_of
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Issue
from gcode2krl.gap.compare import slips
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.trace import Context
from gcode2krl.gap.posterior import set_up
from tests.gap.synthetic import LIBRARY, TRUE_STEP_S, applied, prediction, runs


def _context(text="", exclude=(), **signals):
    nominal = prediction(dt_s=TRUE_STEP_S)
    effects = applied(text) if text else []
    run = runs(effects, 1, 3, base=nominal, normal=False, force=False, **signals)[0]
    return Context(
        (Pair(run=run, number=0, inputs=inputs_of(nominal)),), 1, LIBRARY, Mismatch(), frozenset(exclude)
    )


def test_every_effect_that_a_test_looks_for_is_in_the_library():
    names = {slips._CLOCK, slips._FORCE_UNIT, slips._OVERRIDE, slips._OTHER_PROGRAM, slips._STOPS}
    names |= {set_up._TOOL, set_up._BASE, set_up._TRACKER_FRAME, *slips._EFFECT_OF.values()}
    assert names <= set(LIBRARY)


def test_the_first_test_that_finds_a_slip_ends_the_search(monkeypatch):
    asked = []

    def finding(result):
        def test(pairs, library):
            asked.append(result)
            return result

        return test

    monkeypatch.setattr(set_up, "TESTS", tuple(finding(each) for each in ([], ["first"], ["second"])))
    assert set_up.first_slip([], LIBRARY) == ["first"]
    assert asked == [[], ["first"]]


def test_the_checks_of_the_runs_come_last():
    issue = Issue("error", "run-unit", 2, "controller.csv: radians", "")
    override = _context("override:percent=60", tracker=False)
    named = set_up.first_slip(override.pairs, LIBRARY, [issue])
    assert [slip.applied.effect.name for slip in named] == ["override"]
    sound = _context(tracker=False)
    named = set_up.first_slip(sound.pairs, LIBRARY, [issue])
    assert [(slip.applied.effect.name, slip.final) for slip in named] == [("unit", True)]


def test_a_sound_run_has_no_slip_and_stays_as_it_is():
    context = _context(tracker=False)
    examined = set_up.examine_set_up(context)
    assert (examined.slips, examined.issues, examined.is_final) == ([], [], False)
    assert examined.context.slips == ()
    assert examined.context.pairs[0].inputs is context.pairs[0].inputs


@pytest.mark.slow
def test_a_wrong_clock_is_named_and_taken_off_besides_another_slip():
    context = _context("base_number:x_mm=30,a_deg=2", tracker=False)
    table = context.pairs[0].run.controller
    late = replace(context.pairs[0].run, controller=replace(table, time_s=table.time_s + 2.0))
    context = context.with_pairs([replace(context.pairs[0], run=late)])
    examined = set_up.examine_set_up(context)
    assert [slip.applied.effect.name for slip in examined.slips] == ["base_number", "clock"]
    assert examined.slips[1].applied["offset_s"] == pytest.approx(2.0, abs=0.01)
    assert examined.context.pairs[0].clock_s["controller"] == pytest.approx(2.0, abs=0.01)
    assert [one.effect.name for one in examined.context.slips] == ["base_number"]


@pytest.mark.slow
def test_stops_come_first_and_are_in_the_plan():
    context = _context("advance_stop:count=2,hold_s=0.08", tracker=False)
    examined = set_up.examine_set_up(context)
    assert [slip.applied.effect.name for slip in examined.slips] == ["advance_stop"]
    assert examined.context.stopped
    assert examined.context.pairs[0].inputs.time_s[-1] > context.pairs[0].inputs.time_s[-1] + 0.1
    without = set_up.examine_set_up(
        _context("advance_stop:count=2,hold_s=0.08", ["advance_stop"], tracker=False)
    )
    assert not without.context.stopped
