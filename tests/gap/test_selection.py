"""Selection: effects of known sizes are found in order, what is not there is not, mismatch is no cause."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.nuisance import NuisanceDesign, nuisance_for
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.selection import examine, within_mismatch
from tests.gap.constructed import (
    Added,
    Impossible,
    examined,
    joint_rates,
    motion,
    noise,
    question,
    trace,
    wave,
)

COUNT, SIGMA = 500, 1e-4
TIME_S = motion().time_s
SMALL, LARGE, ABSENT = wave(2.0), wave(3.0), wave(5.0)


def run(seed, number=0, **sizes):
    """Return a run with waves of given sizes in units of sigma: small, large."""
    y = sizes.get("small", 0.0) * SMALL.form(TIME_S) + sizes.get("large", 0.0) * LARGE.form(TIME_S)
    return trace(SIGMA * y[:, None] + noise(COUNT, seed, SIGMA), number=number)


def found(examination):
    return [one.effect.name for one in examination.applied]


def test_two_orthogonal_effects_are_found_the_larger_first_with_their_sizes():
    made = examined([run(1, small=0.8, large=1.6)], [ABSENT, SMALL, LARGE], SIGMA)
    assert found(made) == ["wave_3", "wave_2"]
    assert made.causes == made.applied
    deviation = SIGMA / np.sqrt(COUNT / 2.0)  # a sine of whole turns has the power of half its rows
    for one, size in zip(made.applied, (1.6, 0.8), strict=True):
        assert abs(one.values["size_rad"] - size * SIGMA) < 4.0 * deviation


def test_it_is_examined_from_the_traces_given():
    one = run(1, large=1.6)
    made = examine(one.link, [one], question([SMALL, LARGE]), None, [white(SIGMA)])
    assert [each.effect.name for each in made.applied] == ["wave_3"]
    assert list(made.traces) == [one]


def test_what_is_left_is_the_noise():
    made = examined([run(2, small=0.8, large=1.6)], [ABSENT, SMALL, LARGE], SIGMA)
    assert made.fitted.chi2 == pytest.approx(COUNT, abs=4.0 * np.sqrt(2.0 * COUNT))


def test_several_runs_say_it_together():
    """Each alone is below the threshold, eight are not: the gain grows with the rows."""
    faint = 0.24
    runs = [run(10 + i, number=i, small=faint) for i in range(8)]
    assert found(examined(runs, [SMALL, ABSENT], SIGMA)) == ["wave_2"]
    alone = [found(examined([each], [SMALL, ABSENT], SIGMA)) for each in runs]
    assert sum(bool(names) for names in alone) <= 4


def test_white_noise_is_nothing():
    effects = [wave(hz) for hz in (1.0, 2.0, 3.0, 5.0, 8.0)]
    alarms = [
        seed for seed in range(200) if examined([trace(noise(150, seed, SIGMA))], effects, SIGMA).applied
    ]
    assert len(alarms) <= 2  # a thousandth of each is asked for: more than 2 of 200 by one in a thousand


def test_noise_that_has_to_be_learnt_is_nothing_either():
    effects = [wave(hz) for hz in (1.0, 2.0, 3.0)]
    alarms = [seed for seed in range(40) if examined([trace(noise(300, 500 + seed, SIGMA))], effects).applied]
    assert len(alarms) <= 1


def test_more_than_the_plausible_range_is_not_this_effect():
    narrow = wave(2.0, "narrow", low=0.0, high=0.5 * SIGMA)
    assert found(examined([run(3, small=2.0)], [narrow], SIGMA)) == []
    wide = wave(2.0, "wide", low=0.0, high=4.0 * SIGMA)
    assert found(examined([run(3, small=2.0)], [narrow, wide], SIGMA)) == ["wide"]


def test_what_cannot_be_simulated_is_no_candidate():
    made = examined([run(4, small=2.0)], [Impossible("impossible", SMALL.form), SMALL], SIGMA)
    assert found(made) == ["wave_2"]
    assert [column.block.effect.name for column in made.data.candidates.columns] == ["wave_2"]


def test_a_form_with_its_own_sign_here_and_there_is_no_effect():
    """Its gain over all rows is that of a few stretches; data left out do not confirm it."""
    sign = np.repeat([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0], 50)
    effect = Added("one_way", lambda t: np.sin(2.0 * np.pi * 3.0 * t))
    y = 2.0 * sign * LARGE.form(TIME_S)
    assert found(examined([trace(SIGMA * y[:, None] + noise(COUNT, 5, SIGMA))], [effect], SIGMA)) == []


@pytest.mark.parametrize(("large", "small", "stays"), [(20.0, 2.0, True), (100.0, 2.0, False)])
def test_a_small_effect_stays_beside_a_large_one_unless_models_are_off_by_as_much(large, small, stays):
    """Clear beside the noise: a hundredth of what is explained in all, and less than a thousandth."""
    made = examined([run(6, large=large, small=small)], [SMALL, LARGE], SIGMA)
    assert found(made) == (["wave_3", "wave_2"] if stays else ["wave_3"])


def test_what_others_have_made_needless_is_dropped():
    """The sum of both comes first, as it takes the most; beside both it has nothing left to do."""
    both = Added("both", lambda t: SMALL.form(t) + 0.8 * LARGE.form(t))
    made = examined([run(8, small=3.0, large=3.0)], [both, SMALL, LARGE], SIGMA)
    assert set(found(made)) <= {"wave_2", "wave_3", "both"}
    assert len(made.applied) == 2


LAG = library()["servo_lag"]


def lagging(tau_s, seed=7, sigma=2e-6):
    """Return a run whose A1 is late by a small lag, to first order."""
    late = -tau_s * joint_rates(TIME_S)[:, :1]
    return trace(late + noise(COUNT, seed, sigma)), sigma


@pytest.mark.parametrize(("tau_s", "is_cause"), [(3e-4, False), (2e-3, True)])
def test_a_clear_lag_within_normal_mismatch_is_in_the_model_and_no_cause(tau_s, is_cause):
    one, sigma = lagging(tau_s)
    made = examined([one], [LAG], sigma)
    assert found(made) == ["servo_lag"]
    assert made.applied[0].values["tau_s"] == pytest.approx(tau_s, rel=0.05)
    assert bool(made.causes) is is_cause
    assert within_mismatch(made, 0) is not is_cause


def test_the_bound_of_mismatch_is_the_users():
    one, sigma = lagging(2e-3)
    generous = replace(question([LAG]), mismatch=Mismatch(lag_s=3e-3))
    assert not examined([one], generous, sigma).causes


def test_shared_nuisance_has_one_place_in_all_runs_that_have_it():
    full = replace(question([]), library={"servo_lag": LAG})
    one = trace(np.zeros((COUNT, 6)))
    still = replace(trace(np.zeros((COUNT, 6)), number=1), inputs=standing())
    other = replace(trace(np.zeros((COUNT, 6))), run_number=2)
    first, second, third = nuisance_for([still, one, other], full, Signatures())
    design = NuisanceDesign.of([first, second, third])
    lags = [i for i, name in enumerate(design.names(1)) if name.startswith("servo_lag")]
    assert lags
    assert design.shared == len(lags)
    assert design.places[1][lags].tolist() == design.places[2][lags].tolist() == list(range(len(lags)))
    assert not any(name.startswith("servo_lag") for name in design.names(0))
    own = [set(places[places >= design.shared].tolist()) for places in design.places]
    assert not own[1] & own[2]
    assert set().union(*own) == set(range(design.shared, design.width))


def standing():
    inputs = motion()
    return replace(inputs, q_cmd_rad=np.tile(inputs.q_cmd_rad[:1], (COUNT, 1)))
