"""The slow part of noise: found where it is, of its size, and never what a drift, a step or an effect is."""

import numpy as np
import pytest

from gcode2krl.gap.noise.short import Slow, drawn_slow
from gcode2krl.gap.noise.slow import BlockMeans, slow_parts_of

pytestmark = pytest.mark.slow

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


def test_short_noise_has_no_slow_part():
    assert [slow_parts_of(means(lambda *_: 0.0, seed)) for seed in range(10)] == [()] * 10


def test_memories_of_45_ms_are_short():
    kept = Slow(0.33, SHORT)
    found = [slow_parts_of(means(lambda _, g: drawn_slow(kept, COUNT, g), seed)) for seed in range(10)]
    assert found == [()] * 10


@pytest.mark.parametrize("time_constant_s", [0.1, 0.3, 1.0, 3.0])
def test_the_slow_part_comes_out_beside_constants_and_trends(time_constant_s):
    """What constants and trends take of it is allowed for: within a factor of two in time, 40 % in size."""
    found = [slow_parts_of(means(wandering(time_constant_s), seed)) for seed in range(12)]
    assert all(found)
    sigma = np.median([rms(parts) for parts in found])
    assert sigma == pytest.approx(1.0, rel=0.2 if time_constant_s < 2.0 else 0.4)
    ratio = np.median([parts[0].time_constant_s for parts in found]) / time_constant_s
    assert 0.5 <= ratio <= 2.0


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


def test_an_effect_beside_slow_noise_leaves_the_noise_as_it_is():
    form = np.tile(np.sign(np.sin(2.0 * np.pi * TIME_S / 4.1)), RUNS)
    slow = wandering(0.3)
    found = []
    for seed in range(8):
        both = means(lambda run, g: slow(run, g) + 2.0 * form[:COUNT], seed, form[:, None])
        found.append(rms(slow_parts_of(both)))
    assert np.median(found) == pytest.approx(1.0, rel=0.2)


def test_few_blocks_tell_nothing():
    few = means(wandering(0.3))
    cut = BlockMeans(few.values[:40], np.array([[0, 40]]), few.known[:40], few.candidates[:40], ((0, 40),))
    assert slow_parts_of(cut) == ()
