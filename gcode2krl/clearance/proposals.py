"""Where a PTP hits something: a clearance plane or a point on the way that is free, if one of a few is.

No path through the cell is searched. What is tried: the PTP from or to higher above its end, in steps, and
the line down from there; and a PTP in two parts, A1 and the other axes turning one after the other.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from gcode2krl import robot
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.tables import Targets
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

PTP_STEP_RAD = 2.0 * RAD_PER_DEG
"""Rows along a PTP; what is between them is checked too, so this decides only what it costs."""
_HIGHER_MM = (50.0, 100.0, 200.0, 400.0, 800.0)
_LINE_STEP_MM = 10.0
IsFree = Callable[[Floats], bool]
"""Tells of a way of joints (n, 6) in rad whether it hits nothing."""


class Ptp(NamedTuple):
    """A PTP between targets that hits something."""

    targets: Targets
    row: int
    before_rad: Floats
    """(6,)"""
    after_rad: Floats


def ptp_way(before_rad: Floats, after_rad: Floats) -> Floats:
    """Return the joints (n, 6) along a PTP, both ends among them."""
    steps = max(1, int(np.ceil(np.abs(after_rad - before_rad).max() / PTP_STEP_RAD)))
    way: Floats = before_rad + np.linspace(0.0, 1.0, steps + 1)[:, None] * (after_rad - before_rad)
    return way


def proposal(ptp: Ptp, cell: Cell, is_free: IsFree) -> str:
    """Return what would be free, as a remedy; empty where nothing that is tried is."""
    for words, ways in (*_higher(ptp, cell), *_via(ptp)):
        if all(_is_within_limits(way, cell) and is_free(way) for way in ways):
            return words
    return ""


def _higher(ptp: Ptp, cell: Cell) -> Iterator[tuple[str, list[Floats]]]:
    """Yield the PTP from HOME to farther above its end, and to HOME from farther above its beginning."""
    targets, row = ptp.targets, ptp.row
    goes_home, comes_home = bool(targets.home[row - 1]), bool(targets.home[row])
    if goes_home == comes_home:
        return
    low, low_rad, home_rad = (
        (row - 1, ptp.before_rad, ptp.after_rad) if comes_home else (row, ptp.after_rad, ptp.before_rad)
    )
    base_mm = float(targets.position_mm[low, 2])
    for higher_mm in _HIGHER_MM:
        rise = robot.rise_angles(targets, low, low_rad, higher_mm, _LINE_STEP_MM, cell)
        if np.isnan(rise).any():
            return
        words = f"[clearance] z_mm = {base_mm + higher_mm:.0f}: then the straight way of the joints is free"
        yield words, [ptp_way(home_rad, rise[-1]), rise]


def _via(ptp: Ptp) -> Iterator[tuple[str, list[Floats]]]:
    """Yield the PTP in two parts: A1 turns before the others, or behind them."""
    before, after = ptp.before_rad, ptp.after_rad
    for first, others in ((after, before), (before, after)):
        via = np.concatenate([first[:1], others[1:]])
        axes = ", ".join(f"A{k + 1} {angle:.1f}" for k, angle in enumerate(via * DEG_PER_RAD))
        words = f"a PTP to {{{axes}}} in between, by a template of the cell or another HOME, is free"
        yield words, [ptp_way(before, via), ptp_way(via, after)]


def _is_within_limits(way: Floats, cell: Cell) -> bool:
    return bool(robot.limit_margin(way, cell).min() > 0.0)
