"""The poses of the arm, row by row: distance to limits and singularities, and what is not allowed."""

import functools

import numpy as np
from numpy.typing import NDArray

from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.compiled.core import FLOATS, INTS32, OUT_FLOATS, ArrayOf, core_function
from gcode2krl.compiled.inputs import shaped
from gcode2krl.units import RAD_PER_DEG, RAD_PER_REV

Bits = NDArray[np.uint16]

UNREACHED, FAST, WRIST = 64, 128, 256
"""What is wrong with a row, as bits; bits 0 to 5: A1 to A6 beyond its limit."""
ALL_BITS = tuple(1 << bit for bit in range(9))
WRIST_ZONE_RAD = 5.0 * RAD_PER_DEG
"""|A5| below which an excessive joint speed is called a wrist singularity."""

_judge = core_function(
    "robot_judge", *(FLOATS, FLOATS, FLOATS, FLOATS), OUT_FLOATS, ArrayOf(np.uint16, written=True)
)
_speed_share = core_function("robot_speed_share", FLOATS, FLOATS, INTS32, OUT_FLOATS)


def limits_rad(cell: Cell) -> Floats:
    """Return the joint limits (6, 2); without known limits, infinite ones."""
    pairs = cell.robot.limits.q_deg
    if pairs is None:
        return np.array([[-np.inf, np.inf]] * 6)
    return np.array(pairs) * RAD_PER_DEG


def limit_margin(q_rad: Floats, cell: Cell) -> Floats:
    """Return the distance (n,) in rad to the nearest joint limit, negative beyond it; NaN where q is."""
    margin, _ = _judged(q_rad, np.empty(0), cell)
    return margin


def pose_margins(q_rad: Floats, cell: Cell) -> tuple[Floats, Floats]:
    """Return how far joints (n, 6) are from limits in rad, negative beyond, and from singularities, a sine.

    (n,) each, NaN where the joints are. Each joint counts with its best whole turn; of singularities the
    wrist's, by A5, and the elbow's, by A3's distance from the stretched arm.
    """
    geometry = cell.robot.geometry.array()
    limit_rad = functools.reduce(
        np.minimum, (_in_best_turn(q_rad[:, k], *pair) for k, pair in enumerate(limits_rad(cell)))
    )
    stretched_rad = np.arctan2(geometry[1], geometry[4])
    wrist, elbow = np.abs(np.sin(q_rad[:, 4])), np.abs(np.sin(q_rad[:, 2] + stretched_rad))
    return limit_rad, np.minimum(wrist, elbow)


def _in_best_turn(q_rad: Floats, low: float, high: float) -> Floats:
    """Return the distance (n,) of angles to the nearer limit, in the best of their whole turns."""
    turns = (q_rad + turn for turn in (0.0, -RAD_PER_REV, RAD_PER_REV))
    return functools.reduce(np.maximum, (np.minimum(q - low, high - q) for q in turns))


def what_is_wrong(q_rad: Floats, duration_s: Floats, cell: Cell) -> Bits:
    """Return the bits (n,) of what is not allowed: beyond a limit, out of reach, too fast.

    ``duration_s`` (n,) is the time since the row before, NaN where there is none. A joint is too fast where
    its mean speed since then is above its limit; if the speed limits are not known, the rows
    within `WRIST_ZONE_RAD` of the wrist singularity are marked instead.
    """
    _, wrong = _judged(q_rad, duration_s, cell)
    return wrong


def raise_shares(share: Floats, qd_rad_s: Floats, row: Ints32, cell: Cell) -> None:
    """Raise the shares (n,) in place to the largest ratio of a joint speed to its limit in each row.

    ``row`` (m,) is the row that each of the speeds (m, 6) belongs to.
    """
    speeds = cell.robot.speeds.qd_deg_s
    if speeds is None or not len(row):
        return
    first = int(row.min())
    counts = np.zeros(int(row.max()) + 1 - first)
    most = shaped("most", np.array(speeds) * RAD_PER_DEG, 6)
    _speed_share(shaped("qd_rad_s", qd_rad_s, -1, 6), most, np.ascontiguousarray(row - first), counts)
    part = share[first : first + len(counts)]
    np.maximum(part, counts, out=part)


def _judged(q_rad: Floats, duration_s: Floats, cell: Cell) -> tuple[Floats, Bits]:
    q = shaped("q_rad", q_rad, -1, 6)
    speeds = cell.robot.speeds.qd_deg_s
    most = np.empty(0) if speeds is None else np.array(speeds) * RAD_PER_DEG
    margin, wrong = np.empty(len(q)), np.zeros(len(duration_s), dtype=np.uint16)
    limits, most = shaped("limits", limits_rad(cell), 6, 2), shaped("most", most, -1)
    _judge(q, shaped("duration_s", duration_s, -1), limits, most, margin, wrong)
    return margin, wrong
