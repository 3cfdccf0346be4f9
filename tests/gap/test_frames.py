"""Another base or tool: fitted numbers, what shifts the path alike, and what is no frame."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.effects import inputs_of
from gcode2krl.gap.compare.pair import Pair
from gcode2krl.gap.posterior.set_up import frame_slip, frame_values
from tests.gap.synthetic import LIBRARY, TRUE_STEP_S, applied, prediction, runs


@functools.cache
def _nominal():
    """Return a prediction whose cell has one tool that is 40 mm longer than the others, T5."""
    nominal = prediction(dt_s=TRUE_STEP_S)
    tool = nominal.cell.tool[5]
    longer = tool.model_copy(update={"length_mm": nominal.cell.frames.tool_length_mm + 40.0})
    return replace(nominal, cell=nominal.cell.model_copy(update={"tool": {**nominal.cell.tool, 5: longer}}))


def _pair(text):
    run = runs(applied(text), 1, 3, base=_nominal(), normal=False, tracker=False, force=False)[0]
    return Pair(run=run, number=0, inputs=inputs_of(_nominal()))


def test_the_base_is_fitted_beside_a_clock():
    text = "base_number:x_mm=30,y_mm=-12,z_mm=4,a_deg=2,b_deg=0.5"
    pair = _pair(text)
    late = replace(pair, clock_s={"controller": 0.003})
    (slip,) = frame_slip([late], LIBRARY)
    truth = applied(text)[0]
    for name, value in truth.values.items():
        assert slip.applied[name] == pytest.approx(value, abs=2e-3), name
    assert slip.alike == ()
    assert slip.words.startswith("the commanded joints are those of base")


def test_another_tool_that_is_a_mere_shift_may_be_a_base_as_well():
    (slip,) = frame_slip([_pair("tool_number:target=5")], LIBRARY)
    assert (slip.applied.effect.name, slip.applied.target) == ("tool_number", "5")
    assert slip.words == "the commanded joints are those of tool 5"
    assert slip.alike == (("base_number", None),)


@pytest.mark.parametrize("text", ["base_number:x_mm=0.05", "servo_lag:target=A1,tau_s=0.01"])
def test_small_differences_are_no_other_frame(text):
    assert frame_slip([_pair(text)], LIBRARY) == []


def test_only_effects_of_the_library_are_tried():
    pair = _pair("base_number:x_mm=30,a_deg=2")
    assert frame_slip([pair], {}) == []
    assert frame_slip([pair], {"tool_number": LIBRARY["tool_number"]}) == []


def test_a_rotation_and_a_shift_are_the_values_of_a_frame():
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    values = frame_values(np.array([1.0, 2.0, 3.0]), turn)
    assert values == pytest.approx(
        {"x_mm": 1.0, "y_mm": 2.0, "z_mm": 3.0, "a_deg": 90.0, "b_deg": 0.0, "c_deg": 0.0}
    )
