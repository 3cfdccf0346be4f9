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
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import FLOATS, INT, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue
from gcode2krl.tables import Deflection, Forces, Motion, lengths
from gcode2krl.units import GRAVITY_M_S2, MM_PER_M, NMM_PER_NM

GUESSED_FACTOR = 2.0
"""Factor by which a force may be too large because its stock is guessed (an assumption): up to this many
times the rated payload it is then a warning."""
ABSURD_FORCE_N = 100_000.0
"""No robot of the library carries a tenth of it (10 t): the figure is a mistake, not a prediction."""
ABSURD_DEFLECTION_MM = 100.0
"""The compliance model is linear in small angles: at this size, 2° on a reach of 3 m, it is not valid."""

_find_longest = core_function("prediction_longest", FLOATS, OUT_FLOATS, returns=INT)


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
    bend = position_mm[2 * n :] - 2.0 * position_mm[n:-n] + position_mm[: -2 * n]
    result = np.sqrt(np.einsum("ij,ij->i", bend, bend)) / (n * dt_s) ** 2
    result[tool[2 * n :] != tool[: -2 * n]] = 0.0
    return np.asarray(result)


class AccelerationLimit:
    """The largest acceleration of a Motion that comes block after block, over one interpolation cycle."""

    def __init__(self, cell: Cell, dt_s: float, count: int) -> None:
        """Take the limit of the cell, the time between samples and how many there are in all."""
        self._most = cell.limits.acceleration_mm_s2
        self._dt_s, self._apart = dt_s, _apart(cell.controller.cycle_s, dt_s, count) if count > 2 else 0
        self._position, self._tool = np.zeros((0, 3)), np.zeros(0, dtype=np.int32)
        self._line = np.zeros(0, dtype=np.int32)
        self._largest = Largest()

    def take(self, motion: Motion, line: Ints32) -> None:
        """Judge the next samples; ``line`` (m,) is the G-code line of each."""
        n = self._apart
        if not n:
            return
        position = np.concatenate([self._position, motion.position_mm])
        tool, lines = np.concatenate([self._tool, motion.tool]), np.concatenate([self._line, line])
        if len(position) > 2 * n:
            self._largest.take(_bends(position, tool, n, self._dt_s), lines[n:-n], tool[n:-n])
        self._position, self._tool, self._line = (
            column[-2 * n :].copy() for column in (position, tool, lines)
        )

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
        with np.errstate(over="ignore", invalid="ignore"):
            size_N = lengths(forces.force_base_N)
        self.absurd = _absurd_forces(forces, size_N, line)
        if self.absurd is None:
            self.force.take(size_N, line, forces.tool)
            self.torque.take(forces.torque_Nmm / NMM_PER_NM, line, forces.tool)
            self._take_load(forces, size_N, line)

    def _take_load(self, forces: Forces, cut_N: Floats, line: Ints32) -> None:
        """Keep the largest load on the flange: the cut, or the cut and the weight."""
        own_kg = self._own_kg(forces.tool)
        down = -self._cell.base_in_world()[2, :3]  # the world's -z along the axes of $BASE
        whole_N = lengths(forces.force_base_N + own_kg[:, None] * GRAVITY_M_S2 * down)
        load_N = np.where(cut_N > 0.0, np.maximum(cut_N, whole_N), 0.0)
        row = self.load.take(load_N, line, forces.tool)
        if row is not None:
            self._cut_N, self._whole_N = float(cut_N[row]), float(whole_N[row])

    def _own_kg(self, tool: Ints32) -> Floats:
        """Return the mass (m,) on the flange with the tools (m,); 0 where the cell names none."""
        own_kg = np.empty(len(tool))
        for number in distinct(tool):
            own_kg[tool == number] = self._cell.load_of(int(number)).mass_kg or 0.0
        return own_kg

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
        bent, across = map(_longest, vectors)
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


class _Longest(NamedTuple):
    """The first of the longest vectors; one that is not a number counts as 0."""

    row: int
    length: float
    is_known: bool
    """Whether all vectors are finite."""


def _longest(vectors: Floats) -> _Longest:
    """Return the longest of vectors (m, 3)."""
    longest = np.empty(2)
    row = _find_longest(np.ascontiguousarray(vectors), longest)
    return _Longest(row, float(longest[0]), bool(longest[1]))


def _absurd_forces(forces: Forces, size_N: Floats, line: Ints32) -> Issue | None:
    """Return the finding on absurd forces, None if there are none."""
    columns = (forces.force_base_N, forces.moment_base_Nmm, forces.torque_Nmm, forces.peak_N)
    if all(np.isfinite(column).all() for column in columns) and size_N.max() <= ABSURD_FORCE_N:
        return None
    rows = len(forces)
    finite = np.logical_and.reduce([np.isfinite(column.reshape(rows, -1)).all(axis=1) for column in columns])
    wrong = int(np.argmax(~finite | ~(size_N <= ABSURD_FORCE_N)))
    sentence = f"the forces on T{forces.tool[wrong]} are absurd: they are left out"
    remedy = "check [material] (N/mm2, N/mm), the tool's diameter_mm and teeth, S and F"
    return Issue("error", "force-absurd", int(line[wrong]), sentence, remedy)


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
