"""The diagnosis in words: one sentence a process engineer understands, then links, places, causes, limits."""

from collections.abc import Iterator, Mapping
from typing import Any

from gcode2krl.gap.choose.judgement import NAMED
from gcode2krl.gap.tell.result import Gap

_SIGNALS = {
    "tcp": "at the tool tip", "force": "of force", "joint_actual": "of servo error",
    "joint_load": "behind the gears", "joint_commanded": "off the commanded path", "timing": "off in time",
    "scan": "on the part",
}  # fmt: skip


def text_report(gap: Gap) -> str:
    """Return the report as text."""
    return "\n".join(_lines(gap))


def _lines(gap: Gap) -> Iterator[str]:
    yield headline(gap)
    if gap.links:
        yield ""
        yield "link        before      after       noise       verdict"
        for link in gap.links:
            yield (
                f"{link['link']:<11} {number(link['rms_before']):<11} {number(link['rms_after']):<11} "
                f"{number(link['noise']):<11} {link['verdict']} ({link['unit']})"
            )
    intervals = gap.where.get("intervals", [])
    if intervals:
        yield ""
        yield "where"
        for each in intervals[:8]:
            lines = f", lines {each['lines'][0]}-{each['lines'][1]}" if each["lines"] else ""
            yield (
                f"  {each['run']}: {each['t_start_s']:.2f}-{each['t_end_s']:.2f} s{lines}: "
                f"{number(each['rms'])} ({each['what']})"
            )
        if len(intervals) > 8:
            yield f"  … and {len(intervals) - 8} more"
    if gap.causes:
        yield ""
        yield "causes"
        for cause in gap.causes[:8]:
            yield "  " + _cause(cause)
    if gap.not_examined:
        yield ""
        yield "not examined"
        for each in gap.not_examined:
            yield f"  {each['link']}: needs {each['needs']}"
    for note in gap.notes:
        yield f"note: {note}"


def headline(gap: Gap) -> str:
    """Return the first sentence."""
    size, named = gap.gap, gap.named_causes
    slip = next((cause for cause in named if "words" in cause), None)
    if slip is not None:
        return f"Set-up slip: {slip['words']}."
    floor = f"noise floor {number(size['noise_floor'])} {size['unit']}"
    if gap.verdict == "no_gap":
        before = f"{number(size['rms_before'])} {size['unit']}"
        return f"No gap: {before} RMS are what noise and normal mismatch explain."
    first = (
        f"{number(size['rms_before'])} {size['unit']} RMS {_SIGNALS.get(size['signal'], '')}{_mostly(gap)}"
    )
    if not named:
        return f"{first}: no effect of the library explains it; {floor}."
    causes = " and ".join(describe(cause) for cause in named[:3])
    left = "more remain than noise explains: " if gap.unexplained.get("significant") else ""
    return (
        f"{first}: {causes}; with {'it' if len(named) == 1 else 'them'} in the model {left}"
        f"{number(size['rms_after'])} {size['unit']} on data not used; {floor}."
    )


def describe(cause: Mapping[str, Any]) -> str:
    """Return a cause with its parameters, ``backlash of A2, gap 0.021 deg ± 0.002 deg``."""
    name = cause["effect"].replace("_", " ")
    text = f"{name} of {cause['target']}" if cause["target"] else name
    shown = []
    for key, each in cause["parameters"].items():
        stem, _, unit = key.rpartition("_")
        half = (each["high"] - each["low"]) / 2.0
        name, unit = ((stem or key).replace("_", " "), unit if stem else "")
        shown.append(f"{name} {number(each['value'])} ± {half:.2g} {unit}".rstrip())
    return f"{text}, {', '.join(shown)}" if shown else text


def _mostly(gap: Gap) -> str:
    phases = gap.where.get("phases") or []
    joints = gap.where.get("joints") or []
    if not phases or phases[0]["share"] < 0.5:
        return ""
    share = {0.9: "nearly all of it", 0.75: "four fifths of it", 0.6: "two thirds of it", 0.0: "half of it"}
    words = next(text for least, text in share.items() if phases[0]["share"] >= least)
    place = {
        "corner": "at corners", "reversal": "after reversals", "entry": "where the cutter enters",
        "exit": "where it leaves", "cruise": "while cutting", "air": "in air",
    }[phases[0]["phase"]]  # fmt: skip
    joint = f" of axis {joints[0]['joint'][1:]}" if phases[0]["phase"] == "reversal" and joints else ""
    return f", {words} {place}{joint}"


def _cause(cause: Mapping[str, Any]) -> str:
    mark = "" if cause["probability"] >= NAMED else " (not named)"
    shrink = "" if cause["shrink"] is None else f", takes {cause['shrink']:.0%} of the gap on data not used"
    return f"{cause['probability']:.2f} {describe(cause)}{shrink}{mark}"


def number(value: Any) -> str:
    """Return a number with three significant digits."""
    return "-" if value is None else f"{value:.3g}"
