"""Tones of time and of a joint's angle."""

import numpy as np
import pytest

from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.posterior.study import angle_tones, tones
from tests.gap import constructed as c
from tests.gap.test_families import view_of

SIGNS = np.ones((1, 10))


def test_the_strongest_tone_comes_with_its_evidence():
    t = c.motion().time_s
    rows, view, grid = view_of([c.trace(np.sin(2.0 * np.pi * 7.7 * t)[:, None] + c.noise(500, 1))])
    found = list(tones(rows, view.at(0), grid.places[0], SIGNS))
    best = max(found, key=lambda each: each.nats)
    assert best.at == (-1, pytest.approx(7.7, abs=0.05))
    assert best.gain == pytest.approx(250.0, rel=0.3)  # 500 rows of power one half


def test_an_uneven_encoder_is_a_frequency_of_the_angle():
    """A hundred and thirty lines a turn, which no gear ratio explains."""
    q = c.joints(c.motion().time_s)[:, 0]
    values = [np.sin(130.0 * q)[:, None] + c.noise(500, seed) for seed in range(2)]
    rows, view, grid = view_of([c.trace(each, number=i) for i, each in enumerate(values)])
    (found,) = angle_tones(rows, view.at(0), grid.places[0], np.ones((1, 20)))
    assert found.on is Dependence.MOTOR_ANGLE
    assert found.at[1] == pytest.approx(130.0, abs=4.0)
    assert found.nats > 150.0
