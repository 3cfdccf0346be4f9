"""Triggers of different motions keep more than a cycle apart: each motion's start is read from samples."""

import numpy as np

from gcode2krl.krl.triggers import place_triggers
from gcode2krl.krl.windows import Windows
from tests.cells import over_demonstration

CYCLE_S, OFF_S = 0.012, 0.0015
"""A motion's start in the samples may be so far off on either side."""


def windows_of_short_motions(chance, count):
    """Return motions of 5 to 60 ms with corners of up to 4 ms between."""
    length, corner = chance.uniform(0.005, 0.060, count), chance.uniform(0.0, 0.004, count)
    begin = np.concatenate([[0.0], np.cumsum(length + corner)[:-1]])
    row = np.arange(1, count + 1)
    zero = np.zeros(count)
    return Windows(
        row,
        row,
        begin,
        begin + length,
        begin,
        begin + length,
        zero,
        zero,
        np.zeros(1),
        np.zeros(0),
        np.zeros(0),
    )


def test_triggers_of_two_motions_never_act_in_one_cycle():
    chance = np.random.default_rng(1)
    cell = over_demonstration()
    between = 0
    for _ in range(40):
        windows = windows_of_short_motions(chance, 60)
        knot_s = 0.5 + np.cumsum(chance.choice([CYCLE_S, 0.02, 0.1], 20))
        triggers = place_triggers(knot_s - 0.042, np.zeros(20), windows, cell)
        placed = triggers.row >= 0
        fire_s, row = triggers.fire_s[placed], triggers.row[placed]
        gap_s, other = np.diff(fire_s), np.diff(row) > 0
        between += int((gap_s[other] < 0.02).sum())
        assert (gap_s >= CYCLE_S - 1e-9).all()
        assert (gap_s[other] >= CYCLE_S + 2 * OFF_S - 1e-9).all()
    assert between > 50, "the case occurs"
