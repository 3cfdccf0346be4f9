"""Stops that nobody planned, and the times at which places are reached."""

import numpy as np
import pytest

from gcode2krl.gap.compare.clocks import gone
from gcode2krl.gap.compare.pair import pairs_of
from gcode2krl.gap.compare.slips import unplanned_stops
from gcode2krl.gap.diagnosis import known_effects
from tests.gap.synthetic import applied, refined, runs

pytestmark = pytest.mark.slow

SERVO = {"tracker": False, "force": False}


def _pairs(some):
    return list(pairs_of(refined(), some))


def test_stops_are_found_with_their_hold():
    some = runs(applied("advance_stop:count=2,hold_s=0.08"), 2, 5, **SERVO)
    (slip,), stopped = unplanned_stops(_pairs(some), known_effects([]))
    assert slip.applied.values["count"] == 2.0
    assert slip.applied.values["hold_s"] == pytest.approx(0.08, abs=0.005)
    assert slip.rms_after is not None
    assert slip.rms_after < 0.05 * slip.rms_before
    assert "stopped exactly" in slip.words
    assert len(stopped[0].inputs.time_s) > len(_pairs(some)[0].inputs.time_s)


@pytest.mark.parametrize(
    "text", [None, "velocity_rule:acc_cp_m_s2=1.2", "clock:target=controller,offset_s=0.2"]
)
def test_another_law_or_clock_is_no_stop(text):
    some = runs(applied(text) if text else [], 2, 5, **SERVO)
    assert unplanned_stops(_pairs(some), known_effects([]))[0] == []


def test_how_far_a_noisy_signal_has_gone():
    t = np.arange(0.0, 10.0, 0.01)
    x = np.where(t < 4.0, 50.0 * t, np.where(t < 6.0, 200.0, 200.0 + 50.0 * (t - 6.0)))
    noisy = np.column_stack([x, 0.0 * x]) + np.random.default_rng(1).normal(0.0, 0.02, (len(t), 2))
    _, raw = gone(t, noisy, 0.0)
    _, way = gone(t, noisy, 0.5)
    assert raw[-1] > 1.01 * 400.0  # standing still in noise looks like motion
    assert way[-1] == pytest.approx(400.0, rel=2e-3)
