"""Runs whose rest is moved in time: what stands where the command is, and noise, which does not."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.gap.components import Place
from gcode2krl.gap.posterior.families import Columns, View, evidence_of, moved_evidence
from gcode2krl.gap.posterior.gram import SplitColumns
from gcode2krl.gap.posterior.study import Study
from gcode2krl.gap.thresholds import THRESHOLDS

COUNT, RUNS = 400, 3
"""Blocks of a run at 25 a second: 16 s."""


def command(number):
    """Return what the command gives (n, 2) in a run: a direction that turns back, and the way."""
    turns = np.sort(np.random.default_rng(90 + number).integers(0, COUNT, 8))
    rate = (-1.0) ** np.searchsorted(turns, np.arange(COUNT))
    return np.stack([rate, np.cumsum(rate) / 25.0], axis=1)


def view(rest):
    """Return the view of rests (n,) of runs of a tip's one component."""
    rows = COUNT * RUNS
    stretches = np.arange(rows) // 25
    return View(
        residual=np.concatenate(rest),
        tangents=np.zeros((rows, 0)),
        nuisance=SplitColumns(np.zeros((rows, 0)), (), 0),
        members=csr_array((np.ones(rows), (stretches, np.arange(rows)))),
        components=np.zeros(rows, dtype=int),
        runs=np.repeat(np.arange(RUNS), COUNT),
    )


def command_p(rest, on=Dependence.REVERSALS):
    columns = Columns(np.concatenate([command(number) for number in range(RUNS)]))
    parts = [command(number)[None] for number in range(RUNS)]
    place, roots = Place("tip", Where.TIP, [np.ones((1, COUNT, 1))] * RUNS), (np.eye(2),)
    found = evidence_of(view(rest), place, on, parts, columns, roots, np.ones((1, 48)))
    return Study(0.0, (found,), 1.0, moved=lambda: moved_evidence(view(rest), columns, roots)).command_p


def wander(draw):
    """Return noise with a long memory, bursts and heavy tails (n,): of unit variance in its calm rows."""
    slow = np.empty(COUNT)
    slow[0] = draw.standard_normal()
    pole = np.exp(-1.0 / (25.0 * draw.uniform(0.2, 5.0)))
    for i in range(1, COUNT):
        slow[i] = pole * slow[i - 1] + (1.0 - pole**2) ** 0.5 * draw.standard_normal()
    rest = draw.uniform(0.0, 3.0) * slow + draw.standard_t(4, COUNT)
    for at in draw.integers(0, COUNT - 10, draw.integers(0, 4)):
        rest[at : at + 10] += 8.0 * draw.standard_normal(10)
    return rest


def test_a_moved_run_is_the_run_and_all_its_components_move_together():
    values = np.random.default_rng(3).standard_normal((2, COUNT))
    both = View(
        residual=values.ravel(),
        tangents=np.zeros((2 * COUNT, 0)),
        nuisance=SplitColumns(np.zeros((2 * COUNT, 0)), (), 0),
        members=csr_array(np.ones((1, 2 * COUNT))),
        components=np.repeat([0, 1], COUNT),
        runs=np.zeros(2 * COUNT, dtype=int),
    )
    for row in both.moved.reshape(-1, 2, COUNT)[:7]:
        by = [k for k in range(COUNT) if np.allclose(np.abs(row), np.abs(np.roll(values, k, axis=1)))]
        assert len(by) == 1
        assert 0.04 * COUNT < by[0] < 0.96 * COUNT
        assert abs(float(np.sum(row * np.roll(values, by[0], axis=1)))) == pytest.approx(np.sum(values**2))


def test_what_turns_back_with_the_robot_is_no_noise():
    draw = np.random.default_rng(1)
    late = np.linspace(0.2, 1.0, COUNT)
    rest = [draw.standard_normal(COUNT) + 4.0 * late * command(number)[:, 0] for number in range(RUNS)]
    assert command_p(rest) <= THRESHOLDS.posterior.gap_p
    assert command_p(rest, Dependence.TRAVEL) == 1.0


def test_noise_with_a_memory_and_bursts_does_not_know_the_command():
    found = []
    for seed in range(400):
        draw = np.random.default_rng(seed)
        found.append(command_p([wander(draw) for _ in range(RUNS)]))
    assert sum(p <= THRESHOLDS.posterior.gap_p for p in found) <= 3
    assert sum(p < 1.0 for p in found) > 20
