"""Whole: causes that one program cannot tell apart, the run that is proposed, and the answer after it."""

import pytest

from gcode2krl.canned import draft_of, place_of, predicted
from gcode2krl.gap.answer.result import EffectAt
from gcode2krl.gap.diagnosis import diagnose
from tests.gap.synthetic import applied, prediction, runs


def alike(gap):
    """Return the effects that the causes cannot be told from."""
    every = [each for cause in gap.causes for each in cause.indistinguishable_from]
    return {each.effect for each in every if isinstance(each, EffectAt)}


@pytest.mark.slow
def test_the_proposed_run_tells_tool_from_base():
    tool = applied("tool_frame:x_mm=0.3,y_mm=0.2")
    first = diagnose(prediction(), runs(tool, 3, 5, force=False))
    assert first.next_run is not None
    assert "base_frame" in alike(first)
    assert first.next_run.program == "orientation"
    assert first.next_run.separates[0].odds > 100.0

    cell = prediction().cell
    draft = draft_of(first.next_run.program, place_of(cell))
    fine, planned = predicted(draft, cell, 0.003), predicted(draft, cell, 0.012)
    second = diagnose(planned, runs(tool, 1, 6, base=fine, force=False, normal=False))
    named = [(cause.effect, cause.is_named) for cause in second.causes]
    assert named[0] == ("tool_frame", True)
    assert "base_frame" not in alike(second)
