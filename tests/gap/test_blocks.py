"""Block means: of what rows, over which segments, and contrasts of repeats, by hand."""

from dataclasses import replace

import numpy as np

from gcode2krl.gap.noise.slow import block_means
from tests.gap.constructed import columns_nuisance, motion, noise, trace

COUNT = 500
"""Rows of 0.02 s; blocks of 0.05 s hold two or three."""
TIME_S = motion().time_s
BLOCK = np.floor(TIME_S / 0.05).astype(int)


def made(traces, residuals, signatures=None, nuisance=(), repeats=False):
    columns = signatures or [np.zeros((one.shape[1], len(one.time_s), 0)) for one in traces]
    usual = list(nuisance) or [[] for _ in traces]
    return list(block_means(traces, residuals, columns, usual, repeats))


def by_hand(values):
    return np.array([values[number == BLOCK].mean() for number in np.unique(BLOCK)])


def test_means_are_those_of_the_rows_in_each_twentieth_of_a_second():
    y = noise(COUNT, 1, width=2)
    form = np.sin(TIME_S)
    signature = np.stack([np.stack([form, form**2], axis=1), np.zeros((COUNT, 2))])
    first, second = made([trace(y)], [y], [signature])
    np.testing.assert_allclose(first.values, by_hand(y[:, 0]))
    np.testing.assert_allclose(second.values, by_hand(y[:, 1]))
    np.testing.assert_allclose(first.candidates[:, 0], by_hand(form))
    np.testing.assert_allclose(first.candidates[:, 1], by_hand(form**2))
    assert not second.candidates[:, :2].any()
    assert first.segments.tolist() == [[0, 200]]
    assert first.runs == ((0, 200),)


def test_a_gap_parts_segments_and_not_runs():
    y = noise(COUNT, 2)
    kept = (TIME_S < 3.0) | (TIME_S > 4.0)
    one = replace(trace(y), time_s=TIME_S[kept], measured=y[kept])
    (found,) = made([one], [y[kept]])
    assert len(found.segments) == 2
    assert found.segments[0, 1] == found.segments[1, 0] == 60
    assert found.runs == ((0, len(found.values)),)


def test_each_runs_constant_and_trend_and_mismatch_are_known():
    column = np.cos(TIME_S)
    usual = [columns_nuisance("machine", column), columns_nuisance("zero", column**2, shared=False)]
    runs = [trace(noise(COUNT, seed), number=seed) for seed in range(2)]
    (found,) = made(runs, [one.measured for one in runs], nuisance=[usual, usual])
    # two constants, two trends, one column of the machine, two of the runs
    assert found.known.shape == (400, 7)
    ones = np.concatenate([np.ones(200), np.zeros(200)])
    assert any(np.allclose(column, ones) for column in found.known.T)
    machine = np.tile(by_hand(np.cos(TIME_S)), 2)
    assert any(np.allclose(column, machine) for column in found.known.T)


def test_what_a_run_shows_is_among_the_candidates():
    """A smooth function of the place, a velocity with its sign, a step: each is in the candidates' span."""
    (found,) = made([trace(noise(COUNT, 3))], [noise(COUNT, 3)])
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
    shared = 50.0 * np.sin(3.0 * TIME_S)[:, None]
    runs = [trace(shared + noise(COUNT, seed), number=seed) for seed in range(3)]
    (found,) = made(runs, [one.measured - one.nominal for one in runs], repeats=True)
    assert found.runs == ((0, 200), (200, 400))
    single = [by_hand((one.measured - one.nominal)[:, 0]) for one in runs]
    np.testing.assert_allclose(found.values[:200], (single[0] - single[1]) / np.sqrt(2.0))
    expected = (single[0] + single[1] - 2.0 * single[2]) / np.sqrt(6.0)
    np.testing.assert_allclose(found.values[200:], expected)
    assert np.abs(found.values).max() < 3.0
