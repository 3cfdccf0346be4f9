"""Errors of a set-up compete as sets: the best one is found, and what cannot be told from it is declared."""

import itertools

import numpy as np
import pytest

from gcode2krl.effects import Parameter
from gcode2krl.gap.posterior.selection import _errors_of_set_up, _Sets, rivals_of, with_set_rival
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.constructed import Added, examined, motion, noise, trace, wave

SIGMA = 1e-4
TIME_S = motion().time_s
FORMS = [wave(hz).form(TIME_S) for hz in (2.0, 3.0, 4.0)]
"""Orthogonal, of equal power."""


PLAIN = {"nominal": 0.0, "start": 1.0, "source": "a test", "linear": True}


class Error(Added):
    """A wrong zero: a sum of the forms."""

    of_set_up = "small"

    def __init__(self, name, *weights):
        super().__init__(name, lambda t: sum(w * form for w, form in zip(weights, FORMS, strict=True)))


class Moved(Added):
    """A frame: each of the forms by a number of its own."""

    of_set_up = "frame"

    def __init__(self, name="frame"):
        super().__init__(name, None)
        size = self.parameters[0]
        names = [f"size_{i}_rad" for i in range(len(FORMS))]
        self.parameters = tuple(Parameter(name, size.unit, size.low, size.high, **PLAIN) for name in names)

    def servo(self, q_act_rad, inputs, applied):
        q = np.array(q_act_rad)
        for name, form in zip(self.names, FORMS, strict=True):
            q[:, 0] += applied[name] * form
        return q


FIRST, SECOND, THIRD = (
    Error("first", 1.0, 0.5, 0.0),
    Error("second", 0.0, 1.0, 0.5),
    Error("third", 0.5, 0.0, 1.0),
)
FRAME = Moved()


def seen(seed, *weights, effects=(FIRST, SECOND, THIRD, FRAME)):
    """Return the examination of a sum of the forms, in units of sigma."""
    y = SIGMA * sum(w * form for w, form in zip(weights, FORMS, strict=True))
    return examined([trace(y[:, None] + noise(len(y), seed, SIGMA))], list(effects), SIGMA)


def names(applied):
    return {each.effect.name for each in applied}


@pytest.mark.parametrize("seed", range(4))
def test_the_best_set_is_that_of_all_sets(seed):
    made = seen(seed, *np.random.default_rng(seed).uniform(-3.0, 3.0, 3))
    columns = _errors_of_set_up(made)
    assert len(columns) == 4
    sets = _Sets(made.data.gram(made.fitted, without=range(len(made.applied))), columns, 1.0)
    every = [
        sets.of(keys, sizes)
        for count in range(5)
        for keys in itertools.combinations(columns, count)
        for sizes in THRESHOLDS.posterior.set_up_sizes
    ]
    assert sets.best().worth == pytest.approx(max(each.worth for each in every))


def test_two_wrong_zeros_are_found_where_a_frame_comes_first():
    made = seen(5, 2.0, 3.0, 1.0)  # twice the first and twice the second
    assert names(made.applied) == {"first", "second"}
    for each in made.applied:
        assert each["size_rad"] == pytest.approx(2.0 * SIGMA, rel=0.1)


def declared(made, number=0):
    rivals = with_set_rival(made, number, rivals_of(made, number))
    return set().union(*(names(each.together) for each in rivals if each.alike))


def test_what_does_the_same_together_is_declared():
    made = seen(6, 2.0, 3.0, 1.0)
    assert [declared(made, number) for number in range(2)] == [{"frame"}, {"frame"}]
    whole = seen(8, 3.0, -1.0, 1.0)  # all three zeros, or the frame
    sets = [{each.effect.name} | declared(whole, n) for n, each in enumerate(whole.applied)]
    assert all("frame" in each for each in sets)
    assert set().union(*sets) == {"first", "second", "third", "frame"}


def test_what_zeros_together_do_not_take_is_the_frames_own():
    made = seen(7, 2.0, 3.0, 1.0, effects=[FIRST, FRAME])
    assert names(made.applied) == {"frame"}
    assert declared(made) == set()
