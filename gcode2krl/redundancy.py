"""What a program leaves to the robot: the turn about the tool axis, and where the external axes stand."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from gcode2krl import compliance, program, robot
from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import from_rest, points_moved, standing, to_rest
from gcode2krl.cell.sections.external import EXTERNAL_NAMES
from gcode2krl.errors import Issue
from gcode2krl.posture import Poses, bending_at, is_one, quality_at
from gcode2krl.tables import Targets, Toolpath
from gcode2krl.turns import seen_at_rest, spin_of

_SAME_HEIGHT_MM = 1e-6
_ROUNDING = 1e-3
"""The last decimal of an external axis in the program's text."""


def posed_targets(toolpath: Toolpath, cell: Cell, tolerance_mm: float | None) -> Targets:
    """Return the targets of a program with the turn about the tool axis and the external axes chosen.

    See `program.plan_targets` for the errors it raises.
    """
    home = _home_pose(cell)
    if not cell.external:
        return program.plan_targets(toolpath, cell, home, spin_of(cell), tolerance_mm)
    searched = isinstance(cell.frames.spin, str)
    untouched: program.SpinOf = (lambda *_: 0.0) if searched else spin_of(cell)
    planned = program.plan_targets(toolpath, cell, home, untouched, tolerance_mm)
    followed = _followed(planned, cell)
    external = _stations(planned, toolpath, followed, cell)
    stops = _stops(external, _free_motions(planned, toolpath))
    planned = replace(
        planned,
        rotation=_rotations(planned, external, cell, table_follows=bool(followed.any())),
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


def _rotations(targets: Targets, external: Floats, cell: Cell, *, table_follows: bool) -> Floats:
    """Return the quaternions (p, 4) of targets whose external axes are at (p, 6).

    Where they move and the turn about the tool axis is searched, or a table follows the tool, the turn is
    that which the robot sees, with the external axes at rest; else it is that in ``$BASE``.
    """
    if not isinstance(cell.frames.spin, str) and not table_follows:
        return targets.rotation
    rows = np.flatnonzero(~targets.home)
    position, at, tool = targets.position_mm[rows], external[rows], targets.tool[rows]
    axis = fr.rotation_from_quaternion(targets.rotation[rows])[:, :, 2]
    lines = program.straight(targets.ptp, targets.home, targets.tool)[rows]
    if is_one(at):
        turned = program.tool_rotation(axis, spin_of(standing(cell, at[0]))(position, axis, tool, lines))
    else:
        seen, seen_axis = seen_at_rest(position, axis, at, cell)
        spin = spin_of(cell, at)(position, axis, tool, lines)
        turned = from_rest(seen, program.tool_rotation(seen_axis, spin), at, cell)[1]
    result = np.array(targets.rotation)
    result[rows] = turned
    return result


def _stops(external: Floats, is_free: Bools) -> Bools:
    """Mark the targets (p,) at which the robot stops: before and behind a motion to another station."""
    moves = (external != np.roll(external, 1, axis=0)).any(axis=1) & is_free
    return np.asarray(moves | np.roll(moves, -1))


def _uncoupled(targets: Targets, external: Floats, cell: Cell) -> Iterator[Issue]:
    """Yield the axes that would have to move in a program although ``$BASE`` does not move with them."""
    cut = ~targets.home
    for column, name in enumerate(EXTERNAL_NAMES):
        axis = cell.external.get(name)
        other = np.flatnonzero(cut & (external[:, column] != external[cut][0, column]))
        if axis is None or axis.is_coupled or not len(other):
            continue
        key = f"[external.{name}] " + ("coupled = true" if axis.is_rail else "machine_def")
        sentence = f"{name} would have to move here, and the controller does not move $BASE along with it"
        remedy = f"give {key} where the controller couples it, or split the part"
        yield Issue("error", "external-uncoupled", int(targets.source_line[other[0]]), sentence, remedy)


def _beyond(targets: Targets, external: Floats, cell: Cell) -> Iterator[Issue]:
    """Yield the axes that leave their limits, as a table may that follows the tool."""
    for column, name in enumerate(EXTERNAL_NAMES):
        axis = cell.external.get(name)
        if axis is None:
            continue
        low, high = axis.limits
        wrong = np.flatnonzero(
            (external[:, column] < low - _ROUNDING) | (external[:, column] > high + _ROUNDING)
        )
        if len(wrong):
            row = int(wrong[0])
            sentence = f"{name} at {external[row, column]:.1f} {axis.unit}, allowed {low:g}..{high:g}"
            remedy = f"leave out [external.{name}] follows, or state a position"
            yield Issue("error", "external-limit", int(targets.source_line[row]), sentence, remedy)


def _without_speed(external: Floats, cell: Cell) -> Iterator[Issue]:
    """Yield the axes that move in the program and have no stated speed."""
    for column, name in enumerate(EXTERNAL_NAMES):
        axis = cell.external.get(name)
        if axis is not None and axis.speed is None and np.ptp(external[:, column]) > 0.0:
            sentence = f"{name} moves, and its speed is not stated: what takes longer with it is not known"
            yield Issue("warning", "external-speed", 0, sentence, f"give [external.{name}] speed")


def _stations(targets: Targets, toolpath: Toolpath, followed: Floats, cell: Cell) -> Floats:
    """Return E1 to E6 (p, 6) at targets, at HOME as stated, else as at its neighbour.

    ``followed`` (p, 6) is how far they turn with the program.
    """
    rows, table_follows = np.flatnonzero(~targets.home), bool(followed.any())
    is_free, followed = _free_motions(targets, toolpath)[rows], followed[rows]
    lines = program.straight(targets.ptp, targets.home, targets.tool)[rows]
    turned = _turned_with(targets.position_mm[rows], followed, cell) if table_follows else None
    points = program.between(targets.position_mm[rows], lines & ~is_free, turned)
    is_target = points.share == 0.0
    poses = Poses(
        points.of(targets.position_mm[rows]),
        points.rotations(targets.rotation[rows]),
        targets.tool[rows][points.before],
    )
    followed = points.of(followed)
    ranges = [
        program.Range(column, *_room(cell.external[name].limits, followed[:, column]))
        for column, name in enumerate(EXTERNAL_NAMES)
        if name in cell.external and cell.external[name].moves
    ]

    def quality(at: Ints, place: Floats) -> Floats:
        return quality_at(poses.at(at), place + followed[at], cell, table_follows=table_follows)

    def bending(at: Ints, place: Floats) -> Floats:
        return bending_at(poses.at(at), place + followed[at], cell, table_follows=table_follows)

    stiff = None if compliance.missing_stiffness(cell) else bending
    start = cell.external_rest()
    is_free = is_free[points.before] & is_target
    found = program.plan_stations(poses.position_mm, is_free, quality, ranges, start, stiff, is_target)
    if table_follows:
        found = np.round(found + followed, 3)
    found = np.broadcast_to(found[0], (len(rows), 6)) if is_one(found) else found[is_target]
    homes = np.flatnonzero(targets.home)
    stated = [(k, cell.external[n].home) for k, n in enumerate(EXTERNAL_NAMES) if n in cell.external]
    if is_one(found) and all(value is None or value == found[0, k] for k, value in stated):
        return np.broadcast_to(found[0], (len(targets), 6))
    external = np.empty((len(targets), 6))
    external[rows] = found
    external[homes] = found[np.minimum(np.searchsorted(rows, homes), len(rows) - 1)]
    for column, value in stated:
        if value is not None:
            external[homes, column] = value
    return external


def _followed(targets: Targets, cell: Cell) -> Floats:
    """Return how far E1 to E6 turn with the program (p, 6), from their places at its first row on."""
    followed = np.broadcast_to(0.0, (len(targets), 6))
    rows = np.flatnonzero(~targets.home)
    for column, name in enumerate(EXTERNAL_NAMES):
        axis = cell.external.get(name)
        if axis is None or axis.follows is None:
            continue
        tool_axis = fr.rotation_from_quaternion(targets.rotation[rows])[:, :, 2]
        in_base = cell.stated_base()[:3, :3].T @ axis.direction()
        followed = np.array(followed)
        followed[rows, column] = program.following_deg(tool_axis, in_base)
    return followed


def _turned_with(position_mm: Floats, followed: Floats, cell: Cell) -> Floats:
    """Return positions (r, 3) as the robot sees them where the external axes turn by (r, 6)."""
    by = to_rest(cell.external_rest() + followed, cell)
    return position_mm if by is None else points_moved(position_mm, by)


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


def _home_pose(cell: Cell) -> Callable[[int], tuple[Floats, Floats]]:
    def home_pose(tool: int) -> tuple[Floats, Floats]:
        position, rotation = robot.forward(cell.home_q_rad(), cell, tool)
        return position[0], rotation[0]

    return home_pose
