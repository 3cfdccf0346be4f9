"""The turn about the tool axis: a mill is symmetric, so the robot may choose it.

``auto`` keeps away from joint limits, singularities and obstacles. One angle is used for the whole program
where it is good enough (the smoothest choice); otherwise an angle that changes slowly along the path, found
by dynamic programming over a grid. It is chosen at targets; on a long move it goes evenly from one to the
other, as the controller turns the tool, and the points in between count with the angle there. ``stiffest``
takes the angle at which the arm bends least, within the same limits, and of those about as stiff the one
farthest from mode coupling (`chatter`).
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gcode2krl import compliance, robot
from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import at_rest, points_moved, standing, to_rest, vectors_turned
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.pose.chatter import usual_coupling
from gcode2krl.pose.path import between, cheapest_track, extremes, way_mm
from gcode2krl.pose.quality import Judge, Poses, Quality, bending_mm, quality_at, quality_of, stacked
from gcode2krl.tables import Joints, Motion, chord_directions, rows_at
from gcode2krl.units import RAD_PER_DEG

GOOD_ENOUGH = 0.3
"""Margin (1 = 30° from limits and singularities) at which a constant angle is taken."""
STEP_MM = 25.0
"""Path over which a changing angle may move by one step of the grid."""
STIFF_MARGIN = 0.15
"""Least margin of a pose that `stiffest_spin` may take."""
_GRID_RAD = 5.0 * RAD_PER_DEG
_WORTH_TURNING = 0.02
"""Fraction of the mean deflection that a changing angle must save compared with a constant one."""
_AS_STIFF = 0.05
"""Fraction of the mean deflection that a turn may cost that keeps off mode coupling."""
_COUPLED = 12
_CHANGE_COST = 0.05
_IMPOSSIBLE_COST = 1e3
_SAMPLES = 400


def tool_rotation(axis: Floats, spin_rad: Floats | float) -> Floats:
    """Return tool frames as quaternions (n, 4) whose z is ``axis`` (n, 3).

    At a turn of zero the frame is ``$BASE`` turned by the smallest angle from z to the axis, so a 3-axis
    program has A = B = C = 0; ``spin_rad`` (n,) or a number then turns it about the axis. An axis along -z is
    reached by a half turn about x.
    """
    constant = len(axis) == 0 or (axis.strides[0] == 0 or bool(np.all(axis == axis[0])))
    if constant and np.ndim(spin_rad) == 0 and len(axis):
        rotation = _rotation(axis[:1], np.asarray([float(spin_rad)]))
        return np.broadcast_to(rotation, (len(axis), 4))
    return _rotation(axis, np.broadcast_to(np.asarray(spin_rad, dtype=float), (len(axis),)))


def _rotation(axis: Floats, spin_rad: Floats) -> Floats:
    x, y, z = axis[:, 0], axis[:, 1], axis[:, 2]
    across = x * x + y * y
    upside_down = (z < 0.0) & (across == 0.0)
    one_and_z = np.where(z < 0.0, across / (1.0 + np.abs(z)), 1.0 + z)  # the same, without cancellation
    scale = np.sqrt(2.0 * np.where(upside_down, 1.0, one_and_z))
    tilt = np.stack([-y / scale, x / scale, np.zeros_like(z), scale / 2.0], axis=1)
    tilt[upside_down] = [1.0, 0.0, 0.0, 0.0]
    half = spin_rad / 2.0
    c, s = np.cos(half), np.sin(half)
    tx, ty, _, tw = tilt.T
    turned = np.stack([tx * c + ty * s, ty * c - tx * s, tw * s, tw * c], axis=1)
    return fr.quaternion_from_rotation(fr.rotation_from_quaternion(turned))


def stated_spin_rad(cell: Cell) -> float | None:
    """Return the turn that the cell states, None where it is to be searched.

    Raises `NotUnderstoodError` where the stiffest is asked for, and the stiffness of the robot is not known.
    """
    spin = cell.frames.spin
    missing = compliance.missing_stiffness(cell) if spin == "stiffest" else None
    if missing is not None:
        raise NotUnderstoodError(missing, source=cell.name)
    return None if isinstance(spin, str) else float(spin) * RAD_PER_DEG


def spin_along(
    position_mm: Floats, axis: Floats, tool: Ints32, lines: Bools, cell: Cell, external: Floats | None = None
) -> Floats | float:
    """Return the turn in rad at targets, as the robot sees it: a number, or (p,).

    Parameters
    ----------
    position_mm, axis, tool : (p, 3), (p, 3), (p,) of the targets in ``$BASE``.
    lines : (p,) True where a straight line leads to a target from that before it.
    external : (p, 6) E1 to E6 at the targets, at rest by default.
    """
    stated_rad = stated_spin_rad(cell)
    if stated_rad is not None:
        return stated_rad
    in_view = None if external is None else seen_at_rest(position_mm, axis, external, cell)[0]
    points = between(position_mm, lines, in_view)
    path_mm, path_axis, path_tool = points.of(position_mm), points.directions(axis), tool[points.before]
    at = None if external is None else points.of(external)
    seen_mm, seen_axis = (path_mm, path_axis) if at is None else seen_at_rest(path_mm, path_axis, at, cell)

    def poses(rows: Ints, spin_rad: float) -> Poses:
        rotation = tool_rotation(seen_axis[rows], spin_rad)
        return Poses(seen_mm[rows], rotation, path_tool[rows], None if at is None else at[rows])

    direction = chord_directions(seen_mm)
    judge = Judge[float](
        lambda rows, spin_rad: quality_of(poses(rows, spin_rad), cell),
        lambda rows, spin_rad: bending_mm(poses(rows, spin_rad), cell),
        None
        if cell.material is None
        else lambda rows, spin_rad: usual_coupling(poses(rows, spin_rad), direction[rows], cell),
    )
    search = stiffest_spin if cell.frames.spin == "stiffest" else smooth_spin
    is_target = points.share == 0.0
    spin_rad = search(path_mm, judge, seen_axis, is_target)
    return spin_rad if isinstance(spin_rad, float) else spin_rad[is_target]


def seen_at_rest(position_mm: Floats, axis: Floats, external: Floats, cell: Cell) -> tuple[Floats, Floats]:
    """Return positions (p, 3) and tool axes (p, 3) in ``$BASE`` as seen with the external axes at rest.

    ``external`` (p, 6) is where E1 to E6 are.
    """
    by = to_rest(external, cell)
    return (position_mm, axis) if by is None else (points_moved(position_mm, by), vectors_turned(axis, by))


def smooth_spin(
    position_mm: Floats, judge: Judge[float], axis: Floats | None = None, is_target: Bools | None = None
) -> Floats | float:
    """Return the turn in rad: one number, or (p,) where no constant angle is good enough.

    One branch serves the whole program. Where the tool axis (p, 3) is given, its outermost directions are
    judged too. Positions that are not ``is_target`` (p,) are points on straight moves between targets; the
    first and the last position are targets. Where nothing is possible throughout, the angle is taken that is
    impossible at the fewest.
    """
    rows, spins_rad = _judged_rows(position_mm, axis, is_target), _grid()
    quality = stacked([judge.quality(rows, float(spin)) for spin in spins_rad])  # (spins, rows, branches)
    worst = quality.worst(axis=1).best(axis=1)
    most = np.where(worst.collides, np.inf, GOOD_ENOUGH + 0.1)
    score = np.round(np.minimum(worst.margin, most), 2)
    best = int(np.lexsort((np.abs(spins_rad), -score, -worst.rank()))[0])
    if worst.free_margin()[best] >= GOOD_ENOUGH or len(rows) < 3:
        return _rounded(spins_rad[best])
    margin = quality.free_margin()
    cost = np.where(margin > 0.0, 1.0 - np.minimum(margin, 1.0), _IMPOSSIBLE_COST)
    constant = cost.sum(axis=1).min(axis=1)
    knots = _Knots(position_mm, rows, is_target)
    least, track = min((knots.cheapest_track(one) for one in np.moveaxis(cost, 2, 0)), key=lambda it: it[0])
    if least < constant.min():
        return knots.along(np.round(spins_rad, 12)[track] + 0.0)
    if worst.rank()[best] < 2:
        best = int(np.lexsort((np.abs(spins_rad), np.round(constant, 6)))[0])
    return _rounded(spins_rad[best])


def stiffest_spin(
    position_mm: Floats, judge: Judge[float], axis: Floats | None = None, is_target: Bools | None = None
) -> Floats | float:
    """Return the turn in rad that bends least: one number, or (p,) where a changing angle saves more.

    Of constant turns that bend at most `_AS_STIFF` more than the least, that with the lowest index of mode
    coupling of a usual cut is taken.
    One branch serves the whole program; see `smooth_spin`, which decides where no turn has `STIFF_MARGIN`
    throughout.
    """
    rows, spins_rad = _judged_rows(position_mm, axis, is_target), _grid()
    assert judge.bending_mm is not None
    quality = stacked([judge.quality(rows, float(spin)) for spin in spins_rad])
    bent_mm = np.stack([judge.bending_mm(rows, float(spin)) for spin in spins_rad])
    possible = (quality.free_margin() >= STIFF_MARGIN) & np.isfinite(bent_mm)
    constant = np.where(possible, bent_mm, np.inf).mean(axis=1)  # (spins, branches)
    least = constant.min(axis=1)
    best = int(np.lexsort((np.abs(spins_rad), least))[0])
    if not np.isfinite(least[best]):
        return smooth_spin(position_mm, judge, axis, is_target)
    branch = int(np.argmin(constant[best]))
    knots = _Knots(position_mm, rows, is_target)
    cost = np.where(possible, bent_mm / least[best], _IMPOSSIBLE_COST)[:, :, branch]
    total, track = knots.cheapest_track(cost)
    if total < (1.0 - _WORTH_TURNING) * len(rows):
        return knots.along(spins_rad[track])
    if judge.coupling is not None:
        near = np.flatnonzero(least <= (1.0 + _AS_STIFF) * least[best])
        some = rows[np.unique(np.linspace(0, len(rows) - 1, min(_COUPLED, len(rows))).astype(np.int64))]
        branches = np.argmin(constant[near], axis=1)
        index = [
            judge.coupling(some, float(spins_rad[at]))[:, b] for at, b in zip(near, branches, strict=True)
        ]
        order = np.lexsort((least[near], np.round(np.nanmax(index, axis=1), 2)))
        best = int(near[order[0]])
    return _rounded(spins_rad[best])


def _grid() -> Floats:
    """Return the turns that are tried, rising."""
    return np.arange(-np.pi, np.pi - 1e-9, _GRID_RAD)


def _rounded(spin_rad: float) -> float:
    return float(np.round(spin_rad, 12) + 0.0)


def _judged_rows(position_mm: Floats, axis: Floats | None, is_target: Bools | None) -> Ints:
    """Return rows spread over the program, its outermost points and tilts among them.

    With a point between two targets these are judged too.
    """
    rows = np.linspace(0, len(position_mm) - 1, min(_SAMPLES, len(position_mm))).astype(np.int64)
    outermost = extremes(position_mm)
    if axis is not None and axis.strides[0] != 0:
        outermost += extremes(axis)
    rows = np.unique(np.concatenate([rows, outermost]))
    if is_target is None:
        return rows
    targets = np.flatnonzero(is_target)
    behind = np.searchsorted(targets, rows[~is_target[rows]])
    return np.unique(np.concatenate([rows, targets[behind - 1], targets[behind]]))


class _Knots:
    """The judged rows of a path: targets, at which the angle is chosen, and points between them."""

    def __init__(self, position_mm: Floats, rows: Ints, is_target: Bools | None) -> None:
        """Take the positions (p, 3), the rows (n,) of them that are judged, and which are targets (p,)."""
        self._path_mm = way_mm(position_mm)
        at_mm = self._path_mm[rows]
        chosen = np.arange(len(rows)) if is_target is None else np.flatnonzero(is_target[rows])
        self._chosen, self._knots_mm = chosen, at_mm[chosen]
        self._allowed = np.maximum(1, (np.diff(self._knots_mm) / STEP_MM).astype(np.int64))
        self._passed: dict[int, tuple[Ints, Floats]] = {}
        for knot in (np.flatnonzero(np.diff(chosen) > 1) + 1).tolist():
            points = np.arange(chosen[knot - 1] + 1, chosen[knot])
            start, end = self._knots_mm[knot - 1 : knot + 1]
            self._passed[knot] = points, (at_mm[points] - start) / max(end - start, 1e-9)

    def along(self, spin_rad: Floats) -> Floats:
        """Return the angle (p,) along the path from those at the targets that were judged."""
        return np.asarray(np.interp(self._path_mm, self._knots_mm, spin_rad))

    def cheapest_track(self, cost: Floats) -> tuple[float, Ints]:
        """Return (cost, grid index per judged target) of the cheapest track through the grid (spins, n).

        It does not wrap at ±180°: a full turn about the tool would wind up A6.
        """
        before = np.arange(len(cost))[None, :]
        change = before.T - before

        def arrive(knot: int, total: Floats) -> Floats:
            steps = np.abs(change)
            through = total + np.where(steps <= self._allowed[knot - 1], _CHANGE_COST * steps, np.inf)
            for point, share in zip(*self._passed.get(knot, ((), ())), strict=True):
                turns = np.round(before + share * change, 9)  # between two of the grid the worse one counts
                nearest = (np.floor(turns), np.ceil(turns))
                through += np.maximum(*(cost[turn.astype(np.int64), point] for turn in nearest))
            return through

        return cheapest_track(cost.T[self._chosen], arrive)


class SpinMap(NamedTuple):
    """The turn about the tool axis along a motion, and what others would be in the same branch."""

    path_mm: Floats
    """(n,)"""
    spin_rad: Floats
    """(s,) rising, from -pi."""
    quality: Quality
    """(s, n)"""
    chosen_rad: Floats
    """(n,)"""


def spin_map(motion: Motion, joints: Joints, cell: Cell) -> SpinMap:
    """Return the map of a motion, at up to 400 of its samples and every 5 degrees.

    Where external axes move, the turn is that which the robot sees.
    """
    moves = bool(cell.external) and bool((motion.external != motion.external[0]).any())
    if cell.external and not moves:
        cell = standing(cell, motion.external[0])
    rows = np.unique(np.linspace(0, len(motion) - 1, min(_SAMPLES, len(motion))).astype(np.int64))
    rows = rows[np.isfinite(joints.q_rad[rows]).all(axis=1)]
    shown, branch = rows_at(motion, rows), joints.status[rows]
    if moves:
        position, rotation = at_rest(shown.position_mm, shown.rotation, shown.external, cell)
        shown = replace(shown, position_mm=position, rotation=rotation)
    turned = fr.rotation_from_quaternion(np.ascontiguousarray(shown.rotation))
    axis, x = turned[:, :, 2], turned[:, :, 0]
    start = fr.rotation_from_quaternion(tool_rotation(axis, 0.0))
    chosen = np.arctan2(np.einsum("ni,ni->n", x, start[:, :, 1]), np.einsum("ni,ni->n", x, start[:, :, 0]))
    external = shown.external if moves else None

    def quality(spin_rad: float) -> Quality:
        q_rad = robot.inverse(shown.position_mm, tool_rotation(axis, spin_rad), cell, shown.tool)
        return quality_at(q_rad[np.arange(len(rows)), branch], shown.tool, external, cell)

    spins_rad = _grid()
    return SpinMap(shown.path_mm, spins_rad, stacked([quality(float(spin)) for spin in spins_rad]), chosen)
