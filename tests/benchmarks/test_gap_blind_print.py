"""The tables of the check, from judgements made by hand."""

from importlib import import_module

from tests.benchmarks.hand_made import cause, depends, effect, record

rows = import_module("blind.tables")
tables = import_module("blind.tables")
score = import_module("blind.score")


def figures(*records):
    return {row.metric: row for row in rows.metrics([score.judge(each) for each in records])}


def test_false_alarms_by_what_is_foreign():
    walk = {"foreign_noise": [{"channel": "tracker", "kind": "random_walk"}]}
    made = figures(
        record(kind="null"),
        record(kind="null_foreign_noise", verdict="unexplained", label=walk),
        record(kind="null_foreign_noise"),
        record(kind="null_foreign_mismatch", causes=[cause()]),
    )
    assert made["false alarms, usual noise"].figure == "0.000 (<= 0.950, n 1)"
    foreign = made["false alarms, foreign noise"]
    assert foreign.figure.startswith("0.500 (<= ")
    assert foreign.worst == "tracker random_walk 1/1"
    assert made["  any of them with a named cause"].figure.startswith("0.250")
    assert made["  all effect-free cases"].figure.startswith("0.500 (<= ")


def test_each_kind_of_noise_and_each_law_has_a_line():
    noise = [{"channel": "tracker", "kind": "pink"}, {"channel": "force", "kind": "hum"}]
    wide = {"mismatch_law": {"shape": "beta", "scale": 1.5}}
    records = [
        record(kind="null_foreign_noise", verdict="unexplained", label={"foreign_noise": noise}),
        record(kind="null_foreign_noise", label={"foreign_noise": noise[:1]}),
        record(kind="null_foreign_mismatch", causes=[cause()], label=wide),
        record(kind="null"),
    ]
    told = tables.report([score.judge(each) for each in records], [], "four cases")
    assert "| tracker pink | 1/2 (<= 0.975) | unexplained 1" in told
    assert "| force hum    | 1/1 (<= 1.000) | unexplained 1" in told
    assert "| 1.5 x beta   | 1/1 (<= 1.000) | backlash A2 1" in told


def test_what_a_case_costs_beside_the_diagnosis():
    timed = record(kind="null") | {"diagnosis_cpu_s": 6.0, "plant_cpu_s": 1.0, "beside_cpu_s": 1.0}
    told = tables.report([score.judge(timed)], [], "one case")
    assert "mean: plant 1.00, diagnosis 6.00, oracle and simple methods 1.00: 25 % of a case" in told


def test_forms_stand_apart_and_small_effects_do_not_count():
    made = rows.metrics(
        [
            score.judge(record([effect()], [cause()])),
            score.judge(record([effect(ratio=0.5)])),
            score.judge(record([effect("friction", form="other")], [cause()])),
        ]
    )
    found = [(row.metric, row.figure, row.worst) for row in made]
    assert ("same form, >= noise: declared set", "1.000 (>= 0.050, n 1)", "") in found
    assert ("  half the noise: declared set", "0.000 (>= 0.000, n 1)", "backlash 0/1") in found
    assert ("other form, >= noise: declared set", "0.000 (>= 0.000, n 1)", "friction 0/1") in found
    assert ("  something else named", "1.000 (<= 1.000, n 1)", "friction 1/1") in found


def test_unknowns():
    made = figures(
        record([effect("cable_snag", None)], [cause()], kind="open"),
        record([effect()], [], "unexplained", "deleted", rest=[depends()]),
        record([effect(ratio=0.5)], [cause()], kind="open"),
    )
    assert made["outside the library: wrongly named"].figure == "1.000 (<= 1.000, n 1)"
    assert made["  wrongly named, no simple effect fits as well"].figure == "0.000 (<= 0.950, n 1)"
    assert made["taken out of the library: wrongly named"].figure == "0.000 (<= 0.950, n 1)"
    assert made["family and place of an unknown right"].figure.startswith("0.500 (>= ")


def test_what_is_left_without_a_channel():
    made = figures(
        record([effect()], [cause()], kind="missing"),
        record([effect()], [cause("friction")], kind="missing", label={"undecided": True}),
    )
    assert made["channels missing, effect still shows: declared set"].figure == "1.000 (>= 0.050, n 1)"
    assert made["  all of them: something else named"].figure.startswith("0.500")


def test_wrong_names_that_the_data_could_have_told():
    alike = effect("cable_snag", None, stand_ins=[{"effect": "force_offset", "left_over": 0.3}])
    made = [score.judge(record([each], [cause()], kind="open")) for each in (alike, effect("hard_spot"))]
    row = next(row for row in rows.metrics(made) if row.metric.startswith("  wrongly named, no simple"))
    assert row.figure == "1.000 (<= 1.000, n 1)"


def test_names_that_are_sure_of_themselves():
    made = figures(
        record([effect()], [cause(probability=0.95)]),
        record([effect()], [cause("friction", probability=0.92)]),
        record([effect()], [cause("friction", probability=0.89)]),
    )
    assert made["precision of names with p >= .9, all kinds"].figure.startswith("0.500")


def test_an_explanation_leaves_no_significant_rest():
    made = figures(
        record([effect()], [cause()]),
        record([effect()], [cause()], significant=True),
        record([effect()], [], "unexplained", significant=True),
    )
    assert made["explained, beside a significant rest"].figure.startswith("0.500 (<= ")


def test_the_report_names_what_was_confused():
    judged = [
        score.judge(record([effect()], [cause("friction")])),
        score.judge(record([effect("cable_snag", None)], [cause()], kind="open")),
        score.judge({"case": {"seed": 7, "kind": "null"}, "label": {"effects": []}, "error": "boom"}),
    ]
    text = tables.report(judged, [], "a title")
    assert text.startswith("a title")
    assert "| single | backlash A2 | friction A2" in text.replace("  ", " ")
    assert "No result, an exception: null-00007" in text
    assert "full check of" in text
