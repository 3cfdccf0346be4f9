"""Models of noise: what comes back from noise whose model is known."""

import numpy as np
import pytest

from gcode2krl.gap.fit.noise import Noise, at_most, drawn_noise, fit, unbiased, white


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
    assert at_most(white(1.0), 1.4).sigma == 1.0
