"""The diagnosis from end to end, on logs of a motion made of sines; whole ones are in test_diagnose.py."""

import numpy as np
import pytest

from gcode2krl.effects import Applied, library, simulate
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gap.diagnosis import diagnose_log, known_effects
from tests.gap.constructed import Added, controller, motion, noise, pair

SIGMA_RAD = np.radians(3e-4)


def log(number, *effects):
    """Return a run's log with drives that do what effects say, and noise of their encoders."""
    inputs = motion(10.0, 0.012)
    actual = simulate(inputs, effects).q_act_rad + noise(len(inputs), number, SIGMA_RAD, 6)
    columns = {"q_cmd_rad": inputs.q_cmd_rad, "q_act_rad": actual}
    rounded = {name: np.radians(np.round(np.degrees(q), 5)) for name, q in columns.items()}
    return pair(controller=controller(inputs.time_s, **rounded), number=number).run


def named(gap):
    return [(cause.effect, cause.target) for cause in gap.named_causes]


def test_a_lag_of_one_drive_is_named_with_its_size():
    lag = Applied(library()["servo_lag"], "A3", {"tau_s": 0.012})
    gap = diagnose_log([log(i, lag) for i in range(2)])
    assert named(gap) == [("servo_lag", "A3")]
    assert gap.verdict == "explained"
    interval = gap.causes[0].parameters["tau_s"]
    assert interval.value == pytest.approx(0.012, rel=0.05)
    assert interval.low < 0.012 < interval.high
    # the rms of what lags, by hand
    rate = np.gradient(motion(10.0, 0.012).q_cmd_rad[:, 2], 0.012)
    before = np.degrees(np.sqrt(np.mean((0.012 * rate) ** 2) + 6.0 * SIGMA_RAD**2))
    assert gap.gap.rms_before == pytest.approx(before, rel=0.03)
    assert " ".join(each.link for each in gap.not_examined) == "timing path gear force mechanics part"


def test_drives_that_follow_are_no_gap():
    gap = diagnose_log([log(i) for i in range(2)])
    assert (gap.verdict, gap.causes) == ("no_gap", ())
    assert gap.gap.rms_before == pytest.approx(np.degrees(SIGMA_RAD) * np.sqrt(6.0), rel=0.05)
    assert gap.runs == ("run-1", "run-2")


def test_no_run_is_an_error():
    with pytest.raises(NotUnderstoodError, match="no run"):
        diagnose_log([])


def test_effects_of_ones_own_are_known_beside_the_library():
    own = Added("my_own", np.sin)
    known = known_effects([own])
    assert known["my_own"] is own
    assert set(library()) | {"my_own"} == set(known)
