"""Another override: its size, and runs that show none."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import inputs_of
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.slips import override_slip
from tests.gap.synthetic import LIBRARY, TRUE_STEP_S, applied, prediction, runs


def _pair(percent, **signals):
    nominal = prediction(dt_s=TRUE_STEP_S)
    effects = applied(f"override:percent={percent}")
    run = runs(effects, 1, 3, base=nominal, normal=False, force=False, **signals)[0]
    return Pair(run=run, number=0, inputs=inputs_of(nominal))


@pytest.mark.slow
@pytest.mark.parametrize("signals", [{"tracker": False}, {"controller": False}])
def test_the_override_is_found_by_joints_or_by_the_tip(signals):
    (slip,) = override_slip([_pair(72, **signals)], LIBRARY)
    assert slip.applied["percent"] == pytest.approx(72.0, abs=0.2)
    assert slip.rms_after < 0.1 * slip.rms_before
    assert slip.words.startswith("the run was at 7")


def test_a_small_difference_is_left_to_the_time_laws():
    assert override_slip([_pair(97, tracker=False)], LIBRARY) == []


def test_another_path_is_no_override():
    pair = _pair(72, tracker=False)
    table = pair.run.controller
    rows = slice(0, int(0.8 * len(table.time_s)))
    shorter = replace(
        table,
        time_s=table.time_s[rows],
        row=table.row[rows],
        q_cmd_rad=table.q_cmd_rad[rows],
        q_act_rad=table.q_act_rad[rows],
        segments=np.array([[0, rows.stop]]),
    )
    assert override_slip([replace(pair, run=replace(pair.run, controller=shorter))], LIBRARY) == []


def test_a_log_alone_and_an_excluded_effect_show_none():
    pair = _pair(72, tracker=False)
    assert override_slip([replace(pair, from_log=True)], LIBRARY) == []
    assert override_slip([pair], {}) == []
