"""Clocks that were taken off the stamps are named, one a table."""

from dataclasses import replace

import pytest

from gcode2krl.effects import inputs_of
from gcode2krl.gap.compare.links import MECHANICS, PATH
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.slips import clock_slips
from tests.gap.synthetic import LIBRARY, TRUE_STEP_S, prediction, runs


@pytest.fixture(scope="module")
def pairs():
    nominal = prediction(dt_s=TRUE_STEP_S)
    some = runs([], 3, 3, base=nominal, normal=False, force=False)
    return [Pair(run=run, number=n, inputs=inputs_of(nominal)) for n, run in enumerate(some)]


def _late(pair, table, offset_s):
    own = getattr(pair.run, table)
    late = replace(pair.run, **{table: replace(own, time_s=own.time_s + offset_s)})
    return replace(pair, run=late, clock_s={**pair.clock_s, table: offset_s})


@pytest.mark.parametrize(("table", "link"), [("controller", PATH), ("tracker", MECHANICS)])
def test_the_median_offset_of_a_table_is_named(pairs, table, link):
    late = [_late(pair, table, s) for pair, s in zip(pairs, (0.5, 0.8, 3.0), strict=True)]
    (slip,) = clock_slips(late, LIBRARY)
    assert (slip.applied.target, slip.link) == (table, link)
    assert slip.applied["offset_s"] == 0.8
    assert slip.rms_after < 0.01 * slip.rms_before
    assert slip.words == f"the clock of {table} is +0.800 s off the prediction's"
    assert not slip.final


def test_each_table_has_a_clock_of_its_own(pairs):
    late = [_late(_late(pair, "controller", 0.5), "tracker", -0.3) for pair in pairs]
    slips = clock_slips(late, LIBRARY)
    assert [slip.applied["offset_s"] for slip in slips] == [0.5, -0.3]


def test_clocks_of_few_runs_and_excluded_ones_are_not_named(pairs):
    assert clock_slips(pairs, LIBRARY) == []
    assert clock_slips([_late(pairs[0], "controller", 0.5), *pairs[1:]], LIBRARY) == []
    assert clock_slips([_late(pair, "controller", 0.5) for pair in pairs], {}) == []


def test_a_table_that_no_run_has_is_not_named(pairs):
    bare = [replace(pair, run=replace(pair.run, tracker=None), clock_s={"tracker": 1.0}) for pair in pairs]
    assert clock_slips(bare, LIBRARY) == []
