"""The check on withheld data: its scores on answers made by hand, its seeds, and three cases through it."""

import json
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
cases = import_module("gap_blind_cases")
score = import_module("gap_blind_score")
tables = import_module("gap_blind_print")
baselines = import_module("gap_blind_baselines")
blind = import_module("gap_blind")


GAP = {"signal": "tcp", "rms_before": 0.5, "rms_after": 0.3, "shrink": 0.9, "held_out": True}


def effect(name="backlash", target="A2", form="same", ratio=2.0, **more):
    return {
        "effect": name,
        "target": target,
        "family": "joint",
        "form": form,
        "ratio": ratio,
        "parameters": {"gap_deg": 0.02},
        "main_signal": "tcp",
        "where": [{"run": "run-1", "t_start_s": 1.0, "t_end_s": 3.0}],
    } | more


def cause(name="backlash", target="A2", probability=0.9, alike=(), **parameters):
    return {
        "effect": name,
        "target": target,
        "probability": probability,
        "parameters": parameters,
        "indistinguishable_from": [{"effect": n, "target": t} for n, t in alike],
    }


def record(effects=(), causes=(), verdict=None, kind="single", intervals=(), **more):
    verdict = verdict or ("explained" if causes else "no_gap")
    result = {
        "verdict": verdict,
        "causes": list(causes),
        "gap": GAP,
        "where": {"intervals": list(intervals)},
    }
    made = {
        "case": {"seed": 1, "kind": kind},
        "label": {"effects": list(effects)},
        "result": result,
        "error": None,
    }
    return made | more


def test_a_right_answer():
    said = {"value": 0.021, "low": 0.019, "high": 0.023}
    found = score.judge(record([effect()], [cause(gap_deg=said)], oracle={"before": 0.25, "removed": 0.2}))
    assert found.exact
    assert found.declared
    assert found.errors == pytest.approx([0.05])
    assert found.covered == [True]
    assert found.relative_shrink == pytest.approx(0.16 / 0.2)


@pytest.mark.parametrize(
    "causes",
    [
        [cause(target="A3")],
        [cause("hysteresis")],
        [cause(probability=0.49)],
        [cause(), cause("friction", "A2")],
        [cause(), cause()],
        [],
    ],
)
def test_wrong_answers(causes):
    found = score.judge(record([effect()], causes))
    assert not found.exact
    assert not found.declared


def test_the_declared_set_counts_apart():
    found = score.judge(record([effect()], [cause("hysteresis", "A2", alike=[("backlash", "A2")])]))
    assert (found.exact, found.declared, found.set_size) == (False, True, 2.0)
    assert found.probabilities == [(0.9, True)]


def test_two_effects_need_two_causes():
    both = [effect(), effect("servo_lag", "A1")]
    one = cause("friction", "A2", alike=[("backlash", "A2"), ("servo_lag", "A1")])
    assert not score.judge(record(both, [one], kind="pair")).declared
    assert score.judge(record(both, [cause("servo_lag", "A1"), cause()], kind="pair")).exact
    assert score.judge(
        record(both, [one, cause()], kind="pair")
    ).declared  # each truth has a cause of its own


def test_nothing_is_right_where_nothing_is():
    assert score.judge(record(kind="null")).exact
    assert not score.judge(record(causes=[cause()], kind="null")).exact
    assert not score.judge(record(verdict="unexplained", kind="null")).exact


def test_no_name_is_right_for_what_the_library_does_not_have():
    found = score.judge(record([effect("cable_snag", None)], [cause()], "explained", "open"))
    assert not found.exact
    assert found.probabilities == [(0.9, False)]
    assert score.judge(record([effect("cable_snag", None)], [], "unexplained", "open")).exact


@pytest.mark.parametrize(
    ("spans", "expected"),
    [
        ([(1.0, 3.0)], 1.0),
        ([(2.0, 4.0)], 1.0 / 3.0),
        ([(1.0, 2.0), (2.0, 3.0)], 1.0),
        ([], 0.0),
        ([(5.0, 6.0)], 0.0),
    ],
)
def test_overlap(spans, expected):
    intervals = [{"run": "run-1", "signal": "tcp", "t_start_s": a, "t_end_s": b} for a, b in spans]
    assert score.overlap(effect(), intervals) == pytest.approx(expected)
    other = [each | {"run": "run-2"} for each in intervals]
    assert score.overlap(effect(), other) == 0.0


def test_errors_are_shares_of_what_differs_from_nominal():
    said = {"value": 0.75, "low": 0.7, "high": 0.79}
    found = score.judge(
        record([effect("stiffness", "A2", parameters={"scale": 0.8})], [cause("stiffness", scale=said)])
    )
    assert found.errors == pytest.approx([0.25])
    assert found.covered == [False]


def test_a_vector_is_one_error():
    way = {"x_mm": 3.0, "y_mm": 4.0, "z_mm": 0.0}
    said = {
        name: {"value": value + 0.5 * (name == "z_mm"), "low": -9.0, "high": 9.0}
        for name, value in way.items()
    }
    found = score.judge(
        record([effect("base_frame", None, parameters=way)], [cause("base_frame", None, **said)])
    )
    assert found.errors == pytest.approx([0.1])


def test_bounds_of_a_rate_agree_with_their_definition():
    none = score.Rate(0, 300)
    assert none.upper == pytest.approx(1.0 - 0.05 ** (1.0 / 300.0), rel=1e-9)
    assert none.upper < 0.01
    some = score.Rate(7, 40)
    from math import comb

    below = sum(comb(40, k) * some.upper**k * (1.0 - some.upper) ** (40 - k) for k in range(8))
    above = sum(comb(40, k) * some.lower**k * (1.0 - some.lower) ** (40 - k) for k in range(7, 41))
    assert below == pytest.approx(0.05, rel=1e-6)
    assert above == pytest.approx(0.05, rel=1e-6)


def test_calibration_error():
    assert score.calibration_error([(0.9, True)] * 9 + [(0.9, False)]) == pytest.approx(0.0)
    assert score.calibration_error([(0.9, True)] * 5 + [(0.9, False)] * 5) == pytest.approx(0.4)
    assert score.calibration_error([(1.0, False)]) == 1.0


def test_smallest_seen():
    judged = [
        score.judge(record([effect(ratio=r)], [cause()] if r > 0.6 else []))
        for r in (0.3, 0.5, 0.7, 1.0, 3.0)
    ]
    assert score.smallest_seen(judged) == 0.7
    assert score.smallest_seen([judged[0]]) is None


def test_blocks_of_seeds_never_mix():
    some = cases.plan(1, {"null": 3, "single": 5, "pair": 2, "deleted": 1})
    more = cases.plan(1, {"null": 9, "single": 50, "slip": 7, "pair": 2, "deleted": 1})
    assert set(some) <= set(more)
    assert len({case.seed for case in more}) == len(more)
    assert max(case.seed for case in more) < cases.SCORED_FROM
    with pytest.raises(ValueError, match="calibration"):
        cases.plan(9000, {"null": 1})
    with pytest.raises(ValueError, match="no effect"):
        cases.plan(1, {"single": 1}, ["blacklash"])
    assert sum(cases.mixed(200).values()) == 200


def test_the_lasso_finds_two_of_many():
    rng = np.random.default_rng(1)
    wide = rng.normal(size=(400, 30))
    wide /= np.linalg.norm(wide, axis=0)
    y = 5.0 * wide[:, 3] - 4.0 * wide[:, 17] + 0.05 * rng.normal(size=400)
    groups = [("effect", f"A{i}") for i in range(30)]
    named = baselines._lasso(y, wide, np.arange(30), groups)
    assert sorted(named) == [["effect", "A17"], ["effect", "A3"]]
    assert baselines._best_correlation(y, wide, np.arange(30), groups) == [["effect", "A3"]]
    assert baselines._lasso(np.zeros(400), wide, np.arange(30), groups) == []


@pytest.mark.slow
def test_three_cases_go_through_and_resume(tmp_path, capsys):
    options = ["--small", "--seed", "7", "--jobs", "1", "--effects", "backlash", "--no-baselines"]
    options += ["--resume", str(tmp_path)]
    assert blind.main(options) == 0
    out, err = capsys.readouterr()
    assert "false alarms on effect-free runs" in out
    assert "calibration, not to be quoted" in out
    assert "3 cases, 0 already there" in err
    files = sorted((tmp_path / "results").glob("*.json"))
    assert [file.stem for file in files] == ["null-00007", "open-03007", "single-01007"]
    for file in files:
        made = json.loads(file.read_text(encoding="utf-8"))
        assert made["error"] is None, made["error"]
        assert made["result"]["schema"] == "gcode2krl/gap/1"
    assert not list(tmp_path.rglob("*.label.json"))
    assert blind.main([*options, "--json"]) == 0
    out, err = capsys.readouterr()
    assert "3 cases, 3 already there" in err
    assert len(out.splitlines()) == 3
