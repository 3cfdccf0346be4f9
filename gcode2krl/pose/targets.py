"""The targets of a program with what it leaves to the robot: the turn about the tool axis, E1 to E6."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gcode2krl import compliance, program, robot
from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import at_rest, from_rest, points_moved, standing, to_rest
from gcode2krl.cell.sections.external import EXTERNAL_NAMES, ExternalAxis, ExternalName
from gcode2krl.errors import Issue
from gcode2krl.pose.along import following_deg
from gcode2krl.pose.path import between, is_one
from gcode2krl.pose.quality import Judge, Poses, Quality, bending_mm, quality_of, stacked
from gcode2krl.pose.spin import seen_at_rest, spin_along, stated_spin_rad, tool_rotation
from gcode2krl.pose.stations import DECIMALS, PlaceJudge, Range, plan_stations
from gcode2krl.tables import Targets, Toolpath
from gcode2krl.units import RAD_PER_DEG

_SAME_HEIGHT_MM = 1e-6
_ROUNDING = 1e-3
"""The last decimal of an external axis in the program's text."""
_TRIED_SPINS_RAD = np.arange(-180.0, 180.0, 30.0) * RAD_PER_DEG
"""Turns about the tool axis of which the best one counts at a place, where the turn is searched."""


def posed_targets(toolpath: Toolpath, cell: Cell, tolerance_mm: float | None) -> Targets:
    """Return the targets of a program with the turn about the tool axis and the external axes chosen.

    ``tolerance_mm`` is the blend tolerance; below ``G64 P``, above the cell's own. Raises
    `NotUnderstoodError` where the program has no motion, or the stiffest turn is asked for and the stiffness
    of the robot is not known.
    """
    spin_rad = stated_spin_rad(cell)
    route = program.Route(toolpath, cell, lambda tool: _home_pose(cell, tool))
    away = route.away
    if not cell.external:
        return route.targets(tool_rotation(away.axis, spin_along(*away, cell)), tolerance_mm)
    rotation = tool_rotation(away.axis, 0.0 if spin_rad is None else spin_rad)
    planned = route.targets(rotation, tolerance_mm)
    followed = _followed(planned, cell)
    external = _stations(planned, toolpath, followed, away.lines, cell)
    turned = planned.rotation
    if spin_rad is None or followed.any():
        turned = _rotations(planned, external, away.lines, cell)
    stops = _stops(external, _free_motions(planned, toolpath))
    planned = replace(
        planned,
        rotation=turned,
        external=external,
        cdis_mm=np.where(stops, 0.0, planned.cdis_mm),
        issues=(
            *planned.issues,
            *_uncoupled(planned, external, cell),
            *_beyond(planned, external, cell),
            *_without_speed(external, cell),
        ),
    )
    return _with_home(planned, cell)


def _rotations(targets: Targets, external: Floats, lines: Bools, cell: Cell) -> Floats:
    """Return the quaternions (p, 4) of targets whose external axes are at (p, 6).

    Where they move, the turn about the tool axis is that which the robot sees, with the external axes at
    rest; else it is that in ``$BASE``. ``lines`` is that of the route.
    """
    rows = np.flatnonzero(~targets.home)
    position, at, tool = targets.position_mm[rows], external[rows], targets.tool[rows]
    axis = fr.rotation_from_quaternion(targets.rotation[rows])[:, :, 2]
    result = np.array(targets.rotation)
    if is_one(at):
        result[rows] = tool_rotation(axis, spin_along(position, axis, tool, lines, standing(cell, at[0])))
    else:
        seen, seen_axis = seen_at_rest(position, axis, at, cell)
        spin_rad = spin_along(position, axis, tool, lines, cell, at)
        result[rows] = from_rest(seen, tool_rotation(seen_axis, spin_rad), at, cell)[1]
    return result


def _stops(external: Floats, is_free: Bools) -> Bools:
    """Mark the targets (p,) at which the robot stops: before and behind a motion to another station."""
    moves = (external != np.roll(external, 1, axis=0)).any(axis=1) & is_free
    return np.asarray(moves | np.roll(moves, -1))


def _uncoupled(targets: Targets, external: Floats, cell: Cell) -> Iterator[Issue]:
    """Yield the axes that would have to move in a program although ``$BASE`` does not move with them."""
    cut = ~targets.home
    for column, name, axis in _axes(cell):
        at = external[:, column]
        other = np.flatnonzero(cut & (at != at[cut][0]))
        if axis.is_coupled or not len(other):
            continue
        key = f"[external.{name}] " + ("coupled = true" if axis.is_rail else "machine_def")
        sentence = f"{name} would have to move here, and the controller does not move $BASE along with it"
        remedy = f"give {key} where the controller couples it, or split the part"
        yield Issue("error", "external-uncoupled", int(targets.source_line[other[0]]), sentence, remedy)


def _beyond(targets: Targets, external: Floats, cell: Cell) -> Iterator[Issue]:
    """Yield the axes that leave their limits, as a table may that follows the tool."""
    for column, name, axis in _axes(cell):
        (low, high), at = axis.limits, external[:, column]
        wrong = np.flatnonzero((at < low - _ROUNDING) | (at > high + _ROUNDING))
        if len(wrong):
            sentence = f"{name} at {at[wrong[0]]:.1f} {axis.unit}, allowed {low:g}..{high:g}"
            remedy = f"leave out [external.{name}] follows, or state a position"
            yield Issue("error", "external-limit", int(targets.source_line[wrong[0]]), sentence, remedy)


def _without_speed(external: Floats, cell: Cell) -> Iterator[Issue]:
    """Yield the axes that move in the program and have no stated speed."""
    for column, name, axis in _axes(cell):
        if axis.speed is None and np.ptp(external[:, column]) > 0.0:
            sentence = f"{name} moves, and its speed is not stated: what takes longer with it is not known"
            yield Issue("warning", "external-speed", 0, sentence, f"give [external.{name}] speed")


def _axes(cell: Cell) -> list[tuple[int, ExternalName, ExternalAxis]]:
    """Return the external axes of a cell: column in E1 to E6, name, what is stated."""
    names = enumerate(EXTERNAL_NAMES)
    return [(column, name, cell.external[name]) for column, name in names if name in cell.external]


def _stations(targets: Targets, toolpath: Toolpath, followed: Floats, lines: Bools, cell: Cell) -> Floats:
    """Return E1 to E6 (p, 6) at targets, at HOME as stated, else as at its neighbour.

    ``followed`` (p, 6) is how far they turn with the program, ``lines`` that of the route.
    """
    rows, table_follows = np.flatnonzero(~targets.home), bool(followed.any())
    is_free, followed = _free_motions(targets, toolpath)[rows], followed[rows]
    position, turns = targets.position_mm[rows], to_rest(cell.external_rest() + followed, cell)
    turned = points_moved(position, turns) if table_follows and turns is not None else None
    points = between(position, lines & ~is_free, turned)
    is_target, followed = points.share == 0.0, points.of(followed)
    poses = Poses(
        points.of(position), points.rotations(targets.rotation[rows]), targets.tool[rows][points.before]
    )
    axes = _axes(cell)
    ranges = [Range(k, *_room(axis.limits, followed[:, k])) for k, _, axis in axes if axis.moves]
    is_free = is_free[points.before] & is_target
    judge = _judge_of(poses, followed, cell, table_follows=table_follows)
    places = plan_stations(poses.position_mm, is_free, judge, ranges, cell.external_rest(), is_target)
    if table_follows:
        places = np.round(places + followed, DECIMALS)
    places = np.broadcast_to(places[0], (len(rows), 6)) if is_one(places) else places[is_target]
    stated = {k: axis.home for k, _, axis in axes if axis.home is not None}
    if is_one(places) and all(value == places[0, k] for k, value in stated.items()):
        return np.broadcast_to(places[0], (len(targets), 6))
    homes, external = np.flatnonzero(targets.home), np.empty((len(targets), 6))
    external[rows] = places
    external[homes] = places[np.minimum(np.searchsorted(rows, homes), len(rows) - 1)]
    for column, value in stated.items():
        external[homes, column] = value
    return external


def _judge_of(poses: Poses, followed: Floats, cell: Cell, *, table_follows: bool) -> PlaceJudge:
    """Return what judges poses (d) in ``$BASE`` with the external axes at places, in the best turn tried.

    At a place they are by ``followed`` (d, 6) farther.
    """
    spin_rad = stated_spin_rad(cell)
    spins_rad = _TRIED_SPINS_RAD if spin_rad is None else np.array([spin_rad])

    def seen(rows: Ints, place: Floats) -> tuple[Cell, Iterator[Poses]]:
        """Return the cell with the external axes at places (r, 6), and the poses to try as seen there."""
        external = place + followed[rows]
        position, rotation, tool = poses.position_mm[rows], poses.rotation[rows], poses.tool[rows]
        there, at = (standing(cell, external[0]), None) if is_one(external) else (cell, external)
        if at is not None:
            position, rotation = at_rest(position, rotation, at, cell)
        if spin_rad is not None and not table_follows:
            return there, iter([Poses(position, rotation, tool, at)])
        axis = fr.rotation_from_quaternion(rotation)[:, :, 2]
        return there, (Poses(position, tool_rotation(axis, float(spin)), tool, at) for spin in spins_rad)

    def quality(rows: Ints, place: Floats) -> Quality:
        there, tried = seen(rows, place)
        return stacked([quality_of(turned, there) for turned in tried]).best(axis=0)

    def stiffest_mm(rows: Ints, place: Floats) -> Floats:
        there, tried = seen(rows, place)
        stiffest: Floats = np.fmin.reduce([bending_mm(turned, there) for turned in tried])
        return stiffest

    return Judge(quality, None if compliance.missing_stiffness(cell) else stiffest_mm)


def _followed(targets: Targets, cell: Cell) -> Floats:
    """Return how far E1 to E6 turn with the program (p, 6), from their places at its first row on."""
    followed = np.broadcast_to(0.0, (len(targets), 6))
    rows = np.flatnonzero(~targets.home)
    for column, _, axis in _axes(cell):
        if axis.follows is not None:
            tool_axis = fr.rotation_from_quaternion(targets.rotation[rows])[:, :, 2]
            in_base = cell.stated_base()[:3, :3].T @ axis.direction()
            followed = np.array(followed)
            followed[rows, column] = following_deg(tool_axis, in_base)
    return followed


def _room(limits: tuple[float, float], followed: Floats) -> tuple[float, float]:
    """Return between which places an axis may begin that turns with the program."""
    low, high = limits[0] - float(followed.min()), limits[1] - float(followed.max())
    return (low, high) if low <= high else (sum(limits) / 2.0, sum(limits) / 2.0)


def _free_motions(targets: Targets, toolpath: Toolpath) -> Bools:
    """Mark the motions (p,) during which external axes may move: PTP, and rapids above all that is cut.

    No rapid is one that leaves a cut, level or upwards: the tool is still in the part. Where a feed motion
    has led it up, it is not.
    """
    row = np.maximum(targets.move, 0)
    rapid = (targets.move < 0) | toolpath.rapid[row] | toolpath.machine[row]
    height = targets.position_mm[:, 2]
    cut = ~rapid & ~targets.ptp
    above = height >= (height[cut].max() if cut.any() else -np.inf) - _SAME_HEIGHT_MM
    rises = height > np.roll(height, 1) + _SAME_HEIGHT_MM
    leaves = np.roll(cut, 1) & (rises | ~np.roll(rises, 1))
    free: Bools = targets.ptp | (rapid & above & np.roll(above, 1) & ~leaves)
    return free


def _with_home(targets: Targets, cell: Cell) -> Targets:
    """Return targets whose HOME is where its joints are, as the external axes stand there."""
    position, rotation = np.array(targets.position_mm), np.array(targets.rotation)
    rows = np.flatnonzero(targets.home)
    moved = from_rest(position[rows], rotation[rows], targets.external[rows], cell)
    position[rows], rotation[rows] = moved
    return replace(targets, position_mm=position, rotation=rotation)


def _home_pose(cell: Cell, tool: int) -> tuple[Floats, Floats]:
    position, rotation = robot.forward(cell.home_q_rad(), cell, tool)
    return position[0], rotation[0]
