"""What is loud for moments: a gap where it follows the command, an instrument's where it does not."""

import numpy as np

from gcode2krl.gap.posterior.examination import _share_in_step
from gcode2krl.gap.thresholds import THRESHOLDS

MOMENTS, ROWS, APART = 1000, 12, 6.0


def powers(rng, loudness=None):
    x = rng.normal(size=(MOMENTS, ROWS))
    return np.mean((x if loudness is None else x * loudness[:, None]) ** 2, axis=1)


def bursts(rng):
    """So many bursts as of a tenth of the time, each a dozen moments long, anywhere."""
    at = np.arange(MOMENTS)
    scale = sum(np.exp(-0.5 * ((at - start) / 3.0) ** 2) for start in rng.uniform(0, MOMENTS, 12))
    return 1.0 + 4.0 * scale


def corners(rng):
    """Where a command changes: a third of the time, in pieces of unequal length."""
    edges = np.cumsum(rng.integers(3, 25, 200))
    return (np.searchsorted(edges, np.arange(MOMENTS)) % 3) == 0


def test_bursts_of_an_instrument_fall_anywhere():
    rng = np.random.default_rng(1)
    told = sum(_share_in_step(powers(rng, bursts(rng)), corners(rng), 6, APART) > 0.0 for _ in range(400))
    assert told <= 4


def test_what_is_loud_at_corners_is_told_with_its_power():
    rng = np.random.default_rng(2)
    changes = np.arange(MOMENTS) % 20 < 3
    share = _share_in_step(powers(rng, np.where(changes, 3.0, 1.0)), changes, 6, APART)
    assert share == np.clip(
        share, 0.15 * 7.0, 0.15 * 9.0
    )  # nine times the power in .15 of the time, less one


def test_two_loud_moments_are_a_coincidence():
    power = np.ones(MOMENTS)
    power[[100, 500]] = 50.0
    changes = np.isin(np.arange(MOMENTS), [100, 500])
    assert THRESHOLDS.compare.in_step_least > 2
    assert _share_in_step(power, changes, 1, APART) == 0.0
