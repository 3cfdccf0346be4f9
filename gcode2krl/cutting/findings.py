"""Findings of the material removal: collisions, and cuts beyond the limits of tool or spindle."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import Material, Tool
from gcode2krl.compiled.core import BOOLS, FLOATS, INTS32, OUT_FLOATS, OUT_INTS, core_function
from gcode2krl.cutting.law import THICK_CHIP_MM, THIN_CHIP_MM, spindle_power
from gcode2krl.cutting.records import followed, taken
from gcode2krl.errors import MOST_PLACES, Issue, Severity
from gcode2krl.tables import Forces, lengths
from gcode2krl.units import MM_PER_M, RAD_PER_DEG, RAD_PER_REV, S_PER_MIN

# Stretches of samples at which something is wrong, found in samples that come some at a time.

CONTACT_MM = 0.01
"""Thinner material that rapid, shank or holder meet is rounding of path and cells."""
_GRAZE_MM = 3.0
"""Longest way, a little more than that of a sample at 0.2 m/s, on which a rapid may meet material that a
rounded corner has left."""
_THIN_MM = 0.3
"""Thicker material is never ignored as the rest of a rounded corner."""


_count_chips = core_function(
    "cutting_count_chips", BOOLS, *(FLOATS,) * 4, INTS32, FLOATS, OUT_FLOATS, OUT_INTS, OUT_INTS
)


class Stretch(NamedTuple):
    """Where a stretch begins, with which tool, and its largest value (0 where it has none)."""

    line: int
    tool: int
    worst: float


class Stretches:
    """The first `MOST_PLACES` stretches at which something is wrong."""

    def __init__(self) -> None:
        """Begin in front of the first sample."""
        self.listed: list[Stretch] = []
        self._goes_on = False
        self._is_listed = False

    def take(self, wrong: Bools, line: Ints32, tool: Ints32, values: Floats | None = None) -> None:
        """Judge the next samples (m, at least one) from whether they are wrong, line, tool and value."""
        if self._goes_on and self._is_listed and wrong[0] and values is not None:
            worst = float(values[: _end(wrong, 0)].max())
            self.listed[-1] = self.listed[-1]._replace(worst=max(self.listed[-1].worst, worst))
        begins = np.flatnonzero(wrong & ~np.concatenate([[self._goes_on], wrong[:-1]]))
        room = MOST_PLACES - len(self.listed)
        for row in begins[:room].tolist():
            worst = float(values[row : _end(wrong, row)].max()) if values is not None else 0.0
            self.listed.append(Stretch(int(line[row]), int(tool[row]), worst))
        if len(begins):
            self._is_listed = len(begins) <= room
        self._goes_on = bool(wrong[-1])


def _end(wrong: Bools, start: int) -> int:
    """Return the row after a stretch."""
    length = int(np.argmin(wrong[start:]))  # stops at the first False
    return start + length if not wrong[start + length] else len(wrong)


class _RapidSamples(NamedTuple):
    """Samples of rapids."""

    row: Ints
    line: Ints32
    tool: Ints32
    step_mm: Floats
    descent_mm: Floats
    depth_mm: Floats


class RapidContacts:
    """Rapids through material. What one has cut off is known only some samples later."""

    def __init__(self, blend_mm: float) -> None:
        """Take the largest CDIS, see `findings.Findings`."""
        self._blend_mm = blend_mm
        self._count = 0
        none, zero = np.zeros(0, dtype=np.int32), np.zeros(0)
        self._rows = _RapidSamples(np.zeros(0, dtype=np.int64), none, none, zero, zero, zero)

    def take(self, cut: "Cut", tool: Ints32) -> None:
        """Add the next samples."""
        rows = np.flatnonzero(cut.rapid)
        columns = (cut.source_line[rows], tool[rows], cut.step_mm[rows], cut.descent_mm[rows])
        added = _RapidSamples(self._count + rows, *columns, np.zeros(len(rows)))
        self._rows = followed(self._rows, added)
        self._count += len(tool)

    def met(self, row: Ints, depth_mm: Floats, settled: int) -> None:
        """Note how deep (r,) rapids were at samples (r,); nothing more comes of those before ``settled``."""
        known = self._rows
        np.maximum.at(known.depth_mm, np.searchsorted(known.row, row), depth_mm)
        kept = (known.row >= settled) | (known.depth_mm > CONTACT_MM)
        self._rows = taken(known, kept)

    def stretches(self) -> list[Stretch]:
        """Return the stretches in which a rapid meets more than the rest of a rounded corner."""
        met = self._rows.depth_mm > CONTACT_MM
        rows = taken(self._rows, met)
        if not len(rows.row):
            return []
        begins = np.flatnonzero(np.diff(rows.row, prepend=-2) > 1)
        stretch = np.repeat(np.arange(len(begins)), np.diff(begins, append=len(rows.row)))
        depth_mm = self._below_surface(rows, begins[stretch])
        way_mm, deepest_mm = np.bincount(stretch, rows.step_mm), np.zeros(len(begins))
        np.maximum.at(deepest_mm, stretch, depth_mm)
        grazes = (way_mm <= _GRAZE_MM) & (deepest_mm <= min(self._blend_mm, _THIN_MM) + CONTACT_MM)
        return [
            Stretch(int(rows.line[begins[k]]), int(rows.tool[begins[k]]), float(deepest_mm[k]))
            for k in np.flatnonzero(~grazes)[:MOST_PLACES]
        ]

    @staticmethod
    def _below_surface(rows: _RapidSamples, first: Ints) -> Floats:
        """Return how far (m,) rapids are below the surface that they met in the ``first`` row of a stretch.

        Material that one sample has cut off is missing for the next, so the descent is added.
        """
        down_mm = np.cumsum(rows.descent_mm)
        return np.asarray(np.maximum(rows.depth_mm, rows.depth_mm[first] + down_mm - down_mm[first]))


_PLUNGE_RAD = 20.0 * RAD_PER_DEG
"""Descent above which a mill that does not cut at its centre cannot follow: assumed, ramps are flatter."""
_WIDE_PLUNGE_MM = 32.0
"""Diameter above which a mill is assumed not to cut at its centre unless the cell states that it does;
solid end mills end there, face mills begin at 40 to 50 mm (ISO 6462) and leave a core."""
_NEAR_MODE = 0.15
"""Fraction of a mode's frequency within which a spindle or tooth harmonic is noted."""
_HARMONICS = 3
_SHORT_S = 0.1
"""A thin chip that lasts less than this is an entry, an exit or a corner."""
_BESIDE = 0.02
"""Feed and depth this little beside the measured range, relative, are within it: predictions are rounded."""
Judge = Callable[..., None]
"""Takes a code, the samples that are wrong, the value of each, and a tool."""


@dataclass(frozen=True)
class Cut:
    """What is known of some samples (m rows) that follow each other, beside their forces."""

    source_line: Ints32
    rapid: Bools
    engaged: Bools
    """(m,) True in material."""
    spindle_rad_s: Floats
    f_z_mm: Floats
    ramp_rad: Floats
    centre_mm: Floats
    """Material below the middle of a descending tool."""
    overlap_mm: Floats
    """(m, 2) how far shank and holder are in the material."""
    step_mm: Floats
    """Distance from the sample before."""
    descent_mm: Floats
    """(m,) part of it down the tool axis, 0 where the tool rises."""


class Findings:
    """What is found on the samples of a motion, which are taken in order, some at a time."""

    def __init__(
        self, cell: Cell, tools: Sequence[int], guessed: bool, blend_mm: float, cycle_s: float
    ) -> None:
        """Take the cell, the tools that move, whether the stock is guessed, and the time between samples.

        ``blend_mm`` is the largest CDIS: a rounded corner leaves material up to that thickness on the rim,
        where the tool went in.
        """
        self._cell, self._tools, self._guessed = cell, tools, guessed
        self._rapids = RapidContacts(blend_mm)
        self._wrong: dict[tuple[str, int], Stretches] = {}
        self._chips = _Chips(cycle_s, cell.material)
        self._speeds: dict[tuple[float, int], None] = {}
        self._first_at: dict[float, int] = {}

    def take(self, cut: Cut, forces: Forces) -> None:
        """Judge the next samples."""
        if not len(forces):
            return
        line, tool = cut.source_line, forces.tool
        self._rapids.take(cut, tool)

        def judge(code: str, wrong: Bools, values: Floats | None = None, number: int = 0) -> None:
            stretches = self._wrong.setdefault((code, number), Stretches())
            stretches.take(wrong, line, tool, values)

        for column, code in enumerate(("shank-in-stock", "holder-in-stock")):
            depth = cut.overlap_mm[:, column]
            judge(code, depth > CONTACT_MM, depth)
        engaged = cut.engaged & ~cut.rapid
        judge("spindle-off", engaged & (cut.spindle_rad_s == 0.0))
        judge("spindle-direction", engaged & (cut.spindle_rad_s < 0.0))
        self._judge_tools(cut, forces, judge)
        self._judge_spindle(cut, forces, judge)
        self._chips.take(cut, forces)
        self._note_speeds(cut, forces)

    def rapids_met(self, row: Ints, depth_mm: Floats, settled: int) -> None:
        """Note rapids (r) through material; nothing more will be said of the samples before ``settled``."""
        self._rapids.met(row, depth_mm, settled)

    def issues(self) -> tuple[Issue, ...]:
        """Return the findings, by line. Collisions are errors, warnings where the stock is guessed."""
        issues = [
            *self._collisions(),
            *self._spindle(),
            *self._plunges(),
            *self._limits(),
            *self._chips.issues(),
            *self._modes(),
        ]
        if self._guessed:
            remedy = "give [stock] box_mm or mesh in the cell"
            sentence = "the stock is guessed from the feed moves: its findings are warnings"
            issues.append(Issue("note", "stock-guessed", 0, sentence, remedy))
        return tuple(sorted(issues, key=lambda issue: issue.line))

    # --- taking ---

    def _judge_tools(self, cut: Cut, forces: Forces, judge: Judge) -> None:
        size_N = lengths(forces.force_base_N)
        for number in self._tools:
            tool: Tool = self._cell.tool[number]
            with_tool = forces.tool == number
            if not tool.centre_cutting or _wide_and_silent(tool):
                into = with_tool & (cut.centre_mm > CONTACT_MM) & (cut.ramp_rad > _PLUNGE_RAD)
                judge("plunge", into, None, number)
            if tool.max_depth_mm is not None:
                deepest_mm = tool.max_depth_mm * (1.0 + 1e-6) + CONTACT_MM
                judge("depth-limit", with_tool & (forces.a_p_mm > deepest_mm), forces.a_p_mm, number)
            if tool.max_force_N is not None:
                judge("force-limit", with_tool & (size_N > tool.max_force_N), size_N, number)

    def _judge_spindle(self, cut: Cut, forces: Forces, judge: Judge) -> None:
        spindle = self._cell.spindle
        if spindle.max_torque_Nm is not None:
            torque_Nm = forces.torque_Nmm / MM_PER_M
            judge("spindle-torque", torque_Nm > spindle.max_torque_Nm, torque_Nm)
        if spindle.max_power_W is not None:
            power_W = spindle_power(forces.torque_Nmm, cut.spindle_rad_s)
            judge("spindle-power", power_W > spindle.max_power_W, power_W)

    def _note_speeds(self, cut: Cut, forces: Forces) -> None:
        """Note the spindle speeds and tools that cut, and where each speed cuts first."""
        rows = np.flatnonzero(cut.engaged)
        if not len(rows):
            return
        speeds, tools = np.abs(cut.spindle_rad_s[rows]), forces.tool[rows]
        for begin in _runs(speeds, tools).tolist():
            speed = float(speeds[begin])
            self._speeds.setdefault((speed, int(tools[begin])))
            self._first_at.setdefault(speed, int(cut.source_line[rows[begin]]))

    # --- telling ---

    @property
    def _severity(self) -> Literal["error", "warning"]:
        return "warning" if self._guessed else "error"

    def _found(self, code: str, number: int = 0) -> list[Stretch]:
        stretches = self._wrong.get((code, number))
        return stretches.listed if stretches is not None else []

    def _collisions(self) -> Iterator[Issue]:
        kinds = (
            (
                "rapid-in-stock",
                self._rapids.stretches(),
                "rapid move through material, {depth:.2f} mm deep",
                "retract first, or use G1",
            ),
            (
                "shank-in-stock",
                self._found("shank-in-stock"),
                "the shank of T{tool} touches material, {depth:.2f} mm above its edges",
                "use a tool with longer flutes, or cut in shallower steps",
            ),
            (
                "holder-in-stock",
                self._found("holder-in-stock"),
                "the holder of T{tool} touches material, {depth:.2f} mm deep",
                "let the tool stick out further, or cut in shallower steps",
            ),
        )
        for code, stretches, sentence, remedy in kinds:
            for stretch in stretches:
                words = sentence.format(depth=stretch.worst, tool=stretch.tool)
                yield Issue(self._severity, code, stretch.line, words, remedy)

    def _spindle(self) -> Iterator[Issue]:
        for stretch in self._found("spindle-off"):
            sentence = f"T{stretch.tool} cuts material while the spindle is stopped"
            yield Issue(self._severity, "spindle-off", stretch.line, sentence, "M3 with S before the cut")
        for stretch in self._found("spindle-direction"):
            sentence = f"T{stretch.tool} cuts with M4: a right-hand tool turns the wrong way"
            yield Issue("error", "spindle-direction", stretch.line, sentence, "use M3")

    def _plunges(self) -> Iterator[Issue]:
        remedy = "ramp or helix down, pre-drill, or use a centre-cutting mill"
        for number in self._tools:
            tool: Tool = self._cell.tool[number]
            doubtful = _wide_and_silent(tool)
            for stretch in self._found("plunge", number)[: 1 if doubtful else None]:
                if doubtful:
                    sentence = (
                        f"T{number}, {tool.diameter_mm:g} mm wide, plunges into material: mills that wide "
                        "hardly ever cut at their centre"
                    )
                    or_so = f"{remedy}; or state tool.{number}.centre_cutting = true"
                    yield Issue("warning", "plunge-wide", stretch.line, sentence, or_so)
                else:
                    sentence = f"T{number} plunges into material and does not cut at its centre"
                    yield Issue(self._severity, "plunge", stretch.line, sentence, remedy)

    def _limits(self) -> Iterator[Issue]:
        less = "lower F or the depth of cut"
        for number in self._tools:
            tool: Tool = self._cell.tool[number]
            for stretch in self._found("depth-limit", number):
                sentence = f"T{number} cuts {stretch.worst:.2f} mm deep, allowed {tool.max_depth_mm:g}"
                yield Issue("warning", "depth-limit", stretch.line, sentence, "cut in shallower steps")
            for stretch in self._found("force-limit", number):
                sentence = f"T{number} is loaded with {stretch.worst:.0f} N, allowed {tool.max_force_N:g}"
                yield Issue("warning", "force-limit", stretch.line, sentence, less)
        spindle = self._cell.spindle
        for stretch in self._found("spindle-torque"):
            sentence = f"cutting takes {stretch.worst:.2f} Nm, the spindle has {spindle.max_torque_Nm:g}"
            yield Issue("warning", "spindle-torque", stretch.line, sentence, less)
        for stretch in self._found("spindle-power"):
            sentence = f"cutting takes {stretch.worst:.0f} W, the spindle has {spindle.max_power_W:g}"
            yield Issue("warning", "spindle-power", stretch.line, sentence, less)

    def _modes(self) -> Iterator[Issue]:
        """A note where spindle or tooth passing meets a structural mode; stability is not predicted."""
        for speed, number in sorted(self._speeds):
            teeth = self._cell.tool[number].teeth
            turns_hz = speed / RAD_PER_REV
            for mode in self._cell.compliance.modes_hz:
                for order in sorted(
                    {*range(1, _HARMONICS + 1), *(teeth * n for n in range(1, _HARMONICS + 1))}
                ):
                    if abs(order * turns_hz - mode) <= _NEAR_MODE * mode:
                        what = "the spindle" if order % teeth else "tooth passing"
                        yield Issue(
                            "note",
                            "near-mode",
                            self._first_at[speed],
                            f"{order} times {turns_hz * S_PER_MIN:.0f}/min of T{number} ({what}) is near "
                            f"the mode at {mode:g} Hz; stability is not predicted",
                            "change the spindle speed",
                        )
                        break


def _wide_and_silent(tool: Tool) -> bool:
    """Tell whether a tool is too wide to be assumed centre-cutting, and the cell does not state it."""
    return (
        tool.kind != "drill"
        and tool.diameter_mm > _WIDE_PLUNGE_MM
        and "centre_cutting" not in tool.model_fields_set
    )


class _Chips:
    """Cuts outside the range of the coefficients: once each, with the fraction of the time in cut."""

    def __init__(self, cycle_s: float, material: Material | None) -> None:
        self._cycle_s = cycle_s
        self._measured = np.tile([-np.inf, np.inf], (2, 1))
        self._beyond = np.tile([np.inf, 0.0], (2, 1))
        """(2, 2) the range of f_z and a_p that was measured, and that of values outside it."""
        if material is not None:
            for row, between in enumerate((material.measured_f_z_mm, material.measured_a_p_mm)):
                if between is not None:
                    self._measured[row] = between[0] * (1.0 - _BESIDE), between[1] * (1.0 + _BESIDE)
        self._counts, self._line = np.zeros(4, dtype=np.int64), np.zeros(3, dtype=np.int64)
        """Of thin chips, thick ones and cuts that were not measured: how many, and the line of the first;
        behind them how many cuts in all."""

    def take(self, cut: Cut, forces: Forces) -> None:
        samples = (cut.engaged, forces.phi_rad, cut.f_z_mm, cut.ramp_rad, forces.a_p_mm, cut.source_line)
        columns = map(np.ascontiguousarray, samples)
        _count_chips(*columns, self._measured, self._beyond, self._counts, self._line)

    def issues(self) -> Iterator[Issue]:
        ranges = zip(("f_z", "a_p"), self._beyond.tolist(), strict=True)
        beyond = ", ".join(f"{name} {low:.3f}..{high:.3f} mm" for name, (low, high) in ranges if low <= high)
        change = "change F or the spindle speed"
        kinds: tuple[tuple[Severity, str, str, str], ...] = (
            ("note", "chip-thin", f"chips below {THIN_CHIP_MM:g} mm: edges rub more than cut", change),
            ("note", "chip-thick", f"chips above {THICK_CHIP_MM:g} mm: beyond the coefficients", change),
            (
                "warning",
                "force-unmeasured",
                f"cuts with {beyond}, for which the coefficients were not measured: their band does not hold",
                "measure such a cut too (`gcode2krl identify force`), or change F and the depth",
            ),
        )
        *counts, in_cut = self._counts.tolist()
        lines = self._line.tolist()
        for count, line, (severity, code, words, remedy) in zip(counts, lines, kinds, strict=True):
            if count * self._cycle_s < max(_SHORT_S, 0.05 * in_cut * self._cycle_s):
                continue
            share = count / in_cut
            sentence = f"{words}, in {share:.0%} of the time in cut, first at this line"
            yield Issue(severity, code, line, sentence, remedy)


def _runs(*columns: NDArray[Any]) -> Ints:
    """Return where stretches of rows (m,) begin in which no column changes."""
    begins = np.arange(len(columns[0])) == 0
    for column in columns:
        begins[1:] |= column[1:] != column[:-1]
    return np.flatnonzero(begins)
