"""``predict_many``: the predictions of `predict`, in the order of the parts, and what a bad part does."""

import numpy as np
import pytest

from gcode2krl import Gcode2KrlError, load_cell, predict, predict_many
from tests.conftest import EXAMPLES

PART = "G21 G90 G17\nT1 M6\nS8000 M3\nG0 G43 H1 X0 Y0 Z20\nG1 Z-1 F500\nG1 X{x} F1000\nG0 Z20\nM30\n"


@pytest.fixture
def parts(tmp_path):
    files = [tmp_path / name for name in ("c.nc", "a.nc", "Größe 1.nc")]
    for number, file in enumerate(files):
        file.write_text(PART.format(x=20 + number), encoding="ascii")
    return files


def test_they_are_those_of_predict_in_the_order_given(parts):
    cell = load_cell()
    for file, many in zip(parts, predict_many(parts, cell, processes=2), strict=True):
        one = predict(file, cell)
        assert many.toolpath.source == one.toolpath.source
        np.testing.assert_array_equal(many.motion.time_s, one.motion.time_s)
        np.testing.assert_array_equal(many.forces.force_base_N, one.forces.force_base_N)
        np.testing.assert_array_equal(many.deflection.deflection_base_mm, one.deflection.deflection_base_mm)
        assert many.issues == one.issues


@pytest.mark.slow
def test_a_folder_comes_sorted(parts):
    found = [prediction.toolpath.source for prediction in predict_many(parts[0].parent, forces=False)]
    assert found == [str(file) for file in sorted(parts)]


def test_options_are_those_of_predict(parts):
    (found,) = predict_many(parts[:1], forces=False, dt_s=0.1)
    assert found.forces is None
    assert np.diff(found.motion.time_s)[0] == pytest.approx(0.1)


def test_a_bad_part_raises_when_it_is_its_turn(parts, tmp_path):
    found = predict_many([parts[0], tmp_path / "nothing.nc", parts[1]])
    assert next(found).toolpath.source == str(parts[0])
    with pytest.raises(Gcode2KrlError, match=r"nothing\.nc"):
        next(found)
    assert list(found) == []


@pytest.mark.slow
def test_a_bad_part_may_be_kept_as_its_error(parts, tmp_path):
    first, error, last = predict_many([parts[0], tmp_path / "nothing.nc", parts[1]], errors="keep")
    assert (first.toolpath.source, last.toolpath.source) == (str(parts[0]), str(parts[1]))
    assert (error.exit_code, error.issues[0].code) == (2, "file-unreadable")


def test_a_wrong_option_is_the_callers_error(parts):
    with pytest.raises(TypeError, match="tolerance"):
        predict_many(parts, tolerance=0.1)


def test_no_part_is_no_prediction():
    assert list(predict_many([])) == []
    assert len(EXAMPLES) > 3
