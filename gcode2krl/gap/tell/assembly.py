"""The answer: judgements of the links, slips and clocks, put together."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import Issue
from gcode2krl.gap.beside.context import Context
from gcode2krl.gap.beside.links import GEAR, JOINTS, LINKS, MECHANICS, PATH, TIMING
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.timing import timing_share, timing_sizes
from gcode2krl.gap.choose.detectable import observable
from gcode2krl.gap.choose.judgement import Cause, Judgement
from gcode2krl.gap.slips.slip import Slip
from gcode2krl.gap.tell.result import Gap
from gcode2krl.gap.tell.where import place

_MOST_ALIKE = 5
_SURE = 0.95
"""A slip was re-simulated and took nine tenths of a gap that machines do not have by themselves."""


def answer(context: Context, slips: Sequence[Slip], issues: Sequence[Issue]) -> Gap:
    """Return the diagnosis of all links together."""
    pairs = context.pairs
    judgements = [each for each in context.judgements if isinstance(each, Judgement)]
    main = max(judgements, key=_weight, default=None)
    gapped = [each for each in judgements if each.verdict != "no_gap"]
    causes = [_slip_cause(slip) for slip in slips]
    causes += [_cause(cause, each) for each in gapped for cause in each.causes]
    causes.sort(key=lambda cause: -cause["probability"])
    verdict = _verdict(gapped, slips)
    named = [slip.applied for slip in slips if not slip.final]
    named += [one for each in gapped for one in each.applied]
    every = [
        replace(issue, message=f"{pair.name}: {issue.message}") for pair in pairs for issue in pair.run.issues
    ]
    return Gap(
        verdict=verdict,
        gap=_gap(main, slips),
        links=_links(judgements, slips),
        where=_where(main, judgements),
        causes=causes,
        unexplained=_rest(main),
        not_examined=_not_examined(judgements, slips),
        observable=[entry for each in judgements for entry in observable(each.examination)],
        named=tuple(named),
        issues=(*issues, *every),
        runs=tuple(pair.name for pair in pairs),
        notes=tuple(_notes(pairs, judgements)),
    )


def _notes(pairs: Sequence[Pair], judgements: Sequence[Judgement]) -> Iterator[str]:
    """Yield what a reader should know of what was left out."""
    if any(pair.run.head.angles == "relative" for pair in pairs):
        yield "angles are relative: no kinematics, no limits, no gravity"
    for each in judgements:
        left = [joint for joint in JOINTS if joint not in each.traces[0].components]
        if each.link.of_joints and left:
            yield f"{each.link.name}: {', '.join(left)} left out: not recorded, or never moving"
    for each in judgements:
        if each.usual:
            names = ", ".join(one.label for one in each.usual)
            yield f"{each.link.name}: {names} within normal mismatch"


def _weight(judgement: Judgement) -> tuple[bool, float]:
    """Order links by whether there is a gap, then by its power over the noise's."""
    size = judgement.size
    return judgement.verdict != "no_gap", size.excess_before / max(size.noise, 1e-30)


def _verdict(gapped: Sequence[Judgement], slips: Sequence[Slip]) -> str:
    if not gapped:
        return "explained" if slips else "no_gap"
    verdicts = {each.verdict for each in gapped}
    if verdicts == {"explained"}:
        return "explained"
    if verdicts == {"unexplained"} and not slips:
        return "unexplained"
    return "partly_explained"


def _gap(main: Judgement | None, slips: Sequence[Slip]) -> dict[str, Any]:
    if main is None or (slips and main.verdict == "no_gap"):
        slip = slips[0] if slips else None
        link = slip.link if slip else MECHANICS
        return {
            "signal": link.signal, "unit": link.unit,
            "rms_before": slip.rms_before if slip else None, "rms_after": slip.rms_after if slip else None,
            "noise_floor": None, "max_before": None, "max_after": None, "shrink": None, "held_out": False,
        }  # fmt: skip
    size, factor = main.size, main.traces[0].factor
    explained = bool(main.causes)
    return {
        "signal": TIMING.signal if _is_timing(main) else main.traces[0].signal,
        "unit": main.traces[0].unit,
        "rms_before": factor * size.before**0.5,
        "rms_after": factor * size.after**0.5,
        "noise_floor": factor * size.floor**0.5,
        "max_before": factor * size.largest_before,
        "max_after": factor * size.largest_after,
        "shrink": size.shrink if explained and main.held_out else None,
        "held_out": main.held_out,
    }


def _is_timing(judgement: Judgement) -> bool:
    return (
        judgement.link.tells_time and judgement.verdict != "no_gap" and timing_share(judgement.traces) > 0.5
    )


def _links(judgements: Sequence[Judgement], slips: Sequence[Slip]) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    by_link = {each.link: each for each in judgements}
    slipped = {slip.link for slip in slips}
    for link in LINKS:
        if link is TIMING and PATH in by_link:
            path = by_link[PATH]
            before, after = timing_sizes(path.traces, path.examination.applied)
            verdict = path.verdict if _is_timing(path) else "no_gap"
            entry = {"link": link.name, "rms_before": before, "rms_after": after, "noise": None, "unit": "s"}
            found.append(entry | {"verdict": verdict})
        if link in by_link:
            each = by_link[link]
            factor = each.traces[0].factor
            verdict = "no_gap" if _is_timing(each) else each.verdict
            found.append({
                "link": link.name,
                "rms_before": factor * each.size.before**0.5,
                "rms_after": factor * each.size.after**0.5,
                "noise": factor * each.size.floor**0.5,
                "unit": each.traces[0].unit,
                "verdict": "explained" if link in slipped and verdict == "no_gap" else verdict,
            })  # fmt: skip
        if link is GEAR and link in by_link:
            found[-1]["offset_deg"] = _zeros(by_link[link])
    return found


def _zeros(judgement: Judgement) -> dict[str, float]:
    """Return the constant difference of the encoders of each joint, which is a zero and no finding."""
    values = np.mean([trace.measured.mean(axis=0) for trace in judgement.traces], axis=0)
    factor = judgement.traces[0].factor
    return {
        name: factor * float(value)
        for name, value in zip(judgement.traces[0].components, values, strict=True)
    }


def _where(main: Judgement | None, judgements: Sequence[Judgement]) -> dict[str, Any]:
    signals = [
        {
            "signal": each.traces[0].signal,
            "rms": each.traces[0].factor * each.size.before**0.5,
            "noise": each.traces[0].factor * each.size.floor**0.5,
            "significant": each.verdict != "no_gap",
        }
        for each in judgements
    ]
    empty: dict[str, Any] = {
        "intervals": [], "direction_base": None, "phases": [], "joints": [], "frequency_hz": None
    }  # fmt: skip
    if main is None or main.verdict == "no_gap":
        return {"signals": signals, **empty}
    named = list(main.applied)
    return {"signals": signals, **place(main.traces, main.examination.noise, named)}


def _cause(cause: Cause, judgement: Judgement) -> dict[str, Any]:
    factor = judgement.traces[0].factor
    shows_in_time = _is_timing(judgement) and TIMING.name in cause.applied.effect.links
    link = TIMING if shows_in_time else judgement.link
    return {
        "effect": cause.applied.effect.name,
        "target": cause.applied.target,
        "link": link.name,
        "probability": cause.probability,
        "parameters": {name: each._asdict() for name, each in cause.parameters.items()},
        "shrink": cause.shrink,
        "rms_after": None if cause.rms_after is None else factor * cause.rms_after,
        "indistinguishable_from": [
            {"effect": rival.applied.effect.name, "target": rival.applied.target}
            for rival, _ in cause.rivals
            if rival.alike
        ][:_MOST_ALIKE],
        "rivals": [
            {"effect": rival.applied.effect.name, "target": rival.applied.target, "probability": share}
            for rival, share in cause.rivals
            if not rival.alike
        ],
    }


def _slip_cause(slip: Slip) -> dict[str, Any]:
    # what it leaves of the gap says how well its numbers are met
    share = (slip.rms_after or 0.0) / slip.rms_before if slip.rms_before > 0.0 else 0.0
    values = {}
    for name, v in slip.applied.values.items():
        wide = share * abs(v) + (Mismatch.clock_s if name.endswith("_s") else 0.0)
        values[name] = {"value": v, "low": v - wide, "high": v + wide}
    return {
        "effect": slip.applied.effect.name, "target": slip.applied.target, "link": slip.link.name,
        "probability": _SURE, "parameters": {} if slip.final else values, "shrink": None,
        "rms_after": slip.rms_after, "words": slip.words,
        "indistinguishable_from": [{"effect": name, "target": target} for name, target in slip.alike],
    }  # fmt: skip


def _rest(main: Judgement | None) -> dict[str, Any]:
    if main is None:
        return {"rms": None, "significant": False, "structure": "unknown"}
    size, factor = main.size, main.traces[0].factor
    return {
        "rms": factor * max(size.after, 0.0) ** 0.5,
        "significant": bool(size.significant),
        "structure": "structured" if size.significant else "white",
    }


def _not_examined(judgements: Sequence[Judgement], slips: Sequence[Slip]) -> list[dict[str, Any]]:
    done = {each.link for each in judgements}
    if PATH in done:
        done.add(TIMING)
    final = any(slip.final for slip in slips)
    return [
        {"link": link.name, "needs": "a run that belongs to the prediction" if final else link.needs}
        for link in LINKS
        if link not in done
    ]
