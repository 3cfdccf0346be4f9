"""The judgement of a case, on answers and labels made by hand."""

from importlib import import_module

import pytest

from tests.benchmarks.hand_made import cause, depends, effect, record

score = import_module("blind.score")


def test_a_right_answer():
    said = {"value": 0.021, "low": 0.019, "high": 0.023}
    found = score.judge(record([effect()], [cause(gap_deg=said)], oracle={"before": 0.25, "removed": 0.2}))
    assert found.exact
    assert found.declared
    assert not found.is_wrongly_named
    assert found.errors == pytest.approx([0.05])
    assert found.covered == (True,)
    assert found.shrink == pytest.approx(0.16 / 0.2)


def test_an_oracle_that_removes_next_to_nothing_gives_no_figure():
    found = score.judge(record([effect()], [cause()], oracle={"before": 0.25, "removed": 0.02}))
    assert found.shrink is None


@pytest.mark.parametrize(
    ("causes", "wrongly"),
    [
        ([cause(target="A3")], True),
        ([cause("hysteresis")], True),
        ([cause(probability=0.49)], False),
        ([cause(), cause("friction", "A2")], True),
        ([cause(), cause()], False),
        ([], False),
    ],
)
def test_wrong_answers(causes, wrongly):
    found = score.judge(record([effect()], causes))
    assert not found.exact
    assert not found.declared
    assert found.is_wrongly_named == wrongly


def test_the_declared_set_counts_apart():
    found = score.judge(record([effect()], [cause("hysteresis", "A2", alike=[("backlash", "A2")])]))
    assert (found.exact, found.declared, found.is_wrongly_named) == (False, True, False)
    assert found.probabilities == ((0.9, True),)


def test_a_set_counts_below_the_probability_of_a_name():
    found = score.judge(
        record([effect()], [cause("hysteresis", "A2", 0.3, [("backlash", "A2")])], kind="confounded")
    )
    assert (found.in_a_set, found.declared, found.is_wrongly_named) == (True, False, False)


def test_two_effects_need_two_causes():
    both = [effect(), effect("servo_lag", "A1")]
    one = cause("friction", "A2", alike=[("backlash", "A2"), ("servo_lag", "A1")])
    assert not score.judge(record(both, [one], kind="pair")).declared
    assert score.judge(record(both, [cause("servo_lag", "A1"), cause()], kind="pair")).exact
    assert score.judge(record(both, [one, cause()], kind="pair")).declared  # each truth has its own cause


@pytest.mark.parametrize("kind", ["null", "null_foreign_noise", "null_foreign_mismatch"])
def test_nothing_is_right_where_nothing_is(kind):
    assert score.judge(record(kind=kind)).exact
    for wrong in (record(causes=[cause()], kind=kind), record(verdict="unexplained", kind=kind)):
        assert not score.judge(wrong).exact
        assert score.judge(wrong).alarms


def test_what_is_foreign_is_the_subject_of_a_null_case():
    noise = {"foreign_noise": [{"channel": "tracker", "kind": "pink"}]}
    law = {"mismatch_law": {"shape": "beta", "scale": 1.5}}
    assert score.judge(record(kind="null_foreign_noise", label=noise)).subject == "tracker pink"
    assert score.judge(record(kind="null_foreign_mismatch", label=law)).subject == "1.5 x beta"
    assert score.judge(record(kind="null")).subject == "usual"


@pytest.mark.parametrize("kind", ["open", "deleted"])
def test_no_name_is_right_for_what_the_library_does_not_have(kind):
    wrong = score.judge(record([effect()], [cause()], "explained", kind))
    assert wrong.is_wrongly_named
    assert not wrong.exact
    assert wrong.probabilities == ((0.9, False),)  # even the effect's own name: it was taken out
    right = score.judge(record([effect()], [], "unexplained", kind))
    assert right.exact
    assert right.flagged


def test_place_and_family_of_an_unknown():
    right = score.judge(record([effect()], [], "unexplained", "open", rest=[depends()]))
    assert (right.told.place, right.told.family, right.told.form) == (True, True, True)
    assert right.depends == ((0.9, True),)
    assert not score.judge(record([effect()], [], "unexplained", "open")).told.place


def test_a_right_name_says_family_and_place():
    assert score.judge(record([effect()], [cause()])).family_or_name
    assert not score.judge(record([effect()], [cause("friction")])).family_or_name
    assert score.judge(record([effect()], [cause("friction", family="A2, reversals")])).family_or_name


def test_a_record_without_an_answer_is_wrong():
    found = score.judge(
        {"case": {"seed": 1, "kind": "null"}, "label": {"effects": []}, "result": None, "error": "boom"}
    )
    assert found.failed
    assert not found.exact
    assert found.alarms
