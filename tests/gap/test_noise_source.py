"""Where noise is learnt: what repeats is none, nor what effects explain, nor what is slow."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.gap.noise.short import Noise, Slow, drawn_noise, drawn_slow
from gcode2krl.gap.noise.source import noise_of
from gcode2krl.gap.posterior.examination import size_of_gap
from tests.gap.constructed import STEP_S, applied, columns_nuisance, motion, noise, trace, wave

# Where noise is learnt: what repeats is none, nor what effects explain, nor what is slow; bounds hold

COUNT, SIGMA = 2000, 2e-4
TIME_S = 0.02 * np.arange(COUNT)
COLOURED = Noise(np.array([0.6, 0.0, 0.0]), SIGMA, SIGMA / 0.8)
"""Its rms is scale/sqrt(1 - 0.6²)."""


def no_signatures(count: int = COUNT) -> np.ndarray:
    return np.zeros((1, count, 0))


def learnt(residuals: list[np.ndarray], signatures: np.ndarray | None = None, nuisance=(), **more) -> Noise:
    """Return the noise of the one component of some runs."""
    traces = [trace(r.reshape(-1, 1), number=i, **more) for i, r in enumerate(residuals)]
    columns = no_signatures(len(residuals[0])) if signatures is None else signatures
    return noise_of(traces, [columns] * len(traces), [list(nuisance)] * len(traces))[0]


def white(seed: int, sigma: float = SIGMA) -> np.ndarray:
    return noise(COUNT, seed, sigma)[:, 0]


def coloured(seed: int) -> np.ndarray:
    return drawn_noise(COLOURED, COUNT, np.random.default_rng(seed))


def test_between_repeats_the_noise_comes_out_whatever_they_share():
    shared = 30.0 * SIGMA * (np.sin(2.0 * np.pi * 8.0 * TIME_S) + np.sign(np.sin(TIME_S)))
    found = learnt([shared + coloured(seed) for seed in (1, 2, 3)])
    assert found.sigma == pytest.approx(SIGMA / 0.8, rel=0.05)
    assert found.scale == pytest.approx(SIGMA, rel=0.05)
    np.testing.assert_allclose(found.a, [0.6, 0.0, 0.0], atol=0.06)


def sine(hz, turn=0.0):
    return np.sin(2.0 * np.pi * hz * TIME_S + turn)


TONE = np.stack([sine(9.0), sine(9.0, 0.5 * np.pi)], axis=1)
COMB = np.sign(sine(7.0))
NO_NOISE = {
    "half of what two repeats differ by is that of each": ([white(4), white(5)],),
    "slow structure of a single run": ([20.0 * SIGMA * sine(0.15) + white(6)],),
    "a tone that an effect could be": ([5.0 * SIGMA * TONE[:, 0] + white(7)], TONE[None]),
    "a tone that nothing could be: a gap without a name": ([5.0 * SIGMA * TONE[:, 0] + white(7)],),
    "what nuisance could be": ([4.0 * SIGMA * COMB + white(8)], None, [columns_nuisance("comb", COMB)]),
}


@pytest.mark.parametrize("given", NO_NOISE.values(), ids=NO_NOISE)
def test_what_is_no_noise_is_not_learnt(given):
    assert learnt(*given).sigma == pytest.approx(SIGMA, rel=0.05)


@pytest.mark.parametrize("times", [1.1, 5.0])
def test_a_steady_tone_is_no_noise_in_one_run_nor_between_repeats(times):
    """Floor vibration: in each run a phase of its own, so that repeats differ by it."""

    def run(seed):
        return times * np.sqrt(2.0) * SIGMA * sine(8.3, seed) + white(seed)

    assert learnt([run(1)]).sigma == pytest.approx(SIGMA, rel=0.06)
    assert learnt([run(seed) for seed in (1, 2, 3)]).sigma == pytest.approx(SIGMA, rel=0.06)


def test_slow_noise_is_learnt_beside_the_short_and_no_more_than_repeats_differ():
    slow = Slow(float(np.exp(-0.02 / 0.4)), SIGMA)

    def run(seed):
        return drawn_slow(slow, COUNT, np.random.default_rng(100 + seed)) + white(seed)

    for runs in (1, 3):
        models = [learnt([run(runs * case + i) for i in range(runs)]) for case in range(5)]
        assert np.median([found.short_sigma for found in models]) == pytest.approx(SIGMA, rel=0.1)
        slow_sigma = [np.sqrt(sum(part.sigma**2 for part in found.slow)) for found in models]
        assert np.median(slow_sigma) == pytest.approx(SIGMA, rel=0.2)
    # what the runs share is no noise, however it wanders
    shared = 3.0 * drawn_slow(slow, COUNT, np.random.default_rng(1))
    found = learnt([shared + white(seed) for seed in (1, 2, 3)])
    assert found.sigma == pytest.approx(SIGMA, rel=0.05)


def test_a_statement_is_of_the_short_noise():
    """A data sheet says nothing of what its instrument does within seconds: the slow part stays."""
    slow = Slow(float(np.exp(-0.02 / 0.4)), SIGMA)
    run = drawn_slow(slow, COUNT, np.random.default_rng(3)) + white(3)
    stated = learnt([run], declared_sigma=SIGMA)
    assert stated.short_sigma == pytest.approx(SIGMA, rel=0.15)
    assert np.sqrt(sum(part.sigma**2 for part in stated.slow)) == pytest.approx(SIGMA, rel=0.3)


def test_known_effects_are_taken_off_before():
    effect = wave(9.0)
    one = trace(5.0 * SIGMA * effect.form(motion(40.0).time_s)[:, None] + noise(COUNT, 9, SIGMA))
    (found,) = noise_of([one], [no_signatures()], [[]], [applied(effect, 5.0 * SIGMA)])
    assert found.sigma == pytest.approx(SIGMA, rel=0.05)


@pytest.mark.parametrize("runs", [1, 2])
def test_of_a_stated_sigma_nine_tenths_are_the_least(runs):
    quiet = [white(10 + i) for i in range(runs)]
    least = 0.9 * 4.0 * SIGMA
    assert least <= learnt(quiet, declared_sigma=4.0 * SIGMA).sigma < 1.05 * least
    assert learnt(quiet, declared_sigma=0.9 * SIGMA).sigma == pytest.approx(SIGMA, rel=0.05)


def test_more_than_the_stated_sigma_by_far_is_structure():
    loud = [white(12, 4.0 * SIGMA)]
    found = learnt(loud, declared_sigma=SIGMA)
    assert found.sigma == pytest.approx(1.4 * SIGMA, rel=1e-9)
    assert not found.a.any()


def test_runs_of_different_paths_are_no_repeats():
    """Else a difference of their structure would be noise."""
    slow = 20.0 * SIGMA * np.sin(2.0 * np.pi * 0.2 * TIME_S)
    one = trace(noise(COUNT, 13, SIGMA) + slow[:, None])
    elsewhere = replace(motion(40.0), position_mm=motion(40.0).position_mm + 5.0)
    other = trace(noise(COUNT, 14, SIGMA), number=1, inputs=elsewhere)
    (found,) = noise_of([one, other], [no_signatures()] * 2, [[]] * 2)
    assert found.sigma == pytest.approx(SIGMA, rel=0.05)


def test_runs_that_move_otherwise_are_no_repeats_whatever_their_tips():
    """With relative angles no tip is known; what three programs have in common is no repeat of one."""
    seconds = 0.02 * COUNT
    still = replace(motion(seconds), position_mm=np.zeros((COUNT, 3)))
    does = drawn_slow(Slow(0.9, 2.0 * SIGMA), COUNT, np.random.default_rng(9))
    residuals = [coloured(run) + does for run in range(3)]

    def sigma(stretch):
        moved = [replace(still, q_cmd_rad=(1.0 + stretch * run) * still.q_cmd_rad) for run in range(3)]
        runs = [trace(r[:, None], number=i, inputs=moved[i]) for i, r in enumerate(residuals)]
        return noise_of(runs, [no_signatures()] * 3, [[]] * 3)[0].sigma

    assert sigma(0.0) < 1.1 * COLOURED.sigma
    assert sigma(0.2) > 1.5 * COLOURED.sigma


@pytest.mark.parametrize("runs", [1, 3])
def test_a_spike_in_one_run_is_no_noise(runs):
    """Twelve rows of a hundred times the noise: by mean squares they would be three to eight times it."""
    residuals = [coloured(20 + run) for run in range(runs)]
    residuals[-1][700:712] += 100.0 * COLOURED.sigma
    assert learnt(residuals).sigma == pytest.approx(COLOURED.sigma, rel=0.1)


def test_a_spike_hides_no_slow_part():
    slow = Slow(float(np.exp(-0.02 / 0.4)), 2.0 * SIGMA)
    run = drawn_slow(slow, COUNT, np.random.default_rng(31)) + white(31)
    run[700:712] += 200.0 * SIGMA
    found = learnt([run])
    assert found.slow
    assert 0.8 < found.sigma / (np.sqrt(5.0) * SIGMA) < 1.5  # a slow part of few waves is known no better


def test_what_shakes_after_each_corner_is_no_noise():
    """A sixth of the time at ten times the noise: what follows the command is to be explained."""
    after = np.mod(TIME_S, 2.4) < 0.4
    shaken = coloured(41) + after * white(42, 10.0 * SIGMA)
    assert learnt([shaken]).sigma == pytest.approx(COLOURED.sigma, rel=0.1)


def test_heavy_tails_are_noise_all_but_the_heaviest():
    """Student's t of three degrees of freedom: a median would say two thirds of its rms."""
    draws = [np.random.default_rng(50 + i).standard_t(3.0, COUNT) / np.sqrt(3.0) * SIGMA for i in range(5)]
    plain = [learnt([white(60 + i) + draw]).sigma for i, draw in enumerate(draws)]
    assert np.mean(plain) == pytest.approx(np.sqrt(2.0) * SIGMA, rel=0.08)


# Six encoders are alike: what wanders or is loud in few joints is no noise, in most of them it is


def runs(more):
    """Return traces of three runs of other lengths, so no repeats; ``more`` (joints,) is added of each."""
    found = []
    for number in range(3):
        residual = noise(COUNT - 100 * number, number, SIGMA, 6)
        for joint, value in more(number, len(residual)).items():
            residual[:, joint] += value
        found.append(trace(residual, number=number, declared_sigma=SIGMA))
    return found


def wander(joints):
    def added(number, count):
        return {
            joint: drawn_slow(Slow(0.98, 2.0 * SIGMA), count, np.random.default_rng(10 * number + joint))
            for joint in joints
        }

    return added


def learnt_of(traces):
    nothing = [np.zeros((6, len(each.time_s), 0)) for each in traces]
    return noise_of(traces, nothing, [()] * len(traces))


@pytest.mark.parametrize(("joints", "is_noise"), [((1,), False), ((0, 4), False), (range(6), True)])
def test_a_slow_part_is_noise_where_most_encoders_have_it(joints, is_noise):
    slow = [bool(each.slow) for each in learnt_of(runs(wander(joints)))]
    assert slow[joints[0]] == is_noise
    assert is_noise or not any(slow)


def gap_of(more):
    traces = runs(more)
    return size_of_gap(traces, [()] * len(traces), learnt_of(traces), ())


def bump(number, count):
    """Half a second far off in two of three runs: a joint that is held, no encoder."""
    values = np.zeros(count)
    if number != 1:
        values[900:925] = 30.0 * SIGMA
    return {3: values}


def heavy(number, count):
    draw = np.random.default_rng(50 + number)
    return {joint: SIGMA * draw.standard_t(3, count) for joint in range(6)}


def test_what_one_joint_alone_has_for_moments_is_a_gap():
    assert gap_of(bump).significant
    assert not gap_of(lambda number, count: {}).significant


def test_heavy_tails_of_all_joints_and_a_spike_in_one_run_are_none():
    assert gap_of(heavy).loud_in_step == 0.0
    spike = gap_of(
        lambda number, count: (
            {3: np.where(np.arange(count) == 700, 300.0 * SIGMA, 0.0)} if number == 0 else {}
        )
    )
    assert spike.loud_in_step == 0.0


def faster_is_louder(share):
    """Noise of one joint with so much more deviation at its highest speed than where it stands."""

    def added(number, count):
        speed = np.abs(np.gradient(motion(STEP_S * count).q_cmd_rad[:, 3]))
        return {3: share * SIGMA * speed / speed.max() * noise(count, 70 + number, 1.0, 1)[:, 0]}

    return added


def test_an_encoder_that_is_louder_while_its_joint_turns_fast_shows_a_gap():
    assert gap_of(faster_is_louder(1.2)).loud_in_step > 0.25
    assert gap_of(faster_is_louder(0.0)).loud_in_step == 0.0
    assert gap_of(wander(range(6))).loud_in_step == 0.0
