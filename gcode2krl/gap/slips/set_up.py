"""Set-up slips, tested before everything else: most real gaps are one of them.

A slip is named where the run's own checks name it, or where the effect of the slip, re-simulated, takes nine
tenths of a gap that is far beyond what machines do by themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Effect
from gcode2krl.effects.frame_effect import frame_of
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Gcode2KrlError, Issue
from gcode2krl.gap.beside.clocks import fitted_offset
from gcode2krl.gap.beside.commanded import on_the_curve
from gcode2krl.gap.beside.links import FORCE, MECHANICS, MODEL_RAD, PATH
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.fit.likelihood import Likelihood
from gcode2krl.gap.fit.noise import white
from gcode2krl.gap.fit.nuisance import Nuisance
from gcode2krl.gap.fit.refitting import refit
from gcode2krl.gap.slips.program import other_program
from gcode2krl.runs import check_against
from gcode2krl.runs.matching import rotation_between
from gcode2krl.units import DEG_PER_RAD

_LARGE_RAD = 3e-3
"""A commanded path further off than this, 5 mm at an arm's length, is no matter of a servo or a gear."""
_LARGE_MM = 20.0
_EXPLAINS = 0.9
_SPEED = 5.0
"""Per cent by which the override must differ."""
_FORCE_UNITS = {
    1e-3: "kilonewtons", 0.1019716: "kilograms-force", 0.2248089: "pounds-force", 1e3: "millinewtons",
    10.0: "decinewtons",
}  # fmt: skip
_NEAR_UNIT = 0.15
_TURN_RAD = 1e-4
"""0.01 mm over 100 mm: a frame turned by less is a shift."""
_FATAL = ("run-unit", "run-axes", "run-program")


@dataclass(frozen=True)
class Slip:
    """A slip, where it showed, and whether anything can be said beyond it."""

    applied: Applied
    link: str
    rms_before: float
    rms_after: float | None
    unit: str
    words: str
    final: bool
    """The run cannot be compared further."""
    alike: tuple[tuple[str, str | None], ...] = ()
    """Names and targets of the slips that it cannot be told from; None for a target that is not known."""


def slips_of(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> tuple[list[Slip], list[Issue]]:
    """Return the slips that all runs share, and what the checks of the runs say besides."""
    issues = [issue for pair in pairs for issue in _checked(pair)]
    codes = {issue.code for issue in issues if issue.severity == "error"}
    found = _other_program(pairs, library) or [*_override(pairs, library), *_other_frame(pairs, library)]
    if found:
        return found[:1], issues
    found = _tracker_frame(pairs, library) or _force_unit(pairs, library)
    if found:
        return found, issues
    for issue in issues:
        if issue.severity == "error" and issue.code in _FATAL and len(codes) > 0:
            name = {"run-unit": "unit", "run-axes": "unit", "run-program": "other_program"}[issue.code]
            return [_fatal(library, name, issue, pairs)], issues
    return [], issues


def clock_slips(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return the tables whose clock is so far off that it was taken off their stamps."""
    found = []
    if "clock" not in library:
        return []
    for link in (PATH, MECHANICS):
        name = link.table
        offsets = [pair.clock_s.get(name, 0.0) for pair in pairs]
        if not any(offsets):
            continue
        plain = [replace(pair, clock_s={**pair.clock_s, name: 0.0}) for pair in pairs]
        after, before = link.traces(pairs), link.traces(plain)
        if not after or not before:
            continue
        offset = float(np.median(offsets))
        if offset == 0.0:
            continue
        one = Applied(library["clock"], name, {"offset_s": offset, "skew": 0.0})
        words = f"the clock of {name} is {offset:+.3f} s off the prediction's"
        rms = [_rms([trace.residual for trace in traces]) * after[0].factor for traces in (before, after)]
        found.append(Slip(one, link.name, rms[0], rms[1], after[0].unit, words, False))
    return found


def _checked(pair: Pair) -> list[Issue]:
    if pair.from_log:
        return []
    return check_against(pair.run, pair.inputs.time_s, pair.inputs.position_mm, pair.inputs.q_cmd_rad)


def _fatal(library: Mapping[str, Effect], name: str, issue: Issue, pairs: Sequence[Pair]) -> Slip:
    file = issue.message.split(".")[0].split(":")[0]
    target = file if file in library[name].targets(pairs[0].inputs.cell) else None
    return _final(library[name], target, issue.message, pairs)


def _final(effect: Effect, target: str | None, words: str, pairs: Sequence[Pair]) -> Slip:
    """Return a slip beyond which nothing is compared."""
    traces = PATH.traces(pairs) or MECHANICS.traces(pairs)
    rms = _rms([trace.residual for trace in traces]) if traces else 0.0
    factor, unit = (traces[0].factor, traces[0].unit) if traces else (1.0, "mm")
    values = {p.name: p.start if p.nominal is None else p.nominal for p in effect.parameters}
    return Slip(Applied(effect, target, values), "path", rms * factor, None, unit, words, True)


def _other_program(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return the run of another program, if its commanded path shows one; no override explains that."""
    words = other_program(pairs) if "other_program" in library else None
    return [] if words is None else [_final(library["other_program"], None, words, pairs)]


def _override(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return the override at which the program ran, by the time that the same path took."""
    if "override" not in library or any(pair.from_log for pair in pairs):
        return []
    percents = [_percent(pair) for pair in pairs]
    known = [each for each in percents if each is not None]
    if not known or abs(float(np.median(known)) - 100.0) < _SPEED:
        return []
    traces = PATH.traces(pairs) or MECHANICS.traces(pairs)
    if not traces:
        return []
    guess = float(np.median(known))
    tried = [
        Applied(library["override"], None, {"percent": percent})
        for percent in guess * np.array([0.9, 0.95, 0.98, 1.0, 1.02, 1.05, 1.1])
    ]
    best, rms = _best(traces, tried)
    for width in (0.02, 0.008, 0.003, 0.001, 4e-4, 1.5e-4):
        around = best.values["percent"] * (1.0 + width * np.array([-0.5, 0.0, 0.5, -1.0, 1.0]))
        best, rms = _best(traces, [replace(best, values={"percent": float(p)}) for p in around])
    return _slip_if_explained(traces, best, rms, f"the run was at {best.values['percent']:.1f} % override")


def _percent(pair: Pair) -> float | None:
    """Return 100 times predicted over measured time in motion; None where paths differ in length."""
    table = pair.run.controller
    if table is not None and table.q_cmd_rad is not None and np.isfinite(table.q_cmd_rad).all():
        own_s, own, wanted, still = table.time_s, table.q_cmd_rad, pair.inputs.q_cmd_rad, 1e-3
    elif pair.run.tracker is not None:
        own_s, own, wanted, still = (
            pair.run.tracker.time_s,
            pair.run.tracker.position_mm,
            pair.inputs.position_mm,
            1.0,
        )
    else:
        return None
    measured, length = _moving(own_s, own, still)
    predicted, expected = _moving(pair.inputs.time_s, wanted, still)
    if measured <= 0.0 or expected <= 0.0 or abs(length / expected - 1.0) > 0.1:
        return None
    return 100.0 * predicted / measured


def _moving(time_s: Floats, values: Floats, still: float) -> tuple[float, float]:
    """Return for how long a signal moves faster than ``still`` a second, and how far."""
    step = max(1, round(0.1 / float(np.median(np.diff(time_s)))))
    t, v = time_s[::step], values[::step]
    way = np.linalg.norm(np.diff(v, axis=0), axis=1)
    dt = np.diff(t)
    moves = way > still * dt
    return float(dt[moves].sum()), float(way[moves].sum())


def _other_frame(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return another tool or base, if the commanded joints show one."""
    traces = PATH.traces(pairs)
    if not traces or _rms([trace.residual for trace in traces]) < _LARGE_RAD:
        return []
    cell, used = pairs[0].inputs.cell, set(np.unique(pairs[0].inputs.tool).tolist())
    tried = []
    if "tool_number" in library:
        effect = library["tool_number"]
        tried += [Applied(effect, str(n), {}) for n in sorted(cell.tool) if n not in used]
    if "base_number" in library:
        tried.append(_base_number(pairs[0], library["base_number"]))
    if not tried:
        return []
    best, rms = _best(traces, tried)
    if best.effect.name == "base_number":
        best = _refined(traces, best)
        rms = _rms([trace.measured - trace.sample([best]) for trace in traces])
    if not all(_brings_back(pair, best) for pair in pairs):
        return []
    name = best.target if best.effect.name == "tool_number" else "another one"
    what = "tool" if best.effect.name == "tool_number" else "base"
    found = _slip_if_explained(traces, best, rms, f"the commanded joints are those of {what} {name}")
    return [replace(slip, alike=_alike(best, pairs)) for slip in found]


def _brings_back(pair: Pair, one: Applied) -> bool:
    """Tell whether the frame of another tool or base puts the commanded path where it was programmed."""
    if one.effect.name == "tool_number":
        return on_the_curve(pair, tool=int(one.target or 0))
    return on_the_curve(pair, frame_of(one))


def _alike(one: Applied, pairs: Sequence[Pair]) -> tuple[tuple[str, str | None], ...]:
    """Return what shifts the path like another tool or base: one of the other, while the tool never turns."""
    rotations = np.concatenate([pair.inputs.tool_rotation for pair in pairs])
    turns = float(np.abs(rotations - rotations[0]).max())
    if one.effect.name == "base_number":
        turns = max(turns, float(np.abs(frame_of(one)[:3, :3] - np.eye(3)).max()))
        return (("tool_number", None),) if turns < _TURN_RAD else ()
    cell = pairs[0].inputs.cell
    wrong = cell.tool_matrix(int(one.target or 0))[:3, :3]
    for number in np.unique(np.concatenate([pair.inputs.tool for pair in pairs])):
        turns = max(turns, float(np.abs(cell.tool_matrix(int(number))[:3, :3] - wrong).max()))
    return (("base_number", None),) if turns < _TURN_RAD else ()


def _refined(traces: Sequence[Trace], best: Applied) -> Applied:
    """Return the frame that fits the commanded joints of all runs, whose clocks may be off."""
    nuisance = [
        [Nuisance("clock", False, -np.ascontiguousarray(trace.rate.T)[:, :, None] * Mismatch.clock_s)]
        for trace in traces
    ]
    target = Likelihood(traces, nuisance, [white(MODEL_RAD)] * traces[0].shape[1])
    return refit(target, (best,), steps=3).applied[0]


def _base_number(pair: Pair, effect: Effect) -> Applied:
    """Return the base that the logged joints belong to (Kabsch 1976 on their tips)."""
    from gcode2krl import robot
    from gcode2krl.gap.beside.interpolation import cubic

    table = pair.run.controller
    values = dict.fromkeys(effect.names, 0.0)
    if table is None or table.q_cmd_rad is None or not np.isfinite(table.q_cmd_rad).all():
        return Applied(effect, None, values)
    tool = int(np.bincount(np.maximum(pair.inputs.tool, 0)).argmax())
    tips, turned = robot.forward(table.q_cmd_rad, pair.inputs.cell, tool)
    traces = PATH.traces([pair])
    late_s, deviation = fitted_offset(traces[0]) if traces else (0.0, np.inf)
    stamps = pair.stamps(table) - (late_s if np.isfinite(deviation) else 0.0)
    wanted = cubic(stamps, pair.inputs.time_s, pair.inputs.position_mm)
    row = len(tips) // 2
    near = int(np.argmin(np.abs(pair.inputs.time_s - stamps[row])))
    rotation = fr.rotation_from_quaternion(turned[row : row + 1])[0] @ pair.inputs.tool_rotation[near].T
    by_path, _ = rotation_between(wanted, tips)
    if np.abs(by_path - rotation).max() < 1e-3:
        rotation = by_path
    shift = (tips - wanted @ rotation.T).mean(axis=0)
    abc = fr.abc_from_rotation(rotation) * DEG_PER_RAD
    names = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
    return Applied(effect, None, dict(zip(names, [*shift.tolist(), *abc.tolist()], strict=True)))


def _tracker_frame(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return the frame in which the tracker states the tip, if it is far from ``$BASE`` (Kabsch 1976)."""
    traces = [
        trace for trace in MECHANICS.traces(pairs) if not (trace.in_sensor_frame or trace.in_tool_frame)
    ]
    if "base_frame" not in library or not traces or _rms([trace.residual for trace in traces]) < _LARGE_MM:
        return []
    wanted, found = (
        np.concatenate([getattr(trace, name) for trace in traces]) for name in ("nominal", "measured")
    )
    rotation, shift = rotation_between(wanted, found)
    abc = fr.abc_from_rotation(rotation) * DEG_PER_RAD
    effect = library["base_frame"]
    numbers = [*shift.tolist(), *abc.tolist()]
    names = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
    one = Applied(effect, None, dict(zip(names, numbers, strict=True)))
    rms = _rms([trace.measured - trace.sample([one]) for trace in traces])
    words = f"the tracker is in another frame: $BASE shifted by {np.linalg.norm(shift):.0f} mm and turned"
    return _slip_if_explained(traces, one, rms, words)


def _force_unit(pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
    """Return the unit of the force table, if it is none of newtons."""
    traces = FORCE.traces(pairs)
    if "unit" not in library or not traces or not any(trace.nominal.any() for trace in traces):
        return []
    power = sum(float(np.sum(trace.nominal**2)) for trace in traces)
    factor = sum(float(np.sum(trace.nominal * trace.measured)) for trace in traces) / power
    near = min(_FORCE_UNITS, key=lambda unit: abs(np.log(max(factor, 1e-12) / unit)))
    if abs(np.log(max(factor, 1e-12) / near)) > _NEAR_UNIT:
        return []
    one = Applied(library["unit"], "force", {"factor": near})
    rms = _rms([trace.measured - trace.sample([one]) for trace in traces])
    words = f"force.csv is {near:g} times the predicted force: {_FORCE_UNITS[near]} in place of newtons"
    return _slip_if_explained(traces, one, rms, words)


def _best(traces: Sequence[Trace], tried: Sequence[Applied]) -> tuple[Applied, float]:
    """Return the effect that leaves least, and its rms; what cannot be simulated is left out."""
    found = []
    for one in tried:
        try:
            found.append((_rms([trace.measured - trace.sample([one]) for trace in traces]), one))
        except Gcode2KrlError:
            continue
    if not found:
        return tried[0], float("inf")
    rms, best = min(found, key=lambda each: each[0])
    return best, rms


def _slip_if_explained(traces: Sequence[Trace], best: Applied, rms: float, words: str) -> list[Slip]:
    before = _rms([trace.residual for trace in traces])
    if rms**2 > (1.0 - _EXPLAINS) * before**2:
        return []
    trace = traces[0]
    return [Slip(best, trace.link.name, before * trace.factor, rms * trace.factor, trace.unit, words, False)]


def _rms(values: Sequence[Floats]) -> float:
    """Return the rms of vectors, a constant clock error of a run left in."""
    return float(np.sqrt(np.mean(np.concatenate([np.sum(v**2, axis=1) for v in values]))))
