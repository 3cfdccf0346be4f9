"""A diagnosis finds a step: in which run, when, where and how large."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from gcode2krl.gap import diagnose
from tests.gap.synthetic import applied, prediction, runs

BEGIN = datetime(2026, 3, 2, 8, 0, tzinfo=UTC)


def dated(*texts, **more):
    """Return three runs, half an hour apart as they are made."""
    made = runs(applied(*texts), 3, seed=11, **more)
    heads = [
        run.head.model_copy(update={"started": BEGIN + timedelta(hours=0.5 * n)})
        for n, run in enumerate(made)
    ]
    return [replace(run, head=head) for run, head in zip(made, heads, strict=True)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "target", "at_s", "size", "value"),
    [
        pytest.param(
            "step:target=tip,at_s=1806,size_mm=0.15,direction=0/0/1",
            "tip",
            1806.0,
            "size_mm",
            0.15,
        ),
        ("step:target=A2,at_s=7.5,size_deg=0.01", "A2", 7.5, "size_deg", 0.01),
    ],
)
def test_a_step_is_named_with_its_moment(text, target, at_s, size, value):
    found = diagnose(prediction(), dated(text, load_encoders=target != "tip")).as_dict()
    (cause,) = found["causes"]
    assert (cause["effect"], cause["target"]) == ("step", target)
    numbers = cause["parameters"]
    assert numbers["at_s"]["value"] == pytest.approx(at_s, abs=0.05)
    assert numbers["at_s"]["high"] - numbers["at_s"]["low"] < 0.5
    assert numbers[size]["value"] == pytest.approx(value, rel=0.05)
