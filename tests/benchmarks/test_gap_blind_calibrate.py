"""The calibration on made-up records: it finds which tests matter, leaves whole effects out, and refuses."""

import json
import math
from importlib import import_module

import numpy as np
import pytest

from gcode2krl.gap.posterior.calibrated import FAMILY_TERMS, NAME, TERMS, Probabilities
from tests.benchmarks import hand_made, made_up_records

assert hand_made.BENCHMARKS.is_dir()  # where the modules below are found
calibrate = import_module("blind.calibrate")


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    return calibrate.records_of(made_up_records.write_made_up(tmp_path_factory.mktemp("made_up")))


def row(term, value, right, group="a", kind="single"):
    """Return a row that is good in all terms but one."""
    u = tuple(value if name == term else 1.0 for name in TERMS)
    return calibrate.Row(case="c", kind=kind, group=frozenset({group}), u=u, right={NAME: right}, before=0.9)


def test_the_script_writes_a_table_that_the_diagnosis_takes(tmp_path, capsys):
    folder, target = made_up_records.write_made_up(tmp_path / "records"), tmp_path / "table.json"
    assert calibrate.main([str(folder), "-o", str(target)]) == 0
    table = json.loads(target.read_text(encoding="utf-8"))
    known = Probabilities.of(table)
    assert set(table["heads"]) == {"name", "family", "unknown", "dependence"}
    assert table["provenance"]["cases"] == 72
    assert table["provenance"]["seeds"] == ["1000-1023", "3000-3023", "5000-5023"]
    assert {each["effects"] for each in table["provenance"]["left_out_effects"]} >= {"backlash", "thermal"}
    assert all(weight >= 0.0 for head in known.heads.values() for weight in head.weights)
    said = capsys.readouterr().out
    assert "P(name)" in said
    assert all(f"| {term} |" in said for term in TERMS)


@pytest.mark.slow
def test_the_same_records_make_the_same_table(tmp_path):
    tables = []
    for name in ("first", "second"):
        folder = made_up_records.write_made_up(tmp_path / f"{name} records")
        assert calibrate.main([str(folder), "-o", str(tmp_path / name)]) == 0
        tables.append((tmp_path / name).read_text(encoding="utf-8"))
    assert tables[0] == tables[1]


def test_the_prior_speaks_for_every_term():
    assert set(calibrate.ONE_WORST) == set(TERMS) | set(FAMILY_TERMS)
    model = calibrate.fitted([], NAME)
    best = model.probability([1.0] * len(TERMS))
    assert best > 0.75
    for number, term in enumerate(TERMS):
        u = [float(i != number) for i in range(len(TERMS))]
        assert model.probability(u) < best, term


def test_a_test_that_parts_right_from_wrong_gets_the_weight():
    draw = np.random.default_rng(2)
    rows = [row("form", value, draw.random() < value) for value in draw.random(400)]
    model = dict(zip(TERMS, calibrate.fitted(rows, NAME).weights, strict=True))
    assert model["form"] > 3.0
    assert model["form"] == max(model.values())
    # logistic regression recovers about what it was drawn from: P = u has odds of 9 at 0.9 and 1/9 at 0.1
    found = [calibrate.fitted(rows, NAME).probability(row("form", u, True).u) for u in (0.1, 0.5, 0.9)]
    assert found == pytest.approx([0.1, 0.5, 0.9], abs=0.1)


def test_a_test_that_speaks_the_wrong_way_gets_none():
    rows = [row("shape", value, value < 0.5) for value in np.linspace(0.0, 1.0, 200)]
    assert dict(zip(TERMS, calibrate.fitted(rows, NAME).weights, strict=True))["shape"] == 0.0


def test_a_left_out_effect_teaches_nothing_about_itself():
    """Two effects fail another test each; the model of the one does not know the other's."""
    rows = [row("form", 0.0, False, "a")] * 40 + [row("form", 1.0, True, "a")] * 40
    rows += [row("constant", 0.0, False, "b")] * 40 + [row("constant", 1.0, True, "b")] * 40
    own = [calibrate.fitted(rows, NAME).probability(each.u) for each in rows]
    scores = calibrate.unseen_scores(rows, NAME)
    unseen = calibrate.left_out(rows, NAME, scores)
    assert unseen[0] > own[0]
    assert unseen[80] > own[80]
    assert len(set(scores[:40])) == 1


def test_scores_that_are_too_sure_of_unseen_effects_are_stretched():
    """Of a score of ±2 three in four are right: odds of 3, a slope of log 3 / 2."""
    rows = [row("form", 1.0, i % 4 > 0, f"e{i // 20}") for i in range(400)]
    rows += [row("form", 0.0, i % 4 == 0, f"e{i // 20}") for i in range(400)]
    scores = np.repeat([2.0, -2.0], 400)
    stretch = calibrate.Stretch.of(rows, scores, NAME)
    assert stretch.slope == pytest.approx(math.log(3.0) / 2.0, rel=0.05)
    assert stretch.shift == pytest.approx(0.0, abs=0.05)
    assert calibrate.left_out(rows, NAME, scores)[[0, 400]] == pytest.approx([0.75, 0.25], abs=0.02)
    model = calibrate.fitted(rows, NAME)
    u = rows[0].u
    assert stretch.stretched(model).score(u) == pytest.approx(
        stretch.slope * model.score(u) + stretch.shift, abs=0.01
    )
    few = calibrate.Stretch.of([], np.zeros(0), NAME)
    assert (few.slope, few.shift) == (1.0, 0.0)


def test_foreign_cases_count_as_much_as_all_others():
    rows = [row("form", 1.0, True)] * 90 + [row("form", 0.0, False, "x", kind="open")] * 10
    weights = calibrate.weights_of(rows)
    assert weights[:90].sum() == pytest.approx(weights[90:].sum()) == pytest.approx(50.0)


def test_scores_are_those_of_hand_made_rows():
    rows = [row("form", 1.0, right) for right in (True, True, False, True)]
    found = calibrate.scores_of(rows, np.array([0.95, 0.95, 0.95, 0.35]), NAME)
    assert found.ece == pytest.approx((abs(3 * 0.95 - 2.0) + abs(0.35 - 1.0)) / 4.0)
    assert found.brier == pytest.approx((2 * 0.05**2 + 0.95**2 + 0.65**2) / 4.0)
    assert found.log == pytest.approx(-np.log([0.95, 0.95, 0.05, 0.35]).mean())
    assert (found.sure, found.sure_right, found.named, found.named_wrong) == (3, 2, 3, 1)


def test_conformal_threshold_covers_what_it_promises():
    draw = np.random.default_rng(3)
    behind = [
        calibrate.Behind(frozenset({str(i)}), float(nats))
        for i, nats in enumerate(draw.exponential(size=400))
    ]
    count, of = calibrate.covered(behind)
    assert of == 400
    assert count / of >= 0.94
    assert calibrate.conformal_nats(behind) == pytest.approx(-math.log(0.05), rel=0.2)
    assert calibrate.conformal_nats(behind[:5]) == math.inf
    assert (
        calibrate.covered([*behind, calibrate.Behind(frozenset({"x"}), None)])[1] == 400
    )  # what was not compared has no score


def test_the_set_follows_the_threshold_and_makes_a_name_right(records):
    wrong = next(
        r
        for r in records
        if r["case"]["kind"] == "single" and r["result"]["causes"][0]["effect"] == "hysteresis"
    )
    cause = wrong["result"]["causes"][0]
    assert [each["behind_nats"] for each in calibrate.with_set(cause, 4.6)["indistinguishable_from"]] == [2.0]
    assert [each["behind_nats"] for each in calibrate.with_set(cause, 8.0)["indistinguishable_from"]] == [
        2.0,
        7.0,
    ]
    assert [row.right[NAME] for row in calibrate.cause_rows([wrong], 4.6)] == [False]
    assert [row.right[NAME] for row in calibrate.cause_rows([wrong], 8.0)] == [True]
    assert [each.nats for each in calibrate.behind_of([wrong])] == [7.0]


def test_what_the_library_lacks_has_no_right_name(records):
    outside = [record for record in records if record["case"]["kind"] in ("open", "deleted")]
    rows = list(calibrate.cause_rows(outside, 100.0))
    assert not any(row.right["name"] for row in rows)
    assert all(row.right["unknown"] for row in rows)
    assert any(row.right["family"] for row in rows)


def changed(folder, change):
    """Change the first record of a folder."""
    file = sorted((folder / "results").glob("single-*.json"))[0]
    record = json.loads(file.read_text(encoding="utf-8"))
    change(record)
    file.write_text(json.dumps(record), encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda record: record["case"].update(seed=30_000), "scored"),
        (lambda record: record["result"]["causes"][0]["tests"].pop("margin"), "other tests"),
    ],
)
def test_sealed_seeds_and_records_of_other_tests_are_refused(tmp_path, capsys, change, words):
    folder = made_up_records.write_made_up(tmp_path)
    changed(folder, change)
    assert calibrate.main([str(folder), "-o", str(tmp_path / "t.json")]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "t.json").exists()


@pytest.mark.parametrize(
    ("kind", "stand_ins", "teaches"),
    [
        ("deleted", [], True),
        ("deleted", [{"effect": "base_frame", "left_over": 0.1}], False),
        ("single", [{"effect": "base_frame", "left_over": 0.1}], True),
        ("null_foreign_mismatch", [], False),
    ],
)
def test_what_no_data_can_tell_teaches_nothing(tmp_path, kind, stand_ins, teaches):
    folder = made_up_records.write_made_up(tmp_path)

    def change(record):
        record["case"].update(seed=1, kind=kind)
        record["label"]["effects"][0]["stand_ins"] = stand_ins

    changed(folder, change)
    taught = [record["case"]["seed"] for record in calibrate.records_of(folder)]
    assert (1 in taught) is teaches


def test_an_empty_folder_is_refused(tmp_path):
    with pytest.raises(calibrate.RecordsError, match="no records"):
        calibrate.records_of(tmp_path)
