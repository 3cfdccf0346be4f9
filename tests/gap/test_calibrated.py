"""Probabilities: monotone in every test, clipped, refused where the table is of something else."""

import copy
import json
from dataclasses import fields, replace

import numpy as np
import pytest

from gcode2krl.gap.answer.causes import cause_of
from gcode2krl.gap.answer.result import plain
from gcode2krl.gap.posterior.calibrated import (
    DEPENDENCE,
    FAMILY_TERMS,
    NAME,
    NAMES,
    TERMS,
    UNKNOWN,
    FamilyFeatures,
    Features,
    Head,
    Probabilities,
    Scale,
    family_features,
    goodnesses,
    probabilities_table,
)
from gcode2krl.gap.posterior.judgement import judge
from gcode2krl.gap.thresholds import TABLE, THRESHOLDS, declared_nats, stated_table
from tests.gap.constructed import LINK, motion, noise, question, trace, wave

# Probabilities: monotone in every test, clipped, refused where the table is of something else

GOOD = Features(
    surprise=300.0,
    size_over_noise=1.0,
    margin=80.0,
    form_ratio=0.98,
    other_share=0.0,
    other_power=0.0,
    inconstancy=0.02,
    constant_p=0.4,
    shape_interval=0.1,
    fold_agreement=1.0,
    shrink_of_rest=0.97,
    shrink_where_others=1.0,
    shrink_together=0.97,
    share_left=0.0,
    causes=1,
    gap_p=0.005,
    conditions_failed=0,
)
WORSE = {
    "surprise": [100.0, 10.0, 1.0, -5.0],
    "size_over_noise": [0.4, 0.1, 0.01],
    "margin": [20.0, 1.0, -4.0, -1000.0],
    "form_ratio": [0.95, 0.9, 0.7, 0.0],
    "other_share": [0.03, 0.1, 1.0],
    "other_power": [0.03, 0.1, 1.0],
    "inconstancy": [0.1, 0.3, 5.0],
    "constant_p": [0.01, 0.001, 0.0],
    "shape_interval": [0.4, 0.8, 1.0],
    "fold_agreement": [0.75, 0.5, 0.0],
    "shrink_of_rest": [0.9, 0.5, 0.0],
    "shrink_where_others": [0.2, 0.05, 0.0],
    "shrink_together": [0.9, 0.7, 0.0],
    "share_left": [0.03, 0.1, 1.0],
    "causes": [2, 3, 4],
    "gap_p": [0.02, 0.1, 1.0],
    "conditions_failed": [1, 2, 3],
}
"""Of each test, results from good to bad."""
TOGETHER = [("inconstancy", "constant_p"), ("gap_p", "surprise")]
"""Tests of which the better one counts."""


def weighted(**more):
    """Return a table in which every term has a weight, whatever the package's has."""
    table = copy.deepcopy(stated_table())
    for head in table["heads"].values():
        head["weights"] = dict.fromkeys(head["weights"], 1.0)
        head["bias"] = -0.8 * len(head["weights"])
    return Probabilities.of(table | more)


def worse_ones(name):
    """Return features from good to bad in one test, and in the one that counts with it."""
    names = next((pair for pair in TOGETHER if name in pair), (name,))
    steps = max(len(WORSE[each]) for each in names)
    return [
        replace(GOOD, **{each: WORSE[each][min(i, len(WORSE[each]) - 1)] for each in names})
        for i in range(steps)
    ]


def test_every_test_is_tried():
    assert set(WORSE) == set(NAMES)


@pytest.mark.parametrize("table", [probabilities_table(), weighted()], ids=["package", "all weights"])
@pytest.mark.parametrize("name", NAMES)
def test_a_worse_test_never_makes_a_name_more_probable(name, table):
    every = [GOOD, *worse_ones(name)]
    for falling in (table.name, table.family):
        found = [falling(each) for each in every]
        assert (np.diff(found) <= 0.0).all()
        assert all(0.02 <= p <= 0.98 for p in found)
    model, u = table.heads[UNKNOWN], [goodnesses(each.as_dict()) for each in every]
    assert (np.diff([model.probability(each) for each in u]) >= 0.0).all()


@pytest.mark.parametrize("term", TERMS)
def test_with_a_weight_each_term_lowers_the_probability(term):
    name = next(iter(TERMS[term]))
    found = [weighted().name(each) for each in [GOOD, worse_ones(name)[-1]]]
    assert found[1] < found[0]


@pytest.mark.parametrize("name", ["lead_nats", "share", "p"])
def test_a_family_of_a_rest_is_monotone_too(name):
    values = {"lead_nats": [100.0, 10.0, 0.0, -50.0], "share": [0.9, 0.2, 0.0], "p": [0.005, 0.05, 1.0]}[name]
    good = FamilyFeatures(lead_nats=100.0, share=0.9, p=0.005, of_largest=1.0, larger_links=0)
    found = [weighted().dependence(replace(good, **{name: value})) for value in values]
    assert (np.diff(found) <= 0.0).all()
    assert found[-1] < found[0]


def test_a_cause_that_fails_a_condition_is_not_named_however_good_the_rest_is():
    for table in (probabilities_table(), weighted()):
        assert table.name(replace(GOOD, conditions_failed=1)) < 0.5


def test_a_good_cause_is_named_and_a_bad_one_is_not():
    table = probabilities_table()
    assert table.name(GOOD) > 0.5
    bad = replace(GOOD, margin=-20.0, form_ratio=0.6, share_left=0.5, shrink_of_rest=0.1, conditions_failed=2)
    assert table.name(bad) < 0.3
    assert table.unknown(bad) > table.unknown(GOOD)


def test_name_and_unknown_are_never_more_than_all_and_a_name_has_a_family():
    draw = np.random.default_rng(1)
    for table in (probabilities_table(), weighted()):
        for _ in range(200):
            names = draw.choice(list(WORSE), size=4, replace=False)
            drawn = replace(GOOD, **{name: draw.choice(WORSE[name]).item() for name in names})
            assert table.name(drawn) + table.unknown(drawn) <= 1.0 + 1e-12
            assert table.family(drawn) >= table.name(drawn)


def test_a_test_that_was_not_made_counts_as_usual():
    model = Head(-1.0, (2.0,) * len(TERMS), (0.5,) * len(TERMS))
    u = goodnesses(replace(GOOD, fold_agreement=None, inconstancy=None, constant_p=None).as_dict())
    at = list(TERMS).index("folds")
    assert u[at] is None
    assert model.probability(u) == model.probability([0.5 if each is None else each for each in u])


def test_scales_begin_at_their_worst_and_end_at_their_best():
    for terms in (TERMS, FAMILY_TERMS):
        for term in terms.values():
            for scale in term.values():
                assert scale.goodness(scale.worst) == pytest.approx(0.0, abs=1e-12)
                assert scale.goodness(scale.best) == pytest.approx(1.0)
    assert Scale(0.1, 0.001, "log").goodness(0.01) == pytest.approx(0.5)
    assert Scale(0.0, 0.99, "log_rest").goodness(0.9) == pytest.approx(0.5)


def test_the_package_has_no_worthless_table():
    """Weights are a few and not negative; provenance names seeds that are no scored ones."""
    table = stated_table()
    seeds = [int(end) for each in table["provenance"]["seeds"] for end in each.split("-")]
    assert max(seeds) < 30_000
    assert sum(table["heads"][NAME]["weights"].values()) > 0.0
    assert set(table["provenance"]["left_out_scores"]) == set(table["heads"])
    assert sum(table["provenance"]["kinds"].values()) == table["provenance"]["cases"]


@pytest.mark.parametrize("key", ["features", "family_features"])
def test_a_table_of_other_features_is_refused(key):
    table = stated_table()
    with pytest.raises(ValueError, match="other"):
        Probabilities.of(table | {key: [*table[key], "more"]})


def test_a_table_of_other_terms_or_with_a_negative_weight_is_refused():
    for change, words in (({"more": 1.0}, "other terms"), ({"family": -0.1}, "negative")):
        table = copy.deepcopy(stated_table())
        table["heads"][NAME]["weights"] |= change
        with pytest.raises(ValueError, match=words):
            Probabilities.of(table)


def test_the_table_comes_back_as_it_was_written():
    again = Probabilities.of(json.loads(json.dumps(stated_table())))
    assert again == Probabilities.of(json.loads(TABLE.read_text(encoding="utf-8")))
    assert again.heads[DEPENDENCE].weights == tuple(stated_table()["heads"][DEPENDENCE]["weights"].values())


# The table of probabilities is a file of the package


def test_the_table_stands_beside_the_thresholds():
    assert TABLE.is_file()
    assert stated_table() == json.loads(TABLE.read_text(encoding="utf-8"))


def test_declared_sets_are_as_wide_as_the_table_says_and_no_narrower_than_the_convention():
    assert declared_nats() == stated_table()["alike_nats"]
    assert declared_nats() >= THRESHOLDS.posterior.alike_chi2 / 2.0


# The tests of a cause as numbers: what goes in, how they are rounded, and their names in the JSON object

COUNT, SIGMA = 500, 1e-4
TIME_S = motion().time_s
EFFECT = wave(2.0)


def run(number, y):
    return trace(SIGMA * y[:, None] + noise(COUNT, number, SIGMA), number=number)


def judged(values, held=(), effects=(EFFECT,)):
    traces = [run(i, y) for i, y in enumerate(values)]
    return judge(
        LINK["servo"], traces, [run(len(traces) + i, y) for i, y in enumerate(held)], question(effects)
    )


def features(values, held=(), effects=(EFFECT,)):
    return judged(values, held, effects).causes[0].features


def test_a_right_cause_has_good_tests():
    found = features([2.0 * EFFECT.form(TIME_S)] * 3)
    assert found.fold_agreement == 1.0
    assert found.shrink_of_rest > 0.95
    assert found.shrink_where_others == 1.0  # nothing is above it
    assert (found.share_left, found.conditions_failed, found.causes) == (0.0, 0, 1)
    assert found.inconstancy < 0.1
    # a sine of 2 sigma has an rms of √2 in values of one sigma
    assert found.size_over_noise == pytest.approx(2.0**0.5, rel=0.25)
    assert found.gap_p < 0.01
    assert found.surprise > 100.0


def test_without_the_effect_on_held_out_runs_they_are_bad():
    found = features([2.0 * EFFECT.form(TIME_S)] * 2, held=[0.0 * TIME_S])
    assert found.shrink_of_rest == 0.0
    assert found.fold_agreement is None  # one choice, made without the held-out run


def test_a_size_that_differs_from_run_to_run_is_inconstant():
    y = EFFECT.form(TIME_S)
    found = features([1.0 * y, 3.0 * y])
    assert found.inconstancy > 0.2
    assert found.constant_p < 1e-3


def test_the_object_names_every_test_and_rounds_to_four_digits():
    judgement = judged([2.0 * EFFECT.form(TIME_S)] * 2)
    tests = plain(cause_of(judgement.causes[0], judgement, "servo"))["tests"]
    assert tuple(tests) == NAMES == tuple(entry.name for entry in fields(Features))
    assert all(value is None or isinstance(value, float) for value in tests.values())
    assert all(value is None or np.isfinite(value) for value in tests.values())
    assert tests["size_over_noise"] == float(f"{judgement.causes[0].features.size_over_noise:.4g}")


def test_the_lead_of_a_family_is_over_the_best_other():
    t = TIME_S
    rest = judged([3.0 * (t > 5.0)]).rest
    first, second = (family_features(rest, each) for each in rest.study.evidences[:2])
    assert first.lead_nats > 0.0 > second.lead_nats
    assert first.lead_nats == pytest.approx(-second.lead_nats)
    assert first.share > 0.9
    assert isinstance(first, FamilyFeatures)
    assert list(first.as_dict()) == ["lead_nats", "share", "p", "of_largest", "larger_links"]
    assert (first.of_largest, first.larger_links) == (1.0, 0)
