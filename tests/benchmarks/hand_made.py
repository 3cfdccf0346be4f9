"""Labels, causes and answers made by hand, for the scores of the check."""

import sys
from pathlib import Path

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
if str(BENCHMARKS) not in sys.path:
    sys.path.insert(0, str(BENCHMARKS))

GAP = {"signal": "tcp", "rms_before": 0.5, "rms_after": 0.3, "shrink": 0.9, "held_out": True}
DEPENDS = {"where": "joint", "target": "A2", "joints": ["A2"], "on": ["reversals"], "form": "loop"}


def effect(name="backlash", target="A2", form="same", ratio=2.0, **more):
    span = [{"run": "run-1", "t_start_s": 1.0, "t_end_s": 3.0}]
    return {
        "effect": name,
        "target": target,
        "family": "joint",
        "form": form,
        "ratio": ratio,
        "parameters": {"gap_deg": 0.02},
        "main_signal": "tcp",
        "signals": {"tcp": {"ratio": ratio}},
        "where": span,
        "above_noise": span,
        "depends": DEPENDS,
    } | more


def cause(name="backlash", target="A2", probability=0.9, alike=(), **more):
    given = {key: more.pop(key) for key in ("family", "form_fits", "constant", "tests") if key in more}
    return {
        "effect": name,
        "target": target,
        "link": "mechanics",
        "probability": probability,
        "parameters": more,
        "indistinguishable_from": [{"effect": n, "target": t} for n, t in alike],
    } | given


def depends(at="A2", on="reversals", form="loop", probability=0.9, share=0.8, link="mechanics"):
    return {"link": link, "at": at, "on": on, "form": form, "probability": probability, "share": share}


def answer(causes=(), verdict=None, intervals=(), rest=(), next_run=None, significant=False):
    return {
        "verdict": verdict or ("explained" if causes else "no_gap"),
        "causes": list(causes),
        "gap": GAP,
        "where": {"intervals": list(intervals)},
        "unexplained": {"significant": significant, "depends_on": list(rest)},
        "next_run": next_run,
    }


def record(effects=(), causes=(), verdict=None, kind="single", label=None, oracle=None, **more):
    return {
        "case": {"seed": 1, "kind": kind},
        "label": {"effects": list(effects)} | (label or {}),
        "result": answer(causes, verdict, **more),
        "error": None,
        "oracle": oracle,
    }
