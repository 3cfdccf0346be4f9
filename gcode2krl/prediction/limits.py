"""Predicted figures beyond ``[limits]`` of the cell, beyond the robot's data sheet, or absurd.

- Beyond ``[limits]``: a warning with the line where the largest value occurs.
- Beyond the rated payload: an error. The cutting force and the weight on the flange together must not exceed
  the weight of the payload that the robot is rated for: by ISO 8373 the rated load is the largest that may
  act on the mechanical interface in normal use. (Its moment is not judged: the models do not state it. A
  warning up to twice as much where the stock is only guessed.)
- Not finite, or beyond `ABSURD_FORCE_N` or `ABSURD_DEFLECTION_MM`: an error, and the figures are left out.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import FLOAT, FLOATS, INT, INTS32, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.compiled.inputs import contiguous, distinct
from gcode2krl.errors import Issue
from gcode2krl.tables import Deflection, Forces, Motion, lengths
from gcode2krl.units import GRAVITY_M_S2, MM_PER_M

GUESSED_FACTOR = 2.0
"""Factor by which a force may be too large because its stock is guessed (an assumption): up to this many
times the rated payload it is then a warning."""
ABSURD_FORCE_N = 100_000.0
"""No robot of the library carries a tenth of it (10 t): the figure is a mistake, not a prediction."""
ABSURD_DEFLECTION_MM = 100.0
"""The compliance model is linear in small angles: at this size, 2° on a reach of 3 m, it is not valid."""

_find_longest = core_function("prediction_longest", FLOATS, OUT_FLOATS, returns=INT)
_find_loads = core_function(
    "prediction_loads", *(FLOATS,) * 4, INTS32, INTS32, FLOATS, FLOAT, OUT_FLOATS, OUT_INTS, returns=INT
)
_write_bends = core_function("prediction_bends", FLOATS, INTS32, INT, FLOAT, OUT_FLOATS)


def cycle_acceleration(motion: Motion, cycle_s: float) -> Floats:
    """Return the acceleration (m,) in mm/s² over one interpolation cycle, as a trace would show it.

    The law's own peak, v²·cos(alpha/2)/d, is not what drives see where a corner is passed within a cycle:
    at 0.2 m/s and d = 0.1 mm it lasts 1 ms, and the controller commands a position every ``cycle_s``.
    It is 0 at a tool change, where the tip becomes another point.
    """
    result = np.zeros(len(motion))
    if len(motion) < 3:
        return result
    dt_s = float(motion.time_s[1] - motion.time_s[0])
    n = _apart(cycle_s, dt_s, len(motion))
    result[n:-n] = _bends(motion.position_mm, motion.tool, n, dt_s)
    return result


def _apart(cycle_s: float, dt_s: float, count: int) -> int:
    """Return how many samples a cycle is, of so many in all."""
    return min(max(1, round(cycle_s / dt_s)), (count - 1) // 2)


def _bends(position_mm: Floats, tool: Ints32, n: int, dt_s: float) -> Floats:
    """Return the acceleration (m - 2n,) of all but the first and the last n samples, from those n apart."""
    bends = np.empty(len(tool) - 2 * n)
    _write_bends(contiguous(position_mm), np.ascontiguousarray(tool), n, n * dt_s, bends)
    return bends


class AccelerationLimit:
    """The largest acceleration of a Motion that comes block after block, over one interpolation cycle."""

    def __init__(self, cell: Cell, dt_s: float, count: int) -> None:
        """Take the limit of the cell, the time between samples and how many there are in all."""
        self._most = cell.limits.acceleration_mm_s2
        self._dt_s, self._apart = dt_s, _apart(cell.controller.cycle_s, dt_s, count) if count > 2 else 0
        none = np.zeros(0, dtype=np.int32)
        self._before = np.zeros((0, 3)), none, none
        """Position, tool and line of the last samples."""
        self._largest = Largest()

    def take(self, motion: Motion, line: Ints32) -> None:
        """Judge the next samples; ``line`` (m,) is the G-code line of each."""
        n = self._apart
        if not n:
            return
        block: tuple[Any, ...] = motion.position_mm, motion.tool, line
        seam = tuple(np.concatenate([a, b[: 2 * n]]) for a, b in zip(self._before, block, strict=True))
        for position, tool, lines in (seam, block):
            if len(tool) > 2 * n:
                self._largest.take(_bends(position, tool, n, self._dt_s), lines[n:-n], tool[n:-n])
        last = block if len(line) >= 2 * n else seam
        self._before = last[0][-2 * n :].copy(), last[1][-2 * n :].copy(), last[2][-2 * n :].copy()

    def issues(self) -> Iterator[Issue]:
        """Yield a warning where no robot follows."""
        largest = self._largest
        if largest.value > self._most:
            sentence = (
                f"the tip is accelerated by {largest.value / MM_PER_M:.1f} m/s2 over one cycle, "
                f"more than {self._most / MM_PER_M:g}: no robot follows that"
            )
            remedy = (
                "lower F or [controller] rapid_m_s, or raise CDIS there ([limits] acceleration_mm_s2 judges)"
            )
            yield Issue("warning", "acceleration-high", largest.line, sentence, remedy)


class ForceLimits:
    """Forces that come block after block, beyond the limits and the robot's payload, or absurd."""

    def __init__(self, cell: Cell) -> None:
        """Take the limits of the cell."""
        self._cell = cell
        self.force, self.torque, self.load = Largest(), Largest(), Largest()
        self._cut_N, self._whole_N = 0.0, 0.0
        self.absurd: Issue | None = None
        """The first force that is absurd, None if there is none: then no other finding counts."""

    def take(self, forces: Forces, line: Ints32) -> None:
        """Judge the next samples; ``line`` (m,) is the G-code line of each."""
        if self.absurd is not None or not len(forces):
            return
        columns = (forces.force_base_N, forces.moment_base_Nmm, forces.torque_Nmm, forces.peak_N)
        tool = np.ascontiguousarray(forces.tool)
        tools = distinct(tool)
        loads, rows = np.empty(5), np.empty(3, dtype=np.int64)
        weight_N = self._weight_N(tools)
        wrong = _find_loads(*map(contiguous, columns), tool, tools, weight_N, ABSURD_FORCE_N, loads, rows)
        if wrong >= 0:
            self.absurd = _absurd_forces(int(tool[wrong]), int(line[wrong]))
            return
        *values, cut_N, whole_N = loads.tolist()
        kinds = (self.force, self.torque, self.load)
        for kind, value, row in zip(kinds, values, rows.tolist(), strict=True):
            is_new = kind.raise_to(value, int(line[row]), int(tool[row]))
        if is_new:
            self._cut_N, self._whole_N = cut_N, whole_N

    def _weight_N(self, tools: Ints32) -> Floats:
        """Return the weight (k, 3) on the flange with each of the tools (k,); 0 where the cell names none."""
        own_kg = np.array([self._cell.load_of(number).mass_kg or 0.0 for number in tools.tolist()])
        down = -self._cell.base_in_world()[2, :3]  # the world's -z along the axes of $BASE
        return own_kg[:, None] * GRAVITY_M_S2 * down

    def issues(self, is_guessed: bool) -> Iterator[Issue]:
        """Yield what exceeds the limits: one finding, at the largest value, each."""
        limits, force, torque = self._cell.limits, self.force, self.torque
        remedy = (
            "check S, F and the depth of cut; [limits] {key} judges, [stock] and [material] decide the figure"
        )
        overload = self._payload(is_guessed)
        if overload is not None:
            yield overload
        elif force.value > limits.force_N:
            sentence = f"T{force.tool} is loaded with {force.value:.0f} N, more than {limits.force_N:g} N"
            yield Issue("warning", "force-high", force.line, sentence, remedy.format(key="force_N"))
        if torque.value > limits.torque_Nm:
            sentence = f"T{torque.tool} takes {torque.value:.1f} Nm, more than {limits.torque_Nm:g} Nm"
            yield Issue("warning", "torque-high", torque.line, sentence, remedy.format(key="torque_Nm"))

    def _payload(self, is_guessed: bool) -> Issue | None:
        rated_kg, load = self._cell.robot.payload.mass_kg, self.load
        if rated_kg is None:
            return None
        own_kg, rated_N = self._cell.load_of(load.tool).mass_kg or 0.0, rated_kg * GRAVITY_M_S2
        if load.value <= rated_N:
            return None
        with_own = (
            f", with the {own_kg:g} kg on the flange {self._whole_N:.0f} N" if self._cut_N < rated_N else ""
        )
        sentence = (
            f"T{load.tool} is loaded with {self._cut_N:.0f} N{with_own}; the {self._cell.robot.title} is "
            f"rated for {rated_kg:g} kg ({rated_N:.0f} N)"
        )
        remedy = "check S, F and the depth of cut, [stock], [material] and [load] mass_kg of the cell"
        sure = not is_guessed or load.value > GUESSED_FACTOR * rated_N
        return Issue("error" if sure else "warning", "payload", load.line, sentence, remedy)


class DeflectionLimit:
    """Deflections that come block after block, beyond the limit, or absurd."""

    def __init__(self, cell: Cell, known: str = "") -> None:
        """Take the limit of the cell, and how well the stiffness is known where nobody stated it."""
        self._most, self._known = cell.limits.deflection_mm, f" ({known})" if known else ""
        self.bent, self.across = Largest(), Largest()
        self.absurd: Issue | None = None
        """The first deflection that is absurd, None if there is none: then no other finding counts."""

    def take(self, deflection: Deflection, reached: Bools, line: Ints32) -> None:
        """Judge the next samples, of which ``line`` (m,) is the G-code line.

        ``reached`` (m,) is False where the robot has no joint angles, which is reported separately.
        """
        if self.absurd is not None or not len(line):
            return
        vectors = (deflection.deflection_base_mm, deflection.correction_base_mm)
        bent, across = map(longest, vectors)
        if not (bent.is_known and across.is_known and bent.length <= ABSURD_DEFLECTION_MM):
            self.absurd = _absurd_deflection(deflection, reached, line)
        if self.absurd is not None and self._known:  # what nobody stated refuses no program
            self.absurd = replace(self.absurd, severity="warning")
        self.bent.raise_to(bent.length, int(line[bent.row]))
        self.across.raise_to(across.length, int(line[across.row]))

    def issues(self) -> Iterator[Issue]:
        """Yield the deflection that exceeds the limit, at its largest value."""
        if self.bent.value > self._most:
            sentence = (
                f"the tool bends away by {self.bent.value:.2f} mm{self._known}, more than {self._most:g} mm"
            )
            remedy = (
                "cut less deep or slower, or state [stock] and a measured [compliance]; "
                "[limits] deflection_mm judges"
            )
            yield Issue("warning", "deflection-high", self.bent.line, sentence, remedy)


class Largest:
    """The largest of values that come some at a time, the first of equal ones, with its place."""

    def __init__(self) -> None:
        """Begin without a value."""
        self.value = -np.inf
        self.line, self.tool = 0, 0

    def take(self, values: Floats, line: Ints32, tool: Ints32) -> int | None:
        """Take values (m,) with lines and tools; return the row of a new largest one, None without."""
        row = int(values.argmax())
        return row if self.raise_to(float(values[row]), int(line[row]), int(tool[row])) else None

    def raise_to(self, value: float, line: int, tool: int = 0) -> bool:
        """Take one value; tell whether it is a new largest one."""
        if not value > self.value:
            return False
        self.value, self.line, self.tool = value, line, tool
        return True


class Longest(NamedTuple):
    """The first of the longest vectors; one that is not a number counts as 0."""

    row: int
    length: float
    is_known: bool
    """Whether all vectors are finite."""


def longest(vectors: Floats) -> Longest:
    """Return the longest of vectors (m, 3)."""
    size = np.empty(2)
    row = _find_longest(np.ascontiguousarray(vectors), size)
    return Longest(row, float(size[0]), bool(size[1]))


def _absurd_forces(tool: int, line: int) -> Issue:
    """Return the finding on absurd forces."""
    sentence = f"the forces on T{tool} are absurd: they are left out"
    remedy = "check [material] (N/mm2, N/mm), the tool's diameter_mm and teeth, S and F"
    return Issue("error", "force-absurd", line, sentence, remedy)


def _absurd_deflection(deflection: Deflection, reached: Bools, line: Ints32) -> Issue | None:
    """Return the finding on an absurd deflection, None if there is none."""
    columns = (deflection.deflection_base_mm, deflection.correction_base_mm)
    with np.errstate(over="ignore", invalid="ignore"):
        size_mm = lengths(deflection.deflection_base_mm)
    finite = np.logical_and.reduce([np.isfinite(column).all(axis=1) for column in columns])
    wrong = reached & ~(finite & (size_mm <= ABSURD_DEFLECTION_MM))
    if not wrong.any():
        return None
    sentence = f"the deflection comes out beyond {ABSURD_DEFLECTION_MM:g} mm: it is left out"
    remedy = (
        "check [compliance.virtual_joints] of the cell (N·mm/rad: N·m/deg times 57,296; a robot's axis has "
        "1e8 to 1e11), and the forces"
    )
    return Issue("error", "deflection-absurd", int(line[np.argmax(wrong)]), sentence, remedy)
