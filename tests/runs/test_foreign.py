"""Logs of other programs: read back to the right quantities, or asked about; never silently wrong."""

import numpy as np
import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.runs.foreign import guess_of, run_from
from tests.runs.foreign_layouts import ABC_DEG, LAYOUTS, PREDICTION, F, P, Q

WANTED = {
    "q_act": lambda run: (np.degrees(run.controller.q_act_rad), Q, 1e-4),
    "q_cmd": lambda run: (np.degrees(run.controller.q_cmd_rad), Q, 1e-4),
    "xyz_act": lambda run: (run.controller.position_act_mm, P, 1e-3),
    "xyz": lambda run: (run.tracker.position_mm, P, 1e-3),
    "force": lambda run: (run.force.force_N, F, 1e-3),
    "abc_act": lambda run: (np.degrees(run.controller.abc_act_rad), ABC_DEG, 1e-4),
}
NAMES = [layout.name for layout in LAYOUTS]


def written(layout, folder):
    file = folder / f"log{layout.ending}"
    file.write_bytes(layout.make())
    return file


def assert_right(run, layout):
    for signal in (*layout.holds, *filter(None, [layout.orientation])):
        values, truth, tolerance = WANTED[signal](run)
        np.testing.assert_allclose(values, truth, atol=tolerance)


@pytest.mark.parametrize("layout", LAYOUTS, ids=NAMES)
def test_a_log_alone_is_right_or_asked_about(layout, tmp_path):
    file = written(layout, tmp_path)
    if layout.answers:
        with pytest.raises(NotUnderstoodError) as caught:
            run_from(file)
        assert [issue.code for issue in caught.value.issues] == ["run-layout"]
    run = run_from(file, **layout.answers)
    assert_right(run, layout)
    tables = [t for t in (run.controller, run.tracker, run.force) if t is not None]
    assert all(0.9 < np.median(np.diff(t.time_s)) / (0.0005 if "kHz" in layout.name else 0.012) < 1.1 for t in tables)


@pytest.mark.parametrize("layout", LAYOUTS, ids=NAMES)
def test_a_prediction_answers_what_names_leave_open(layout, tmp_path):
    file = written(layout, tmp_path)
    if layout.open_beside_prediction:
        with pytest.raises(NotUnderstoodError):
            run_from(file, prediction=PREDICTION)
    else:
        assert_right(run_from(file, prediction=PREDICTION), layout)
