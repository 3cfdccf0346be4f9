"""Made-up records of the check, to try the calibration without a plant: right causes pass, others fail."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from gcode2krl.gap.posterior.calibrated import FamilyFeatures
from tests.gap.test_calibrated import GOOD

EFFECTS = ("backlash", "stiffness", "servo_lag", "thermal")
OF_EACH = 6
KINDS = {"single": 1_000, "open": 3_000, "deleted": 5_000}
"""Kind -> first seed."""
_BAD = {
    "margin": -10.0,
    "form_ratio": 0.7,
    "other_share": 0.2,
    "other_power": 0.2,
    "inconstancy": 0.3,
    "constant_p": 1e-4,
    "fold_agreement": 0.3,
    "shrink_of_rest": 0.6,
    "share_left": 0.2,
}
"""Of wrong names; each is drawn with an even chance, and one of a right name now and then."""
_DEPENDS = {"where": "joint", "target": "A2", "joints": ["A2"], "on": ["reversals"], "form": "loop"}


def write_made_up(folder: Path, seed: int = 0) -> Path:
    """Write records as the check stores them; returns the folder."""
    draw = np.random.default_rng(seed)
    (folder / "results").mkdir(parents=True, exist_ok=True)
    for kind, first in KINDS.items():
        for i in range(OF_EACH * len(EFFECTS)):
            record = _record(kind, first + i, EFFECTS[i % len(EFFECTS)], draw)
            file = folder / "results" / f"{kind}-{first + i:05d}.json"
            file.write_text(json.dumps(record), encoding="utf-8")
    return folder


def _record(kind: str, seed: int, effect: str, draw: np.random.Generator) -> dict[str, Any]:
    right = kind == "single" and bool(draw.random() < 0.9)
    tests = GOOD.as_dict()
    for name, value in _BAD.items():
        if draw.random() < (0.03 if right else 0.5):
            tests[name] = value
    truth = f"open:{effect}" if kind == "open" else effect
    told = effect if right else "hysteresis"
    result = {
        "verdict": "explained" if right else "partly_explained",
        "causes": [
            {
                "effect": told,
                "target": "A2",
                "probability": 0.98,
                "family": "A2, reversals" if right or draw.random() < 0.5 else "tip, travel",
                "tests": tests,
                "indistinguishable_from": [{"effect": "friction", "target": "A2", "behind_nats": 2.0}],
                "rivals": [{"effect": effect, "target": "A2", "probability": 0.01, "behind_nats": 7.0}],
            }
        ],
        "unexplained": {"depends_on": [] if right else [_family(draw)]},
    }
    label = {"effects": [{"effect": truth, "target": "A2", "depends": _DEPENDS, "ratio": 2.0}]}
    return {"case": {"seed": seed, "kind": kind}, "code": "made up", "label": label, "result": result}


def _family(draw: np.random.Generator) -> dict[str, Any]:
    right = bool(draw.random() < 0.7)
    tests = FamilyFeatures(
        lead_nats=30.0 if right else 2.0, share=0.5, p=0.005, of_largest=1.0 if right else 0.2, larger_links=0
    )
    place = (
        {"at": "A2", "on": "reversals", "form": "loop"}
        if right
        else {"at": "tip", "on": "travel", "form": "smooth"}
    )
    return place | {"link": "mechanics", "probability": 0.9, "share": 0.5, "tests": tests.as_dict()}
