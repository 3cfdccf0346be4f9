"""Rivals: effects that do the same share one probability; probabilities add up to one."""

import numpy as np
import pytest

from gcode2krl.gap.choose.rivals import (
    Rival,
    probabilities,
    rivals_of,
    unknown_probability,
)
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.constructed import Added, applied, examined, motion, noise, trace, wave

LIMITS = THRESHOLDS.choose
ALIKE = LIMITS.alike_chi2
SIGMA = 1e-4
ALIKE, TEMPERATURE, UNKNOWN_SHARE = 9.2, 3.0, 0.15
"""Twice log 100; what differences of chi2 are divided by; a rest as likely unknown as not."""
TIME_S = motion().time_s
CERTAIN, LEVEL = 200.0, 7.0
"""Far above the level: that there is nothing has no probability."""


def rival(worse, apart=None):
    return Rival(applied(wave(2.0), 1.0), worse, worse if apart is None else apart)


def test_alone_a_cause_has_all_that_the_unknown_leaves():
    assert probabilities([], CERTAIN, LEVEL, 0.02) == (pytest.approx(0.98), [])
    assert probabilities([], CERTAIN, LEVEL, 0.6)[0] == pytest.approx(0.4)


def test_at_the_threshold_there_is_nothing_as_likely_as_not():
    assert probabilities([], LEVEL, LEVEL, 0.0)[0] == pytest.approx(0.5)
    assert probabilities([], LEVEL + np.log(10.0), LEVEL, 0.0)[0] == pytest.approx(0.95)


def test_rivals_that_can_be_told_from_it_add_up_to_one_with_it():
    worse = [12.0, 20.0, 100.0]
    own, others = probabilities([rival(w) for w in worse], CERTAIN, LEVEL, 0.1)
    weights = np.exp(-np.array([0.0, *worse]) / (2.0 * LIMITS.temperature))
    np.testing.assert_allclose([own, *others], 0.9 * weights / weights.sum())
    assert own + sum(others) == pytest.approx(0.9)


def test_rivals_that_cannot_be_told_from_it_share_its_probability():
    own, others = probabilities([rival(0.0), rival(3.0), rival(30.0)], CERTAIN, LEVEL, 0.02)
    assert others[0] == others[1] == own
    assert own + others[2] == pytest.approx(0.98)
    assert own > 0.97


def test_a_better_rival_takes_the_probability():
    own, (other,) = probabilities([rival(-60.0)], CERTAIN, LEVEL, 0.0)
    assert own == other == pytest.approx(1.0)  # what is better is no worse: they are alike
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


def test_the_unknown_is_unlikely_without_a_rest_and_certain_with_a_large_one():
    assert unknown_probability(0.9, False) == 0.02
    assert unknown_probability(LIMITS.unknown_share, True) == pytest.approx(0.5)
    assert unknown_probability(0.0, True) == 0.02
    assert unknown_probability(1.0, True) == 0.98
    shares = [unknown_probability(share, True) for share in np.linspace(0.0, 1.0, 101)]
    assert (np.diff(shares) >= 0.0).all()


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
    own, (shared,) = probabilities([rival_], made.surprises[0], made.level, 0.02)
    assert own == shared


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
