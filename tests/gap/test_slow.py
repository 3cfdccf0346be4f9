"""The slow part of noise: block means, what explains them, and what is left."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter

from gcode2krl.gap.compare.inputs import Admissible
from gcode2krl.gap.noise.short import Slow, drawn_slow
from gcode2krl.gap.noise.slow import BlockMeans, block_means, explaining_columns, slow_parts_of, sums_between
from tests.gap.constructed import columns_nuisance, motion, noise, trace

# The slow part of noise: found where it is, of its size, and never what a drift, a step or an effect is

STEP_S = 0.05
COUNT, RUNS = 300, 3
TIME_S = STEP_S * np.arange(COUNT)
SHORT = 0.3
"""Rms of a block's mean of short noise whose rms is about one."""


def means(of_run, seed=0, candidates=None) -> BlockMeans:
    """Return runs of 15 s: short noise and what a function of run and generator adds."""
    generator = np.random.default_rng(seed)
    y = [SHORT * generator.standard_normal(COUNT) + of_run(i, generator) for i in range(RUNS)]
    known = np.kron(np.eye(RUNS), np.column_stack([np.ones(COUNT), TIME_S - TIME_S.mean()]))
    steps = np.kron(np.eye(RUNS), (TIME_S[:, None] >= np.arange(0.5, 15.0, 0.25)).astype(float))
    more = np.zeros((RUNS * COUNT, 0)) if candidates is None else candidates
    edges = tuple((COUNT * i, COUNT * (i + 1)) for i in range(RUNS))
    return BlockMeans(np.concatenate(y), np.array(edges), known, np.column_stack([steps, more]), edges)


def rms(parts) -> float:
    return float(np.sqrt(sum(part.sigma**2 for part in parts)))


def wandering(time_constant_s: float, sigma: float = 1.0):
    part = Slow(float(np.exp(-STEP_S / time_constant_s)), sigma)
    return lambda run, generator: drawn_slow(part, COUNT, generator)


@pytest.mark.slow
def test_short_noise_has_no_slow_part():
    assert [slow_parts_of(means(lambda *_: 0.0, seed)) for seed in range(10)] == [()] * 10


@pytest.mark.slow
def test_memories_of_45_ms_are_short():
    kept = Slow(0.33, SHORT)
    found = [slow_parts_of(means(lambda _, g: drawn_slow(kept, COUNT, g), seed)) for seed in range(10)]
    assert found == [()] * 10


@pytest.mark.slow
@pytest.mark.parametrize("time_constant_s", [0.1, 0.3, 1.0, 3.0])
def test_the_slow_part_comes_out_beside_constants_and_trends(time_constant_s):
    """What constants and trends take of it is allowed for: within a factor of two in time, 40 % in size."""
    found = [slow_parts_of(means(wandering(time_constant_s), seed)) for seed in range(12)]
    assert all(found)
    sigma = np.median([rms(parts) for parts in found])
    assert sigma == pytest.approx(1.0, rel=0.2 if time_constant_s < 2.0 else 0.4)
    ratio = np.median([parts[0].time_constant_s for parts in found]) / time_constant_s
    assert 0.5 <= ratio <= 2.0


@pytest.mark.slow
def test_a_bounded_random_walk_and_1_f_noise_are_slow_noise():
    def walk(_, generator):
        x, steps = np.zeros(COUNT), 0.25 * generator.standard_normal(COUNT)
        for i in range(1, COUNT):
            x[i] = np.clip(x[i - 1] + steps[i], -1.7, 1.7)
        return x

    def pink(_, generator):
        f = np.fft.rfftfreq(COUNT, STEP_S)
        f[0] = np.inf
        x = np.fft.irfft(
            (generator.standard_normal(len(f)) + 1j * generator.standard_normal(len(f))) / f**0.5
        )
        return x / x.std()

    for kind in (walk, pink):
        sigma = [rms(slow_parts_of(means(kind, seed))) for seed in range(8)]
        assert 0.6 < np.median(sigma) < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("times", [1.0, 2.0])
@pytest.mark.parametrize("what", ["drift", "step", "tone", "effect"])
def test_what_is_no_noise_is_not_swallowed(what, times):
    """One or two times the noise, whose rms is about one: what is left to a slow part is a small rest."""
    form = np.sin(2.0 * np.pi * TIME_S / 7.0) + 0.5 * np.sin(2.0 * np.pi * TIME_S / 2.9)
    shapes = {
        "drift": lambda run, _: times * (TIME_S - TIME_S.mean()) / TIME_S.std(),
        "step": lambda run, _: 2.0 * times * (TIME_S > 7.3) * (run == 1),
        "tone": lambda run, _: times * 1.41 * np.sin(2.0 * np.pi * 0.63 * TIME_S + run),
        "effect": lambda run, _: times * form / form.std(),
    }
    candidates = np.tile(form, RUNS)[:, None] if what == "effect" else None
    for seed in range(4):
        assert rms(slow_parts_of(means(shapes[what], seed, candidates))) < 0.25


@pytest.mark.slow
def test_an_effect_beside_slow_noise_leaves_the_noise_as_it_is():
    form = np.tile(np.sign(np.sin(2.0 * np.pi * TIME_S / 4.1)), RUNS)
    slow = wandering(0.3)
    found = []
    for seed in range(8):
        both = means(lambda run, g: slow(run, g) + 2.0 * form[:COUNT], seed, form[:, None])
        found.append(rms(slow_parts_of(both)))
    assert np.median(found) == pytest.approx(1.0, rel=0.2)


@pytest.mark.slow
def test_few_blocks_tell_nothing():
    few = means(wandering(0.3))
    cut = BlockMeans(few.values[:40], np.array([[0, 40]]), few.known[:40], few.candidates[:40], ((0, 40),))
    assert slow_parts_of(cut) == ()


# Sums over blocks of rows


def test_each_block_is_summed_by_itself():
    values = np.random.default_rng(1).normal(size=(40, 3))
    edges = np.array([0, 1, 9, 40])
    sums = sums_between(values, edges)
    for block, (first, last) in enumerate(pairwise(edges)):
        assert np.allclose(sums[block], values[first:last].sum(axis=0), rtol=0.0, atol=1e-13)


def test_rows_before_the_first_edge_and_after_the_last_do_not_count():
    values = np.ones((10, 1))
    assert sums_between(values, np.array([2, 5, 6])).ravel().tolist() == [3.0, 1.0]


def test_columns_that_do_not_follow_each_other_in_memory():
    values = np.arange(24.0).reshape(4, 6)
    assert np.array_equal(sums_between(values[:, ::2], np.array([0, 2, 4])), [[6, 10, 14], [30, 34, 38]])


def test_no_columns_and_no_blocks():
    assert sums_between(np.ones((4, 0)), np.array([0, 2, 4])).shape == (2, 0)
    assert sums_between(np.ones((4, 2)), np.array([0])).shape == (0, 2)


# Block means: of what rows, over which segments, and contrasts of repeats, by hand

ROWS = 500
"""Rows of 0.02 s; blocks of 0.05 s hold two or three."""
ROWS_S = motion().time_s
BLOCK = np.floor(ROWS_S / 0.05).astype(int)


def made(traces, residuals, signatures=None, nuisance=(), repeats=False):
    columns = signatures or [np.zeros((one.shape[1], len(one.time_s), 0)) for one in traces]
    usual = list(nuisance) or [[] for _ in traces]
    return list(block_means(traces, residuals, columns, usual, repeats))


def by_hand(values):
    return np.array([values[number == BLOCK].mean() for number in np.unique(BLOCK)])


def test_means_are_those_of_the_rows_in_each_twentieth_of_a_second():
    y = noise(ROWS, 1, width=2)
    form = np.sin(ROWS_S)
    signature = np.stack([np.stack([form, form**2], axis=1), np.zeros((ROWS, 2))])
    first, second = made([trace(y)], [y], [signature])
    np.testing.assert_allclose(first.values, by_hand(y[:, 0]))
    np.testing.assert_allclose(second.values, by_hand(y[:, 1]))
    np.testing.assert_allclose(first.candidates[:, 0], by_hand(form))
    np.testing.assert_allclose(first.candidates[:, 1], by_hand(form**2))
    assert not second.candidates[:, :2].any()
    assert first.segments.tolist() == [[0, 200]]
    assert first.runs == ((0, 200),)


def test_a_gap_parts_segments_and_not_runs():
    y = noise(ROWS, 2)
    kept = (ROWS_S < 3.0) | (ROWS_S > 4.0)
    one = replace(trace(y), time_s=ROWS_S[kept], measured=y[kept])
    (found,) = made([one], [y[kept]])
    assert len(found.segments) == 2
    assert found.segments[0, 1] == found.segments[1, 0] == 60
    assert found.runs == ((0, len(found.values)),)


def test_each_runs_constant_and_trend_and_mismatch_are_known():
    column = np.cos(ROWS_S)
    usual = [columns_nuisance("machine", column), columns_nuisance("zero", column**2, shared=False)]
    runs = [trace(noise(ROWS, seed), number=seed) for seed in range(2)]
    (found,) = made(runs, [one.measured for one in runs], nuisance=[usual, usual])
    # two constants, two trends, one column of the machine, two of the runs
    assert found.known.shape == (400, 7)
    ones = np.concatenate([np.ones(200), np.zeros(200)])
    assert any(np.allclose(column, ones) for column in found.known.T)
    machine = np.tile(by_hand(np.cos(ROWS_S)), 2)
    assert any(np.allclose(column, machine) for column in found.known.T)


def test_what_a_run_shows_is_among_the_candidates():
    """A smooth function of the place, a velocity with its sign, a step: each is in the candidates' span."""
    (found,) = made([trace(noise(ROWS, 3))], [noise(ROWS, 3)])
    middle = 0.05 * (np.arange(200) + 0.5)
    inputs = motion()
    x = np.interp(middle, inputs.time_s, inputs.position_mm[:, 0])
    rate = np.gradient(inputs.q_cmd_rad[:, 1], inputs.time_s)
    step = (middle > 5.0).astype(float)
    wave = np.cos(2.0 * np.pi * (x - x.min()) / (x.max() - x.min()))
    for wanted in (wave, np.interp(middle, inputs.time_s, np.sign(rate)), step):
        closest = max(abs(np.corrcoef(column, wanted)[0, 1]) for column in found.candidates.T)
        assert closest > 0.9


def test_contrasts_of_repeats_have_nothing_of_what_the_runs_share():
    shared = 50.0 * np.sin(3.0 * ROWS_S)[:, None]
    runs = [trace(shared + noise(ROWS, seed), number=seed) for seed in range(3)]
    (found,) = made(runs, [one.measured - one.nominal for one in runs], repeats=True)
    assert found.runs == ((0, 200), (200, 400))
    single = [by_hand((one.measured - one.nominal)[:, 0]) for one in runs]
    np.testing.assert_allclose(found.values[:200], (single[0] - single[1]) / np.sqrt(2.0))
    expected = (single[0] + single[1] - 2.0 * single[2]) / np.sqrt(6.0)
    np.testing.assert_allclose(found.values[200:], expected)
    assert np.abs(found.values).max() < 3.0


# What noise is cleaned of: the same inputs as those of families, as columns of a component

LONG_ROWS = 1000
LONG_S = np.arange(0.0, 20.0, 0.02)


def spanned(columns, form):
    """Return the share of a form that columns and a constant explain."""
    design = np.column_stack([np.ones(len(form)), columns])
    centred = form - form.mean()
    left = form - design @ np.linalg.lstsq(design, form, rcond=None)[0]
    return 1.0 - left @ left / (centred @ centred)


def logged_torque():
    """Return a torque that no angle tells and that is no tone: it forgets within a second."""
    wave = lfilter([1.0], [1.0, -0.98], noise(LONG_ROWS, 11, 0.2)[:, 0])
    return np.column_stack([wave * (joint + 1.0) for joint in range(6)])


def one(residual, link="servo", **more):
    return trace(residual, link=link, inputs=replace(motion(20.0), **more))


def test_a_joint_has_its_own_torque_with_memory_among_its_columns():
    made = one(np.zeros((LONG_ROWS, 2)), torque_Nm=logged_torque())
    torque = Admissible(made).torque_Nm[:, 1]
    (first,), (second,) = explaining_columns([made])
    assert spanned(second, np.tanh(2.0 * torque)) > 0.99
    assert spanned(second, torque - Admissible(made).torque_with_memory(1)[:, 1]) > 0.999
    assert first.shape == second.shape


def test_a_tip_has_a_vector_that_turns_with_the_tool():
    made = one(np.zeros((LONG_ROWS, 3)), link="mechanics")
    _, (y,), _ = explaining_columns([made])
    vector = made.inputs.tool_rotation @ np.array([0.2, -0.1, 0.3])
    assert spanned(y, vector[:, 1]) > 0.999


def test_temperatures_are_columns_of_every_component():
    warm_C = (20.0 + np.cumsum(noise(LONG_ROWS, 4, 0.01)[:, 0]))[:, None]
    made = one(np.zeros((LONG_ROWS, 1)), temperature_C=warm_C)
    ((columns,),) = explaining_columns([made])
    assert spanned(columns, warm_C[:, 0]) > 0.999


def test_what_follows_the_torque_is_not_learnt_as_slow_noise():
    """Of three times the noise: without the torque, which is irregular, it could only be slow noise."""
    follows = 3.0 * np.tanh(logged_torque()[:, :1])
    residual = noise(LONG_ROWS, 7) + follows

    def slow_sigma(**more):
        made = one(residual, **more)
        (means,) = block_means([made], [residual], [np.zeros((1, LONG_ROWS, 0))], [[]], False)
        return sum(part.sigma for part in slow_parts_of(means))

    assert slow_sigma(torque_Nm=logged_torque()) < 0.2
    assert slow_sigma(torque_Nm=np.zeros((LONG_ROWS, 6))) > 1.0
