"""What the columns of another exporter's table are: by their names, their values and a prediction.

A unit or an order that none of these settles is a question, never an answer.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.errors import input_error
from gcode2krl.runs.foreign.beside_plan import JointFit, Plan, joint_fit, length_unit, time_units
from gcode2krl.runs.foreign.names import FACTORS, Meaning, kind_of, meanings, unit_of
from gcode2krl.runs.foreign.table import LogTable
from gcode2krl.runs.head import Layout

ORDERS = {
    "zyx": "ZYX",
    "xyz": "XYZ",
    "xyz-fixed": "xyz",
    "zyz": "ZYZ",
    "rotvec": "",
}
"""Order of the three angles of an orientation -> scipy's name; capitals turn about turned axes."""
_SAID = "you said so"
_CYCLE_S = (2e-4, 0.5)
"""Shortest and longest step of a recording of a motion: 5 kHz to 2 Hz, our choice."""
_LATEST_S = 6e9
"""Seconds since 1970, 1904 or 1900 are fewer until 2090: 20240506070809 is no date in ms."""
_BEYOND_RAD, _BEYOND_M, _BEYOND_KN = 15.0, 20.0, 10.0
"""No joint turns by more (cobots turn twice either way), no robot reaches that far, no sensor of a robot
bears more: our choice."""
_NEEDED = re.compile(r"t|q\d_(cmd|act|load)|[xyz]|f[xyz]")
"""Quantities that a diagnosis compares: their unit must be known. Others are left out where it is not."""


class Predicted(Protocol):
    """A prediction, as far as a table is compared with it."""

    @property
    def motion(self) -> Any:
        """Its `Motion`, None where there is none."""

    @property
    def joints(self) -> Any:
        """Its `Joints`, None where there are none."""


@dataclass(frozen=True)
class Entry:
    """A column and what it is taken for."""

    name: str
    target: str
    kind: str
    unit: str
    why: str
    low: float
    high: float


@dataclass(frozen=True)
class ColumnQuestion:
    """What only a person can say, and the option that says it."""

    text: str
    option: str


@dataclass(frozen=True, eq=False)
class Guess:
    """The columns of a table with what they are taken for; certain where there is no question."""

    table: LogTable
    entries: tuple[Entry, ...]
    left_out: tuple[str, ...]
    order: str
    questions: tuple[ColumnQuestion, ...] = ()
    notes: tuple[str, ...] = ()
    clock_s: float = 0.0
    """Where the prediction starts on the table's clock."""

    def values(self, target: str) -> Floats | None:
        """Return a column (n,) in the unit of docs/runs.md; None where there is none."""
        for entry in self.entries:
            if entry.target == target:
                return self.table.columns[entry.name] * FACTORS[entry.kind][entry.unit]
        return None

    def layout(self) -> Layout:
        """Return what ``run.toml`` keeps, so that the next table of this kind needs nothing."""
        return Layout(
            file=self.table.source,
            columns={entry.name: entry.target for entry in self.entries},
            units={entry.name: entry.unit for entry in self.entries},
            order=self.order or None,
        )

    def require_certain(self, remedy: str = "") -> None:
        """Raise `NotUnderstoodError` with the open questions."""
        if self.questions:
            texts = "; ".join(question.text for question in self.questions)
            options = " ".join(question.option for question in self.questions)
            advice = f"{remedy} {options}" if remedy else options
            raise input_error("run-layout", texts, advice, source=self.table.source)


def guessed(
    table: LogTable,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    order: str = "",
    joints: str = "",
    prediction: Predicted | None = None,
    said: str = _SAID,
) -> Guess:
    """Return what the columns of a table are.

    Parameters
    ----------
    columns : name → column of docs/runs.md, with or without its unit, ``""`` to leave it out.
    units : name or kind of quantity (time, angle, length, force, …) → unit.
    order : of the three angles of an orientation, a key of `ORDERS`.
    joints : numbers of the axes in the order in which the table counts its joints, ``"321456"``.
    prediction : what the run belongs to; it settles units and orders that names leave open.
    said : who answers; only what a person says of this very table is never doubted.

    Raises
    ------
    NotUnderstoodError
        An answer that names no column, no quantity, no unit or no order.
    """
    columns, units = dict(columns or {}), dict(units or {})
    _require_answers(table, columns, units, order, joints)
    known = meanings(table.columns)
    for name, given in columns.items():
        known[name] = _given(given, table.source, said)
    known = {name: m for name, m in known.items() if m.target}
    free = any(m.free_order for m in known.values()) and not joints
    if joints:
        known = {name: m._replace(target=_reordered(m.target, joints)) for name, m in known.items()}
    known = _without_quaternion(table, known, columns)
    known = _once(table, known, columns)
    seconds = next((table.columns[name] for name, m in known.items() if m.target == "t"), np.zeros(0))
    if (seconds % 1.0 != 0.0).any():  # parts of a second belong to whole ones only
        known = {name: m for name, m in known.items() if m.target != "t_fraction"}
    work = _Work(table, known, units, Plan.of(prediction), said)
    work.settle_time()
    work.settle_units()
    work.settle_joints(free, bool(columns) or bool(joints))
    work.settle_orientation(order)
    work.require_something()
    return work.guess()


def _require_answers(
    table: LogTable, columns: Mapping[str, str], units: Mapping[str, str], order: str, joints: str
) -> None:
    for name in columns:
        if name not in table.columns:
            words = f"there is no column of numbers {name!r}; the file has {', '.join(table.names)[:300]}"
            raise input_error("run-layout", words, "--columns NAME=OURS", source=table.source)
    for name, unit in units.items():
        if name not in FACTORS and name not in table.columns:
            words = f"{name!r} is neither a column nor one of {', '.join(FACTORS)}"
            raise input_error("run-layout", words, "--unit angle=rad", source=table.source)
        if not unit_of(unit) or (name in FACTORS and unit_of(unit) not in FACTORS[name]):
            allowed = ", ".join(FACTORS[name]) if name in FACTORS else "s, ms, deg, rad, mm, m, N, kN, Nm, A"
            words = f"{name}: {unit!r} is no unit of it, allowed: {allowed}"
            raise input_error("run-layout", words, f"--unit {name}=UNIT", source=table.source)
    if order and order not in ORDERS:
        words = f"{order!r} is no order of angles, allowed: {', '.join(ORDERS)}"
        raise input_error("run-layout", words, "docs/runs.md tells them apart", source=table.source)
    if joints and sorted(joints) != list("123456"):
        words = f"joints: {joints!r} does not name each of 1 to 6 once"
        raise input_error("run-layout", words, "say 321456 where A3 is the first", source=table.source)


def _given(target: str, source: str, said: str) -> Meaning:
    """Return the meaning that a person states: ``q1_act``, ``q1_act_rad``, or nothing."""
    if target in ("", "-"):
        return Meaning("")
    stem, _, last = target.rpartition("_")
    for name, unit in ((target, ""), (stem, unit_of(last))):
        if kind_of(name) and (not unit or unit in FACTORS[kind_of(name)]):
            return Meaning(name, unit, said)
    words = f"{target!r} is no column of a run"
    remedy = "t, q1_cmd … q6_cmd, q1_act …, q1_load …, x, y, z, x_act …, fx …; with a unit: q1_act_rad"
    raise input_error("run-layout", words, remedy, source=source)


def _reordered(target: str, joints: str) -> str:
    match = re.fullmatch(r"(\D+)([1-6])(\D*)", target)
    return f"{match[1]}{joints[int(match[2]) - 1]}{match[3]}" if match else target


def _without_quaternion(
    table: LogTable, known: Mapping[str, Meaning], columns: Mapping[str, str]
) -> dict[str, Meaning]:
    """Return the columns without Q0 to Q3 that are a quaternion, whose order the name does not tell."""
    names = [name for name, m in known.items() if re.fullmatch(r"q\d_act", m.target) and name not in columns]
    if len(names) == 4:
        length = np.linalg.norm([table.columns[name] for name in names], axis=0)
        if np.nanmax(np.abs(length - 1.0)) < 1e-3:
            return {name: m for name, m in known.items() if name not in names}
    return dict(known)


def _once(table: LogTable, known: Mapping[str, Meaning], columns: Mapping[str, str]) -> dict[str, Meaning]:
    """Return the first column of each target, those that a person named before others, a row count last."""
    ordered = sorted(
        known,
        key=lambda name: (name not in columns, known[name].target == "t" and _counts(table.columns[name])),
    )
    taken: dict[str, str] = {}
    for name in ordered:
        taken.setdefault(known[name].target, name)
    return {name: known[name] for name in known if taken[known[name].target] == name}


@dataclass
class _Work:
    """The state of a guess: meanings by name, what was said, and what is open."""

    table: LogTable
    known: dict[str, Meaning]
    stated: dict[str, str]
    plan: Plan | None
    said: str
    order: str = ""
    clock_s: float = 0.0
    questions: list[ColumnQuestion] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def name_of(self, target: str) -> str | None:
        """Return the column that is a target."""
        return next((name for name, m in self.known.items() if m.target == target), None)

    def set_unit(self, names: Iterable[str], unit: str, why: str) -> None:
        """Set the unit of some columns, with the reason."""
        for name in names:
            old = self.known[name]
            self.known[name] = old._replace(unit=unit, why=f"{old.why}; {why}" if old.why else why)

    def settle_time(self) -> None:
        """Find the time and its unit."""
        if self.name_of("t") is None:
            words = "no column is the time; the file has " + ", ".join(self.table.names)[:300]
            self.questions.append(ColumnQuestion(words, "--columns NAME=t"))
            return
        name = str(self.name_of("t"))
        values = self.table.columns[name]
        self._take_stated([name], "time")
        if self.known[name].unit:
            self._doubt_time(name, values)
            return
        fit = self._cycles(values)
        if _counts(values):
            words = f"{name}: counts the rows; is it the time, and in which unit?"
            self.questions.append(ColumnQuestion(words, f"--unit time={'|'.join(fit)} or --columns NAME=t"))
            return
        if len(fit) > 1 and self.plan is not None:
            fit = [unit for unit in fit if unit in time_units(values, self.plan)] or fit
        if len(fit) == 1:
            self.set_unit([name], fit[0], f"{_step(values) * FACTORS['time'][fit[0]]:.4g} s between rows")
        else:
            words = f"{name}: {_step(values):g} between rows, {' or '.join(fit) if fit else 'of what unit'}?"
            self.questions.append(ColumnQuestion(words, f"--unit time={'|'.join(fit) or 'UNIT'}"))

    def _cycles(self, values: Floats) -> list[str]:
        """Return the units in which rows are as far apart as recorders write them, and dates are dates."""
        step, largest = _step(values), float(np.nanmax(np.abs(values), initial=0.0))
        shortest, longest = _CYCLE_S
        sizes = FACTORS["time"].items()
        return [unit for unit, s in sizes if shortest <= step * s <= longest and largest * s < _LATEST_S]

    def _doubt_time(self, name: str, values: Floats) -> None:
        """Ask where a stated unit makes steps that no recording has."""
        unit, fit = self.known[name].unit, self._cycles(values)
        if unit in fit or not fit or self._is_sure(name):
            return
        cycle_s = _step(values) * FACTORS["time"][unit]
        words = f"{name}: in {unit} there are {cycle_s:.3g} s between rows; is it {' or '.join(fit)}?"
        self.questions.append(ColumnQuestion(words, f"--unit time={'|'.join([*fit, unit])}"))

    def _is_sure(self, name: str) -> bool:
        """Tell whether a person has said the unit of a column of this table."""
        return self.known[name].why.endswith(_SAID)

    def _take_stated(self, names: Iterable[str], kind: str) -> None:
        """Take units that a person, a line of units or a stamp states."""
        for name in names:
            said = unit_of(self.stated.get(name) or self.stated.get(kind, ""))
            line = self.table.units.get(name, "")
            if said:
                self.known[name] = self.known[name]._replace(unit=said)
                self.set_unit([name], said, self.said)
            elif line in FACTORS[kind] and not self.known[name].unit:
                stamp = kind == "time" and name not in self.table.units
                self.set_unit([name], line, "stamps" if stamp else "the table states the unit")

    def settle_units(self) -> None:
        """Find the units of all other quantities."""
        groups: dict[str, list[str]] = {}
        for name, meaning in self.known.items():
            if meaning.target not in ("t", "t_fraction"):
                group = re.sub(r"\d", "#", meaning.target)
                group = re.sub(r"^(q|r|f|m)?[xyzabcw](?=_|$)", r"\1.", group)  # one unit for x, y and z
                groups.setdefault(f"{kind_of(meaning.target)} {group}", []).append(name)
        for key, names in groups.items():
            kind = key.split()[0]
            self._take_stated(names, kind)
            open_names = [name for name in names if not self.known[name].unit]
            if open_names:
                self._by_values(open_names, kind)
            self._doubt(names, kind)

    def _by_values(self, names: list[str], kind: str) -> None:
        """Set a unit that only one of the usual ones can be; else ask, or leave the columns out."""
        values = np.stack([self.table.columns[name] for name in names], axis=1)
        largest = float(np.nanmax(np.abs(values), initial=0.0))
        usual, most = {
            "angle": (("deg", "rad"), _BEYOND_RAD),
            "length": (("mm", "m"), _BEYOND_M),
            "force": (("N", "kN"), _BEYOND_KN),
        }.get(kind, (tuple(FACTORS[kind]), np.inf))
        if largest > most:
            self.set_unit(names, usual[0], f"up to {largest:.4g}, so not {usual[1]}")
            return
        planned = self._by_plan(names, kind)
        if planned:
            self.set_unit(names, planned, "as the prediction moves")
            return
        option = f"--unit {kind}={'|'.join(usual)}"
        span = f"{names[0]}{f' … {names[-1]}' if len(names) > 1 else ''}"
        if _NEEDED.fullmatch(self.known[names[0]].target):
            words = f"{span}: up to {largest:.4g}, {' or '.join(usual)}?"
            self.questions.append(ColumnQuestion(words, option))
            return
        self.notes.append(f"{span}: left out, its unit is not stated ({option})")
        for name in names:
            del self.known[name]

    def _by_plan(self, names: list[str], kind: str) -> str:
        """Return the unit by which columns move as far as the prediction does, "" where that is open."""
        if self.plan is None or kind not in ("angle", "length"):
            return ""
        values = np.stack([self.table.columns[name] for name in names], axis=1)
        if kind == "length":
            return length_unit(values, self.plan)
        if not all(re.fullmatch(r"q\d_(cmd|act|load)", self.known[name].target) for name in names):
            return ""
        fit = self._joint_fit(names, ("deg", "rad"))
        return fit.unit if fit is not None else ""

    def _doubt(self, names: list[str], kind: str) -> None:
        """Ask where the values contradict the unit that a name or an exporter states."""
        names = [name for name in names if name in self.known]
        if not names or kind not in ("angle", "length") or self._is_sure(names[0]):
            return
        values = np.stack([self.table.columns[name] for name in names], axis=1)
        unit, largest = self.known[names[0]].unit, float(np.nanmax(np.abs(values), initial=0.0))
        if not unit:
            return
        size = FACTORS[kind][unit]
        most = (
            _BEYOND_RAD * FACTORS["angle"]["rad"] if kind == "angle" else _BEYOND_M * FACTORS["length"]["m"]
        )
        usual = "deg|rad" if kind == "angle" else "mm|m"
        planned = self._by_plan(names, kind)
        if largest * size > most:
            words = f"{names[0]} … {names[-1]}: up to {largest:.4g} {unit}, which no robot has"
            self.questions.append(ColumnQuestion(words, f"--unit {kind}={usual}"))
        elif planned and planned != unit:
            words = (
                f"{names[0]} … {names[-1]}: stated in {unit}, but they move as the prediction in {planned}"
            )
            self.questions.append(ColumnQuestion(words, f"--unit {kind}={planned}|{unit}"))

    def time_s(self) -> Floats | None:
        """Return the stamps (n,) in s from the first one; None where they are not known."""
        name = self.name_of("t")
        if name is None or not self.known[name].unit:
            return None
        values = self.table.columns[name]
        known = values[np.isfinite(values)]
        passed = (values - (known[0] if len(known) else 0.0)) * FACTORS["time"][self.known[name].unit]
        parts = self.name_of("t_fraction")
        if parts is not None:
            fraction = self.table.columns[parts] * FACTORS["time"][self.known[parts].unit]
            passed = passed + fraction - fraction[np.isfinite(values)][0]
        return np.asarray(passed)

    def _joint_fit(self, names: list[str], units: Sequence[str]) -> JointFit | None:
        time_s = self.time_s()
        if time_s is None or self.plan is None or len(names) < 6:
            return None
        ordered = sorted(names, key=lambda name: self.known[name].target)
        values = np.stack([self.table.columns[name] for name in ordered], axis=1)
        return joint_fit(time_s, values, self.plan, FACTORS["angle"], units)

    def settle_joints(self, free: bool, said: bool) -> None:
        """Compare the joints with those of the prediction: their order, their signs, and the clock."""
        for side in ("cmd", "act"):
            names = [str(self.name_of(f"q{n}_{side}")) for n in range(1, 7)]
            if any(name == "None" or not self.known[name].unit for name in names):
                continue
            fit = self._joint_fit(names, (self.known[names[0]].unit,))
            if fit is None:
                continue
            self.clock_s = fit.clock_s
            free = free and not fit.certain
            if fit.certain and fit.order != (0, 1, 2, 3, 4, 5) and not said:
                digits = "".join(str(column + 1) for column in fit.order)
                words = f"{names[0]} … {names[5]} move as A{', A'.join(digits)} of the prediction"
                self.questions.append(ColumnQuestion(words, f"--joints {digits}"))
            return
        if free and any(re.fullmatch(r"q\d_\w+", m.target) for m in self.known.values()):
            words = "the joints are numbered as the message lists them, which need not be A1 to A6"
            self.questions.append(ColumnQuestion(words, "--joints 123456 (321456: A3 is the first)"))

    def settle_orientation(self, order: str) -> None:
        """Find the order of three angles; without one they are left out."""
        angles = [n for n, m in self.known.items() if re.fullmatch(r"([abc]|r[xyz])(_cmd|_act)?", m.target)]
        orders = {self.known[name].order for name in angles}
        self.order = order or (orders.pop() if len(orders) == 1 else "")
        if angles and not self.order:
            words = f"{', '.join(angles)}: left out, the order of its angles is not stated"
            self.notes.append(f"{words} (--order {'|'.join(ORDERS)})")
            for name in angles:
                del self.known[name]

    def require_something(self) -> None:
        """Ask for columns where nothing of the table can be compared."""
        if not any(_NEEDED.fullmatch(m.target) for m in self.known.values() if m.target != "t"):
            names = ", ".join(self.table.names)[:300]
            words = f"no column is a joint, a position or a force; the file has {names}"
            self.questions.append(ColumnQuestion(words, "--columns NAME=q1_act …"))

    def guess(self) -> Guess:
        """Return the guess as it stands."""
        if any(re.fullmatch(r"q\d_\w+", m.target) for m in self.known.values()):
            for name, m in self.known.items():  # beside joints a position is the controller's own
                if re.fullmatch(r"([xyzabc]|q[wxyz]|r[xyz])", m.target):
                    self.known[name] = m._replace(target=f"{m.target}_act")
        entries = tuple(_entry(self.table, name, m) for name, m in self.known.items())
        left_out = tuple(name for name in self.table.names if name not in self.known)
        return Guess(
            self.table,
            tuple(sorted(entries, key=lambda entry: (entry.target != "t",))),
            left_out,
            self.order,
            tuple(dict.fromkeys(self.questions)),
            tuple(self.notes),
            self.clock_s,
        )


def _step(values: Floats) -> float:
    steps = np.diff(values[np.isfinite(values)])
    return float(np.median(np.abs(steps))) if len(steps) else 0.0


def _counts(values: Floats) -> bool:
    """Tell whether values (n,) are 0, 1, 2 …: rows or frames, whose rate only a person knows."""
    steps = np.diff(values[np.isfinite(values)])
    return len(steps) > 0 and bool((steps == 1.0).all())


def _entry(table: LogTable, name: str, meaning: Meaning) -> Entry:
    values = table.columns[name]
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)
    return Entry(name, meaning.target, kind_of(meaning.target), meaning.unit, meaning.why, low, high)


def same_columns(layout: Layout, table: LogTable) -> bool:
    """Tell whether a layout is that of a table: all of its columns are there."""
    return bool(layout.columns) and set(layout.columns) <= set(table.columns)


def by_layout(table: LogTable, layout: Layout, prediction: Predicted | None = None) -> Guess:
    """Return the guess that an earlier ``run.toml`` keeps; no column but its own is read."""
    others = {name: "" for name in table.columns if name not in layout.columns}
    columns = {**layout.columns, **others}
    return guessed(
        table,
        columns=columns,
        units=layout.units,
        order=layout.order or "",
        prediction=prediction,
        said="as in the run before",
    )
