"""What a column of another exporter is, by its name: ``exporters.toml`` has the names and their sources."""

import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

from gcode2krl.units import DEG_PER_RAD, MM_PER_INCH, MM_PER_M, N_PER_KN, NMM_PER_NM

FACTORS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "d": 86400.0},
    "angle": {"deg": 1.0, "rad": DEG_PER_RAD, "mdeg": 1e-3, "mrad": 1e-3 * DEG_PER_RAD},
    "length": {"mm": 1.0, "m": MM_PER_M, "um": 1e-3, "cm": 10.0, "in": MM_PER_INCH},
    "force": {"N": 1.0, "kN": N_PER_KN},
    "moment": {"Nm": 1.0, "Nmm": 1.0 / NMM_PER_NM, "kNm": 1e3},
    "current": {"A": 1.0, "mA": 1e-3},
    "temperature": {"C": 1.0},
    "quaternion": {"1": 1.0},
}
"""Kind of quantity -> unit -> its size in the unit of docs/runs.md, which is the first."""
_SPELLINGS = {
    **{unit.lower(): unit for units in FACTORS.values() for unit in units if unit != "1"},
    **{"°": "deg", "degree": "deg", "degrees": "deg", "m°": "mdeg", "radian": "rad", "radians": "rad"},
    **{"sec": "s", "second": "s", "seconds": "s", "msec": "ms", "usec": "us", "µs": "us", "µm": "um"},
    **{"inch": "in", "n·m": "Nm", "n*m": "Nm", "n.m": "Nm", "°c": "C", "degc": "C", "newton": "N"},
}
_TRAILING = ("deg", "degrees", "rad", "mm", "m", "um", "n", "kn", "nm", "nmm", "s", "ms", "us", "ns", "sec")
"""Units that a name may end in, after an underscore."""
_BRACKETS = re.compile(r"\s*[\[(<{]\s*([^\])>}]{1,12}?)\s*[\])>}]\s*$")
_OTHER_QUANTITIES = re.compile(
    r"vel|speed|acc|jerk|torque|current|temp|force|effort|power|err|lag|stat|mode|volt|moment|strom|geschw"
    r"|schlepp|dev|diff|delta|noise|limit|(?:^|_)(?:d|dd|v|qd|qdd|std)(?:_|$)"
)
"""Words of quantities that a pattern must have itself: the current of an axis is none of its angles."""
_KINDS = (
    ("time", r"t(_fraction)?"),
    ("angle", r"q\d_(cmd|act|load|corr)|[abc](_cmd|_act|_corr)?|r[xyz](_cmd|_act)?"),
    ("length", r"[xyz](_cmd|_act|_corr)?"),
    ("quaternion", r"q[wxyz](_cmd|_act)?"),
    ("force", r"f[xyz]"),
    ("moment", r"m[xyz]|tau\d"),
    ("current", r"i\d"),
    ("temperature", r"temp\d|ambient"),
)


class Meaning(NamedTuple):
    """What a name stands for."""

    target: str
    """A column of docs/runs.md without its unit; "" where the name is not known."""
    unit: str = ""
    """As the name or the exporter states it; "" where neither does."""
    why: str = ""
    order: str = ""
    """Of the exporter's angles of orientation."""
    free_order: bool = False
    """The numbers of the joints need not be those of the axes."""


@dataclass(frozen=True)
class _Pattern:
    name: re.Pattern[str]
    target: str
    unit: str
    free_order: bool
    exporter: str
    mark: str
    order: str


@cache
def _exporters() -> dict[str, Any]:
    text = files("gcode2krl.runs.foreign").joinpath("exporters.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


@cache
def _patterns() -> tuple[_Pattern, ...]:
    return tuple(
        _Pattern(
            re.compile(name.replace("{n}", r"(?P<n>\d)")),
            target,
            unit,
            bool(flags),
            exporter["name"],
            exporter.get("mark", ""),
            exporter["order"],
        )
        for exporter in _exporters()["exporter"]
        for name, target, unit, *flags in exporter["columns"]
    )


def kind_of(target: str) -> str:
    """Return the kind of quantity of a column without its unit, a key of `FACTORS`; "" for none of ours."""
    return next((kind for kind, pattern in _KINDS if re.fullmatch(pattern, target)), "")


def unit_of(word: str) -> str:
    """Return a unit as `FACTORS` spells it, "" for a word that is none."""
    return _SPELLINGS.get(word.strip().lower().replace("μ", "µ"), "")


def meanings(names: Iterable[str]) -> dict[str, Meaning]:
    """Return what each name stands for; joints that are counted from 0 become 1 to 6."""
    names = list(names)
    plain = {name: _plain(name) for name in names}
    marks = {whole for whole, _, _ in plain.values()}
    known = {name: _meaning(*plain[name], marks) for name in names}
    known = {name: m if m.target else _joint(name, m.unit) for name, m in known.items()}
    stems = {re.sub(r"\d", "#", m.target) for m in known.values() if re.fullmatch(r"\D+0\D*", m.target)}
    return {
        name: m._replace(target=re.sub(r"\d", lambda digit: str(int(digit[0]) + 1), m.target))
        if re.sub(r"\d", "#", m.target) in stems
        else m
        for name, m in known.items()
    }


def _plain(name: str) -> tuple[str, str, str]:
    """Return a name in plain signs, the same without a unit, and that unit."""
    bracket, unit = _BRACKETS.search(name), ""
    if bracket and (unit := unit_of(bracket[1])):
        name = name[: bracket.start()]
    whole = re.sub(r"[^a-z0-9]+", "_", name.lower().replace("°", "deg")).strip("_")
    stem, _, last = whole.rpartition("_")
    if not unit and stem and last in _TRAILING:
        return whole, stem, unit_of(last)
    return whole, whole, unit


def _meaning(whole: str, stem: str, unit: str, marks: set[str]) -> Meaning:
    for name in dict.fromkeys((whole, stem)):
        words = _OTHER_QUANTITIES.findall(name)
        for pattern in _patterns():
            match = pattern.name.fullmatch(name)
            if match is None or (pattern.mark and pattern.mark not in marks):
                continue
            if any(word.strip("_") not in pattern.name.pattern for word in words):
                continue
            number = match.groupdict().get("n")
            plain = [group for group in match.groups() if group is not None and group != number]
            target = pattern.target.format(*plain, n=number)
            if not kind_of(target):
                continue
            fixed = unit if unit in FACTORS[kind_of(target)] else ""
            stated = "the name states the unit" if fixed else f"{pattern.exporter} fixes it"
            stated = stated if fixed or pattern.unit else ""
            why = f"{pattern.exporter}" if not stated else f"{pattern.exporter}; {stated}"
            return Meaning(target, fixed or pattern.unit, why, pattern.order, pattern.free_order)
    return Meaning("", unit)


def _joint(name: str, unit: str) -> Meaning:
    """Return the joint that a name of usual words stands for: ``actual_joint_position_0``, ``JT1[deg]``."""
    words: dict[str, list[str]] = _exporters()["joints"]
    kind = {word: kind for kind, listed in words.items() for word in listed}
    bracket = _BRACKETS.search(name)
    stem = name[: bracket.start()] if bracket and unit_of(bracket[1]) else name
    parts = [part.lower() for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+|\d+", stem)]
    if parts and parts[-1] in _TRAILING and parts[-1] not in kind:
        parts.pop()
    number = next((k for k in reversed(range(len(parts))) if parts[k].isdigit()), -1)
    first = next((k for k in reversed(range(number)) if parts[k] not in kind), -1) + 1
    used = {kind.get(part, "") for part in (*parts[first:number], *parts[number + 1 :])}
    sides = used & {"cmd", "act", "load"}
    named = "joint" in used or (sides and sides != {"load"} and first == 0)
    if number < 0 or len(parts[number]) > 1 or "" in used or len(sides) > 1 or not named:
        return Meaning("", unit)
    if _OTHER_QUANTITIES.search("_".join(parts[:first]).replace("joint_states", "")):
        return Meaning("", unit)
    fixed = unit if unit in FACTORS["angle"] else ""
    why = "usual names; the name states the unit" if fixed else "usual names"
    return Meaning(f"q{parts[number]}_{sides.pop() if sides else 'act'}", fixed, why)
