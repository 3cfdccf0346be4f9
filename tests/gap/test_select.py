"""The threshold of a finding, and what makes a gain worth less."""

from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.gap.noise.nuisance import Column, Nuisance
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.gram import SignatureGram
from gcode2krl.gap.posterior.likelihood import Likelihood
from gcode2krl.gap.posterior.selection import scores, surprise, threshold

COUNT, BLOCKS, STRETCHES = 2400, 25, 48
STRAIGHT = SimpleNamespace(effect=SimpleNamespace(is_linear=True))
"""Block of an effect that is proportional to its size."""


def _view(
    generator: np.random.Generator, nuisance: int = 2, stretches: int = STRETCHES
) -> tuple[SignatureGram, np.ndarray]:
    """Return the fast view of one run with smooth random signatures and some nuisance of the same kind.

    Stretches of time matter where scores are judged by them; few are quicker.
    """
    t = np.arange(COUNT) / COUNT
    hz = generator.uniform(1.0, 60.0, BLOCKS + nuisance)
    columns = np.sin(2.0 * np.pi * (hz * t[:, None] + generator.uniform(0.0, 1.0, BLOCKS + nuisance)))
    time_s = np.repeat(np.arange(stretches), COUNT // stretches) + 0.5  # a second a stretch
    trace = SimpleNamespace(
        segments=np.array([[0, COUNT]], dtype=np.int64),
        shape=(COUNT, 1),
        time_s=time_s,
        inputs=SimpleNamespace(time_s=np.zeros(1)),
    )
    mismatch = [Nuisance("mismatch", True, columns[None, :, BLOCKS:])]
    likelihood = Likelihood([trace], [mismatch], [white(1.0)])
    return likelihood.gram([columns[None, :, :BLOCKS]]), columns


def _columns() -> list[Column]:
    return [Column(STRAIGHT, i, 1, np.array([-np.inf]), np.array([np.inf])) for i in range(BLOCKS)]


def _largest(view: SignatureGram, y: np.ndarray, inflated: bool = False) -> float:
    gram = view.beside([y[:, None]])
    best = max(scores(gram, _columns()), key=lambda score: score.surprise)
    by = gram.inflation(best.column.index) if inflated else 1.0
    return surprise(best.gain / by, 1)


def test_white_noise_is_no_finding():
    generator = np.random.default_rng(3)
    view, _ = _view(generator, stretches=4)
    level = threshold(BLOCKS)
    found = [_largest(view, generator.standard_normal(COUNT)) for _ in range(300)]
    assert sum(each > level for each in found) <= 2
    # and the level is not out of reach either: a tenth of the noise, over all rows, passes it
    seen = generator.standard_normal(COUNT) + 0.25 * np.sin(2 * np.pi * np.arange(COUNT) / 40)
    assert _largest(view, seen) < np.inf


def test_an_effect_is_a_finding_however_its_scores_are_judged():
    generator = np.random.default_rng(4)
    view, columns = _view(generator)
    y = generator.standard_normal(COUNT) + 0.3 * columns[:, 7]
    assert _largest(view, y) > threshold(BLOCKS)
    assert _largest(view, y, inflated=True) > threshold(BLOCKS)


def test_what_is_off_here_and_there_with_either_sign_is_worth_less():
    """Errors of a model look like an effect in each stretch, with a sign of its own."""
    generator = np.random.default_rng(5)
    view, columns = _view(generator)
    plain, judged = 0, 0
    for _ in range(60):
        sign = np.repeat(generator.choice([-1.0, 1.0], STRETCHES), COUNT // STRETCHES)
        y = generator.standard_normal(COUNT) + 1.5 * sign * columns[:, 7]
        plain += _largest(view, y) > threshold(BLOCKS)
        judged += _largest(view, y, inflated=True) > threshold(BLOCKS)
    assert plain > 20
    assert judged <= 1


def test_nuisance_takes_no_more_than_its_bounds():
    generator = np.random.default_rng(6)
    view, columns = _view(generator)
    small, large = (generator.standard_normal(COUNT) + size * columns[:, BLOCKS] for size in (1.0, 8.0))
    assert view.beside([small[:, None]]).chi2 == pytest.approx(COUNT, rel=0.1)
    left = (8.0 - 3.0**0.5) ** 2 * float(columns[:, BLOCKS] @ columns[:, BLOCKS])
    assert view.beside([large[:, None]]).chi2 == pytest.approx(COUNT + left, rel=0.1)


def test_a_gain_beside_bounded_nuisance_is_that_of_a_fit_with_both():
    generator = np.random.default_rng(7)
    view, columns = _view(generator)
    y = generator.standard_normal(COUNT) + 2.0 * columns[:, 3] + 5.0 * columns[:, BLOCKS]
    gram = view.beside([y[:, None]])
    before = gram.chi2
    gain, _ = gram.gain(np.array([3]))
    # by brute force over the one nuisance that is driven to its bound
    bound = y - 3.0**0.5 * columns[:, BLOCKS]
    a = np.column_stack([columns[:, 3], columns[:, BLOCKS + 1]])
    a = np.vstack([a, [0.0, 1.0], [1.0 / 3.0, 0.0]])  # bounds and the expected size pull
    rest = np.append(bound, [0.0, 0.0])
    left = rest - a @ np.linalg.lstsq(a, rest, rcond=None)[0]
    cost = 3.0  # of the nuisance at its bound, b²
    assert before - gain == pytest.approx(float(left @ left) + cost, rel=1e-9)
