"""Joints along a chain of LIN motions: one branch, the right turns, and what stands in the way.

The controller keeps its configuration on LIN, so the branch is chosen once, for the whole program. Between
two targets the line is sampled, because a limit or a singularity may lie on the way.
"""

import functools
import itertools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcode2krl import frames as fr
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue
from gcode2krl.robot.inverse_kinematics import one_branch
from gcode2krl.robot.jacobian import smallest_singular_value
from gcode2krl.robot.kinematics import status_turn
from gcode2krl.robot.poses import flange_frames, forward
from gcode2krl.tables import Joints, Motion, Targets
from gcode2krl.tool_tips import motion_starts
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG, RAD_PER_REV

Floats = NDArray[np.float64]

STEP_MM, STEP_RAD = 10.0, 2.0 * RAD_PER_DEG
"""Largest step between the samples of a line that are checked."""
WRIST_ZONE_RAD = 5.0 * RAD_PER_DEG
"""|A5| below which an excessive joint speed is called a wrist singularity."""
WEAK_SIGMA = 0.03
"""Smallest singular value below which an excessive joint speed is called a singularity of the arm."""
_TRIAL_SAMPLES = 2000
_MOST_PER_CHECK = 20
_TURN_OR_MOVE = 'turn the tool about its axis ([frames] spin = "auto" or an angle), or move the part'
_ANGLE_GRID_RAD = 1e-9
_PTP_SAMPLES = 50
_ROWS_A_PART = 100_000
_PTP_TOLERANCE_MM = 0.01


@dataclass(frozen=True)
class Line:
    """Samples along the LIN motions: everything that is checked, target rows among them."""

    position_mm: Floats
    rotation: Floats
    tool: NDArray[np.int32]
    target: NDArray[np.int64]
    """(m,) the target each sample leads to."""
    duration_s: Floats
    """(m,) time from the sample before, NaN at the start of a chain."""
    is_target: NDArray[np.bool_]


def follow(targets: Targets, cell: Cell, conditioning: bool = True) -> tuple[Joints, tuple[Issue, ...]]:
    """Return joints at each target (p) and the findings along the lines between them.

    Joint speeds are NaN (they belong to a Motion). A target out of reach has NaN angles. Without
    ``conditioning`` the column ``sigma_min`` is NaN, which saves its time.
    """
    line = sample_lines(targets, cell)
    chain = np.isnan(line.duration_s)
    q_line = _best_branch(line.position_mm, line.rotation, line.tool, chain, cell)
    q = np.full((len(targets), 6), np.nan)
    q[line.target[line.is_target]] = q_line[line.is_target]
    q[targets.home] = cell.home_q_rad()
    joints = _joints(q, np.full_like(q, np.nan), targets.tool, cell, conditioning)
    return joints, joint_findings(line, q_line, targets, cell)


def ptp_joints(targets: Targets, cell: Cell) -> Joints:
    """Return what `follow` does, at the PTP targets only; the other rows are NaN, S and T there 0."""
    line = sample_lines(targets, cell)
    chain = np.isnan(line.duration_s)
    _, _, thin, q_thin = _trial(line.position_mm, line.rotation, line.tool, chain, cell)
    q = np.full((len(targets), 6), np.nan)
    starts = chain[thin]
    q[line.target[thin[starts]]] = q_thin[starts]
    q[targets.home] = cell.home_q_rad()
    return _joints(q, np.full_like(q, np.nan), targets.tool, cell, conditioning=False)


def follow_motion(motion: Motion, cell: Cell) -> Joints:
    """Return joints at each sample (m) of a Motion, one branch for all."""
    q, qd = motion_angles(motion, cell)
    return _joints(q, qd, motion.tool, cell)


def motion_angles(motion: Motion, cell: Cell) -> tuple[Floats, Floats]:
    """Return angles (m, 6) in rad and speeds (m, 6) in rad/s of a Motion; speeds are central differences."""
    chain = np.zeros(len(motion), dtype=np.bool_)
    chain[0] = True
    q = _best_branch(motion.position_mm, motion.rotation, motion.tool, chain, cell)
    qd = np.zeros_like(q)
    if len(motion) > 2:
        cycle_s = motion.time_s[1] - motion.time_s[0]
        qd[1:-1] = (q[2:] - q[:-2]) / (2.0 * cycle_s)  # at both ends the robot rests
    changed = np.flatnonzero(np.diff(motion.tool)) if len(motion) > 1 else np.zeros(0, dtype=np.int64)
    qd[changed], qd[changed + 1] = 0.0, 0.0  # the flange rests while the tool changes
    return q, qd


def _joints(q: Floats, qd: Floats, tool: NDArray[np.int32], cell: Cell, conditioning: bool = True) -> Joints:
    geometry = cell.robot.geometry.array()
    sigma = np.full(len(q), np.nan)
    for number in np.unique(tool) if conditioning else ():
        rows = np.flatnonzero(tool == number)
        tip = cell.tool_matrix(int(number))[:3, 3]
        singular = functools.partial(smallest_singular_value, geometry=geometry, tool_position_mm=tip)
        parts = np.array_split(rows, max(1, len(rows) // _ROWS_A_PART))
        with ThreadPoolExecutor() as pool:  # the compiled loop releases the interpreter
            sigma[rows] = np.concatenate(list(pool.map(singular, [q[part] for part in parts])))
    status, turn = status_turn(np.rint(q / _ANGLE_GRID_RAD) * _ANGLE_GRID_RAD + 0.0, geometry)
    return Joints(
        q_rad=q,
        qd_rad_s=qd,
        limit_margin_rad=_limit_margin(q, cell),
        sigma_min=sigma,
        status=status.astype(np.int32),
        turn=turn.astype(np.int32),
    )


def sample_lines(targets: Targets, cell: Cell) -> Line:
    """Sample the straight lines between targets; a PTP target starts a new chain.

    After a tool change a line begins where the new tool's tip stands, the flange at rest.
    """
    position, rotation = targets.position_mm, targets.rotation
    count = len(targets)
    from_position, from_rotation = motion_starts(targets, cell)
    from_position[targets.ptp], from_rotation[targets.ptp] = position[targets.ptp], rotation[targets.ptp]
    length = np.linalg.norm(position - from_position, axis=1)
    angle = np.zeros(count)
    turning = functools.reduce(np.logical_or, (rotation != from_rotation).T)
    angle[turning] = fr.angle_between(rotation[turning], from_rotation[turning])
    steps = np.maximum(1, np.ceil(np.maximum(length / STEP_MM, angle / STEP_RAD))).astype(np.int64)
    steps[targets.ptp] = 1
    steps[targets.home] = 0
    target = np.repeat(np.arange(count), steps)
    last = np.cumsum(steps)
    part = (np.arange(len(target)) - (last - steps)[target] + 1) / steps[target]
    start = from_position[target]
    points = start + (position[target] - start) * part[:, None]
    turned = rotation[target]
    partial = np.flatnonzero((angle[target] > 0) & (part < 1))
    if len(partial):
        turned = np.array(turned)
        turned[partial] = fr.slerp(from_rotation[target[partial]], rotation[target[partial]], part[partial])
    speed = targets.speed_mm_s[target]
    duration = np.where(targets.ptp[target], np.nan, np.maximum(length[target], 1e-9) / speed / steps[target])
    return Line(points, turned, targets.tool[target], target, duration, part == 1.0)


def _best_branch(
    tip_mm: Floats, tip_rotation: Floats, tool: NDArray[np.int32], chain: NDArray[np.bool_], cell: Cell
) -> Floats:
    """Return the joints (m, 6) of the branch and turns that keep the whole program within the limits.

    Among branches that do, the one whose weakest point (limits, wrist) is not poor and whose start lies
    nearest to HOME. A trial on a thinned line picks the branch, the full line gets only that one.
    """
    branch, turns, _, _ = _trial(tip_mm, tip_rotation, tool, chain, cell)
    position, rotation = flange_frames(tip_mm, tip_rotation, tool, cell)
    q = _chains(position, rotation, chain, branch, cell.home_q_rad(), cell)
    if turns.any():
        q += turns
    return q


def _trial(
    tip_mm: Floats, tip_rotation: Floats, tool: NDArray[np.int32], chain: NDArray[np.bool_], cell: Cell
) -> tuple[int, Floats, NDArray[np.int64], Floats]:
    """Return (branch, turns (6,), samples (t,), their joints (t, 6)) of the best branch on a thinned line."""
    stride = max(1, len(tip_mm) // _TRIAL_SAMPLES)
    chosen = chain.copy()
    chosen[::stride] = True
    chosen[-1] = True
    thin = np.flatnonzero(chosen)
    position, rotation = flange_frames(tip_mm[thin], tip_rotation[thin], tool[thin], cell)
    scored = []
    for branch in range(8):
        q = _chains(position, rotation, chain[thin], branch, cell.home_q_rad(), cell)
        turns = _turns(q, cell)
        scored.append((_cost(q + turns, cell), branch, turns, q + turns))
    _, branch, turns, q = min(scored, key=lambda entry: (entry[0], entry[1]))
    return branch, turns, thin, q


def _chains(
    position: Floats, rotation: Floats, chain: NDArray[np.bool_], branch: int, reference: Floats, cell: Cell
) -> Floats:
    """Solve each chain (from PTP to PTP) with one branch, starting from the reference."""
    starts = [*np.flatnonzero(chain), len(position)]
    geometry = cell.robot.geometry.array()
    pieces = [
        one_branch(
            position[a:b], rotation[a:b] if len(rotation) > 1 else rotation, geometry, branch, reference
        )
        for a, b in itertools.pairwise(starts)
    ]
    return np.concatenate(pieces) if pieces else np.empty((0, 6))


def limits_rad(cell: Cell) -> Floats:
    """Return the joint limits (6, 2); without known limits, infinite ones."""
    pairs = cell.robot.limits.q_deg
    if pairs is None:
        return np.array([[-np.inf, np.inf]] * 6)
    return np.array(pairs) * RAD_PER_DEG


def _limit_margin(q: Floats, cell: Cell) -> Floats:
    limits = limits_rad(cell)
    margins = (np.minimum(q[:, k] - low, high - q[:, k]) for k, (low, high) in enumerate(limits))
    return functools.reduce(np.minimum, margins)


def _turns(q: Floats, cell: Cell) -> Floats:
    """Return the whole turns (6,) in rad that bring each joint's range best into its limits."""
    limits = limits_rad(cell)
    if np.isnan(q).all() or np.isinf(limits).any():
        return np.zeros(6)
    low, high = np.nanmin(q, axis=0), np.nanmax(q, axis=0)
    candidates = RAD_PER_REV * np.array([0.0, -1.0, 1.0])
    margin = np.minimum(low + candidates[:, None] - limits[:, 0], limits[:, 1] - high - candidates[:, None])
    fits_already = margin[0] >= 0
    best = np.where(fits_already, 0, np.argmax(margin, axis=0))
    return candidates[best]


def _cost(q: Floats, cell: Cell) -> tuple[float, float]:
    """Return (share of samples that cannot be, distance of the start from HOME plus poverty of the wrist)."""
    if len(q) == 0:
        return 0.0, 0.0
    bad = np.isnan(q).any(axis=1) | (_limit_margin(q, cell) < 0)
    start = np.abs(q[0] - cell.home_q_rad()).sum()
    wrist = np.nanmin(np.abs(np.sin(q[:, 4]))) if not np.isnan(q).all() else 0.0
    poor = max(0.0, np.sin(WRIST_ZONE_RAD) - wrist) / np.sin(WRIST_ZONE_RAD)
    other_arm = _arm_bits(q[:1], cell) != _arm_bits(cell.home_q_rad()[None, :], cell)
    return float(bad.mean()), float(np.nan_to_num(start, nan=1e3) + 10.0 * poor + 20.0 * other_arm)


def _arm_bits(q: Floats, cell: Cell) -> int:
    """Return the bits of S that say how the arm stands (the wrist's bit left out)."""
    return int(status_turn(np.nan_to_num(q), cell.robot.geometry.array())[0][0]) & 3


def joint_findings(line: Line, q: Floats, targets: Targets, cell: Cell) -> tuple[Issue, ...]:
    """Return what stands in the robot's way along the sampled lines: reach, limits, singularities, speeds."""
    findings: list[Issue] = []
    source_line = targets.source_line[line.target]
    if cell.robot.limits.q_deg is None:
        findings.append(
            Issue(
                "error",
                "limits-unknown",
                0,
                f"the joint limits of {cell.robot.model} are not known",
                "give [robot.limits] q_deg in the cell, from the data sheet",
            )
        )
    home = _limit_margin(cell.home_q_rad()[None, :], cell)[0]
    if home < 0:
        findings.append(
            Issue(
                "error",
                "home-limit",
                0,
                f"HOME is {-home * DEG_PER_RAD:.2f} deg beyond a joint limit",
                "correct [home] q_deg in the cell",
            )
        )
    unreached = np.isnan(q[:, 0])  # a pose out of reach has no angle at all
    for sample in _stretches(unreached):
        x, y, z = line.position_mm[sample]
        findings.append(
            Issue(
                "error",
                "out-of-reach",
                int(source_line[sample]),
                f"X {x:.3f} Y {y:.3f} Z {z:.3f} is out of reach",
                "move the part nearer ([frames] base), or check the unit",
            )
        )
    limits = limits_rad(cell)
    for joint in range(6):
        angle = q[:, joint]
        for sample in _stretches((angle < limits[joint, 0]) | (angle > limits[joint, 1])):
            low, high = limits[joint] * DEG_PER_RAD
            findings.append(
                Issue(
                    "error",
                    "joint-limit",
                    int(source_line[sample]),
                    f"A{joint + 1} at {angle[sample] * DEG_PER_RAD:.2f} deg, allowed {low:g}..{high:g}",
                    'move the part, turn the tool about its axis ([frames] spin), or use spin = "auto"',
                )
            )
    findings += _speed_findings(line, q, source_line, cell)
    findings += _ptp_findings(line, q, targets, cell)
    mass, rated = cell.load.mass_kg, cell.robot.payload.mass_kg
    if rated is not None and mass > rated:
        findings.append(
            Issue(
                "error",
                "overload",
                0,
                f"the load of {mass:g} kg is above the rated {rated:g} kg",
                "correct [load]",
            )
        )
    return tuple(sorted(findings, key=lambda issue: issue.line)[: 5 * _MOST_PER_CHECK])


def _speed_findings(line: Line, q: Floats, source_line: NDArray[np.int32], cell: Cell) -> list[Issue]:
    """Joint speeds on straight lines at the programmed speed: singularities, and plain slow joints."""
    findings: list[Issue] = []
    if cell.robot.speeds.qd_deg_s is None:
        return [
            Issue(
                "warning",
                "joint-speeds-unknown",
                0,
                f"joint speeds of {cell.robot.model} are not known; singularities are judged by |A5| alone",
                "give [robot.speeds] qd_deg_s in the cell",
            ),
            *_wrist_findings(line, q, source_line),
        ]
    most = np.array(cell.robot.speeds.qd_deg_s) * RAD_PER_DEG
    speed = np.zeros_like(q)
    speed[1:] = np.abs(np.diff(q, axis=0)) / line.duration_s[1:, None]
    load = functools.reduce(np.fmax, (speed / most).T, np.zeros(len(q)))
    fast = load > 1.0 + 1e-6
    for sample in _stretches(fast):
        joint = int(np.argmax(speed[sample] / most))
        near = slice(max(0, sample - 1), sample + 2)
        wrist = np.abs(np.sin(q[near, 4])).min() < np.sin(WRIST_ZONE_RAD)
        tip = cell.tool_matrix(int(line.tool[sample]))[:3, 3]
        arm = smallest_singular_value(q[near], cell.robot.geometry.array(), tip).min() < WEAK_SIGMA
        needed, allowed = speed[sample, joint] * DEG_PER_RAD, most[joint] * DEG_PER_RAD
        number = f"A{joint + 1} would need {needed:.0f} deg/s of {allowed:.0f}"
        where = int(source_line[sample])
        if wrist or arm:
            what = "wrist singularity (A5 near 0)" if wrist else "singularity of the arm"
            findings.append(
                Issue(
                    "error",
                    "singularity",
                    where,
                    f"{what}: {number}",
                    _TURN_OR_MOVE,
                )
            )
        else:
            findings.append(
                Issue(
                    "warning",
                    "joint-speed",
                    where,
                    f"{number}: slower than programmed here",
                    "lower F, or move the part",
                )
            )
    return findings


def _ptp_findings(line: Line, q: Floats, targets: Targets, cell: Cell) -> list[Issue]:
    """PTP between HOME and the clearance plane, sampled in joint space: no dip below the plane."""
    clearance = cell.clearance_z_mm
    if clearance is None:
        return []
    remedy = "choose HOME above the plane ([home] q_deg), or lower [clearance] z_mm"
    home_z = targets.position_mm[targets.home, 2].min(initial=np.inf)
    if home_z < clearance - _PTP_TOLERANCE_MM:
        sentence = f"the tip at HOME is at Z {home_z:.1f}, below the clearance plane at {clearance:g}"
        return [Issue("error", "home-below-clearance", 0, sentence, remedy)]
    at_target = np.full((len(targets), 6), np.nan)
    at_target[line.target[line.is_target]] = q[line.is_target]
    at_target[targets.home] = cell.home_q_rad()
    findings = []
    for row in np.flatnonzero(targets.ptp[1:]) + 1:
        part = np.linspace(0.0, 1.0, _PTP_SAMPLES)[:, None]
        path = at_target[row - 1] + (at_target[row] - at_target[row - 1]) * part
        if np.isnan(path).any():
            continue
        lowest = forward(path, cell, int(targets.tool[row]))[0][:, 2].min()
        if lowest < clearance - _PTP_TOLERANCE_MM:
            sentence = f"PTP comes down to Z {lowest:.1f}, below the clearance plane at {clearance:g}"
            remedy = "choose HOME above the plane ([home] q_deg), or lower [clearance] z_mm"
            findings.append(
                Issue("error", "ptp-below-clearance", int(targets.source_line[row]), sentence, remedy)
            )
    return findings[:1]


def _wrist_findings(line: Line, q: Floats, source_line: NDArray[np.int32]) -> list[Issue]:
    near = np.abs(np.sin(q[:, 4])) < np.sin(WRIST_ZONE_RAD)
    return [
        Issue(
            "error",
            "singularity",
            int(source_line[sample]),
            f"wrist singularity: A5 at {q[sample, 4] * DEG_PER_RAD:.2f} deg",
            _TURN_OR_MOVE,
        )
        for sample in _stretches(near)
    ]  # fmt: skip


def _stretches(wrong: NDArray[np.bool_]) -> list[int]:
    starts = np.flatnonzero(wrong & ~np.concatenate([[False], wrong[:-1]]))
    return [int(sample) for sample in starts[:_MOST_PER_CHECK]]
