"""The JSON object: keys in the order of the contract, plain values, what is left out."""

import json
from dataclasses import dataclass

import numpy as np
import pytest

from gcode2krl.errors import Issue
from gcode2krl.gap.answer.result import (
    SCHEMA,
    CauseResult,
    DependsOnResult,
    EffectAt,
    Gap,
    GapSize,
    LinkResult,
    NotExamined,
    RivalResult,
    Unexplained,
    UnknownAt,
    Where,
    plain,
)
from gcode2krl.gap.posterior.cause_tests import Interval


def _cause(**more):
    return CauseResult(
        effect="backlash",
        target="A2",
        link="gear",
        probability=0.9,
        parameters={"gap_deg": Interval(np.float64(0.02), 0.01, 0.03)},
        shrink=None,
        rms_after=0.1,
        **more,
    )


def _link(**more):
    return LinkResult(
        link="gear", rms_before=1.0, rms_after=0.5, floor=0.4, unit="deg", verdict="explained", **more
    )


def _gap(**more):
    given = {
        "verdict": "explained",
        "gap": GapSize(signal="joint_load", unit="deg"),
        "links": (_link(),),
        "where": Where(),
        "causes": (_cause(),),
        "unexplained": Unexplained(rms=float("nan"), significant=False, structure="white"),
        "not_examined": (NotExamined(link="force", needs="force.csv"),),
    }
    return Gap(**(given | more))


def test_the_keys_are_those_of_the_contract_in_their_order():
    found = _gap().as_dict()
    assert list(found) == [
        "schema",
        "verdict",
        "gap",
        "at_part",
        "links",
        "where",
        "events",
        "causes",
        "unexplained",
        "not_examined",
        "observable",
        "next_run",
        "runs",
        "notes",
        "issues",
    ]
    assert found["schema"] == SCHEMA
    assert list(found["gap"]) == [
        "signal",
        "unit",
        "rms_before",
        "rms_after",
        "noise_floor",
        "max_before",
        "max_after",
        "shrink",
        "held_out",
        "per_run",
    ]
    assert list(found["where"]) == [
        "signals",
        "intervals",
        "direction_base",
        "phases",
        "joints",
        "frequency_hz",
    ]


def test_keys_of_some_causes_and_links_are_left_out_and_others_are_null():
    plain_keys = ["effect", "target", "link", "probability", "parameters", "shrink", "rms_after"]
    kind = ["family", "family_probability", "form_fits", "constant", "tests"]
    assert list(plain(_cause())) == [*plain_keys, "indistinguishable_from", *kind]
    slip = plain(_cause(words="the run was at 50 % override"))
    assert list(slip) == [*plain_keys, "words", "indistinguishable_from", *kind]
    compared = plain(_cause(rivals=(), indistinguishable_from=(EffectAt("mastering", None),)))
    assert list(compared) == [*plain_keys, "indistinguishable_from", "rivals", *kind]
    assert compared["indistinguishable_from"] == [{"effect": "mastering", "target": None}]
    assert (compared["rivals"], compared["shrink"]) == ([], None)
    assert "offset_deg" not in plain(_link())
    assert plain(_link(offset_deg={"A1": 0.5}))["offset_deg"] == {"A1": 0.5}


def test_a_moment_has_two_names_and_an_unknown_may_be_in_a_declared_set():
    at = DependsOnResult(
        link="gear", at="A2", on="time in the run", form="step", probability=0.9, share=0.5, at_time_s=3.5
    )
    rest = Unexplained(rms=0.1, significant=True, structure="structured", depends_on=(at,))
    (found,) = _gap(unexplained=rest).as_dict()["unexplained"]["depends_on"]
    assert (found["t_s"], found["at_time_s"]) == (3.5, 3.5)
    assert {"run", "line", "frequency_hz", "direction", "course"} <= set(found)
    compared = plain(_cause(indistinguishable_from=(UnknownAt("A2", "reversals"),)))
    assert compared["indistinguishable_from"] == [{"kind": "unknown", "at": "A2", "on": "reversals"}]


def test_numbers_are_plain_and_what_is_not_finite_is_null():
    found = _gap(causes=(_cause(rivals=(RivalResult("clock", "q_load", np.float64(0.1)),)),)).as_dict()
    text = json.dumps(found, allow_nan=False)
    assert found["unexplained"]["rms"] is None
    assert json.loads(text) == found
    assert type(found["causes"][0]["rivals"][0]["probability"]) is float
    assert found["causes"][0]["parameters"] == {"gap_deg": {"value": 0.02, "low": 0.01, "high": 0.03}}


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        (np.int64(3), 3),
        (np.bool_(True), True),
        (np.array([1.0, np.inf]), [1.0, None]),
        ({1: (np.float64(2.0), "a", None)}, {"1": [2.0, "a", None]}),
    ],
)
def test_numpy_types_become_those_of_json(value, wanted):
    found = plain(value)
    assert found == wanted
    assert type(found) is type(wanted)


def test_any_dataclass_becomes_its_fields():
    @dataclass(frozen=True)
    class Place:
        at_s: float
        words: str | None = None

    assert plain([Place(1.0)]) == [{"at_s": 1.0}]


def test_findings_have_five_keys():
    issue = Issue("warning", "run-clock", 3, "late", "set it", "t_s")
    (found,) = _gap(issues=(issue,)).as_dict()["issues"]
    assert found == {
        "severity": "warning",
        "code": "run-clock",
        "line": 3,
        "message": "late",
        "remedy": "set it",
    }
