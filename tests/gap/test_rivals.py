"""Rivals: effects that do the same share one probability; others share what it leaves."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied
from gcode2krl.gap.posterior.selection import Rival, rival_probabilities, rivals_of, with_rival
from gcode2krl.gap.thresholds import THRESHOLDS, declared_nats
from tests.gap.constructed import Added, applied, examined, motion, noise, trace, wave

SIGMA = 1e-4
ALIKE, TEMPERATURE = 2.0 * declared_nats(), 3.0
"""As differences of chi2; what these are divided by."""
TIME_S = motion().time_s


def rival(worse, apart=None):
    return Rival(applied(wave(2.0), 1.0), worse, worse if apart is None else apart)


def test_a_cause_without_rivals_shares_with_none():
    assert rival_probabilities([], 0.9) == []


def test_rivals_that_can_be_told_from_it_share_what_it_leaves():
    worse = [12.0, 20.0, 100.0]
    others = rival_probabilities([rival(w) for w in worse], 0.7)
    weights = np.exp(-np.array([0.0, *worse]) / (2.0 * TEMPERATURE))
    np.testing.assert_allclose(others, 0.3 * weights[1:] / weights.sum())


def test_rivals_that_cannot_be_told_from_it_share_its_probability():
    others = rival_probabilities([rival(0.0), rival(3.0), rival(40.0)], 0.9)
    assert others[0] == others[1] == 0.9
    assert others[2] < 0.01


def test_a_better_rival_is_alike():
    assert rival_probabilities([rival(-60.0)], 0.6) == [0.6]
    assert rival(-60.0).alike


@pytest.mark.parametrize(
    ("worse", "apart", "alike"),
    [
        (ALIKE - 0.1, 50.0, True),
        (50.0, ALIKE - 0.1, True),
        (ALIKE + 0.1, ALIKE + 0.1, False),
    ],
)
def test_alike_is_by_chi2_or_by_the_cost_of_numbers(worse, apart, alike):
    assert rival(worse, apart).alike is alike


def test_the_declared_set_is_never_smaller_than_the_convention():
    assert declared_nats() >= THRESHOLDS.posterior.alike_chi2 / 2.0


def with_rivals(effects, y, seed=1):
    made = examined([trace(y[:, None] + noise(len(y), seed, SIGMA))], effects, SIGMA)
    return made, {each.applied.effect.name: each for each in rivals_of(made, 0)}


def test_an_effect_of_the_same_form_is_alike():
    first, twin, other = wave(2.0, "first"), wave(2.0, "twin"), wave(3.0)
    made, found = with_rivals([first, twin, other], 2.0 * SIGMA * first.form(TIME_S))
    name = made.applied[0].effect.name
    (rival_,) = found.values()
    assert {name, rival_.applied.effect.name} == {"first", "twin"}
    assert rival_.alike
    assert rival_.chi2_difference == pytest.approx(0.0, abs=1e-3)
    assert rival_.applied.values["size_rad"] == pytest.approx(made.applied[0].values["size_rad"], rel=1e-6)
    assert rival_probabilities([rival_], 0.9) == [0.9]


def test_a_similar_effect_is_worse_by_what_it_cannot_explain():
    """Of a mixture with correlation c to the truth, 1 - c² of the gain is lost."""
    truth = wave(2.0, "truth")
    share = 0.9
    similar = Added(
        "similar",
        lambda t: share * truth.form(t) + np.sqrt(1.0 - share**2) * np.sin(2.0 * np.pi * 4.0 * t),
    )
    y = 1.5 * SIGMA * truth.form(TIME_S)
    made, found = with_rivals([truth, similar], y, seed=3)
    x = [truth.form(TIME_S), similar.form(TIME_S)]
    data = made.traces[0].residual[:, 0] / SIGMA
    gains = [float((data @ form) ** 2 / (form @ form)) for form in x]
    assert found["similar"].chi2_difference == pytest.approx(
        gains[0] - gains[1], rel=0.3
    )  # less where it is inflated
    assert found["similar"].chi2_difference <= gains[0] - gains[1] + 1e-6
    assert not found["similar"].alike


def test_an_effect_that_explains_nothing_of_it_is_no_rival():
    _, found = with_rivals([wave(2.0), wave(3.0)], 2.0 * SIGMA * np.sin(2.0 * np.pi * 2.0 * TIME_S))
    assert found == {}


class WithMore(Added):
    """A wave with a smaller one beside it, which is not there unless the data show it."""

    def __init__(self, name, hz, more_hz):
        super().__init__(name, wave(hz).form)
        self.more = wave(more_hz).form
        (size,) = self.parameters
        self.parameters = (size, replace(size, name="more_rad", minor=True))

    def servo(self, q_act_rad, inputs, applied):
        q = super().servo(q_act_rad, inputs, applied)
        q[:, 0] += applied["more_rad"] * self.more(inputs.time_s)
        return q


def test_a_rival_pays_for_no_number_that_the_data_do_not_show():
    cause, other = WithMore("cause", 2.0, 3.0), WithMore("other", 2.0, 5.0)
    _, found = with_rivals([cause, other], 2.0 * SIGMA * cause.form(TIME_S))
    (rival_,) = found.values()
    assert rival_.applied["more_rad"] == 0.0
    assert rival_.cost_difference == pytest.approx(0.0, abs=1e-3)


def test_a_rival_is_found_where_another_cause_does_most_of_what_the_cause_does():
    """The mixed form is nearly the large one; what it has beside that is all of the twin."""
    large, twin = wave(3.0, "large"), wave(2.0, "twin")
    mixed = Added("mixed", lambda t: large.form(t) + 0.2 * twin.form(t))
    y = 6.0 * large.form(TIME_S) + 0.4 * twin.form(TIME_S)
    made = examined([trace(SIGMA * y[:, None] + noise(len(y), 1, SIGMA))], [large, twin, mixed], SIGMA)
    small = next(i for i, each in enumerate(made.applied) if each.effect is not large)
    swapped = with_rival(made, small, Applied(mixed, "A1", {"size_rad": 2.0 * SIGMA}))
    number = next(i for i, each in enumerate(swapped.applied) if each.effect is mixed)
    assert {each.applied.effect.name: each.alike for each in rivals_of(swapped, number)} == {"twin": True}
