"""The pipeline, and whatever needs two stages: targets with their spin search, joints of targets."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcode2krl import krc4, program, robot
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue, input_error
from gcode2krl.tables import Joints, Motion, Targets, Toolpath
from gcode2krl.units import RAD_PER_DEG

Floats = NDArray[np.float64]
_SLOWING_ROUNDS = 3


def set_targets(toolpath: Toolpath, cell: Cell, tolerance_mm: float | None = None) -> Targets:
    """Return what the KRL program will say: poses, spin about the tool axis, CDIS, speeds, stops.

    ``tolerance_mm`` is the blend tolerance at corners: below ``G64 P``, above the cell's own. The findings
    of the G-code, of the cell and of the robot (reach, limits, singularities) travel with the table; the
    writer refuses what is an error.

    Raises
    ------
    NotUnderstoodError
        Where the program has no motion, or the tolerance is not positive.
    """
    if tolerance_mm is not None and not (np.isfinite(tolerance_mm) and tolerance_mm > 0):
        raise input_error("option-value", f"tolerance {tolerance_mm} mm is not positive")
    targets = program.plan_targets(toolpath, cell, _home_pose(cell), _spin_of(cell), tolerance_mm)
    _, findings = robot.follow(targets, cell)
    return replace(targets, issues=(*targets.issues, *findings))


def plan_motion(source: Targets | Toolpath, cell: Cell, dt_s: float = 0.012) -> Motion:
    """Return the path the controller will command, sampled every ``dt_s`` (12 ms, or 4 ms under RSI).

    Corners, time law and look-ahead by `krc4`; where a joint would exceed its speed limit the move is slowed
    down (assumption: to exactly that limit). ``issues`` say where time is lost and how much; what rests on a
    hypothesis about the controller says "unverified". Spindle start, tool changes and M-codes take no time
    here.

    Raises
    ------
    NotUnderstoodError
        Where the program has no motion, or ``dt_s`` is not positive.
    """
    targets = set_targets(source, cell) if isinstance(source, Toolpath) else source
    chain = krc4.build_chain(targets, cell)
    profile = krc4.plan(chain, cell)
    motion = krc4.sample_motion(targets, chain, profile, cell, dt_s)
    issues = list(krc4.motion_issues(chain, profile, cell))
    slowed = chain.speed_mm_s
    for _ in range(_SLOWING_ROUNDS):
        share = _joint_speed_share(motion, chain, cell)
        if share is None or share.max(initial=0.0) <= 1.0 + 1e-3:
            break
        slowed = slowed / np.maximum(share, 1.0)
        slower = krc4.with_speed(chain, slowed)
        new_profile = krc4.plan(slower, cell)
        motion = krc4.sample_motion(targets, slower, new_profile, cell, dt_s)
        lost_s = new_profile.total_s - profile.total_s
        worst = int(np.argmin(slowed / chain.speed_mm_s))
        issues = [issue for issue in issues if issue.code != "joint-speed"]
        sentence = f"joint speed limits slow the robot down: {lost_s:.2f} s more, most at this line"
        remedy = "lower F there, move the part, or turn the tool about its axis"
        issues.append(Issue("warning", "joint-speed", int(chain.source_line[worst]), sentence, remedy))
    return replace(motion, issues=tuple(issues))


def corner_errors_mm(targets: Targets, cell: Cell) -> tuple[Floats, NDArray[np.int32]]:
    """Return the corner error (c,) in mm and the G-code line (c,) of each blended corner of the program."""
    chain = krc4.build_chain(targets, cell)
    blended = chain.blend_mm > 0
    return chain.corner_error_mm()[blended], chain.source_line[blended]


def solve_joints(source: Targets | Motion, cell: Cell) -> Joints:
    """Return the joints at each target, or at each sample of a Motion: one branch, KUKA's signs, S and T.

    For Targets ``qd_rad_s`` is NaN, and the findings on reach, limits and singularities are in ``issues``.
    """
    if isinstance(source, Motion):
        return robot.follow_motion(source, cell)
    joints, findings = robot.follow(source, cell)
    return replace(joints, issues=findings)


def _joint_speed_share(motion: Motion, chain: krc4.Chain, cell: Cell) -> Floats | None:
    """Return the largest joint speed over its limit (n,) of each move of the chain; None without limits."""
    if cell.robot.speeds.qd_deg_s is None or len(chain.length_mm) == 0:
        return None
    joints = robot.follow_motion(motion, cell)
    load = np.nan_to_num(np.abs(joints.qd_rad_s) / (np.array(cell.robot.speeds.qd_deg_s) * RAD_PER_DEG)).max(
        axis=1
    )
    share = np.zeros(len(chain.length_mm))
    by_row = np.full(int(max(chain.move.max(), motion.move.max())) + 1, 0.0)
    np.maximum.at(by_row, motion.move, load)
    share[:] = by_row[chain.move]
    return share


def _home_pose(cell: Cell) -> Callable[[int], tuple[Floats, Floats]]:
    def home_pose(tool: int) -> tuple[Floats, Floats]:
        position, rotation = robot.forward(cell.home_q_rad(), cell, tool)
        return position[0], rotation[0]

    return home_pose


def _spin_of(cell: Cell) -> Callable[[Floats, Floats, NDArray[np.int32]], Floats | float]:
    spin = cell.frames.spin
    if spin != "auto":
        return lambda position, axis, tool: float(spin) * RAD_PER_DEG

    def automatic(position: Floats, axis: Floats, tool: NDArray[np.int32]) -> Floats | float:
        def quality(rows: NDArray[np.int64], spin_rad: float) -> Floats:
            rotation = program.tool_rotation(axis[rows], spin_rad)
            return robot.pose_quality(position[rows], rotation, tool[rows], cell)

        return program.smooth_spin(position, quality)

    return automatic
