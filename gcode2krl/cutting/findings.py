"""Findings of the material removal: collisions, and cuts beyond the limits of tool or spindle."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.sections import Tool
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.cutting.law import THICK_CHIP_MM, THIN_CHIP_MM, largest_chip, spindle_power
from gcode2krl.errors import MOST_PLACES, Issue
from gcode2krl.tables import Forces
from gcode2krl.units import MM_PER_M, RAD_PER_DEG, RAD_PER_REV, S_PER_MIN

_CONTACT_MM = 0.01
"""Thinner material that rapid, shank or holder meet is rounding of path and cells."""
_GRAZE_MM = 3.0
"""Longest way, a little more than that of a sample at 0.2 m/s, on which a rapid may meet material that a
rounded corner has left."""
_THIN_MM = 0.3
"""Thicker material is never ignored as the rest of a rounded corner."""
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


@dataclass(frozen=True)
class Cut:
    """What is known of each sample (m rows) beside its forces."""

    source_line: Ints32
    rapid: Bools
    engaged: Bools
    """(m,) True in material."""
    spindle_rad_s: Floats
    f_z_mm: Floats
    ramp_rad: Floats
    cycle_s: float
    centre_mm: Floats
    """Material below the middle of a descending tool."""
    overlap_mm: Floats
    """(m, 3) how far rapid, shank and holder are in the material."""
    step_mm: Floats
    """Distance from the sample before."""
    descent_mm: Floats
    """(m,) part of it down the tool axis, 0 where the tool rises."""
    blend_mm: float
    """Largest CDIS: a rounded corner leaves material up to that thickness on the rim, where the tool went
    in."""


def findings_of(cut: Cut, forces: Forces, cell: Cell, guessed: bool) -> tuple[Issue, ...]:
    """Return the findings, by line. Collisions are errors, warnings where the stock is guessed."""
    severity: Literal["error", "warning"] = "warning" if guessed else "error"
    issues = [
        *_collisions(cut, forces, cell, severity),
        *_spindle(cut, forces, severity),
        *_plunges(cut, forces, cell, severity),
        *_limits(cut, forces, cell),
        *_chips(cut, forces),
        *_modes(cut, forces, cell),
    ]
    if guessed:
        remedy = "give [stock] box_mm or mesh in the cell"
        sentence = "the stock is guessed from the feed moves: its findings are warnings"
        issues.append(Issue("note", "stock-guessed", 0, sentence, remedy))
    return tuple(sorted(issues, key=lambda issue: issue.line))


def _collisions(
    cut: Cut, forces: Forces, cell: Cell, severity: Literal["error", "warning"]
) -> Iterator[Issue]:
    kinds = (
        ("rapid-in-stock", "rapid move through material, {depth:.2f} mm deep", "retract first, or use G1"),
        (
            "shank-in-stock",
            "the shank of T{tool} touches material, {depth:.2f} mm above its edges",
            "use a tool with longer flutes, or cut in shallower steps",
        ),
        (
            "holder-in-stock",
            "the holder of T{tool} touches material, {depth:.2f} mm deep",
            "let the tool stick out further, or cut in shallower steps",
        ),
    )
    for column, (code, sentence, remedy) in enumerate(kinds):
        depth = cut.overlap_mm[:, column]
        if column == 0:
            depth = _below_surface(cut, depth)
            depth = np.where(_grazes(cut, depth), 0.0, depth)
        for row in _starts(depth > _CONTACT_MM):
            worst = row + int(np.argmax(depth[row : _end(depth > _CONTACT_MM, row)]))
            words = sentence.format(depth=float(depth[worst]), tool=int(forces.tool[row]))
            yield Issue(severity, code, int(cut.source_line[row]), words, remedy)


def _below_surface(cut: Cut, depth: Floats) -> Floats:
    """Return how far (m,) rapids are below the surface that they met.

    Material that one sample has cut off is missing for the next, so the descent is added.
    """
    met = depth > _CONTACT_MM
    begins = met & ~np.concatenate([[False], met[:-1]])
    first = np.maximum.accumulate(np.where(begins, np.arange(len(met)), 0))
    down_mm = np.cumsum(cut.descent_mm)
    result: Floats = np.where(met, np.maximum(depth, depth[first] + down_mm - down_mm[first]), depth)
    return result


def _grazes(cut: Cut, depth: Floats) -> Bools:
    """Return where a rapid meets only the rest of a rounded corner: thin and short."""
    met = depth > _CONTACT_MM
    stretch = np.cumsum(met & ~np.concatenate([[False], met[:-1]])) * met
    way_mm = np.bincount(stretch, cut.step_mm)
    deepest_mm = np.zeros(len(way_mm))
    np.maximum.at(deepest_mm, stretch, depth)
    grazing = (way_mm <= _GRAZE_MM) & (deepest_mm <= min(cut.blend_mm, _THIN_MM) + _CONTACT_MM)
    result: Bools = met & grazing[stretch]
    return result


def _spindle(cut: Cut, forces: Forces, severity: Literal["error", "warning"]) -> Iterator[Issue]:
    engaged = cut.engaged & ~cut.rapid
    for row in _starts(engaged & (cut.spindle_rad_s == 0.0)):
        sentence = f"T{forces.tool[row]} cuts material while the spindle is stopped"
        yield Issue(severity, "spindle-off", int(cut.source_line[row]), sentence, "M3 with S before the cut")
    for row in _starts(engaged & (cut.spindle_rad_s < 0.0)):
        sentence = f"T{forces.tool[row]} cuts with M4: a right-hand tool turns the wrong way"
        yield Issue("error", "spindle-direction", int(cut.source_line[row]), sentence, "use M3")


def _plunges(cut: Cut, forces: Forces, cell: Cell, severity: Literal["error", "warning"]) -> Iterator[Issue]:
    remedy = "ramp or helix down, pre-drill, or use a centre-cutting mill"
    for number in _tools(forces).tolist():
        tool: Tool = cell.tool[number]
        doubtful = _wide_and_silent(tool)
        if tool.centre_cutting and not doubtful:
            continue
        with_tool = forces.tool == number
        into = with_tool & (cut.centre_mm > _CONTACT_MM) & (cut.ramp_rad > _PLUNGE_RAD)
        for row in _starts(into)[: 1 if doubtful else None]:
            line = int(cut.source_line[row])
            if doubtful:
                sentence = (
                    f"T{number}, {tool.diameter_mm:g} mm wide, plunges into material: mills that wide hardly "
                    "ever cut at their centre"
                )
                yield Issue(
                    "warning",
                    "plunge-wide",
                    line,
                    sentence,
                    f"{remedy}; or state tool.{number}.centre_cutting = true",
                )
            else:
                sentence = f"T{number} plunges into material and does not cut at its centre"
                yield Issue(severity, "plunge", line, sentence, remedy)


def _wide_and_silent(tool: Tool) -> bool:
    """Tell whether a tool is too wide to be assumed centre-cutting, and the cell does not state it."""
    return (
        tool.kind != "drill"
        and tool.diameter_mm > _WIDE_PLUNGE_MM
        and "centre_cutting" not in tool.model_fields_set
    )


def _limits(cut: Cut, forces: Forces, cell: Cell) -> Iterator[Issue]:
    size = np.linalg.norm(forces.force_base_N, axis=1)
    for number in _tools(forces).tolist():
        tool: Tool = cell.tool[number]
        with_tool = forces.tool == number
        deepest = tool.max_depth_mm
        if deepest is not None:
            yield from _beyond(
                cut,
                with_tool,
                forces.a_p_mm,
                deepest * (1.0 + 1e-6) + _CONTACT_MM,
                "depth-limit",
                f"T{number} cuts {{value:.2f}} mm deep, allowed {deepest:g}",
                "cut in shallower steps",
            )
        if tool.max_force_N is not None:
            yield from _beyond(
                cut,
                with_tool,
                size,
                tool.max_force_N,
                "force-limit",
                f"T{number} is loaded with {{value:.0f}} N, allowed {tool.max_force_N:g}",
                "lower F or the depth of cut",
            )
    spindle = cell.spindle
    if spindle.max_torque_Nm is not None:
        yield from _beyond(
            cut,
            None,
            forces.torque_Nmm / MM_PER_M,
            spindle.max_torque_Nm,
            "spindle-torque",
            f"cutting takes {{value:.2f}} Nm, the spindle has {spindle.max_torque_Nm:g}",
            "lower F or the depth of cut",
        )
    if spindle.max_power_W is not None:
        yield from _beyond(
            cut,
            None,
            spindle_power(forces.torque_Nmm, cut.spindle_rad_s),
            spindle.max_power_W,
            "spindle-power",
            f"cutting takes {{value:.0f}} W, the spindle has {spindle.max_power_W:g}",
            "lower F or the depth of cut",
        )


def _beyond(
    cut: Cut, own: Bools | None, values: Floats, most: float, code: str, sentence: str, remedy: str
) -> Iterator[Issue]:
    beyond = values > most if own is None else own & (values > most)
    for row in _starts(beyond):
        worst = float(values[row : _end(beyond, row)].max())
        yield Issue("warning", code, int(cut.source_line[row]), sentence.format(value=worst), remedy)


def _chips(cut: Cut, forces: Forces) -> Iterator[Issue]:
    """Yield chips outside the range of the coefficients: once each, with the fraction of the time in cut."""
    cutting = cut.engaged & (cut.f_z_mm > 0.0)
    thin, thick = np.zeros((2, len(cutting)), dtype=np.bool_)

    def judge(start: int, end: int) -> None:
        rows = start + np.flatnonzero(cutting[start:end])
        chip = largest_chip(forces.phi_rad[rows], cut.f_z_mm[rows], cut.ramp_rad[rows])
        thin[rows], thick[rows] = chip < THIN_CHIP_MM, chip > THICK_CHIP_MM

    in_chunks(judge, chunk_borders(len(cutting)))
    in_cut = np.count_nonzero(cutting)
    for wrong, code, words in (
        (thin, "chip-thin", f"chips below {THIN_CHIP_MM:g} mm: edges rub more than cut"),
        (thick, "chip-thick", f"chips above {THICK_CHIP_MM:g} mm: beyond the coefficients"),
    ):
        count = np.count_nonzero(wrong)
        if count * cut.cycle_s < max(_SHORT_S, 0.05 * in_cut * cut.cycle_s):
            continue
        sentence = f"{words}, in {count / in_cut:.0%} of the time in cut, first at this line"
        line = int(cut.source_line[np.argmax(wrong)])
        yield Issue("note", code, line, sentence, "change F or the spindle speed")


def _modes(cut: Cut, forces: Forces, cell: Cell) -> Iterator[Issue]:
    """A note where spindle or tooth passing meets a structural mode; stability itself is not predicted."""
    begins = _runs(cut.spindle_rad_s, forces.tool)
    begins = begins[np.logical_or.reduceat(cut.engaged, begins)]
    speeds = np.abs(cut.spindle_rad_s[begins])
    for speed, number in np.unique(np.stack([speeds, forces.tool[begins]], axis=1), axis=0):
        teeth = cell.tool[int(number)].teeth
        turns_hz = float(speed) / RAD_PER_REV
        for mode in cell.compliance.modes_hz:
            for order in sorted({*range(1, _HARMONICS + 1), *(teeth * n for n in range(1, _HARMONICS + 1))}):
                if abs(order * turns_hz - mode) <= _NEAR_MODE * mode:
                    begin = int(begins[np.argmax(speeds == speed)])
                    row = begin + int(np.argmax(cut.engaged[begin:]))
                    what = "the spindle" if order % teeth else "tooth passing"
                    yield Issue(
                        "note",
                        "near-mode",
                        int(cut.source_line[row]),
                        f"{order} times {turns_hz * S_PER_MIN:.0f}/min of T{int(number)} ({what}) is near "
                        f"the mode at {mode:g} Hz; stability is not predicted",
                        "change the spindle speed",
                    )
                    break


def _tools(forces: Forces) -> Ints32:
    return np.unique(forces.tool[_runs(forces.tool)])


def _runs(*columns: NDArray[Any]) -> Ints:
    """Return where stretches of rows (m,) begin in which no column changes."""
    begins = np.arange(len(columns[0])) == 0
    for column in columns:
        begins[1:] |= column[1:] != column[:-1]
    return np.flatnonzero(begins)


def _starts(wrong: Bools) -> list[int]:
    """Return where stretches begin, at most `MOST_PLACES`."""
    begins = np.flatnonzero(wrong & ~np.concatenate([[False], wrong[:-1]]))
    return [int(row) for row in begins[:MOST_PLACES]]


def _end(wrong: Bools, start: int) -> int:
    """Return the row after a stretch."""
    length = int(np.argmin(wrong[start:]))  # stops at the first False
    return start + length if not wrong[start + length] else len(wrong)
