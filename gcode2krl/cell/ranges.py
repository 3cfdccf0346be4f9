"""Plausible and possible ranges of the cell's physical keys: they catch a wrong unit or digit.

``ranges.toml`` has the table. Beyond the possible range a value is an error of the cell file, beyond the
plausible one a warning.
"""

import math
import re
import tomllib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any

from pydantic import BaseModel

from gcode2krl.errors import Issue

_ANGLES = re.compile(
    r"((?:frames\.(?:base|tool|robroot)|external\.E\d\.origin|work_offsets\..+|tool\.\d+\.frame)\.)[abc]_deg|home\.q_deg|frames\.spin"
)
_EIGHTH_TURN_RAD = math.pi / 4
_NEAR_RAD = 2e-4
_FULL_TURN = 8.01
"""Largest angle of a frame, in eighths of a turn."""


@dataclass(frozen=True)
class Range:
    """The plausible and the possible range (low, high) of a key, and their source."""

    plausible: tuple[float, float]
    possible: tuple[float, float]
    source: str


@lru_cache(maxsize=1)
def all_ranges() -> dict[str, Range]:
    """Return key → range; ``*`` stands for a number or a name: ``tool.*.diameter_mm``."""
    text = resources.files("gcode2krl.cell").joinpath("ranges.toml").read_text(encoding="utf-8")
    return {
        key: Range(tuple(row["plausible"]), tuple(row["possible"]), row["source"])
        for key, row in tomllib.loads(text).items()
    }


def range_issues(cell: BaseModel, tools: Collection[int] | None = None) -> Iterator[Issue]:
    """Yield each value of a resolved cell that is impossible (error) or hardly plausible (warning).

    With ``tools``, keys of other tools are left out.
    """
    table, stated = all_ranges(), list(numbers(cell))
    for key, value in stated:
        known = table.get(general(key))
        if known is None or (tools is not None and key.startswith("tool.") and _number(key) not in tools):
            continue
        low, high = known.possible
        if not low <= value <= high:
            yield _issue("error", "cell-impossible", key, value, known.possible, known.source)
            continue
        low, high = known.plausible
        if not low <= value <= high:
            yield _issue("warning", "cell-doubtful", key, value, known.plausible, known.source)
    yield from _radians(stated)


def _number(key: str) -> int:
    return int(key.split(".")[1])


@lru_cache(maxsize=4096)
def general(key: str) -> str:
    """Return a dotted key with ``*`` for the number of a tool and the names of offsets and joints."""
    key = re.sub(r"^tool\.\d+\.", "tool.*.", key)
    key = re.sub(r"^external\.E\d\.", "external.*.", key)
    key = re.sub(r"^work_offsets\.(G59\.\d|G54\.1P\d+|G\d+)\.", "work_offsets.*.", key)
    return re.sub(r"^compliance\.virtual_joints\.\w+\.", "compliance.virtual_joints.*.", key)


def numbers(cell: BaseModel) -> Iterator[tuple[str, float]]:
    """Yield (dotted key, value) of every number in a cell; the numbers of a list have the key of the list."""
    yield from _numbers(cell, "")


def _numbers(value: Any, key: str) -> Iterator[tuple[str, float]]:
    if isinstance(value, int | float):
        if not isinstance(value, bool):
            yield key, float(value)
    elif isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield from _numbers(getattr(value, name), f"{key}.{name}" if key else name)
    elif isinstance(value, dict):
        for name, item in value.items():
            yield from _numbers(item, f"{key}.{name}")
    elif isinstance(value, tuple | list):
        for item in value:
            yield from _numbers(item, key)


def _issue(
    severity: str, code: str, key: str, value: float, allowed: tuple[float, float], source: str
) -> Issue:
    word = "possible" if severity == "error" else "usual"
    bounds = f"{allowed[0]:g} and more" if allowed[1] == math.inf else f"{allowed[0]:g} to {allowed[1]:g}"
    text = f"{key} = {value:g} is not {word}: {bounds} ({source})"
    return Issue(
        "error" if severity == "error" else "warning",
        code,
        0,
        text,
        f"correct {key}: check its unit and digits",
        key=key,
    )


def _radians(stated: list[tuple[str, float]]) -> Iterator[Issue]:
    """Yield the frames, and HOME, whose angles are multiples of 45 degrees when read as radians."""
    angles: dict[str, list[float]] = {}
    for key, value in stated:
        match = _ANGLES.fullmatch(key)
        if match:
            angles.setdefault(match[1] or key, []).append(value)
    for key, angles_deg in angles.items():
        eighths = [abs(angle) / _EIGHTH_TURN_RAD for angle in angles_deg]
        all_multiples = all(abs(turn - round(turn)) * _EIGHTH_TURN_RAD < _NEAR_RAD for turn in eighths)
        if all_multiples and 0.99 < max(eighths) <= _FULL_TURN:
            shown = ", ".join(f"{angle:g}" for angle in angles_deg)
            name = key.rstrip(".")
            yield Issue(
                "error",
                "cell-impossible",
                0,
                f"{name}: the angles {shown} are multiples of pi/4: radians, where degrees are meant",
                f"write the angles of {name} in degrees",
                key=name,
            )
