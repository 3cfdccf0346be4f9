"""Kinds of cases for a check: each is drawn by its name and a seed, with everything else in the label.

`python -m tests.plant.kinds KIND --cases 10 --seed 1 -o folder`
"""

import argparse
import sys
import time
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.plant import cases, mismatch, plans
from tests.plant.confounded import PAIRS
from tests.plant.effects import LIBRARY, SLIPS, UNKNOWN
from tests.plant.faults import Fault
from tests.plant.plans import WITHOUT_SCAN, Options, Plan

KINDS = (
    "null",
    "null_foreign_noise",
    "null_foreign_mismatch",
    "single",
    "double",
    "open",
    "deleted",
    "slip",
    "confounded",
    "missing",
    "story",
    "many",
)
CLEAR = (1.0, 4.0)  # ratio of a case in which the answer must be seen
MISSING = {  # what a person may not have
    "no_tracker": ("tracker",),
    "no_force": ("force",),
    "no_controller": ("controller",),
    "no_load_encoders": tuple(f"q{j}_load_deg" for j in range(1, 7)),
    "load_encoders_of_a1_a2_a3": tuple(f"q{j}_load_deg" for j in range(4, 7)),
    "no_torques": tuple(f"tau{j}_Nm" for j in range(1, 7)),
    "no_moments": ("mx_Nm", "my_Nm", "mz_Nm"),
}


STORIES: dict[str, tuple[str, tuple[float, float] | None]] = {  # what happens, and its size where it is told
    "collision": ("collision@A2", (900.0, 1300.0)),  # 1.1 kN for 10 to 30 ms; A2 has slipped from then on
    "jerk": ("jerk_feed_forward", None),
    "jerk_of_all": ("jerk_feed_forward@all", None),
    "snag": ("open:cable_jerks_free", None),
}
"""Plain events: what happens at which moment (`effects[].moments` of the label) has to be told."""
MANY = (3, 6)  # so many of these at once, each of a place or kind of its own, as arms have them on arrival
SMALL = (1.0, 2.5)  # ratio of each of them
SET_UP = [*(f"mastering@A{j}" for j in range(1, 7)), "base_frame", "tool_frame", "servo_lag@all"]
SET_UP += ["force_offset", "force_scale"]
COMMON = {
    "servo_lag@all": (0.003, 0.03),  # s
    "dead_time@all": (0.003, 0.03),
    "backlash@all": (0.001, 0.02),  # deg
}
"""What six synchronised axes have alike: as large as on real arms, whatever the noise."""


def draw_case(
    kind: str,
    seed: int,
    folder: str | Path,
    effect: str | None = None,
    form: str | None = None,
    predictions: str = "../predictions",
) -> dict:
    """Write the case of a kind and a seed to `folder` and its label beside it; returns the label.

    `effect`: as for `make_case`, of the shelf that the kind draws from; for "confounded" the name of a pair.
    `form`: "same", "other" or None for a third of others. Raises ValueError for what is not there.
    """
    made_with = {"kind": kind, "seed": seed, "effect": effect, "form": form}
    plan, more = plan_of(**made_with)
    return cases.store(plan, folder, predictions, {"kind": kind, "made_with": made_with, **more})


def plan_of(kind: str, seed: int, effect: str | None = None, form: str | None = None) -> tuple[Plan, dict]:
    """The case before it is driven, and what its label says beside the plan."""
    if kind not in KINDS:
        raise ValueError(f"no kind {kind!r}; known: {', '.join(KINDS)}")
    rng = np.random.default_rng([seed, zlib.crc32(kind.encode())])
    options, more = BUILDERS.get(kind, _plain(kind))(rng, Options(effect=effect, form=form))
    plan = plans.draw(seed, options)
    if options.missing:
        more["undecided"] = any(_measured_in(fault) in options.missing for fault in plan.faults)
    return plan, more


def _measured_in(fault: Fault) -> str:
    """Table or column in which an effect is judged, if it is one and no other."""
    if fault.kind.signal == "joint_load" and fault.target is not None:
        return f"q{fault.target[1:]}_load_deg"
    return {"tcp": "tracker", "force": "force", "joint_actual": "controller"}.get(fault.kind.signal, "")


def _plain(kind: str):
    """One effect of a shelf."""

    def build(rng: np.random.Generator, options: Options) -> tuple[Options, dict]:
        drawn = str(rng.choice(SHELVES[kind]()))
        effect = _known_form(options, drawn)
        return replace(options, effect=effect, sized=COMMON.get(effect)), {}

    return build


def _known_form(options: Options, drawn: str) -> str:
    return drawn if options.effect is None else options.effect


SHELVES = {
    "null": lambda: ["none"],
    "null_foreign_noise": lambda: ["none"],
    "null_foreign_mismatch": lambda: ["none"],
    "single": lambda: sorted(LIBRARY),
    "deleted": lambda: sorted(LIBRARY),
    "missing": lambda: WITHOUT_SCAN,
    "open": lambda: [f"open:{name}" for name in sorted(UNKNOWN)],
    "slip": lambda: sorted(SLIPS),
}


def _foreign_noise(rng: np.random.Generator, options: Options) -> tuple[Options, dict]:
    effect = options.effect or "none"
    return replace(options, effect=effect, foreign_noise=True), {}


def _foreign_mismatch(rng: np.random.Generator, options: Options) -> tuple[Options, dict]:
    effect = options.effect or "none"
    return replace(options, effect=effect, law=mismatch.foreign(rng)), {}


def _double(rng: np.random.Generator, options: Options) -> tuple[Options, dict]:
    pair = "+".join(rng.choice(WITHOUT_SCAN, 2, replace=False))
    return replace(options, effect=options.effect or pair, ratios=CLEAR), {}


def _many(rng: np.random.Generator, options: Options) -> tuple[Options, dict]:
    count = int(rng.integers(MANY[0], MANY[1] + 1))
    drawn = "+".join(str(each) for each in rng.choice(SET_UP, count, replace=False))
    return replace(options, effect=options.effect or drawn, form="same", ratios=SMALL), {}


def _deleted(rng: np.random.Generator, options: Options) -> tuple[Options, dict]:
    effect = options.effect or str(rng.choice(SHELVES["deleted"]()))
    more = {"delete": effect.partition("@")[0], "in_library": False, "answers": []}
    return replace(options, effect=effect), more


def _confounded(rng: np.random.Generator, options: Options) -> tuple[Options, dict]:
    name = options.effect or str(rng.choice(sorted(PAIRS)))
    if name not in PAIRS:
        raise ValueError(f"no pair {name!r}; known: {', '.join(PAIRS)}")
    pair = PAIRS[name]
    more = {
        "pair": name,
        "answers": [{"effect": e, "target": t} for e, t in pair.answers],
        "undecided": True,
        "why": pair.why,
        "apart": list(pair.apart),
    }
    return replace(options, effect=pair.effect, form="same", ratios=CLEAR), more


def _missing(rng: np.random.Generator, options: Options) -> tuple[Options, dict]:
    effect = options.effect or str(rng.choice(SHELVES["missing"]()))
    what = str(rng.choice(sorted(MISSING)))
    return replace(options, effect=effect, missing=MISSING[what]), {"missing": what}


def _story(rng: np.random.Generator, options: Options) -> tuple[Options, dict]:
    name = options.effect or str(rng.choice(sorted(STORIES)))
    if name not in STORIES:
        raise ValueError(f"no story {name!r}; known: {', '.join(STORIES)}")
    effect, sized = STORIES[name]
    return replace(options, effect=effect, form="same", ratios=CLEAR, sized=sized), {"story": name}


BUILDERS = {
    "story": _story,
    "null_foreign_noise": _foreign_noise,
    "null_foreign_mismatch": _foreign_mismatch,
    "double": _double,
    "many": _many,
    "deleted": _deleted,
    "confounded": _confounded,
    "missing": _missing,
}


def main(arguments: list[str] | None = None) -> int:
    """Write cases of a kind and print a line for each."""
    parser = argparse.ArgumentParser(prog="python -m tests.plant.kinds", description=__doc__)
    parser.add_argument("kind", choices=(*KINDS, "names"), help="names: list the effects and stop")
    parser.add_argument("--cases", type=int, default=1, help="how many")
    parser.add_argument("--seed", type=int, default=1, help="of the first case; case i has seed + i")
    parser.add_argument("--effect", help="of the kind's shelf; default: drawn")
    parser.add_argument("--form", choices=["same", "other"], help="default: a third are other forms")
    parser.add_argument("-o", "--output", type=Path, default=Path(), help="folder for KIND-0001 …")
    options = parser.parse_args(arguments)
    if options.kind == "names":
        print("\n".join([*LIBRARY, *SLIPS, *(f"open:{name}" for name in UNKNOWN)]))
        return 0
    for i in range(options.cases):
        start, seed = time.perf_counter(), options.seed + i
        place = options.output / f"{options.kind}-{seed:05d}"
        try:
            label = draw_case(options.kind, seed, place, options.effect, options.form)
        except ValueError as error:
            print(f"kinds: {error}", file=sys.stderr)
            return 2
        print(f"{place.name}  {time.perf_counter() - start:4.1f} s  {cases.line_of(label)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
