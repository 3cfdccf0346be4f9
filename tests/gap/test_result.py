"""The typed result, its JSON object, and named causes in a cell file."""

import json
import tomllib
from dataclasses import FrozenInstanceError, dataclass, fields, is_dataclass, replace

import numpy as np
import pytest

from gcode2krl import load_cell
from gcode2krl.effects import Applied, from_cell, library
from gcode2krl.errors import Issue, NotUnderstoodError
from gcode2krl.gap.answer import result
from gcode2krl.gap.answer.result import (
    SCHEMA,
    CauseResult,
    DependsOnResult,
    EffectAt,
    Expectation,
    Gap,
    GapSize,
    LinkResult,
    NextRun,
    NotExamined,
    RivalResult,
    Separates,
    Unexplained,
    UnknownAt,
    Where,
    apply_to_cell,
    plain,
)
from gcode2krl.gap.posterior.cause_tests import Interval
from gcode2krl.gap.posterior.judgement import NAMED
from tests.gap.answered import GAP

# The typed result: frozen, and which causes count as named


def _backlash(**more):
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


def _of_gear(**more):
    return LinkResult(
        link="gear", rms_before=1.0, rms_after=0.5, floor=0.4, unit="deg", verdict="explained", **more
    )


def _answer(**more):
    given = {
        "verdict": "explained",
        "gap": GapSize(signal="joint_load", unit="deg"),
        "links": (_of_gear(),),
        "where": Where(),
        "causes": (_backlash(),),
        "unexplained": Unexplained(rms=float("nan"), significant=False, structure="white"),
        "not_examined": (NotExamined(link="force", needs="force.csv"),),
    }
    return Gap(**(given | more))


def test_causes_are_named_from_one_half_on():
    gap = _answer(causes=[replace(_backlash(), probability=p) for p in (0.9, NAMED, NAMED - 1e-9, 0.1)])
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
    with pytest.raises(FrozenInstanceError):
        _answer().verdict = "no_gap"


def test_nothing_compared_is_none_and_not_zero():
    size = result.GapSize(signal="tcp", unit="mm")
    assert {getattr(size, entry.name) for entry in fields(size)[2:]} == {None, False, ()}


# The JSON object: keys in the order of the contract, plain values, what is left out


def test_the_keys_are_those_of_the_contract_in_their_order():
    found = _answer().as_dict()
    assert " ".join(found) == (
        "schema verdict gap at_part links where events causes unexplained not_examined observable next_run "
        "runs notes issues"
    )
    assert found["schema"] == SCHEMA
    assert " ".join(found["gap"]) == (
        "signal unit rms_before rms_after noise_floor max_before max_after shrink held_out per_run"
    )
    assert " ".join(found["where"]) == "signals intervals direction_base phases joints frequency_hz"


def test_keys_of_some_causes_and_links_are_left_out_and_others_are_null():
    plain_keys = ["effect", "target", "link", "probability", "parameters", "shrink", "rms_after"]
    kind = ["family", "family_probability", "form_fits", "constant", "tests"]
    assert list(plain(_backlash())) == [*plain_keys, "indistinguishable_from", *kind]
    slip = plain(_backlash(words="the run was at 50 % override"))
    assert list(slip) == [*plain_keys, "words", "indistinguishable_from", *kind]
    compared = plain(_backlash(rivals=(), indistinguishable_from=(EffectAt("mastering", None),)))
    assert list(compared) == [*plain_keys, "indistinguishable_from", "rivals", *kind]
    assert compared["indistinguishable_from"] == [{"effect": "mastering", "target": None}]
    assert (compared["rivals"], compared["shrink"]) == ([], None)
    assert "offset_deg" not in plain(_of_gear())
    assert plain(_of_gear(offset_deg={"A1": 0.5}))["offset_deg"] == {"A1": 0.5}


def test_a_moment_has_two_names_and_an_unknown_may_be_in_a_declared_set():
    at = DependsOnResult(
        link="gear", at="A2", on="time in the run", form="step", probability=0.9, share=0.5, at_time_s=3.5
    )
    rest = Unexplained(rms=0.1, significant=True, structure="structured", depends_on=(at,))
    (found,) = _answer(unexplained=rest).as_dict()["unexplained"]["depends_on"]
    assert (found["t_s"], found["at_time_s"]) == (3.5, 3.5)
    assert {"run", "line", "frequency_hz", "direction", "course"} <= set(found)
    compared = plain(_backlash(indistinguishable_from=(UnknownAt("A2", "reversals"),)))
    assert compared["indistinguishable_from"] == [{"kind": "unknown", "at": "A2", "on": "reversals"}]


def test_the_next_run_parts_pairs_and_says_what_follows_from_what():
    run = NextRun(
        program="dwell",
        minutes=np.float64(32.0),
        separates=(Separates(first="thermal", second="step", odds=31.2),),
        expect=(Expectation(answer="step", shows="nothing"),),
    )
    assert _answer(next_run=run).as_dict()["next_run"] == {
        "program": "dwell",
        "minutes": 32.0,
        "separates": [["thermal", "step", 31.2]],
        "expect": [{"if": "step", "then": "nothing"}],
    }


def test_numbers_are_plain_and_what_is_not_finite_is_null():
    found = _answer(causes=(_backlash(rivals=(RivalResult("clock", "q_load", np.float64(0.1)),)),)).as_dict()
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
    (found,) = _answer(issues=(issue,)).as_dict()["issues"]
    assert found == {
        "severity": "warning",
        "code": "run-clock",
        "line": 3,
        "message": "late",
        "remedy": "set it",
    }


# Named causes in a cell file: the next prediction has them, what stood there stays

LIBRARY = library()
BACKLASH = Applied(LIBRARY["backlash"], "A2", {"gap_deg": 0.0212345678})
FRAME = Applied(
    LIBRARY["base_frame"],
    None,
    {"x_mm": 0.5, "y_mm": 0.0, "z_mm": -0.25, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.01},
)
SLIP = Applied(LIBRARY["override"], None, {"percent": 50.0})


def with_causes(*causes):
    return replace(GAP, named=causes)


def effects(file):
    return tomllib.loads(file.read_text(encoding="utf-8"))["effects"]


def test_a_new_file_holds_the_causes_with_their_source(tmp_path):
    file = tmp_path / "cell.toml"
    assert apply_to_cell(with_causes(BACKLASH, FRAME), file, None, ["run-1", "run-2"]) == 2
    first, second = effects(file)
    assert first == {
        "name": "backlash",
        "target": "A2",
        "parameters": {"gap_deg": 0.0212346},
        "source": "diagnosed from run-1, run-2",
    }
    assert "target" not in second
    assert second["parameters"] == FRAME.values


def test_the_next_prediction_has_them(tmp_path):
    file = tmp_path / "cell.toml"
    apply_to_cell(with_causes(BACKLASH, FRAME), file, None, ["run-1"])
    found = from_cell(load_cell(file))
    assert [(one.effect.name, one.target) for one in found] == [("backlash", "A2"), ("base_frame", None)]
    assert found[0].values["gap_deg"] == pytest.approx(0.0212346)


def test_set_up_slips_are_put_right_and_not_modelled(tmp_path):
    file = tmp_path / "cell.toml"
    assert apply_to_cell(with_causes(SLIP), file, None, ["run-1"]) == 0
    assert effects(file) == []


def test_what_stood_there_stays_and_the_same_cause_is_replaced(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(
        'name = "my cell"\n[[effects]]\nname = "backlash"\ntarget = "A2"\nparameters = { gap_deg = 0.05 }\n'
        '[[effects]]\nname = "backlash"\ntarget = "A3"\nparameters = { gap_deg = 0.01 }\n',
        encoding="utf-8",
    )
    apply_to_cell(with_causes(BACKLASH), file, None, ["run-1"])
    assert [(one["target"], one["parameters"]["gap_deg"]) for one in effects(file)] == [
        ("A3", 0.01),
        ("A2", 0.0212346),
    ]
    assert tomllib.loads(file.read_text(encoding="utf-8"))["name"] == "my cell"


def test_a_new_file_begins_from_another_and_leaves_that_alone(tmp_path):
    base, file = tmp_path / "base.toml", tmp_path / "cell.toml"
    base.write_text('name = "the old one"\n', encoding="utf-8")
    apply_to_cell(with_causes(BACKLASH), file, base, ["run-1"])
    assert tomllib.loads(file.read_text(encoding="utf-8"))["name"] == "the old one"
    assert base.read_text(encoding="utf-8") == 'name = "the old one"\n'


@pytest.mark.parametrize("text", ["effects = 3\n", 'controller = "no table"\n'])
def test_what_is_no_cell_is_an_error_and_not_written(tmp_path, text):
    file = tmp_path / "cell.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(NotUnderstoodError):
        apply_to_cell(with_causes(BACKLASH), file, None, ["run-1"])
    assert file.read_text(encoding="utf-8") == text
