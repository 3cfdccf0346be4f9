"""Chatter along a motion: mode coupling of the arm from its pose and cut, and the lobes of tools.

Mode coupling is judged at samples that cut, not where external axes carry robot or part; lobes where the cell
states modes from a tap test. Both are estimates: `compliance.mode_coupling` and `cutting.lobes` say what they
leave out.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gcode2krl import robot
from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.inputs import distinct
from gcode2krl.compliance import missing_stiffness, stiffness
from gcode2krl.compliance.mode_coupling import MOST_GAIN, coupling_index, tip_flexibility
from gcode2krl.cutting.force import cutting_load
from gcode2krl.cutting.law import law_array
from gcode2krl.cutting.lobes import depth_limit
from gcode2krl.cutting.stiffness import process_stiffness, stiffness_of_cut
from gcode2krl.errors import Issue
from gcode2krl.frames import rotation_from_quaternion
from gcode2krl.pose.quality import Poses
from gcode2krl.tables import Forces, Motion, Toolpath, rows_at
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG, RAD_PER_REV, S_PER_MIN

JUDGED = 400
"""Samples of a block, or of a prediction, that are judged, evenly among those that cut."""
_DEEPEST = 6
_GRID_RAD = 5.0 * RAD_PER_DEG
_USUAL_CHIP_MM = 0.1
_UP_HALF = np.array([[0.0, math.pi / 2.0]])
_ALONG_X, _UPRIGHT = np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 0.0, 1.0]])
_TO_HOLDER = np.array([1.0, 1.0, -1.0])
"""Axial forces count from the holder to the tip."""


class Coupling(NamedTuple):
    """The index of mode coupling along a motion, at the samples that were judged (n)."""

    row: Ints
    """Row of the Motion."""
    coupling: Floats
    """(n,) the index; from 1 on the arm swings by itself, as predicted."""
    spin_rad: Floats
    """(s,) turns of the tool about its axis, counted from that of the motion."""
    over_spin: Floats
    """(s, n) the index at these turns, in the branch of the motion; NaN out of reach."""


def coupling_along(
    toolpath: Toolpath,
    motion: Motion,
    q_rad: Floats,
    forces: Forces,
    cell: Cell,
    *,
    spins: bool = False,
    most_gain: float = MOST_GAIN,
) -> Coupling:
    """Return the index at up to `JUDGED` samples that cut, and with ``spins`` the map over the turn.

    ``q_rad`` (m, 6). Its 90 % band is relative, `index_band`. Raises `NotUnderstoodError` where the stiffness
    is not known.

    >>> from gcode2krl import Prediction
    >>> from gcode2krl.pose.chatter import coupling_along
    >>> seen = Prediction.load("prediction")
    >>> along = coupling_along(seen.toolpath, seen.motion, seen.joints.q_rad, seen.forces, seen.cell)
    >>> len(along.coupling) <= 400
    True
    """
    cuts = np.isfinite(forces.phi_rad[:, 0]) & (forces.a_p_mm > 0.0) & np.isfinite(q_rad[:, 0])
    rows = np.flatnonzero(cuts)
    rows = rows[distinct(np.linspace(0, len(rows) - 1, min(JUDGED, len(rows))).astype(np.int64))]
    pose, tool = q_rad[rows], forces.tool[rows]
    process = stiffness_of_cut(rows, forces, motion, toolpath, cell)
    turns, over = np.zeros(0), np.zeros((0, len(rows)))
    if spins:
        turns = np.arange(-np.pi, np.pi - 1e-9, _GRID_RAD)
        over = _turned(rows_at(motion, rows), pose, tool, process, cell, turns)
    index = coupling_index(tip_flexibility(pose, cell, tool), process, most_gain=most_gain)
    return Coupling(rows, index, turns, over)


def chatter_not_judged(cell: Cell, tools: Sequence[int], *, is_cut: bool) -> str:
    """Return the kinds of chatter that nothing is said of with these tools, "" where both are estimated."""
    if not is_cut or not _couples(cell):
        return "chatter"
    tested = {mode.tool for mode in cell.compliance.tap_modes}
    untested = [f"T{number}" for number in tools if number not in tested]
    return f"chatter of {', '.join(untested)} (no tap test)" if untested else ""


def _couples(cell: Cell) -> bool:
    return not cell.external and cell.material is not None and missing_stiffness(cell) is None


def index_band(forces: Forces, cell: Cell) -> float:
    """Return the half-width of the 90 % band of an index, relative: that of force and stiffness together."""
    return math.hypot(forces.relative_band, stiffness(cell).relative_band)


def _turned(
    motion: Motion, q_rad: Floats, tool: Ints32, process: Floats, cell: Cell, turns_rad: Floats
) -> Floats:
    """Return the index (s, n) with the tool turned about its axis, in the branch nearest to ``q_rad``."""
    row = np.tile(np.arange(len(q_rad)), len(turns_rad))
    index = np.full(len(row), np.nan)
    half = np.repeat(turns_rad / 2.0, len(q_rad))
    x, y, z, w = motion.rotation[row].T
    s, c = np.sin(half), np.cos(half)
    rotation = np.stack([x * c + y * s, y * c - x * s, z * c + w * s, w * c - z * s], axis=1)
    other = robot.inverse(motion.position_mm[row], rotation, cell, tool[row])
    away = np.abs(np.angle(np.exp(1j * (other - q_rad[row][:, None]))))[:, :, :5].max(axis=2)
    nearest = np.argmin(np.where(np.isfinite(away), away, np.inf), axis=1)
    chosen = other[np.arange(len(row)), nearest]
    reached = np.isfinite(chosen).all(axis=1)
    reached[reached] = robot.pose_margins(chosen[reached], cell)[0] >= 0.0
    if reached.any():
        at = row[reached]
        index[reached] = coupling_index(tip_flexibility(chosen[reached], cell, tool[at]), process[at])
    return index.reshape(len(turns_rad), len(q_rad))


def usual_coupling(poses: Poses, direction: Floats, cell: Cell) -> Floats:
    """Return the index (n, 8) of each branch for a usual cut: up-milling, half as deep and wide as the mill.

    It is asked for before there is a cut, to choose among poses. ``direction`` (n, 3) of the motion, or 0.
    NaN out of reach.
    """
    material = cell.material
    assert material is not None
    law, index = law_array(material), np.full((len(direction), 8), np.nan)
    axis = rotation_from_quaternion(np.ascontiguousarray(poses.rotation))[:, :, 2]
    feed = _across(direction, axis)
    for number in np.unique(poses.tool).tolist():
        rows, tool = np.flatnonzero(poses.tool == number), cell.tool[number]
        depth, chip = np.array([tool.diameter_mm / 2.0]), np.array([_USUAL_CHIP_MM])
        force = cutting_load(tool, law, _UP_HALF, depth, chip, peak=False).force_N * _TO_HOLDER
        cut = (_UP_HALF, depth, chip, force, _ALONG_X, _UPRIGHT, tool.teeth, tool.diameter_mm, law)
        way = np.stack([feed[rows], np.cross(axis[rows], feed[rows]), axis[rows]], axis=2)
        process = way @ process_stiffness(*cut) @ way.transpose(0, 2, 1)
        q_rad = robot.inverse(poses.position_mm[rows], poses.rotation[rows], cell, number).reshape(-1, 6)
        coupling = coupling_index(tip_flexibility(q_rad, cell, number), np.repeat(process, 8, axis=0))
        index[rows] = coupling.reshape(-1, 8)
    return index


def _across(direction: Floats, axis: Floats) -> Floats:
    """Return the unit direction (n, 3) of a motion across unit axes (n, 3), zero where it is along them."""
    part = direction - axis * np.einsum("ij,ij->i", direction, axis)[:, None]
    size = np.linalg.norm(part, axis=1, keepdims=True)
    return np.asarray(np.divide(part, size, out=np.zeros_like(part), where=size > 1e-9))


class ChatterWatch:
    """Looks at forces that come block after block, and keeps the worst of each kind."""

    def __init__(self, toolpath: Toolpath, cell: Cell) -> None:
        """Take what the motion was made from."""
        self._toolpath, self._cell = toolpath, cell
        self._couples = _couples(cell)
        self._worst: tuple[float, int, float, Motion, Floats, Forces] | None = None
        self._deep: tuple[float, int, float, float, float] | None = None
        self._tested = (
            {mode.tool for mode in cell.compliance.tap_modes} if cell.material is not None else set()
        )

    def take(self, motion: Motion, q_rad: Floats, forces: Forces, line: Ints32) -> None:
        """Judge the next samples (m), of which ``line`` is the G-code line."""
        if self._couples:
            along = coupling_along(self._toolpath, motion, q_rad, forces, self._cell, most_gain=1.0)
            index = np.nan_to_num(along.coupling)
            at = int(np.argmax(index)) if len(index) else -1
            if at >= 0 and (self._worst is None or index[at] > self._worst[0]):
                row = along.row[at : at + 1]
                kept = rows_at(motion, row), q_rad[row], rows_at(forces, row)
                band = index_band(forces, self._cell)
                self._worst = (float(index[at]), int(line[row[0]]), band, *kept)
        if self._tested:
            self._regenerative(motion, forces, line)

    def _regenerative(self, motion: Motion, forces: Forces, line: Ints32) -> None:
        """Hold the deepest cuts of each tool with stated modes against its lobes."""
        for number in self._tested:
            mine = np.flatnonzero((forces.tool == number) & np.isfinite(forces.phi_rad[:, 0]))
            for row in mine[np.argsort(-forces.a_p_mm[mine], kind="stable")][:_DEEPEST]:
                spindle = abs(float(self._toolpath.spindle_rad_s[motion.move[row]]))
                feed = motion.direction[row, :2]
                if spindle == 0.0 or float(np.hypot(*feed)) < 1e-6:
                    continue
                limit_mm = self._limit_mm(
                    number, feed, forces.phi_rad[row], spindle, float(motion.speed_mm_s[row])
                )
                deep_mm = float(forces.a_p_mm[row])
                if self._deep is None or deep_mm / limit_mm > self._deep[0]:
                    self._deep = (deep_mm / limit_mm, int(line[row]), deep_mm, limit_mm, spindle)

    def _limit_mm(
        self, number: int, feed: Floats, phi_rad: Floats, spindle: float, speed_mm_s: float
    ) -> float:
        tool, material = self._cell.tool[number], self._cell.material
        assert material is not None
        if material.linear_edge is not None:
            tangential, ratio = material.linear_edge.Ktc, material.linear_edge.Krc / material.linear_edge.Ktc
        else:
            law = material.kienzle
            assert law is not None
            chip_mm = max(RAD_PER_REV * speed_mm_s / (tool.teeth * spindle) * 2.0 / np.pi, 1e-4)
            tangential, ratio = law.kc11 * chip_mm**-law.mc, law.radial_ratio
        modes = [mode for mode in self._cell.compliance.tap_modes if mode.tool == number]
        arc = (float(phi_rad[0]), float(phi_rad[1]))
        return depth_limit(modes, feed, arc, tool.teeth, spindle, tangential, ratio)

    def issues(self) -> Iterator[Issue]:
        """Yield a note for each kind whose worst sample is beyond the border."""
        if self._worst is not None and self._worst[0] >= 1.0:
            index, line, band, motion, q_rad, forces = self._worst
            over = coupling_along(self._toolpath, motion, q_rad, forces, self._cell, spins=True)
            low, high = max(index * (1.0 - band), 0.0), index * (1.0 + band)
            does = "makes" if low >= 1.0 else "may make"
            sentence = (
                f"the cut {does} the arm swing by itself, as it does above 1: mode coupling, index "
                f"{index:.1f} ({low:.1f} to {high:.1f}, 90 %; estimated)"
            )
            remedy = "cut less deep or wide, or climb instead of up-milling"
            least = over.over_spin[:, 0]
            if np.isfinite(least).any() and np.nanmin(least) < 1.0:
                turn = float(over.spin_rad[int(np.nanargmin(least))]) * DEG_PER_RAD
                remedy += f"; turned by {turn:.0f} deg about the tool axis it is {np.nanmin(least):.1f} there"
            yield Issue("note", "mode-coupling", line, sentence, remedy)
        if self._deep is not None and self._deep[0] >= 1.0:
            _, line, deep_mm, limit_mm, spindle = self._deep
            sentence = (
                f"{deep_mm:.2f} mm deep at {spindle / RAD_PER_REV * S_PER_MIN:.0f}/min, stable up to "
                f"{limit_mm:.2f} mm by the modes of the tap test (estimated)"
            )
            yield Issue("note", "lobes", line, sentence, "cut less deep, or change the spindle speed")
