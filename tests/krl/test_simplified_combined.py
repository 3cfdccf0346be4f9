"""Merged moves together with what else changes a program: compensation, restart, the pilot force, RSI."""

import math

import numpy as np
import pytest

from gcode2krl import Prediction, predict, read_gcode, set_targets, write_krl
from gcode2krl.cell import resolve_cell
from gcode2krl.pipeline import predict_toolpath
from gcode2krl.restart.material import restarted
from gcode2krl.translation.compensation import compensated
from tests.krl.conftest import verified

CELL = resolve_cell(
    {
        "based_on": "demonstration",
        "material": {"relative_band": 0.1},
        "stock": {"box_mm": [[-20, -20, -10], [100, 30, 0]], "resolution_mm": 0.5},
    }
)
WAVE = "".join(f"X{x / 4:.3f} Y{3 * math.sin(x / 40):.3f}\n" for x in range(1, 321))
PART = (
    "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\nG0 X-20 Y0\nG0 Z5\nG1 Z-2 F600\nX0 F1500\n"
    f"{WAVE}G0 Z30\nM5\nM30\n"
)


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    path = tmp_path_factory.mktemp("wave") / "wave.nc"
    path.write_text(PART)
    return path


@pytest.fixture(scope="module")
def prediction(part):
    return predict(part, CELL, simplify_mm=0.01)


def test_compensated_targets_keep_to_the_original_within_the_correction(part, prediction, tmp_path):
    moved = compensated(prediction, None)
    assert moved.targets.correction_mm > 0.05
    program = write_krl(moved, tmp_path / "wave.src")
    figures = program.report.original
    assert figures.limit_mm == pytest.approx(0.011 + moved.targets.correction_mm)
    assert figures.left_out > 200
    moved.save(tmp_path / "saved")
    loaded = Prediction.load(tmp_path / "saved")
    assert loaded.targets.correction_mm == moved.targets.correction_mm
    toolpath = read_gcode(part, CELL)
    report = verified(tmp_path / "wave.src", toolpath, CELL, prediction=loaded)
    assert report.ok, report.issues


def test_a_pilot_force_cuts_long_moves_and_still_agrees(part, prediction, tmp_path):
    program = write_krl(prediction, tmp_path / "wave.src", pilot="values")
    assert len(program.targets) > len(prediction.targets)  # pieces for triggers
    assert program.report.original.left_out > 200
    report = verified(tmp_path / "wave.src", read_gcode(part, CELL), CELL, simplify_mm=0.01)
    assert report.ok, report.issues


def test_a_restart_is_simplified_from_its_line_on(part, tmp_path):
    begun = restarted(read_gcode(part, CELL), 200, CELL)
    prediction = predict_toolpath(begun, CELL, simplify_mm=0.01)
    way = begun.restart.way_rows
    assert np.isin(np.arange(1, way + 1), prediction.targets.move).all()
    assert prediction.targets.simplified.left_out > 50
    program = write_krl(prediction, tmp_path / "wave.src")
    assert program.report.original.left_out > 50
    report = verified(tmp_path / "wave.src", begun, CELL, simplify_mm=0.01)
    assert report.ok, report.issues


def test_a_program_corrected_online_is_simplified(part, prediction, tmp_path):
    program = write_krl(prediction, tmp_path / "wave.src", online="WAVE_RSI")
    assert program.report.original.left_out > 200
    report = verified(tmp_path / "wave.src", read_gcode(part, CELL), CELL, simplify_mm=0.01)
    assert report.ok, report.issues


def test_forces_are_those_of_nearly_the_same_path(part, prediction):
    whole = predict(part, CELL)
    largest = [np.linalg.norm(each.forces.force_base_N, axis=1).max() for each in (whole, prediction)]
    assert largest[1] == pytest.approx(largest[0], rel=0.25)
    assert prediction.motion.time_s[-1] < 0.8 * whole.motion.time_s[-1]


def test_a_spin_that_changes_does_not_keep_moves_apart(part):
    """The turn about the tool's own axis is free, so only the axis counts."""
    cell = CELL.model_copy(update={"frames": CELL.frames.model_copy(update={"spin": "auto"})})
    targets = set_targets(read_gcode(part, cell), cell, None, 0.01)
    assert targets.simplified.left_out > 200
