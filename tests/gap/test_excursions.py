"""Excursions: a sway or a pull in one stretch is found by its nats; levels, bursts and tails are not."""

import numpy as np
import pytest
from scipy import stats

from gcode2krl.gap.compare.trace import Whose
from gcode2krl.gap.posterior.excursions import one_way, with_excursions
from tests.gap.constructed import likelihood, motion, trace

STEP_S, SECONDS, AT_S = 0.01, 20.0, 8.0
COUNT = round(SECONDS / STEP_S)
TIME_S = STEP_S * np.arange(COUNT)
WAY = np.array([0.6, 0.0, 0.8])
DRAWS = 40


def drawn(kind, seed):
    """Return noise (n, 3) of unit variance where it is calm."""
    generator = np.random.default_rng(seed)
    if kind == "heavy tails":
        return generator.standard_t(3.0, (COUNT, 3)) / np.sqrt(3.0)
    rows = generator.standard_normal((COUNT, 3))
    if kind == "bursts":
        for at_s in generator.uniform(0.0, SECONDS, 6):
            rows *= 1.0 + 6.0 * np.exp(-0.5 * ((TIME_S - at_s) / 0.15) ** 2)[:, None]
    return rows


def sway(nats):
    """Return a ring of 2.5 Hz that dies away, of so many nats in white noise of unit variance."""
    since = TIME_S - AT_S
    ring = np.where(since > 0.0, np.exp(-np.maximum(since, 0.0) / 0.6) * np.sin(5.0 * np.pi * since), 0.0)
    return np.sqrt(2.0 * nats / np.sum(ring**2)) * ring


def pull(nats):
    """Return what grows for half a second and ends at once."""
    pulled = np.where((TIME_S > AT_S - 0.5) & (TIME_S < AT_S), TIME_S - AT_S + 0.5, 0.0)
    return np.sqrt(2.0 * nats / np.sum(pulled**2)) * pulled


def level(lasts_s, height):
    since = TIME_S - AT_S
    return height * ((since > 0.0) & (since < lasts_s))


def events(values):
    """Return the events that are told of the rests (n, 3) of a tip in white noise of unit variance."""
    one = trace(values, "mechanics", inputs=motion(SECONDS, STEP_S))
    (found,) = with_excursions(likelihood([one]), [one.residual])
    return found.events


def test_the_share_of_a_window_is_hotellings():
    rows = drawn("white", 1)
    first = np.arange(0, COUNT - 20, 20)
    shares = one_way(rows, first, 20)
    window = rows[first[7] : first[7] + 20]
    total = window.sum(axis=0)
    assert shares[7] == pytest.approx(total @ np.linalg.inv(window.T @ window) @ total / 20.0, rel=1e-6)
    assert stats.kstest(shares, stats.beta(1.5, 8.5).cdf).pvalue > 0.01
    assert one_way(np.ones((20, 1)), np.array([0]), 20) == pytest.approx(1.0)


@pytest.mark.parametrize("kind", ["white", "heavy tails", "bursts"])
def test_noise_of_any_loudness_has_none(kind):
    """By chance one link in a thousand has one."""
    assert not any(events(drawn(kind, seed)) for seed in range(DRAWS))


@pytest.mark.parametrize("kind", ["white", "heavy tails"])
@pytest.mark.parametrize("form", [sway, pull])
def test_what_goes_one_way_is_found_by_its_nats(form, kind):
    """Four hundred nats nearly always are, and where they are; five never."""
    seen = [events(drawn(kind, seed) + np.outer(form(400.0), WAY)) for seed in range(20)]
    assert sum(map(bool, seen)) >= 18
    assert all(each.whose is Whose.IMPULSE for found in seen for each in found)
    assert all(AT_S - 0.6 < each.at_s < AT_S + 2.0 for found in seen for each in found)
    assert not any(events(drawn(kind, seed) + np.outer(form(5.0), WAY)) for seed in range(20))


def test_a_pull_is_told_when_it_ends():
    late_s = [
        each.at_s - AT_S
        for seed in range(10)
        for each in events(drawn("white", seed) + np.outer(pull(300.0), WAY))
    ]
    assert np.abs(late_s).max() < 0.02


@pytest.mark.parametrize("lasts_s", [0.3, 1.0, 4.0])
def test_levels_of_a_tracker_that_found_its_beam_again_are_none(lasts_s):
    assert not any(events(drawn("white", seed) + np.outer(level(lasts_s, 2.0), WAY)) for seed in range(10))
