"""Words for numbers, causes, dependences and the next run."""

import math
from collections.abc import Mapping, Sequence

from gcode2krl.gap.choose.intervals import Interval
from gcode2krl.gap.tell.result import CauseResult, DependsOnResult, EffectAt, EventResult, NextRun, UnknownAt
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.tell
_AXES = ("x", "y", "z")
_UNITS = {
    name: name
    for name in ("mm", "deg", "rad", "mrad", "N", "Nm", "kNm", "kg", "s", "ms", "h", "m", "cm", "K")
} | {"um": "µm", "hz": "Hz", "s2": "s²", "s3": "s³", "krpm": "1000/min", "percent": "%"}
"""Words at the end of a parameter's name that are units -> how they are written."""
_TARGETS = {
    "tracker": "the tracker",
    "force": "the force sensor",
    "controller": "the controller's log",
    "q_cmd": "the commanded joints",
    "q_load": "the load encoders",
    "all": "all axes",
}
_FORCE_AXES = ("fx", "fy", "fz")
_EVENTS = {
    "impulse": "an impulse of {size} in {link}",
    "slip": "a slip of {size} in {link}, which stays",
    "burst": "a burst of {size} in {link}, its instrument's: left out",
}
_FORMS = {
    "drift": "a drift with {on}",
    "periodic": "periodic in {on}",
    "loop": "a loop with {on}",
    "smooth": "a smooth function of {on}",
}


def number(value: float | None) -> str:
    """Return a number with three significant digits, ``-`` for None."""
    return "-" if value is None else f"{value:.3g}"


def rounded(value: float) -> str:
    """Return a number with two significant digits, written out."""
    if abs(value) < 1e-9:  # what is left of two equal numbers
        return "0"
    if not math.isfinite(value):
        return f"{value:g}"
    decimals = max(0, 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}"


def measured(interval: Interval, unit: str) -> str:
    """Return a value and half of its interval, ``0.0212 deg ± 0.0020``: two digits of what is uncertain."""
    half = (interval.high - interval.low) / 2.0
    unit = f" {unit}" if unit else ""
    if not math.isfinite(half) or half <= 0.0:
        return f"{number(interval.value)}{unit}"
    if abs(math.log10(half)) > 4.0:
        return f"{interval.value:.3g}{unit} ± {half:.2g}"
    first = math.floor(math.log10(half))
    decimals = max(0, (1 if round(half / 10.0**first, 6) < 2.0 else 0) - first)
    return f"{interval.value:.{decimals}f}{unit} ± {half:.{decimals}f}"


def unit_of(name: str) -> tuple[str, str]:
    """Return a parameter's name without its unit, and the unit: ``gap_deg`` is gap, in deg.

    Units that follow each other, with or without ``per``, are divided: ``N_per_deg`` is in N/deg.
    """
    words = name.split("_")
    units: list[str] = []
    while words and len(units) < 2 and words[-1] in _UNITS:
        units.insert(0, _UNITS[words.pop()])
        divides = bool(words) and words[-1] == "per"
        if divides:
            words.pop()
        if divides and (not words or words[-1] not in _UNITS):
            units.insert(0, "1")
            break
    return " ".join(words), "/".join(units)


def named(effect: str, target: str | None) -> str:
    """Return an effect and where it is, ``backlash of A2``."""
    name = effect.replace("_", " ")
    return name if target is None else f"{name} of {_TARGETS.get(target, target.replace('_', ' '))}"


def describe(cause: CauseResult, most: int | None = None) -> str:
    """Return a cause with its numbers, ``backlash of A2, 0.0212 deg ± 0.0020``.

    Components of a vector stand in brackets; where there are more than ``most`` numbers none is given.
    """
    if cause.effect == "geometry":
        count = f"{len(cause.parameters)} small numbers" if cause.parameters else "no number by itself"
        return f"the arm's own geometry, {count}"
    moment = cause.moment
    numbers = _numbers({k: v for k, v in cause.parameters.items() if moment is None or k != "at_s"})
    if moment is not None:
        numbers.insert(0, f"at {moment.t_s:.2f} s of {moment.run}, line {moment.line}")
    if most is not None and len(numbers) > most:
        numbers = []
    return ", ".join([named(cause.effect, cause.target), *numbers])


def _numbers(parameters: Mapping[str, Interval]) -> list[str]:
    """Return the numbers of a cause in words; a single one needs no name."""
    names, numbers = list(parameters), []
    while names:
        vector = _vector(names)
        if vector:
            values = ", ".join(rounded(parameters[name].value) for name in vector)
            numbers.append(f"along ({values})")
            names = [name for name in names if name not in vector]
            continue
        name = names.pop(0)
        stem, unit = unit_of(name)
        interval = parameters[name]
        if unit == "s" and abs(interval.value) < _LIMITS.in_ms_below_s:
            interval, unit = Interval(*(1000.0 * each for each in interval)), "ms"
        value = measured(interval, unit)
        numbers.append(value if len(parameters) == 1 or not stem else f"{stem} {value}")
    return numbers


def _vector(names: Sequence[str]) -> list[str]:
    """Return the three components of a direction, where the first names are one."""
    head = list(names[:3])
    is_direction = [name.rpartition("_")[2] for name in head] == list(_AXES) and head[0].startswith(
        "direction"
    )
    return head if is_direction else []


def listed(words: Sequence[str], last: str = "and") -> str:
    """Return words as an English list."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def alike(others: Sequence[EffectAt | UnknownAt]) -> str:
    """Return what a cause cannot be told from."""
    return listed([_other(each) for each in others], "or")


def _other(other: EffectAt | UnknownAt) -> str:
    if isinstance(other, UnknownAt):
        return f"something that the library lacks ({other.at}, {other.on})"
    return named(other.effect, other.target)


def happened(event: EventResult) -> str:
    """Return what happened in a moment: when, on which line, what, how large and for how long."""
    line = f", line {event.line}" if event.line else ""
    what = _EVENTS[event.what].format(size=f"{rounded(event.size)} {event.unit}", link=event.link)
    return f"{event.t_s:.2f} s of {event.run}{line}: {what}, for {rounded(1000.0 * event.lasts_s)} ms"


def depends(found: DependsOnResult) -> str:
    """Return where a gap is and on what it depends: ``tip, a step from 11.2 s of run-1 on``."""
    return ", ".join([_place(found), _form(found), *_size(found), *_course(found)])


def what_there_is(found: DependsOnResult) -> str:
    """Return the same within a sentence: ``a step from 11.2 s of run-1 on at the tip``."""
    place = _place(found)
    where = {"tip": "at the tip", "force": "in the force", "timing": "in time"}.get(place, f"in {place}")
    return ", ".join([f"{_form(found)} {where}", *_size(found)])


def _course(found: DependsOnResult) -> list[str]:
    """Return a course by its ends and, where it lies between them, its farthest point from their line."""
    course = found.course
    if course is None:
        return []
    (x0, y0), *_, (x1, y1) = course.points

    def bend(point: tuple[float, float]) -> float:
        return abs(point[1] - y0 - (y1 - y0) * (point[0] - x0) / (x1 - x0))

    far = max(course.points, key=bend)
    told = [(x0, y0), (x1, y1)]
    if bend(far) > max(abs(y1 - y0), max(abs(y) for _, y in course.points)) / 2.0:
        told.insert(1, far)
    words = [f"{rounded(y)} {course.unit} at {rounded(x)} {course.over_unit}" for x, y in told]
    run = f" of {course.run}" if course.run else ""
    return [f"over {course.over}{run}: {' to '.join(words)}"]


def _place(found: DependsOnResult) -> str:
    """Return the place; the direction says more than the axis of a force."""
    return "force" if found.at in _FORCE_AXES else found.at


def _form(found: DependsOnResult) -> str:
    if found.form in ("step", "impulse") and found.at_time_s is not None:
        line = f", line {found.line}" if found.line else ""
        at = f"{found.at_time_s:.1f} s" + (f" of {found.run}{line}" if found.run else "")
        gone = ", gone in the next run" if found.in_later_runs is False else ""
        return f"a step from {at} on{gone}" if found.form == "step" else f"an impulse at {at}"
    if found.frequency_hz is not None:
        return f"a tone of {number(found.frequency_hz)} Hz"
    return _FORMS.get(found.form, "a function of {on}").format(on=found.on)


def _size(found: DependsOnResult) -> list[str]:
    if found.size is None:
        return []
    size = f"{rounded(found.size)} {found.unit or ''}".rstrip()
    if found.direction is None:
        return [size]
    return [f"{size} along ({', '.join(f'{round(value, 1) + 0.0:.1f}' for value in found.direction)})"]


def kind(cause: CauseResult) -> str | None:
    """Return what a reader should know of a cause's family, form and constancy; None where all is well."""
    words = []
    if cause.family is not None:
        words.append(f"of the kind {cause.family}")
    if cause.form_fits is not None and cause.form_fits < _LIMITS.form_fits_well:
        words.append(f"its form takes {cause.form_fits:.0%} of what its kind takes")
    if cause.constant is not None and cause.constant.p < _LIMITS.constant_least_p:
        spread = cause.constant.inconstancy
        words.append(f"its size varies by {spread:.0%} over runs and halves (p = {cause.constant.p:.2g})")
    return "; ".join(words) or None


def next_run(run: NextRun) -> list[str]:
    """Return the next run in lines: the command, what it separates, what is expected in either case."""
    minutes = f"{run.minutes:.0f} minutes" if run.minutes >= 1.5 else "a minute"
    lines = [f"gcode2krl make-test {run.program}, {minutes}"]
    for pair in run.separates:
        first, second = pair.first.replace("_", " "), pair.second.replace("_", " ")
        lines.append(f'tells "{first}" from "{second}", odds {_odds(pair.odds)}')
    lines += [f"if {each.answer.replace('_', ' ')}: {each.shows}" for each in run.expect]
    return lines


def _odds(odds: float) -> str:
    return "over 1000 to 1" if odds > 1000.0 else f"{rounded(odds)} to 1"
