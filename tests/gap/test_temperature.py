"""Logged temperatures at the samples of a model, and as what a gap depends on."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.compare.pair import temperature_at
from gcode2krl.gap.components import Grid
from gcode2krl.runs import Controller
from tests.gap.constructed import motion, noise, trace

TIME_S = np.arange(0.0, 10.0, 0.02)


def table(**columns):
    count = len(TIME_S)
    return Controller(time_s=TIME_S, row=np.arange(count), segments=np.array([[0, count]]), **columns)


def test_places_come_first_the_ambient_last_and_gaps_are_filled():
    places = np.full((len(TIME_S), 8), np.nan)
    places[:, 2] = 20.0 + 0.1 * TIME_S
    places[100:400, 2] = np.nan
    found = temperature_at(table(temperature_C=places, ambient_C=np.full((len(TIME_S), 1), 18.0)), TIME_S)
    assert found.shape == (len(TIME_S), 2)
    np.testing.assert_allclose(found[:, 0], 20.0 + 0.1 * TIME_S)
    np.testing.assert_allclose(found[:, 1], 18.0)


def test_without_a_logged_value_there_is_none():
    assert temperature_at(None, TIME_S) is None
    assert temperature_at(table(), TIME_S) is None
    assert temperature_at(table(temperature_C=np.full((len(TIME_S), 8), np.nan)), TIME_S) is None


@pytest.mark.parametrize("logged", [True, False])
def test_temperature_is_a_family_where_it_was_logged(logged):
    warm_C = (20.0 + np.sqrt(TIME_S))[:, None] if logged else None
    inputs = replace(motion(), temperature_C=warm_C)
    grid = Grid([trace(noise(500, 1, width=2), inputs=inputs)], [1.0, 1.0])
    assert (Dependence.TEMPERATURE in {family.on for family in grid.families()}) == logged
