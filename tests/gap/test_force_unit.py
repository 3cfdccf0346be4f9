"""Units of force: each is found by its factor, and what is no unit is left to effects."""

from dataclasses import replace

import pytest

from gcode2krl.effects import inputs_of
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.slips import _UNITS, force_unit_slip
from tests.gap.synthetic import LIBRARY, TRUE_STEP_S, prediction, runs


@pytest.fixture(scope="module")
def pair():
    nominal = prediction(dt_s=TRUE_STEP_S)
    run = runs([], 1, 3, base=nominal, normal=False, controller=False, tracker=False)[0]
    return Pair(run=run, number=0, inputs=inputs_of(nominal))


def _times(pair, factor):
    force = pair.run.force
    return replace(pair, run=replace(pair.run, force=replace(force, force_N=factor * force.force_N)))


def test_a_factor_is_how_many_of_the_unit_a_newton_is():
    of_unit = {name: factor for factor, name in _UNITS.items()}
    assert of_unit["kilograms-force"] == pytest.approx(1.0 / 9.80665, rel=1e-6)
    assert of_unit["pounds-force"] == pytest.approx(1.0 / 4.4482216, rel=1e-6)


@pytest.mark.parametrize("factor", _UNITS)
def test_a_unit_is_found(pair, factor):
    (slip,) = force_unit_slip([_times(pair, factor)], LIBRARY)
    assert (slip.applied.target, slip.applied["factor"]) == ("force", factor)
    assert _UNITS[factor] in slip.words


@pytest.mark.parametrize("factor", [1.0, 1.5, 0.3, -1.0])
def test_another_factor_is_no_unit(pair, factor):
    assert force_unit_slip([_times(pair, factor)], LIBRARY) == []


def test_without_forces_or_effect_there_is_none(pair):
    assert force_unit_slip([replace(pair, run=replace(pair.run, force=None))], LIBRARY) == []
    assert force_unit_slip([_times(pair, 1e-3)], {}) == []
