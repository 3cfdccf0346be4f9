"""Models of short noise: what comes back from noise whose model is known, against dense covariances."""

import numpy as np
import pytest
from scipy.linalg import solve_triangular, toeplitz

from gcode2krl.gap.noise.short import (
    Noise,
    Slow,
    at_most,
    drawn_noise,
    drawn_slow,
    fit,
    innovation_gains,
    innovations,
    unbiased,
    white,
    without_lines,
)

# Models of noise: what comes back from noise whose model is known


def _segments(count):
    return np.array([[0, count]], dtype=np.int64)


@pytest.mark.parametrize("a", [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.6, 0.2, -0.1]])
def test_a_model_is_found_again_and_whitens(a):
    true = Noise(np.array(a), 0.3, 0.3)
    x = drawn_noise(true, 40_000, np.random.default_rng(1))
    found = fit([(x, _segments(len(x)))], 1e-9)
    np.testing.assert_allclose(found.a, a, atol=0.02)
    assert found.scale == pytest.approx(0.3, rel=0.02)
    assert found.sigma == pytest.approx(x.std(), rel=1e-3)
    e = found.whiten(x[:, None], _segments(len(x)))[10:, 0]
    assert e.std() == pytest.approx(1.0, rel=0.02)
    assert abs(np.corrcoef(e[1:], e[:-1])[0, 1]) < 0.02


def test_what_a_filter_takes_of_the_noise_is_given_back():
    """Half-second means are taken off coloured noise: sigma comes out too small, and right once corrected."""
    true = Noise(np.array([0.8, 0.0, 0.0]), 1.0, 1.0)

    def taken(values):
        blocks = values.reshape(-1, 50)
        return (blocks - blocks.mean(axis=1, keepdims=True)).ravel()

    sigma, biased, corrected = 1.0 / np.sqrt(1.0 - 0.64), [], []
    for seed in range(10):
        x = drawn_noise(true, 20_000, np.random.default_rng(seed))
        first = fit([(taken(x), _segments(len(x)))], 1e-9)
        z = drawn_noise(first, len(x), np.random.default_rng(100 + seed))
        again = fit([(taken(z), _segments(len(z)))], 1e-12)
        biased.append(first.sigma)
        corrected.append(unbiased(first, again, 1e-9).sigma)
    assert np.mean(biased) < 0.95 * sigma
    assert abs(np.mean(corrected) / sigma - 1.0) < 0.5 * abs(np.mean(biased) / sigma - 1.0)


def test_noise_is_no_more_than_it_is_stated_to_be():
    loud = Noise(np.array([0.9, 0.0, 0.0]), 1.0, 2.3)
    assert at_most(loud, 1.4).sigma == 1.4
    assert not at_most(loud, 1.4).a.any()
    assert np.hypot(1.4, at_most(loud, 1.4).beyond) == pytest.approx(loud.short_sigma)
    assert (at_most(white(1.0), 1.4).sigma, at_most(white(1.0), 1.4).beyond) == (1.0, 0.0)


@pytest.mark.parametrize("slow", [(), (Slow(0.97, 1.3),), (Slow(0.9, 0.5), Slow(0.995, 2.0))])
def test_whitening_is_the_inverse_cholesky_factor_of_the_covariance(slow):
    """Each segment by itself, from its first row on; the covariance is made of the autocovariance."""
    a = np.array([0.5, -0.3, 0.2])
    power = drawn_noise(Noise(a, 0.7, 1.0), 400_000, np.random.default_rng(1)).std()
    model = Noise(a, 0.7, steady_rms(a, 0.7), slow)
    assert model.short_sigma == pytest.approx(power, rel=0.01)
    values = np.random.default_rng(2).standard_normal((40, 2))
    segments = np.array([[0, 17], [17, 19], [19, 40]], dtype=np.int64)
    expected = np.empty_like(values)
    for first, last in segments:
        covariance = toeplitz(model.autocovariance(last - first))
        expected[first:last] = solve_triangular(
            np.linalg.cholesky(covariance), values[first:last], lower=True
        )
    np.testing.assert_allclose(model.whiten(values, segments), expected, rtol=1e-8, atol=1e-9)


def steady_rms(a, scale):
    """Return the rms of an autoregressive process, by its pulse response."""
    h = [1.0]
    for _ in range(300):
        h.append(sum(coefficient * h[-1 - lag] for lag, coefficient in enumerate(a) if lag < len(h)))
    return scale * float(np.sqrt(np.sum(np.square(h))))


def test_the_short_part_is_what_the_slow_one_leaves_of_the_lags():
    true = Noise(np.array([0.5]), 1.0, 1.0 / np.sqrt(0.75), (Slow(0.99, 1.5),))
    generator = np.random.default_rng(3)
    count = 100_000
    x = drawn_noise(true, count, generator)
    slow = [(drawn_slow(true.slow[0], count, generator), _segments(count))]
    found = fit([(x, _segments(count))], 1e-9, slow)
    np.testing.assert_allclose(found.a, [0.5, 0.0, 0.0], atol=0.05)
    assert found.short_sigma == pytest.approx(true.short_sigma, rel=0.05)
    # a slow part larger than the data is taken off only as far as a short part is left
    loud = [(4.0 * values, segments) for values, segments in slow]
    assert fit([(x, _segments(count))], 1e-9, loud).short_sigma > 0.3


def test_the_slow_part_is_no_more_than_an_instrument_may_wander():
    wild = Noise(np.zeros(0), 1.0, 1.0, (Slow(0.99, 7.0),))
    assert at_most(wild, np.inf).slow == (Slow(0.99, 2.0),)
    assert at_most(wild, 0.5).slow == (Slow(0.99, 1.0),)


def test_a_jump_at_a_gap_is_no_innovation():
    model = Noise(np.array([0.9, 0.0, 0.0]), 1.0, 2.3)
    x = np.concatenate([drawn_noise(model, 500, np.random.default_rng(i)) for i in (3, 4)])
    joined = model.whiten(x[:, None], _segments(1000))[3:, 0]
    parted = model.whiten(x[:, None], np.array([[0, 500], [500, 1000]]))[:, 0]
    np.testing.assert_allclose(np.delete(joined, range(497, 500)), np.delete(parted[3:], range(497, 500)))
    assert np.mean(parted**2) == pytest.approx(1.0, rel=0.15)


def test_the_fit_is_that_of_all_segments_together():
    """Against least squares on lags that were stacked by hand; the ridge is below the last digits shown."""
    generator = np.random.default_rng(5)
    x = drawn_noise(Noise(np.array([0.6, 0.2, -0.1]), 1.0, 1.0), 900, generator)
    segments = np.array([[0, 300], [300, 310], [310, 900]], dtype=np.int64)
    rows = [r for first, last in segments for r in range(first + 3, last)]
    past = np.array([[x[r - 1], x[r - 2], x[r - 3]] for r in rows])
    expected, left, _, _ = np.linalg.lstsq(past, x[rows], rcond=None)
    found = fit([(x, segments)], 1e-9)
    np.testing.assert_allclose(found.a, expected, rtol=1e-4, atol=1e-5)
    assert found.scale == pytest.approx(float(np.sqrt(left[0] / len(rows))), rel=1e-6)


def test_few_rows_are_white_and_no_noise_is_below_the_last_decimal():
    x = np.random.default_rng(6).standard_normal(30)
    short = fit([(x, _segments(30))], 1e-9)
    assert len(short.a) == 0
    assert short.sigma == pytest.approx(float(np.sqrt(np.mean(x**2))))
    assert fit([(0.0 * x, _segments(30))], 0.25).sigma == 0.25
    still = fit([(np.zeros(400), _segments(400))], 0.25)
    assert (still.sigma, still.scale) == (0.25, pytest.approx(0.3 * 0.25))


def test_what_hardly_decays_is_brought_to_decay():
    x = np.cumsum(np.random.default_rng(7).standard_normal(5000))
    found = fit([(x, _segments(len(x)))], 1e-9)
    poles = np.roots(np.concatenate([[1.0], -found.a]))
    assert np.abs(poles).max() <= 0.98 + 1e-9


# Innovations beside the dense covariance: variances, log determinant, and every row of a segment

A = np.array([0.9, -0.3])
SLOW = [(0.98, 1.5)]


def covariance(count):
    """Return that of the short part, by its pulse response, plus that of the slow one."""
    h = [1.0, A[0]]
    for _ in range(400):
        h.append(A[0] * h[-1] + A[1] * h[-2])
    h = np.array(h)
    short = 0.6**2 * np.array([h[: len(h) - k] @ h[k:] for k in range(count)])
    return toeplitz(short + SLOW[0][1] ** 2 * SLOW[0][0] ** np.arange(count))


def test_innovations_are_those_of_the_dense_covariance():
    count = 60
    gains, variances = innovation_gains(A, 0.6, SLOW, count)
    factor = np.linalg.cholesky(covariance(count))
    np.testing.assert_allclose(np.sqrt(variances), np.diag(factor), rtol=1e-7)
    assert np.sum(np.log(variances)) == pytest.approx(np.linalg.slogdet(covariance(count))[1], rel=1e-7)
    values = np.random.default_rng(1).standard_normal((count, 3))
    white = innovations(values, np.array([[0, count]]), A, SLOW, gains, variances)
    np.testing.assert_allclose(white, np.linalg.solve(factor, values), rtol=1e-6, atol=1e-9)


def test_the_gain_settles_and_is_then_kept():
    _, variances = innovation_gains(A, 0.6, SLOW, 5000)
    assert len(variances) < 2000
    whole = np.diag(np.linalg.cholesky(covariance(300))) ** 2
    np.testing.assert_allclose(variances, whole[: len(variances)], rtol=1e-6)
    np.testing.assert_allclose(variances[-1], whole[len(variances) :], rtol=1e-6)


def test_without_a_slow_part_it_is_the_autoregressive_filter():
    gains, variances = innovation_gains(A, 0.6, [], 50)
    x = np.random.default_rng(2).standard_normal((50, 1))
    white = innovations(x, np.array([[0, 50]]), A, [], gains, variances)[:, 0]
    np.testing.assert_allclose(white[2:], (x[2:, 0] - A[0] * x[1:-1, 0] - A[1] * x[:-2, 0]) / 0.6, rtol=1e-9)


# Tones are taken off noise, and nothing is where there is no tone

COUNT = 1500


def white_noise(seed):
    return np.random.default_rng(seed).standard_normal(COUNT)


@pytest.mark.parametrize("turns", [0.0523, 0.08317, 0.21])
@pytest.mark.parametrize("rms", [0.5, 5.0])
def test_a_tone_is_taken_off_and_the_noise_is_left(turns, rms):
    e = white_noise(1)
    tone = rms * np.sqrt(2.0) * np.sin(2.0 * np.pi * turns * np.arange(COUNT) + 0.4)
    left = without_lines(e + tone)
    assert np.std(left - e) < 0.1
    assert left.std() == pytest.approx(e.std(), rel=0.02)


def test_several_tones_go_one_after_the_other():
    n = np.arange(COUNT)
    tones = 3.0 * np.sin(0.3 * n) + 1.0 * np.sin(1.1 * n) + 0.5 * np.sin(0.72 * n)
    assert np.std(without_lines(white_noise(2) + tones) - white_noise(2)) < 0.15


def test_noise_without_a_tone_is_hardly_ever_touched():
    coloured = Noise(np.array([0.7, 0.1, -0.1]), 1.0, 1.0)
    for kind in (white_noise, lambda seed: drawn_noise(coloured, COUNT, np.random.default_rng(seed))):
        touched = sum(not np.array_equal(without_lines(kind(seed)), kind(seed)) for seed in range(200))
        assert touched <= 2


def test_a_short_signal_stays_as_it_is():
    x = np.sin(np.arange(100.0))
    np.testing.assert_array_equal(without_lines(x), x)
