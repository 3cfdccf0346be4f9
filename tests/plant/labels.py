"""The truth of a case: what acts, where, on what it depends, how large it is, and which answers are right."""

from dataclasses import asdict

from tests.plant import beyond, imitation, instruments, truth
from tests.plant import faults as acting
from tests.plant.effects import LIBRARY, SLIPS
from tests.plant.effects.registry import ALL
from tests.plant.faults import Fault
from tests.plant.instruments import Instruments
from tests.plant.plans import Plan
from tests.plant.robot import Run
from tests.plant.scene import JOINTS

MANY_JOINTS = {"wrist_coupling": ("A5", "A6"), "axis_coupling": ("A3", "A2")}
OF_ALL = ("held_set_points", "supply_sags")
"""Unknown effects that act in all joints at once."""
SCHEMA = "plant/label/2"


def label_of(plan: Plan, sizes: list[float], driven: list[Run], without: list[Run]) -> dict:
    """Everything that was drawn and what it did to the signals."""
    entries = _entries(plan, sizes, driven, without)
    return {
        "schema": SCHEMA,
        "seed": plan.seed,
        "asked": plan.name,
        "null": not plan.faults,
        "slip": any(f.kind in SLIPS.values() for f in plan.faults),
        "in_library": all(f.kind in LIBRARY.values() or f.kind in SLIPS.values() for f in plan.faults),
        "wanted_ratio": plan.ratio,
        "visible": any(_visible(entry) for entry in entries),
        "effects": entries,
        "answers": answers(plan),
        "instruments": asdict(plan.how),
        "foreign_noise": [asdict(kind) for kind in plan.how.foreign],
        "mismatch_law": asdict(plan.options.law),
        "robot_mismatch": asdict(plan.days[0].mismatch),
        "runs": [
            {
                "run": f"run-{day.number + 1}",
                "program": day.program,
                "started": day.started.isoformat(),
                "age_s": day.age_s,
                "duration_s": float(run.t_s[-1]),
                "shift_mm": day.mismatch.shift_mm,
                "turn_rad": day.mismatch.turn_rad,
                "clocks_s": day.mismatch.clocks_s,
                "force_zero_N": day.mismatch.force_zero_N,
            }
            for day, run in zip(plan.days, driven, strict=True)
        ],
    }


def _visible(entry: dict) -> bool:
    """Whether some measured signal changes by its noise."""
    seen = [s["ratio"] for name, s in entry["signals"].items() if name != "joint_commanded"]
    return max([entry["ratio"], *seen]) >= 1.0


def answers(plan: Plan) -> list[dict]:
    """The answer that is right: nothing for no effect and for one that no library has."""
    known = [f for f in plan.faults if f.kind in LIBRARY.values() or f.kind in SLIPS.values()]
    return [{"effect": f.kind.name, "target": f.target} for f in known]


def _entries(plan: Plan, sizes: list[float], driven: list[Run], without: list[Run]) -> list[dict]:
    bare = [instruments.clean(run, plan.how) for run in without]
    out = []
    for fault, size in zip(plan.faults, sizes, strict=True):
        alone = driven
        if len(plan.faults) > 1:
            alone = [plan.drive(day, [fault.hooks(size)]) for day in plan.days]
        seen = [instruments.clean(run, plan.how) for run in alone]
        changes = [truth.differences(a, b) for a, b in zip(seen, bare, strict=True)]
        sized = truth.sizes(changes, plan.how)
        if fault.kind.signal == "scan":
            sized["scan"] = truth.scan_size(alone, without, plan.how)
        entry = _entry(fault, size, changes, sized, plan.how)
        main = entry["main_signal"] or ""
        entry["left_by_mismatch"] = beyond.left_by_mismatch(changes, bare, main, plan.how)
        entry["stand_ins"] = imitation.stand_ins(changes, bare, plan.days, main, plan.how)
        out.append(entry)
    return out


def _entry(fault: Fault, size: float, changes: list[dict], sized: dict[str, dict], how: Instruments) -> dict:
    main = fault.kind.signal
    if main not in sized:
        main = acting.clearest(sized) if sized else None
    main_ratio = sized[main]["ratio"] if main else 0.0
    timed = main in sized and main != "scan"  # a scan has no times
    where = truth.places(changes, main) if timed else []
    above = truth.above_noise(changes, main, how) if timed else []
    values, depends = fault.values(size), fault.depends
    entry = {
        "effect": fault.kind.name,
        "family": fault.kind.family,
        "target": fault.target,
        "form": "same" if fault.same else "other",
        "form_name": fault.form,
        "size": size,
        "parameters": values,
        "main_signal": main,
        "ratio": main_ratio,
        "signals": sized,
        "where": _spans(where),
        "above_noise": _spans(above),
        "depends": {
            "where": depends.where,
            "target": fault.target,
            "joints": _joints(fault),
            "on": list(depends.on),
            "form": depends.form,
            "links": list(depends.links),
        },
    }
    if "moments" in values:
        entry["moments"] = values["moments"]
    elif fault.kind.moments and above:
        entry["moments"] = truth.moments(changes, main)
    if depends.form == "step" and "at_s" in values:
        entry["step"] = {k: values[k] for k in ("run", "at_s", "size", "unit", "direction") if k in values}
    return entry


def _joints(fault: Fault) -> list[str]:
    """Joints that an effect acts in."""
    if fault.kind.name in MANY_JOINTS:
        return list(MANY_JOINTS[fault.kind.name])
    if fault.target == ALL or fault.kind.name in OF_ALL:
        return list(JOINTS)
    return [fault.target] if fault.target in JOINTS else []


def _spans(per_run: list) -> list[dict]:
    return [
        {"run": f"run-{i + 1}", "t_start_s": a, "t_end_s": b}
        for i, intervals in enumerate(per_run)
        for a, b in intervals
    ]
