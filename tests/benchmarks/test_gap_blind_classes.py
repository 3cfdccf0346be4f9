"""Figures by class of decidability, distances of stored labels, moments and pairs that are located."""

import json
from importlib import import_module

import pytest

from tests.benchmarks.hand_made import answer, cause, depends, effect, record
from tests.plant.kinds import plan_of

classes = import_module("blind.figures")
decided = import_module("blind.figures")
dependences = import_module("blind.score")
moments = import_module("blind.score")
score = import_module("blind.score")

AT = [{"run": "run-2", "t_s": 11.8, "lasts_s": 0.02}]


def nats(two, gap=50.0):
    return {"mismatch": gap, "one": two, "two": two, "best_one": "friction@A2", "best_two": []}


def judged(two, causes=(), kind="single", gap=50.0, **more):
    entry = effect(nats=None if two is None else nats(two, gap))
    return score.judge(record([entry], causes, kind=kind, **more))


def test_each_class_has_its_own_column():
    some = [
        judged(20.0, [cause()]),
        judged(20.0),
        judged(5.0, [cause("friction", alike=[("backlash", "A2")])]),
        judged(1.0, [cause("friction")], gap=4.0),
        judged(None, [cause()]),
    ]
    rows = {row[0].strip(): row[1:] for row in classes.class_rows(some)}
    assert rows["cases with an effect"] == ("2", "1", "1", "1")
    assert rows["said no gap, gap >= 10 nats"][0].startswith("0.500 (<= 0.97")
    assert rows["said no gap, gap >= 10 nats"][2] == "-"  # mismatch may explain it away
    assert rows["exact"][0].startswith("0.500 (>= 0.025, n 2)")
    assert [rows["declared set"][i][:5] for i in range(4)] == ["0.500", "1.000", "0.000", "1.000"]
    assert rows["one effect: something else named"][2].startswith("1.000")


def test_a_pair_has_the_class_of_its_least_decidable_effect():
    two = [effect(nats=nats(30.0)), effect("friction", "A1", nats=nats(2.0))]
    assert score.judge(record(two, kind="pair")).decidability == "undecidable"
    two[1]["nats"] = None
    assert score.judge(record(two, kind="pair")).decidability == "not known"
    assert score.judge(record(kind="null")).decidability == ""


def test_both_of_a_pair_are_located_by_statements_of_their_own():
    joint = {"where": "joint", "target": "A1", "joints": ["A1"], "on": ["velocity"], "form": "smooth"}
    pair = [effect(), effect("friction", "A1", depends=joint)]

    def both(causes=(), rest=()):
        return dependences.located(pair, answer(causes, "partly_explained", rest=rest))

    assert both([cause(family="A2, reversals")], [depends("A1", "own angle")])
    assert not both([cause(family="A2, reversals")], [depends("A2")])
    assert not both([cause(family="A2, reversals")], [depends("A1", probability=0.4)])
    assert both(rest=[depends("A1"), depends("A2")])
    # a right name has its place, whatever its family
    assert both([cause("friction", "A1", family="A4, place"), cause(family="A2, reversals")])
    assert both([cause("friction", "A1", family=None)], [depends("A2")])
    assert not both([cause("friction", "A1", family="A2, place")])


def test_what_errs_alike_in_all_joints_is_told_of_all():
    alike = {"where": "joint", "target": "all", "joints": ["A1", "A2"], "on": ["velocity"], "form": "smooth"}
    entry = effect("servo_lag", "all", depends=alike)
    assert dependences.allowed_by(entry).at == {"all", "timing"}


@pytest.mark.parametrize(
    ("causes", "rest", "hit"),
    [
        ([cause("step", at_s={"value": 11.82})], (), True),
        ([cause("step", at_s={"value": 11.9})], (), False),
        ([cause("step", at_s={"value": 11.8}) | {"run": "run-1"}], (), False),
        ([cause("step", at_s={"value": 3611.8}) | {"moment": {"run": "run-2", "t_s": 11.81}}], (), True),
        ([cause("step", at_s={"value": 11.8}) | {"moment": {"run": "run-2", "t_s": 9.0}}], (), False),
        ((), [depends() | {"run": "run-2", "t_s": 11.775}], True),
        ((), [depends() | {"at_time_s": 3596.0}], False),
        ((), (), False),
    ],
)
def test_a_moment_is_right_to_twenty_milliseconds(causes, rest, hit):
    assert moments.moment_hit([effect(moments=AT)], answer(causes, "unexplained", rest=rest)) is hit


def test_without_a_moment_in_the_label_none_is_scored():
    assert moments.moment_hit([effect()], answer()) is None


def test_an_unknown_in_a_set_is_no_effect_and_a_group_names_its_members():
    names = import_module("blind.score")
    unknown = cause("friction") | {
        "indistinguishable_from": [{"kind": "unknown", "at": "A2", "on": "velocity"}]
    }
    assert not names.declares(unknown, ("backlash", "A2"))
    group = cause("geometry", None) | {"members": [{"effect": "mastering", "target": "A1"}]}
    assert names.names(group, ("mastering", "A1"))
    assert not names.names(group, ("mastering", "A2"))


# stored labels ----------------------------------------------------------------------------------------------


def label_of(kind, seed, effect_name=None):
    """As much of a label as its case can be drawn from again."""
    plan, more = plan_of(kind, seed, effect_name)
    return plan, {
        "seed": seed,
        "asked": plan.name,
        "made_with": {"kind": kind, "seed": seed, "effect": effect_name, "form": None},
        "mismatch_law": vars(plan.options.law),
        "foreign_noise": [],
        "instruments": {"tracker_mm": plan.how.tracker_mm},
        "runs": [{"program": day.program, "age_s": day.age_s} for day in plan.days],
        "effects": [
            {"effect": f.kind.name, "target": f.target, "form_name": f.form, "size": f.kind.sizes[1]}
            for f in plan.faults
        ],
        **{key: more[key] for key in ("missing",) if key in more},
    }


@pytest.mark.parametrize("kind", ["single", "double", "open", "missing", "deleted", "story", "confounded"])
def test_a_stored_label_gives_its_plan_again(kind):
    plan, label = label_of(kind, 17)
    again = decided.plan_of(label)
    assert again is not None
    days = [[(d.program, d.started, d.seed) for d in each.days] for each in (again, plan)]
    assert days[0] == days[1]
    assert again.how == plan.how
    assert [f.values(1.0) for f in again.faults] == [f.values(1.0) for f in plan.faults]


def test_a_label_of_another_plant_has_no_distances(tmp_path):
    _, label = label_of("single", 17, "backlash@A2")
    label["runs"][0]["program"] = "air"
    assert decided.plan_of(label) is None
    assert decided.decided(label, (), tmp_path) == [None]
    assert decided.plan_of(label | {"asked": "open:phlogiston"}) is None


def test_only_records_without_distances_of_this_plant_are_decided(tmp_path, monkeypatch):
    monkeypatch.setattr(decided, "decided", lambda label, without, folder: [nats(3.0)])
    monkeypatch.setattr(decided, "digest", lambda: "now")
    records = [record([effect()], [cause()]), record([effect()]) | {"nats_of": "now"}, record(kind="null")]
    done = list(decided.decide(records, tmp_path, 1, float("inf")))
    assert [each["nats_of"] for each in done] == ["now"]
    assert json.loads(json.dumps(done))[0]["label"]["effects"][0]["nats"]["two"] == 3.0
