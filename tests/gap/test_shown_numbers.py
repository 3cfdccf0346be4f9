"""Numbers that the data did not give are not stated, and a form beyond its range is not accepted."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Effect, Parameter, Role
from gcode2krl.gap.components import blocks_at
from gcode2krl.gap.posterior.cause_tests import intervals_of
from gcode2krl.gap.posterior.least_squares import free_of
from gcode2krl.gap.posterior.likelihood import refit
from gcode2krl.gap.posterior.selection import with_shown_numbers
from tests.gap.constructed import applied, examined, motion, noise, trace

TIME_S = motion().time_s


class Settling(Effect):
    """A joint that settles by ``size_rad`` within ``settles_s`` or longer: 1 - exp(-t/T)."""

    name, family, links = "settling", "joint", frozenset({"servo"})

    def __init__(self, low_s, high_s, minor=False):
        self.parameters = (
            Parameter("size_rad", "rad", -1e3, 1e3, nominal=0.0, start=1.0, source="a test", linear=True),
            Parameter("settles_s", "s", low_s, high_s, None, start=(low_s * high_s) ** 0.5, source="a test"),
        )
        if minor:
            bend = Parameter("bend", "", -9.0, 9.0, nominal=0.0, start=1.0, source="a test", minor=True)
            self.parameters = (*self.parameters, bend)

    def targets(self, cell):
        return ("A1",)

    def servo(self, q_act_rad, inputs, applied):
        q = np.array(q_act_rad)
        t = inputs.time_s
        q[:, 0] += applied["size_rad"] * (1.0 - np.exp(-t / applied["settles_s"]))
        if "bend" in applied.values:
            q[:, 0] += applied["bend"] * np.sin(0.7 * np.pi * t)
        return q


class Ringing(Effect):
    """A sine whose frequency is searched."""

    name, family, links = "ringing", "joint", frozenset({"servo"})
    parameters = (
        Parameter("size_rad", "rad", 0.0, 9.0, nominal=0.0, start=1.0, source="a test", linear=True),
        Parameter("hz", "Hz", 1.0, 21.0, None, start=5.0, source="a test", role=Role.FREQUENCY),
    )

    def targets(self, cell):
        return ("A1",)

    def servo(self, q_act_rad, inputs, applied):
        q = np.array(q_act_rad)
        q[:, 0] += applied["size_rad"] * np.sin(2.0 * np.pi * applied["hz"] * inputs.time_s)
        return q


def settled(time_constant_s, size=3.0):
    return size * (1.0 - np.exp(-TIME_S / time_constant_s))[:, None]


def found_in(form, effect, sigma=0.1, seed=3):
    return examined([trace(form + noise(500, seed, sigma))], [effect], sigma)


def test_a_shape_that_the_data_give_is_stated():
    found = found_in(settled(2.0), Settling(0.2, 20.0))
    (numbers,) = intervals_of(found)
    assert numbers["settles_s"].low < 2.0 < numbers["settles_s"].high
    assert numbers["settles_s"].value == pytest.approx(2.0, rel=0.1)


def test_a_shape_whose_interval_spans_its_range_is_held_and_not_stated():
    """A straight line in 10 s is one to all time constants of minutes and more."""
    found = found_in(0.05 * TIME_S[:, None], Settling(100.0, 10_000.0))
    (cause,) = found.causes
    assert cause.held == {"settles_s"}
    (numbers,) = intervals_of(found)
    assert set(numbers) == {"size_rad"}


def test_a_form_beyond_its_range_is_not_accepted():
    """What settles in two seconds is no settling of three seconds and more."""
    assert not found_in(settled(2.0), Settling(3.0, 50.0)).causes


def test_a_minor_number_stays_nominal_unless_the_data_show_it():
    plain = found_in(settled(2.0), Settling(0.2, 20.0, minor=True))
    (cause,) = plain.causes
    assert cause.held == {"bend"}
    assert cause["bend"] == 0.0
    (numbers,) = intervals_of(plain)
    assert numbers["bend"].low < 0.0 < numbers["bend"].high
    bent = found_in(
        settled(2.0) + 0.5 * np.sin(0.7 * np.pi * TIME_S)[:, None], Settling(0.2, 20.0, minor=True)
    )
    (cause,) = bent.causes
    assert not cause.held
    assert cause["bend"] == pytest.approx(0.5, abs=0.05)


def test_held_numbers_are_not_free():
    effect = Settling(0.2, 20.0)
    one = trace(np.zeros((500, 1)))
    made = applied(effect, 1.0)
    made = replace(made, values={"size_rad": 1.0, "settles_s": 2.0})
    assert free_of(made, one).names == ("size_rad", "settles_s")
    held = free_of(replace(made, held=frozenset({"settles_s"})), one)
    assert held.names == ("size_rad",)
    again = held.applied(np.array([0.5]))
    assert (again.values, again.held) == ({"size_rad": 0.5, "settles_s": 2.0}, {"settles_s"})


def test_a_searched_frequency_counts_as_all_that_the_spectrum_tells_apart():
    """20 Hz in 10 s are 200 frequencies, whichever of them have the highest peaks."""
    blocks = list(blocks_at(Ringing(), None, (5.5, 6.5), 20.0 * 10.0))
    assert len(blocks) == 2
    assert sum(block.tried for block in blocks) == pytest.approx(200.0)


def test_held_numbers_cost_little_chi2_and_given_ones_stay_free():
    line = examined([trace(0.05 * TIME_S[:, None] + noise(500, 3, 0.1))], [Settling(100.0, 10_000.0)], 0.1)
    begin = replace(line.applied[0], held=frozenset())
    before = replace(line, fitted=refit(line.likelihood, ()))
    whole = refit(line.likelihood, [begin])
    held = with_shown_numbers(before, whole)
    assert held.applied[0].held == {"settles_s"}
    assert held.chi2 - whole.chi2 < 6.6
    told = found_in(settled(2.0), Settling(0.2, 20.0))
    given = refit(told.likelihood, told.applied)
    assert with_shown_numbers(replace(told, fitted=refit(told.likelihood, ())), given) is given


def test_a_minor_number_that_one_run_alone_shows_is_not_stated():
    """A bend in one run of three is no number of the machine, however well that run shows it."""
    bend = np.sin(0.7 * np.pi * TIME_S)[:, None]

    def held(sizes):
        runs = [
            trace(settled(2.0) + size * bend + noise(500, 3 + run, 0.1), number=run)
            for run, size in enumerate(sizes)
        ]
        (cause,) = examined(runs, [Settling(0.2, 20.0, minor=True)], 0.1).causes
        return cause.held

    assert held((0.5, 0.5, 0.5)) == frozenset()
    assert held((0.2, 0.0, -0.1)) == {"bend"}
