"""What a link's model says of the joints, for the links behind it: effects and mismatch, and no encoder."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.components import Signatures
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.examination import fitted_signal
from tests.gap.constructed import (
    applied,
    joint_rates,
    motion,
    noise,
    question,
    stub,
    trace,
    wave,
)

SIGMA = 1e-5
INPUTS = motion()
EFFECT = wave(2.0)


def fitted(one, effects=(), asked=None, stamps_s=None):
    """Return what the fitted model says of a trace, from as much of an examination as that takes."""
    known = [white(SIGMA)] * one.shape[1]
    data = stub(known=Signatures())
    found = stub(applied=tuple(effects), noise=known, question=asked or question([]), data=data)
    return fitted_signal(one, found, stamps_s)


def test_the_effect_without_the_noise_is_what_later_links_see():
    found = fitted(trace(noise(500, 1, SIGMA)), [applied(EFFECT, 0.01)])
    np.testing.assert_allclose(found[:, 0], 0.01 * EFFECT.form(INPUTS.time_s), atol=1e-12)


def test_mismatch_that_fits_is_part_of_it():
    """A lag of 0.3 ms is no cause, and all the same the joint stands where it makes it stand."""
    late = -3e-4 * joint_rates(INPUTS.time_s)
    one = trace(late + noise(500, 2, 1e-7, 6))
    asked = replace(question([]), library={"servo_lag": library()["servo_lag"]})
    np.testing.assert_allclose(fitted(one, (), asked)[1:], late[1:], rtol=0.2, atol=1e-5)  # from rest
    assert not fitted(one).any()


def test_zeros_and_clocks_of_load_encoders_stay_out():
    nominal = trace(np.zeros((500, 6)), "gear")
    shown = np.full((500, 6), 0.003) + noise(500, 3, SIGMA, 6)
    late = Applied(library()["clock"], "q_load", {"offset_s": 0.01, "skew": 0.0})
    one = trace(shown + nominal.sample([late]) - nominal.nominal, "gear")
    play_rad = Mismatch().play_rad / 2.0  # where in it a joint begins is motion, not instrument
    assert np.abs(fitted(one, [late])).max() < play_rad
    moved = replace(one, plus_late_s=0.01)
    assert np.abs(fitted(moved)).max() < play_rad


def test_play_behind_the_gear_stays_in():
    nominal = trace(np.zeros((500, 6)), "gear")
    play = Applied(library()["backlash"], "A2", {"gap_deg": 0.02})
    shape = nominal.sample([play]) - nominal.nominal
    found = fitted(trace(shape + 0.003, "gear"), [play])
    np.testing.assert_allclose(found, shape, atol=1e-7)
    assert np.abs(shape).max() == pytest.approx(np.radians(0.01))


def test_rows_that_were_left_out_have_a_model_too():
    """A line across the rows of a burst, where a joint turned about, was 0.1 degrees off."""
    whole = trace(noise(500, 1, SIGMA), number=0)
    change = 0.01 * EFFECT.form(INPUTS.time_s)[:, None]
    kept = np.abs(INPUTS.time_s - 1.0) > 0.1
    segments = np.array([[0, np.argmin(kept)], [np.argmin(kept), kept.sum()]])
    cut = replace(
        whole, time_s=whole.time_s[kept], measured=(whole.measured + change)[kept], segments=segments
    )
    found = fitted(cut, [applied(EFFECT, 0.01)], stamps_s=INPUTS.time_s)
    np.testing.assert_allclose(found, change, atol=1e-12)
