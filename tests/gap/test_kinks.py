"""Rows at a kink of the path: where a clock is off by less than a sample they may be on either side of it."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.nuisance import nuisance_of
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.likelihood import Likelihood
from tests.gap.constructed import motion, trace

TURN_S, JUMP, SIGMA = 5.0, 0.2, 1e-6


def turning(rate_jump=JUMP):
    """Return inputs whose A2 turns back at once: its rate (rad/s) jumps by so much."""
    inputs = motion()
    q = inputs.q_cmd_rad.copy()
    q[:, 1] += 0.5 * rate_jump * np.abs(inputs.time_s - TURN_S)
    return replace(inputs, q_cmd_rad=q)


def test_a_kink_is_the_jump_of_the_rate_and_a_smooth_path_has_none():
    inputs = turning()
    own = trace(np.zeros((len(inputs.time_s), 6)), inputs=inputs)
    at = np.argmin(np.abs(own.time_s - TURN_S))
    assert own.kinks[at, 1] == pytest.approx(JUMP, rel=0.05)
    far = np.abs(own.time_s - TURN_S) > 0.1
    assert own.kinks[far].max() < 0.01 * JUMP
    assert own.kinks[:, 0].max() < 0.01 * JUMP


def test_a_row_beside_a_kink_counts_by_what_the_clock_is_sure_of():
    inputs = turning()
    own = trace(np.zeros((len(inputs.time_s), 6)), inputs=inputs)
    parts = nuisance_of(own, {}, Mismatch(), Signatures(), frozenset())
    data = Likelihood([own], [parts], [white(SIGMA)] * 6)
    late_s = 5e-4  # within the clock's bound: the lateness of a path that turns, less its rate times that
    q = np.interp(own.time_s - late_s, inputs.time_s, inputs.q_cmd_rad[:, 1]) - inputs.q_cmd_rad[:, 1]
    missed = q + late_s * np.gradient(inputs.q_cmd_rad[:, 1], inputs.time_s)
    assert np.abs(missed).max() > 20.0 * SIGMA
    white_ = data.white(0, 1, missed[:, None])
    assert np.abs(white_).max() < 3.0
