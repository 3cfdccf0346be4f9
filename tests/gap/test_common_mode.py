"""One lag or dead time of all axes is a rival of the commanded columns' clock, and the other way."""

import numpy as np
import pytest

from gcode2krl.effects import Applied, library
from gcode2krl.effects.builtin.servo_lag import ServoLag
from gcode2krl.effects.inputs import resampled
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.effects.operators import lag
from gcode2krl.gap.components import blocks_of
from gcode2krl.gap.noise.nuisance import Question
from gcode2krl.gap.posterior.judgement import judge
from tests.gap import constructed as c

pytestmark = pytest.mark.slow

SIGMA_RAD = 5e-6


class CommonLag(ServoLag):
    """All six servos follow with one lag."""

    name = "common_lag"

    def targets(self, cell):
        return (None,)

    def servo(self, q_act_rad, inputs, applied):
        tau_s = applied["tau_s"]
        return np.stack([lag(q, inputs.time_s, tau_s) for q in q_act_rad.T], axis=1)


class CommonDeadTime(CommonLag):
    """All six servos follow one time later."""

    name = "common_dead_time"

    def servo(self, q_act_rad, inputs, applied):
        return resampled(q_act_rad, inputs.time_s, inputs.time_s - applied["tau_s"])


LAG, DEAD_TIME, CLOCK = CommonLag(), CommonDeadTime(), library()["clock"]
BLOCKS = [
    *blocks_of(LAG, None),
    *blocks_of(DEAD_TIME, None),
    *blocks_of(CLOCK, "q_cmd"),
    *(block for joint in ("A1", "A2", "A3") for block in blocks_of(ServoLag(), joint)),
]


def told(applied):
    """Return the causes of the servo link for two runs with an effect, each with its declared set."""
    traces = []
    for number in range(2):
        made = c.trace(c.noise(500, number, SIGMA_RAD, 6), number=number)
        change = made.sample([applied]) - made.nominal
        traces.append(c.trace(change + made.residual, number=number))
    found = judge(c.LINK["servo"], traces, [], Question({}, BLOCKS, Mismatch(), frozenset()))
    return [(cause.applied, cause.probability, _declared(cause)) for cause in found.causes]


def _declared(cause):
    alike = {rival.applied.effect.name for rival, _ in cause.rivals if rival.alike}
    return {cause.applied.effect.name, *alike}


def test_one_lag_of_all_axes_is_no_clock():
    ((cause, probability, alike),) = told(Applied(LAG, None, {"tau_s": 0.02}))
    assert cause.effect is LAG
    assert cause["tau_s"] == pytest.approx(0.02, rel=0.02)
    assert probability > 0.5
    assert "clock" not in alike


@pytest.mark.parametrize("late_s", [0.004, 0.03])
@pytest.mark.parametrize("is_clock", [False, True])
def test_a_dead_time_and_a_clock_are_one_answer(late_s, is_clock):
    clock = Applied(CLOCK, "q_cmd", {"offset_s": -late_s, "skew": 0.0})
    ((_, probability, alike),) = told(clock if is_clock else Applied(DEAD_TIME, None, {"tau_s": late_s}))
    assert alike >= {"clock", "common_dead_time"}
    assert probability > 0.5


def test_a_lag_too_small_for_its_form_has_the_clock_in_its_set():
    """A first-order lag and a shift differ by tau squared: at this size by less than the noise."""
    ((_, _, alike),) = told(Applied(LAG, None, {"tau_s": 0.0008}))
    assert alike == {"clock", "common_lag", "common_dead_time"}
