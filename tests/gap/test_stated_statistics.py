"""Nuisance, signatures and fitted numbers follow from what effects state: on signals in closed form."""

import gc
import math
import weakref
from types import SimpleNamespace

import numpy as np
import pytest

from gcode2krl.effects import Effect, Mismatch, Parameter, Role
from gcode2krl.effects.mismatch import sigma
from gcode2krl.gap.compare.links import CLOCK, SERVO
from gcode2krl.gap.components import Block, Signatures, blocks_at, blocks_of
from gcode2krl.gap.noise.nuisance import nuisance_of
from gcode2krl.gap.posterior.least_squares import free_of

TIME_S = np.linspace(0.0, 2.0, 201)


class Signal:
    """As much of a trace as signatures and nuisance need: effects add up in one component."""

    link = SERVO
    shape = (len(TIME_S), 1)
    time_s = TIME_S
    inputs = SimpleNamespace(cell=None, time_s=TIME_S)
    nominal = np.zeros((len(TIME_S), 1))
    rate = clock_rate = np.ones((len(TIME_S), 1))
    kinks = np.zeros((len(TIME_S), 1))
    inputs = SimpleNamespace(time_s=TIME_S, cell=None)

    def __init__(self):
        self.simulated = 0

    def sample(self, applied):
        self.simulated += 1
        return sum((one.effect.shown(one) for one in applied), self.nominal)


def column(values):
    return values[:, None]


class Line(Effect):
    """Two sizes with bounds of their own: an offset and a slope."""

    name = "harmonic"
    links = frozenset({"servo"})
    is_nuisance = True
    parameters = (
        Parameter("phase", "", -1, 1, 0.0, 0.5, "test", linear=True, usual=lambda m: m.lag_s),
        Parameter("hz", "", -1, 1, 0.0, 0.1, "test", linear=True, usual=lambda m: 10.0 * m.lag_s),
        Parameter("free", "", -1, 1, 0.0, 0.1, "test", linear=True),
    )

    def shown(self, applied):
        return column(applied["phase"] + applied["hz"] * TIME_S)


class Sine(Effect):
    """An amplitude, a phase, a frequency and an order."""

    name = "sine"
    links = frozenset({"servo"})
    parameters = (
        Parameter("size", "", 0.0, 2.0, 0.0, 0.5, "test", linear=True),
        Parameter("turn", "rad", -math.pi, math.pi, None, 0.0, "test", grid=(0.0, 1.0), role=Role.PHASE),
        Parameter("order", "", 1.0, 9.0, None, 1.0, "test", grid=(1.0, 2.0), role=Role.COUNT),
        Parameter("beat", "Hz", 1.0, 9.0, None, 3.0, "test", grid=(2.0, 4.0, 8.0), role=Role.FREQUENCY),
    )

    def shown(self, applied):
        angle = 2.0 * np.pi * applied["order"] * applied["beat"] * TIME_S + applied["turn"]
        return column(applied["size"] * np.sin(angle))


def test_every_size_with_a_usual_bound_is_a_nuisance_of_its_own():
    found = nuisance_of(Signal(), {"harmonic": Line()}, Mismatch(lag_s=0.003), Signatures(), frozenset())
    named = {each.name: each for each in found}
    assert list(named) == ["harmonic phase", "harmonic hz", CLOCK]
    assert named["harmonic phase"].shared
    np.testing.assert_allclose(named["harmonic phase"].columns[0], sigma(0.003) * np.ones((201, 1)))
    np.testing.assert_allclose(named["harmonic hz"].columns[0], column(sigma(0.03) * TIME_S))


def test_no_bound_is_no_nuisance():
    found = nuisance_of(Signal(), {"harmonic": Line()}, Mismatch(lag_s=0.0), Signatures(), frozenset())
    assert [each.name for each in found] == [CLOCK]


def test_a_sine_is_spanned_by_two_amplitudes_and_read_back():
    block = Block(Sine(), None, {"order": 2.0, "beat": 3.0})
    signal = Signal()
    columns = Signatures().columns(block, signal)
    assert columns.shape == (1, 201, 2)
    truth = block.applied(np.array([0.6, -0.8]), signal)
    np.testing.assert_allclose(signal.sample([truth]), columns[0] @ np.array([[0.6], [-0.8]]), atol=1e-12)
    assert truth["size"] == pytest.approx(0.5)
    assert truth["turn"] == pytest.approx(math.atan2(-0.8, 0.6))
    low, high = block.bounds(signal)
    assert (low.tolist(), high.tolist()) == ([-4.0, -4.0], [4.0, 4.0])


def test_a_search_tries_orders_of_the_grid_and_frequencies_of_the_spectrum():
    grid = [block.shape for block in blocks_of(Sine(), None)]
    assert grid == [{"order": n, "beat": hz} for n in (1.0, 2.0) for hz in (2.0, 4.0, 8.0)]
    peaks = [block.shape for block in blocks_at(Sine(), None, (5.5, 6.5), 30.0)]
    assert peaks == [{"order": n, "beat": hz} for n in (1.0, 2.0) for hz in (5.5, 6.5)]
    assert list(blocks_at(Line(), None, (5.5,), 30.0)) == []


def test_a_fit_moves_sizes_whatever_they_are_called_and_keeps_counts():
    signal = Signal()
    line = Block(Line(), None).applied(np.array([1.0, 2.0, 0.0]), signal)
    free = free_of(line, signal)
    assert free.names == ("phase", "hz", "free")
    assert free.applied(np.array([-0.3, 0.2, 0.1])).values == {"phase": -0.3, "hz": 0.2, "free": 0.1}
    sine = Block(Sine(), None, {"order": 2.0, "beat": 3.0}).applied(np.array([1.0, 1.0]), signal)
    moved = free_of(sine, signal)
    assert moved.names == ("size", "turn", "beat")
    assert moved.low.tolist() == [-2.0, -2.0, 1.0]
    back = moved.applied(moved.start(sine))
    assert back["order"] == 2.0
    np.testing.assert_allclose(signal.sample([back]), signal.sample([sine]), atol=1e-12)


def test_columns_are_computed_once_a_trace_and_forgotten_with_it():
    known, block, signal, later = Signatures(), Block(Line(), None), Signal(), Signal()
    columns = known.columns(block, signal)
    assert known.columns(Block(Line(), None), signal) is columns
    assert signal.simulated == 3
    known.same(signal, later)
    assert known.columns(block, later) is columns
    assert later.simulated == 0
    assert known.columns(block, Signal()) is not columns
    gone = weakref.ref(signal)
    del signal
    gc.collect()
    assert gone() is None
    assert known.columns(block, later) is columns
