"""A table of poses: joints, what an instrument saw of the tool there, and from which side each joint came."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.errors import input_error
from gcode2krl.frames import rotation_from_abc, rotation_from_quaternion
from gcode2krl.runs.foreign.names import FACTORS, meanings, unit_of
from gcode2krl.runs.foreign.table import LogTable, read_table, table_of
from gcode2krl.units import RAD_PER_DEG

_LEAST = 10
_AROUND_MM = 100.0
"""A measured orientation is read as three points so far from the tip."""
_BEYOND_RAD, _BEYOND_M = 15.0, 20.0
"""No joint turns by more, no instrument of a robot sees further: as in `runs.foreign.guess`."""
_TARGET = re.compile(
    r"(?:(?:target|reflector|smr|point|ball|p)_?)?(?:([xyz])_?([1-9])|([1-9])_?([xyz]))(?:_(mm|m))?"
)
_APPROACH = re.compile(r"(?:approach|direction|dir)_?[aqj]?([1-6])")


@dataclass(frozen=True, eq=False)
class Readings:
    """The poses of a table, in its controller's joints."""

    source: str
    q_rad: Floats
    """(n, 6)"""
    measured: Floats
    """(n, t, 3) targets in mm, or in a unit that only the arm's lengths tell; NaN where one was not seen."""
    row: Ints
    """(n,) line in the table."""
    approach: Floats | None = None
    """(n, 6) -1, 0 or 1: from which side each joint came; None where the table does not say."""
    time_s: Floats | None = None
    """(n,)"""
    angle_unit: str = ""
    """deg or rad; "" where the table leaves it open: then the joints are as in the table."""
    length_unit: str = ""
    oriented: bool = False
    """The targets are three points around the tip, of a measured orientation."""
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Return the number of poses."""
        return len(self.q_rad)


def read_readings(
    source: Any, *, columns: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None
) -> Readings:
    """Read poses: q1 to q6 (A1, J1 …), x, y, z; optionally a, b, c, approach_1 …, t, x2, y2, z2 ….

    Parameters
    ----------
    source : a path (CSV of any separator, Excel, Parquet, MATLAB v5), or a frame as for `gcode2krl.run_from`.
    columns : their name → q1 … q6, x, y, z, x2 …, a, b, c, approach_1 …, t; "" leaves a column out.
    units : angle → deg or rad, length → mm or m, where their names and sizes leave it open.

    Raises
    ------
    NotUnderstoodError
        The file is no table, a column or a unit is missing, or there are fewer than 10 poses.
    """
    table = read_table(source) if isinstance(source, (str, Path)) else table_of(source)
    named = _targets(table, dict(columns or {}))
    stated = dict(units or {})
    for kind in stated:
        if kind not in ("angle", "length") or unit_of(stated[kind]) not in FACTORS[kind]:
            words = f"--unit {kind}={stated[kind]}: not understood"
            raise input_error(
                "run-layout", words, "--unit angle=deg|rad, --unit length=mm|m", source=table.source
            )
    q, angle_unit = _joints(table, named, stated.get("angle", ""))
    targets, length_unit = _seen(table, named, stated.get("length", ""))
    row = np.arange(len(q), dtype=np.int64) + table.first_row
    is_whole = np.isfinite(q).all(axis=1)
    lost = ~np.isfinite(targets).all(axis=2) | (targets == 0.0).all(axis=2)
    targets[lost] = np.nan
    kept = is_whole & ~lost.all(axis=1)
    notes = [f"{int((~kept).sum())} rows without a reading left out"] if not kept.all() else []
    targets, oriented = _with_orientation(table, named, targets, length_unit)
    if int(kept.sum()) < _LEAST:
        words = f"{int(kept.sum())} poses with joints and a measured point, at least {_LEAST} are needed"
        raise input_error(
            "table-empty", words, "30 poses and more, over the whole work space", source=table.source
        )
    approach = _approach(table, named)
    time = table.columns[named["t"]] if "t" in named else None
    return Readings(
        source=table.source,
        q_rad=q[kept],
        measured=targets[kept],
        row=row[kept],
        approach=None if approach is None else approach[kept],
        time_s=None if time is None or not np.isfinite(time[kept]).all() else time[kept],
        angle_unit=angle_unit,
        length_unit=length_unit,
        oriented=oriented,
        notes=tuple(notes),
    )


def _targets(table: LogTable, given: Mapping[str, str]) -> dict[str, str]:
    """Return q1 …, x, y, z, … → column of the table."""
    for name in given:
        if name not in table.columns:
            words = f"there is no column of numbers {name!r}; the file has {', '.join(table.names)[:300]}"
            raise input_error("run-layout", words, "--columns NAME=OURS", source=table.source)
    stated: dict[str, str] = {}
    for name, target in given.items():
        if target:
            stated[re.sub(r"_(mm|m|deg|rad)$", "", target)] = name
    guessed = [name for name in table.columns if name not in given]
    by_rank: dict[str, list[tuple[int, str]]] = {}
    for name, meaning in meanings(guessed).items():
        plain = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        if match := _APPROACH.fullmatch(plain):
            by_rank.setdefault(f"approach_{match[1]}", []).append((0, name))
        elif match := _TARGET.fullmatch(plain):
            by_rank.setdefault(f"{match[1] or match[4]}{match[2] or match[3]}", []).append((0, name))
        elif match := re.fullmatch(r"q([1-6])_(load|act|cmd)", meaning.target):
            rank = ("act", "cmd", "load").index(match[2])
            by_rank.setdefault(f"q{match[1]}", []).append((rank, name))
        elif match := re.fullmatch(r"([xyzabc]|q[wxyz])(_act)?", meaning.target):
            by_rank.setdefault(match[1], []).append((1 if match[2] else 0, name))
        elif meaning.target == "t":
            by_rank.setdefault("t", []).append((0, name))
    return {**{target: min(names)[1] for target, names in by_rank.items()}, **stated}


def _need(table: LogTable, named: Mapping[str, str], targets: Sequence[str], what: str) -> list[str]:
    missing = [target for target in targets if target not in named]
    if missing:
        words = f"no column is {', '.join(missing)} ({what}); the file has {', '.join(table.names)[:300]}"
        raise input_error("run-layout", words, f"--columns NAME={missing[0]}", source=table.source)
    return [named[target] for target in targets]


def _joints(table: LogTable, named: Mapping[str, str], stated: str) -> tuple[Floats, str]:
    names = _need(table, named, [f"q{n}" for n in range(1, 7)], "joints")
    values = np.stack([table.columns[name] for name in names], axis=1)
    unit = _unit(table, names, stated, "angle")
    if not unit and float(np.nanmax(np.abs(values), initial=0.0)) > _BEYOND_RAD:
        unit = "deg"
    if not unit:
        return values, ""
    return values * FACTORS["angle"][unit] * RAD_PER_DEG, unit


def _unit(table: LogTable, names: Sequence[str], stated: str, kind: str) -> str:
    """Return the unit that a person, a line of units or a name states; "" where none does."""
    by_name = [meaning.unit for meaning in meanings(names).values()]
    units = (
        {unit_of(stated)}
        if stated
        else {table.units.get(name, "") or unit for name, unit in zip(names, by_name, strict=True)}
    )
    known = {unit for unit in units if unit in FACTORS[kind]}
    return known.pop() if len(known) == 1 else ""


def _seen(table: LogTable, named: Mapping[str, str], stated: str) -> tuple[Floats, str]:
    """Return the targets (n, t, 3) and their unit."""
    plain = {"x": "x", "y": "y", "z": "z"}
    sets = [plain] if "x" in named else []
    sets += [{a: f"{a}{n}" for a in "xyz"} for n in range(1, 10) if f"x{n}" in named]
    if not sets:
        _need(table, named, ["x", "y", "z"], "the measured point")
    names = [_need(table, named, list(one.values()), "the measured point") for one in sets]
    values = np.stack([np.stack([table.columns[name] for name in one], axis=1) for one in names], axis=1)
    unit = _unit(table, [name for one in names for name in one], stated, "length")
    if not unit and float(np.nanmax(np.abs(values), initial=0.0)) > _BEYOND_M:
        unit = "mm"
    return values * (FACTORS["length"][unit] if unit else 1.0), unit


def _with_orientation(
    table: LogTable, named: Mapping[str, str], targets: Floats, length_unit: str
) -> tuple[Floats, bool]:
    """Return three points around the tip where the orientation was measured too."""
    if targets.shape[1] > 1 or length_unit == "":
        return targets, False
    if all(name in named for name in ("qx", "qy", "qz", "qw")):
        rotation = rotation_from_quaternion(
            np.stack([table.columns[named[q]] for q in ("qx", "qy", "qz", "qw")], axis=1)
        )
    elif all(name in named for name in "abc"):
        names = [named[letter] for letter in "abc"]
        values = np.stack([table.columns[name] for name in names], axis=1)
        unit = _unit(table, names, "", "angle") or ("deg" if np.nanmax(np.abs(values)) > _BEYOND_RAD else "")
        if not unit:
            return targets, False
        rotation = rotation_from_abc(values * FACTORS["angle"][unit] * RAD_PER_DEG)
    else:
        return targets, False
    angle = np.radians([90.0, 210.0, 330.0])
    around = _AROUND_MM * np.stack([np.cos(angle), np.sin(angle), np.zeros(3)], axis=1)
    return targets + np.einsum("nij,tj->nti", rotation, around), True


def _approach(table: LogTable, named: Mapping[str, str]) -> Floats | None:
    names = [named.get(f"approach_{joint}") for joint in range(1, 7)]
    if not any(names):
        return None
    zero = np.zeros(len(next(iter(table.columns.values()))))
    return np.stack([np.sign(np.nan_to_num(table.columns[name])) if name else zero for name in names], axis=1)


def approach_by_order(q_rad: Floats) -> Floats:
    """Return from which side each joint (n, 6) came if the poses were driven in the order of their rows."""
    moved = np.zeros_like(q_rad)
    moved[1:] = np.diff(q_rad, axis=0)
    sign = np.sign(np.where(np.abs(moved) < 1e-4, 0.0, moved))
    for row in range(1, len(sign)):
        sign[row] = np.where(sign[row] == 0.0, sign[row - 1], sign[row])
    return sign
