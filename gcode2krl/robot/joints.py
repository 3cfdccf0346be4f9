"""Joints along a program and along its motion: one branch, the right turns, in parts on all cores.

A part starts from the joints that the trial of the branch found there. Neighbouring parts share a row; where
both agree on its joints, turns included, they are one path, and where not, the later one is solved again from
it.
"""

import copy
import itertools
import mmap
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import at_rest
from gcode2krl.compiled.chunks import ROWS, chunk_borders, in_chunks
from gcode2krl.compiled.core import FLOAT, FLOATS, INTS32, OUT_FLOATS, core_function
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue
from gcode2krl.robot.branch import Branch, Path, best_branch, same_branch, thinned
from gcode2krl.robot.findings import joint_findings
from gcode2krl.robot.kinematics import status_turn
from gcode2krl.robot.lines import Line, count_samples, path_of, sample_lines, samples_at
from gcode2krl.robot.standing import Bits, limit_margin, what_is_wrong
from gcode2krl.robot.velocity_kinematics import smallest_singular_value
from gcode2krl.tables import Joints, Motion, Targets, blocks_of, joined_columns, rows_at, rows_of

_ANGLE_GRID_RAD = 1e-9
_AGREEMENT_RAD = 1e-9

_speeds = core_function("robot_speeds", FLOATS, INTS32, FLOAT, OUT_FLOATS)


def follow(targets: Targets, cell: Cell, conditioning: bool = True) -> tuple[Joints, tuple[Issue, ...]]:
    """Return joints at each target (p) and the findings along the lines between them.

    Joint speeds are NaN (they belong to a Motion). A target out of reach has NaN angles. Without
    ``conditioning`` the column ``sigma_min`` is NaN, which saves its time.
    """
    q, findings = target_angles(targets, cell)
    return joints_at(q, targets, cell, conditioning), findings


def target_angles(targets: Targets, cell: Cell) -> tuple[Floats, tuple[Issue, ...]]:
    """Return the angles (p, 6) in rad at each target, NaN out of reach, and the findings as `follow` does."""
    counts = count_samples(targets, cell)
    branch = _branch_of(targets, counts, cell)
    q, wrong = _along_lines(targets, counts, branch, cell)
    return q, joint_findings(targets, q, wrong, counts, branch, cell)


def joints_at(q_rad: Floats, targets: Targets, cell: Cell, conditioning: bool = True) -> Joints:
    """Return the table of angles (p, 6) at targets; speeds are NaN."""
    return _joints(q_rad, np.broadcast_to(np.nan, q_rad.shape), targets, cell, conditioning)


def ptp_joints(targets: Targets, cell: Cell) -> Joints:
    """Return the joints of `follow` at the PTP targets only; other rows are NaN, their S and T 0."""
    counts = count_samples(targets, cell)
    branch = _branch_of(targets, counts, cell)
    q = np.full((len(targets), 6), np.nan)
    rows = np.flatnonzero(targets.ptp & ~targets.home)
    q[rows] = branch.q_rad[np.searchsorted(branch.samples, counts[rows] - 1)]
    q[targets.home] = cell.home_q_rad()
    return joints_at(q, targets, cell, conditioning=False)


def follow_motion(motion: Motion, cell: Cell) -> Joints:
    """Return joints at each sample (m) of a Motion, one branch for all."""
    return joints_from_angles(motion, *motion_angles(motion, cell), cell)


def angles_near(motion: Motion, q_rad: Floats, cell: Cell) -> Floats:
    """Return the angles (m, 6) in rad along a Motion whose first row is near the joints (6,).

    Branch and turns are those of these joints; limits are not checked.
    """
    starts = np.zeros(len(motion), dtype=np.bool_)
    poses = at_rest(motion.position_mm, motion.rotation, motion.external, cell)
    return same_branch(Path(*poses, motion.tool, starts), q_rad, cell)


def line_angles(targets: Targets, row: int, q_rad: Floats, cell: Cell) -> Floats:
    """Return the angles (s, 6) in rad along the LIN to a target, from the joints (6,) where it begins.

    Branch and turns are those of these joints; the samples are those at which lines are checked, the target
    the last of them.
    """
    return same_branch(path_of(sample_lines(targets, cell, row, row + 1), cell), q_rad, cell)


def rise_angles(
    targets: Targets, row: int, q_rad: Floats, height_mm: float, step_mm: float, cell: Cell
) -> Floats:
    """Return the angles (s, 6) in rad straight up along z of ``$BASE`` from a target with the joints (6,).

    Branch and turns are those of these joints, rows ``step_mm`` apart; NaN out of reach.
    """
    height = np.linspace(0.0, height_mm, max(2, int(np.ceil(height_mm / step_mm)) + 1))
    position = targets.position_mm[row] + height[:, None] * np.array([0.0, 0.0, 1.0])
    rotation = np.tile(targets.rotation[row], (len(height), 1))
    tool = np.full(len(height), targets.tool[row], dtype=np.int32)
    external = np.broadcast_to(targets.external[row], (len(height), 6))
    poses = at_rest(position, rotation, external, cell)
    return same_branch(Path(*poses, tool, np.zeros(len(height), dtype=np.bool_)), q_rad, cell)


class Places(NamedTuple):
    """Places (m) along the lines to targets, with the joints there."""

    line: Line
    q_rad: Floats

    @property
    def target(self) -> Ints:
        """The target (m,) that each place leads to."""
        return self.line.target

    @property
    def external(self) -> Floats:
        """E1 to E6 (m, 6)."""
        return self.line.external


def places_between(targets: Targets, first: int, last: int, cell: Cell) -> Places:
    """Return the places along the lines from target ``first`` to ``last``, in the program's branch."""
    counts = count_samples(targets, cell)
    line = sample_lines(targets, cell, first, last + 1)
    branch = _branch_of(targets, counts, cell)
    guess = branch.guess(int(counts[first]) - 1)
    return Places(line, branch.joints(path_of(line, cell), cell, guess))


def angles_along(places: Places, row: int, way_mm: Floats, cell: Cell) -> Floats:
    """Return the angles (n, 6) in rad at ways (n,) out of a place along the tool axis; NaN out of reach."""
    line, count = places.line, len(way_mm)
    axis = fr.rotation_from_quaternion(line.rotation[row])[:, 2]
    position = line.position_mm[row] + way_mm[:, None] * axis
    rotation = np.tile(line.rotation[row], (count, 1))
    poses = at_rest(position, rotation, np.broadcast_to(line.external[row], (count, 6)), cell)
    tool = np.full(count, line.tool[row], dtype=np.int32)
    return same_branch(Path(*poses, tool, np.zeros(count, dtype=np.bool_)), places.q_rad[row], cell)


def motion_angles(motion: Motion, cell: Cell) -> tuple[Floats, Floats]:
    """Return angles (m, 6) in rad and speeds (m, 6) in rad/s of a Motion; speeds are central differences."""
    rows = trial_rows(len(motion))
    dt_s = float(motion.time_s[1] - motion.time_s[0]) if len(motion) > 1 else 0.0
    follower = Follower(rows_at(motion, rows), rows, dt_s, cell)
    parts = [follower.take(block, ends) for block, ends in blocks_of(motion)]
    q_rad, qd_rad_s = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    return q_rad, qd_rad_s


def trial_rows(count: int) -> Ints:
    """Return the samples of a Motion of so many on which the branch is tried."""
    return thinned(np.zeros(1, dtype=np.int64), count)


class Follower:
    """Joints along a Motion that comes block after block, one branch for all."""

    def __init__(
        self, trial: Motion, rows: Ints, dt_s: float, cell: Cell, *, remembers: bool = False
    ) -> None:
        """Take the samples of the trial, which rows of the Motion they are, and the time between two rows.

        With ``remembers`` the angles are kept for `again`.
        """
        self._cell, self._window_s = cell, 2.0 * dt_s
        self._remembered: deque[Floats] | None = deque() if remembers else None
        self._solved: deque[Floats] | None = None
        starts = np.zeros(len(trial), dtype=np.bool_)
        starts[0] = True
        poses = at_rest(trial.position_mm, trial.rotation, trial.external, cell)
        self._branch = best_branch(Path(*poses, trial.tool, starts), rows, cell)
        self._before: Motion | None = None
        self._row = 0
        self._reached = cell.home_q_rad()
        self._q, self._tool = np.zeros((0, 6)), np.zeros(0, dtype=np.int32)

    def again(self) -> "Follower":
        """Return what says the same of the same blocks once more, and lets go what it has said."""
        other = copy.copy(self)
        other._solved, other._remembered = self._remembered, None
        other._q, other._tool = np.zeros((0, 6)), np.zeros(0, dtype=np.int32)
        return other

    def take(self, motion: Motion, ends: bool) -> tuple[Floats, Floats]:
        """Return angles and speeds (m, 6) of the rows that follow those returned before.

        The last row waits for the one behind it, unless the Motion ``ends`` with it.
        """
        angles = self._angles(motion) if self._solved is None else self._solved.popleft()
        if self._remembered is not None:
            self._remembered.append(_of_its_own(angles))
        known, tool = np.concatenate([self._q, angles]), np.concatenate([self._tool, motion.tool])
        qd = self._speeds(known, tool)
        first, last = max(len(self._q) - 1, 0), len(known) - (not ends)
        self._q, self._tool = known[-2:].copy(), tool[-2:].copy()
        return known[first:last], qd[first:last]

    def _angles(self, motion: Motion) -> Floats:
        """Return the angles (m, 6) of the next rows."""
        shared = int(self._before is not None)
        position, rotation, tool, external = (
            joined_columns([*(getattr(part, name) for part in (self._before, motion) if part is not None)])
            for name in ("position_mm", "rotation", "tool", "external")
        )
        starts = np.zeros(len(position), dtype=np.bool_)
        starts[0] = not shared
        q = np.concatenate([self._q[-1:], np.empty((len(motion), 6))])

        def path(rows: slice) -> Path:
            poses = at_rest(position[rows], rotation[rows], external[rows], self._cell)
            return Path(*poses, tool[rows], starts[rows])

        def solve(start: int, end: int, before: Floats | None) -> Floats:
            first = max(start - 1, 0)
            guess = self._branch.guess(self._row - shared + first) if before is None else before
            angles = self._branch.joints(path(slice(first, end)), self._cell, guess)
            q[start:end] = angles[start - first :]
            row_before: Floats = angles[0].copy()  # a view would keep all rows
            return row_before

        borders = [shared + border for border in chunk_borders(len(motion))]
        self._reached = _solve_parts(solve, q, borders, self._reached)
        self._before, self._row = rows_of(motion, len(motion) - 1, len(motion)), self._row + len(motion)
        return q[shared:]

    def _speeds(self, q: Floats, tool: Ints32) -> Floats:
        """Return the central differences (m, 6), 0 in the first and last row and while the tool changes."""
        qd = np.empty_like(q)
        _speeds(q, tool, self._window_s, qd)
        return qd


def _of_its_own(values: Floats) -> Floats:
    """Return a copy in memory that goes back to the system at once where it is let go."""
    copied = np.frombuffer(mmap.mmap(-1, max(values.nbytes, 1)), count=values.size).reshape(values.shape)
    copied[:] = values
    return copied


def joints_from_angles(motion: Motion, q_rad: Floats, qd_rad_s: Floats, cell: Cell) -> Joints:
    """Return the table of angles and speeds from `motion_angles`."""
    return _joints(q_rad, qd_rad_s, motion, cell)


def _branch_of(targets: Targets, counts: Ints, cell: Cell) -> Branch:
    starts = counts[targets.ptp & ~targets.home] - 1
    samples = thinned(starts, int(counts[-1]))
    return best_branch(path_of(samples_at(targets, cell, counts, samples), cell), samples, cell)


def _along_lines(targets: Targets, counts: Ints, branch: Branch, cell: Cell) -> tuple[Floats, Bits]:
    """Return the joints (p, 6) at the targets, and the bits of `what_is_wrong` up to each (p,)."""
    q, wrong = np.empty((len(targets), 6)), np.empty(len(targets), dtype=np.uint16)

    def solve(start: int, end: int, before: Floats | None) -> Floats:
        q[start:end], wrong[start:end] = np.nan, 0
        line, shared = _with_row_before(targets, counts, start, end, cell)
        guess = branch.guess(int(counts[start]) - 1) if before is None else before
        solution = branch.joints(path_of(line, cell), cell, guess)
        bits = what_is_wrong(solution, line.duration_s, cell)[shared:]
        target, found_own = line.target[shared:], solution[shared:]
        hits = np.flatnonzero(bits)
        np.bitwise_or.at(wrong, target[hits], bits[hits])
        ends = line.is_target[shared:]
        q[target[ends]] = found_own[ends]
        return solution[0].copy() if shared else np.full(6, np.nan)  # a view would keep all rows

    _solve_parts(solve, q, chunk_borders(len(targets)), cell.home_q_rad())
    q[targets.home] = cell.home_q_rad()
    return q, wrong


def _with_row_before(targets: Targets, counts: Ints, start: int, end: int, cell: Cell) -> tuple[Line, int]:
    """Return the line to targets ``start`` to ``end`` - 1, and how many samples belong to the row before."""
    first = max(start - 1, 0)
    line = sample_lines(targets, cell, first, end)
    before = int(np.searchsorted(line.target, start))
    return line.from_sample(max(before - 1, 0)), min(before, 1)


def _solve_parts(
    solve: Callable[[int, int, Floats | None], Floats], q: Floats, borders: list[int], last: Floats
) -> Floats:
    """Solve the parts; solve a part again where it and the part before disagree on their common row.

    ``solve(start, end, before)`` writes the joints of its rows into ``q`` and returns those (6,) it has for
    the row before them. Takes and returns the joints (6,) that were reached last.
    """
    shared = in_chunks(lambda start, end: solve(start, end, None), borders)
    for (start, end), row_before in zip(itertools.pairwise(borders), shared, strict=True):
        reached = np.flatnonzero(~np.isnan(q[start:end, 0]))  # that does not depend on the row before
        if not len(reached):
            continue
        if start and not (np.abs(row_before - q[start - 1]) <= _AGREEMENT_RAD).all():  # NaN does not agree
            solve(start, end, last)
        last = np.array(q[start + reached[-1]])
    return last


def _joints(q: Floats, qd: Floats, along: Targets | Motion, cell: Cell, conditioning: bool = True) -> Joints:
    geometry, tool = cell.robot.geometry.array(), along.tool
    count = len(q)
    margin = np.empty(count)
    sigma = np.empty(count) if conditioning else np.broadcast_to(np.nan, count)
    status, turn = np.empty(count, dtype=np.int32), np.empty(count, dtype=np.int32)

    def part(start: int, end: int) -> None:
        rows = slice(start, end)
        margin[rows] = limit_margin(q[rows], cell)
        status[rows], turn[rows] = status_turn(q[rows], geometry, _ANGLE_GRID_RAD)
        for number in distinct(tool[rows]) if conditioning else ():
            with_tool = start + np.flatnonzero(tool[rows] == number)
            tip = cell.tool_matrix(int(number))[:3, 3]
            sigma[with_tool] = smallest_singular_value(q[with_tool], geometry, tip)

    in_chunks(part, chunk_borders(count, ROWS))
    return Joints(
        q_rad=q,
        qd_rad_s=qd,
        limit_margin_rad=margin,
        sigma_min=sigma,
        status=status,
        turn=turn,
        external=along.external,
    )
