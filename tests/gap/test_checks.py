"""The checks of the runs as slips: which findings end the comparison, and as which effect."""

from dataclasses import replace

import pytest

from gcode2krl.effects import inputs_of
from gcode2krl.errors import Issue
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.compare.slips import check_slip, checked
from tests.gap.synthetic import LIBRARY, TRUE_STEP_S, prediction, runs


@pytest.fixture(scope="module")
def pair():
    run = runs([], 1, 3, base=prediction(dt_s=TRUE_STEP_S), normal=False, force=False)[0]
    return Pair(run=run, number=0, inputs=inputs_of(prediction(dt_s=TRUE_STEP_S)))


def _error(code, message="tracker.csv: column x_mm is odd"):
    return Issue("error", code, 2, message, "mend it")


def test_a_run_of_the_prediction_passes(pair):
    assert checked([pair]) == []
    assert check_slip([pair], LIBRARY, ()) == []


def test_swapped_columns_end_the_comparison(pair):
    tracker = pair.run.tracker
    swapped = replace(
        pair.run,
        tracker=replace(tracker, position_mm=tracker.position_mm[:, [1, 0, 2]], source="tracker.csv"),
    )
    issues = checked([replace(pair, run=swapped)])
    assert {issue.code for issue in issues} == {"run-axes"}
    (slip,) = check_slip([pair], LIBRARY, tuple(issues))
    assert (slip.applied.effect.name, slip.applied.target, slip.final) == ("unit", "tracker", True)
    assert slip.words == issues[0].message
    assert slip.rms_after is None


def test_a_log_alone_has_nothing_to_be_checked_against(pair):
    tracker = pair.run.tracker
    swapped = replace(
        pair.run,
        tracker=replace(tracker, position_mm=tracker.position_mm[:, [1, 0, 2]], source="tracker.csv"),
    )
    assert checked([replace(pair, run=swapped, from_log=True)]) == []


@pytest.mark.parametrize(
    ("code", "effect"), [("run-unit", "unit"), ("run-axes", "unit"), ("run-program", "other_program")]
)
def test_an_error_is_the_slip_of_its_code(pair, code, effect):
    (slip,) = check_slip([pair], LIBRARY, (_error("run-clock"), _error(code)))
    assert slip.applied.effect.name == effect


def test_warnings_and_excluded_effects_end_nothing(pair):
    warning = replace(_error("run-unit"), severity="warning")
    assert check_slip([pair], LIBRARY, (warning,)) == []
    without = {name: effect for name, effect in LIBRARY.items() if name != "unit"}
    assert check_slip([pair], without, (_error("run-unit"),)) == []
