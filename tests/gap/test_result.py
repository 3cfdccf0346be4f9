"""The typed result: frozen, and which causes count as named."""

from dataclasses import FrozenInstanceError, fields, is_dataclass

import pytest

from gcode2krl.gap.answer import result
from gcode2krl.gap.posterior.judgement import NAMED


def _cause(probability):
    return result.CauseResult(
        effect="backlash",
        target="A2",
        link="gear",
        probability=probability,
        parameters={},
        shrink=None,
        rms_after=None,
    )


def _gap(*probabilities):
    return result.Gap(
        verdict="explained",
        gap=result.GapSize(signal="tcp", unit="mm"),
        links=(),
        where=result.Where(),
        causes=tuple(_cause(probability) for probability in probabilities),
        unexplained=result.Unexplained(rms=None, significant=False, structure="unknown"),
        not_examined=(),
    )


def test_causes_are_named_from_one_half_on():
    gap = _gap(0.9, NAMED, NAMED - 1e-9, 0.1)
    assert [cause.probability for cause in gap.named_causes] == [0.9, NAMED]
    assert [cause.is_named for cause in gap.causes] == [True, True, False, False]


def test_results_are_frozen():
    classes = [
        each for each in vars(result).values() if is_dataclass(each) and each.__module__ == result.__name__
    ]
    assert {"Gap", "GapSize", "LinkResult", "CauseResult", "Where", "IntervalResult"} <= {
        c.__name__ for c in classes
    }
    for cls in classes:
        assert cls.__dataclass_params__.frozen, cls
    gap = _gap(0.9)
    with pytest.raises(FrozenInstanceError):
        gap.verdict = "no_gap"


def test_nothing_compared_is_none_and_not_zero():
    size = result.GapSize(signal="tcp", unit="mm")
    assert {getattr(size, entry.name) for entry in fields(size)[2:]} == {None, False, ()}
