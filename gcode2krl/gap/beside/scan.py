"""The part link: points of the finished part against the surface that the tip has swept.

A point is one of a floor, under the lowest tip that has passed over it, or of a wall, a cutter's radius
beside the nearest tip below it. The tip is the model's with what the tracker says of it, where there is one,
so that what bends the arm is no matter of the cutter. A shift of the part and the height of its floors are no
findings here: they are those of frames, which the tip shows better.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import Applied, Effect, simulate
from gcode2krl.effects.mismatch import Mismatch, sigma
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.trace import linear
from gcode2krl.gap.choose.intervals import Interval

_REACH_MM = 1.0
"""A point further from where a floor or a wall should be belongs to neither."""
_ABOVE_MM, _INSIDE_MM = 0.2, 0.3
_SMOOTH_S = 0.2
_STRAIGHT = 1e-6
_OUTLIERS = 4.0
_BLOCK_MM = 20.0
"""Points of one block of the part share what the model of the tip is off by."""
_LEAST_POINTS = 30
_CERTAIN = 4.0
_ROUGH_MM = 1.0
_TIP_MM = 0.003
"""The swept surface is known to some micrometres."""


@dataclass(frozen=True)
class ScanFinding:
    """What the scans say; lengths in mm."""

    points: int
    rms_before: float
    rms_after: float
    noise: float
    offset: Interval
    """By how much the cutter's diameter is larger than stated."""
    shrink: float
    """On points that the offset was not fitted to."""
    applied: Applied | None
    """The cause, where the offset is more than normal mismatch."""


@dataclass(frozen=True, eq=False)
class _Points:
    """Points that were assigned to the surface of one run."""

    deviation: Floats
    """(n,) material beyond the nominal surface is removed where it is positive: a wall further off, in mm."""
    wall: Bools
    normal: Floats
    """(n, 3) from the surface towards the tip."""
    deflection: Floats
    """(n,) of the tip along the normal."""
    place: Floats
    """(n, 3)"""


def examine_scans(
    pairs: Sequence[Pair], found: Sequence[Applied], library: Mapping[str, Effect], mismatch: Mismatch
) -> ScanFinding | None:
    """Return what scans say of the cutter's diameter; None without a scan, or where no wall was scanned."""
    traces = [trace for trace in (_assigned(pair, found) for pair in pairs) if trace is not None]
    effect = library.get("tool_diameter")
    if not traces or effect is None or sum(trace.wall.sum() for trace in traces) < _LEAST_POINTS:
        return None
    y = np.concatenate([trace.deviation for trace in traces])
    x, prior = _columns(traces, mismatch)
    block = _blocks(traces)
    good = _inliers(x, y, prior)
    x, y, block = x[good], y[good], block[good]
    b, covariance = _fit(x, y, prior, block)
    rest = y - x @ b
    others = b.copy()
    others[0] = 0.0
    before = y - x @ others
    even = block % 2 == 0
    held = [(even, ~even), (~even, even)]
    power = [_held_out(x, y, prior, chosen, test) for chosen, test in held if chosen.any() and test.any()]
    noise2 = float(np.mean(rest**2))
    gap2 = float(np.mean([p[0] for p in power])) - noise2 if power else 0.0
    left2 = float(np.mean([p[1] for p in power])) - noise2 if power else 0.0
    shrink = float(np.clip(1.0 - left2 / gap2, 0.0, 1.0)) if gap2 > 0.0 else 0.0
    deviation = float(np.hypot(np.sqrt(covariance[0, 0]), _TIP_MM))
    offset = Interval(*(float(2.0 * (b[0] + k * deviation)) for k in (0.0, -1.645, 1.645)))
    is_gap = abs(2.0 * b[0]) > mismatch.diameter_mm + _CERTAIN * deviation
    return ScanFinding(
        points=len(y),
        rms_before=float(np.sqrt(np.mean(before**2))),
        rms_after=float(np.sqrt(noise2)),
        noise=float(np.sqrt(noise2)),
        offset=offset,
        shrink=shrink,
        applied=Applied(effect, None, {"offset_mm": offset.value}) if is_gap else None,
    )


def _assigned(pair: Pair, found: Sequence[Applied]) -> _Points | None:
    """Return the points of a run's scan beside the surface that its tip has swept."""
    scan, inputs = pair.run.scan, pair.inputs
    axis = inputs.tool_rotation[:, :, 2]
    cuts = inputs.force_base_N.any(axis=1)
    if scan is None or not cuts.any() or np.ptp(axis, axis=0).max() > _STRAIGHT:
        return None
    tip, bent = _tips(pair, found)
    tool = inputs.cell.tool
    radius = np.array([tool[int(number)].diameter_mm / 2.0 for number in inputs.tool])[cuts]
    corner = np.array([_corner(tool[int(number)]) for number in inputs.tool])[cuts]
    up = -axis[0] if axis[0, 2] < 0.0 else axis[0]
    turn = _upright(up)
    path, bend = tip[cuts] @ turn.T, bent[cuts] @ turn.T
    points = scan.position_mm @ turn.T
    found_rows = [_surface(point, path, radius, corner) for point in points]
    kept = np.array([row is not None for row in found_rows])
    if kept.sum() < _LEAST_POINTS:
        return None
    rows = [row for row in found_rows if row is not None]
    deviation = np.array([row[0] for row in rows])
    wall = np.array([row[1] for row in rows])
    normal = np.array([row[2] for row in rows])
    nearest = np.array([row[3] for row in rows])
    return _Points(deviation, wall, normal, np.sum(bend[nearest] * normal, axis=1), points[kept])


def _surface(
    point: Floats, path: Floats, radius: Floats, corner: Floats
) -> tuple[float, bool, Floats, int] | None:
    """Return deviation, whether it is a wall, the normal and the row of the tip; None for neither."""
    apart = path[:, :2] - point[:2]
    away = np.hypot(apart[:, 0], apart[:, 1])
    over = np.flatnonzero(away < radius - corner - _INSIDE_MM)
    if len(over):
        row = int(over[np.argmin(path[over, 2])])
        low = float(path[row, 2] - point[2])
        return (low, False, np.array([0.0, 0.0, 1.0]), row) if abs(low) < _REACH_MM else None
    beside = np.flatnonzero(path[:, 2] + corner < point[2] - _ABOVE_MM)
    if not len(beside):
        return None
    row = int(beside[np.argmin(away[beside] - radius[beside])])
    far = float(away[row] - radius[row])
    if abs(far) > _REACH_MM:
        return None
    return far, True, np.array([*(apart[row] / away[row]), 0.0]), row


def _tips(pair: Pair, found: Sequence[Applied]) -> tuple[Floats, Floats]:
    """Return the tips (m, 3) and how far the model bends them (m, 3)."""
    inputs, table = pair.inputs, pair.run.tracker
    tip = simulate(inputs, list(found)).tcp_base_mm
    bent = inputs.deflection_mm
    if table is None or pair.run.head.frames.tracker != "base":
        return tip, bent
    own_s = pair.stamps(table)
    apart = table.position_mm - linear(own_s, inputs.time_s, tip)
    width = max(1, round(_SMOOTH_S / float(np.median(np.diff(own_s)))))
    kernel = np.ones(width)
    weight = np.convolve(np.ones(len(apart)), kernel, mode="same")
    smooth = np.stack([np.convolve(column, kernel, mode="same") / weight for column in apart.T], axis=1)
    return tip + linear(inputs.time_s, own_s, smooth), np.zeros_like(bent)


def _columns(traces: Sequence[_Points], mismatch: Mismatch) -> tuple[Floats, Floats]:
    """Return (n, c) columns and (c,) the weight of each prior: radius; shift, floors and bend of each run."""
    rows = sum(len(trace.deviation) for trace in traces)
    x = np.zeros((rows, 1 + 5 * len(traces)))
    prior = np.zeros(x.shape[1])
    prior[0] = 1.0 / _ROUGH_MM**2
    at = 0
    for number, trace in enumerate(traces):
        mine, first = slice(at, at + len(trace.deviation)), 1 + 5 * number
        x[mine, 0] = trace.wall
        x[mine, first : first + 2] = trace.normal[:, :2]
        x[mine, first + 2] = ~trace.wall
        x[mine, first + 3] = trace.deflection
        x[mine, first + 4] = (
            np.where(trace.wall, 0.0, trace.place[:, 0] - trace.place[:, 0].mean()) / _BLOCK_MM
        )
        prior[first : first + 2] = 1.0 / sigma(mismatch.frame_mm) ** 2
        prior[first + 2] = 1.0 / _ROUGH_MM**2
        prior[first + 3] = 1.0 / sigma(mismatch.stiffness) ** 2
        prior[first + 4] = 1.0 / sigma(mismatch.frame_mm) ** 2
        at += len(trace.deviation)
    return x, prior


def _blocks(traces: Sequence[_Points]) -> Ints:
    """Return the number (n,) of the block of the part, run by run, that each point lies in."""
    numbers = [
        np.column_stack([np.full(len(trace.place), number), np.floor(trace.place[:, :2] / _BLOCK_MM)])
        for number, trace in enumerate(traces)
    ]
    _, block = np.unique(np.concatenate(numbers), axis=0, return_inverse=True)
    return np.asarray(block, dtype=np.int64).ravel()


def _solved(x: Floats, y: Floats, prior: Floats) -> Floats:
    """Return the coefficients; priors are worth what the scatter of the points makes them."""
    spread = max(float(np.median(np.abs(y - np.median(y)))) * 1.4826, 1e-3)
    b: Floats = np.zeros(x.shape[1])
    for _ in range(3):
        b[:] = np.linalg.solve(x.T @ x / spread**2 + np.diag(prior), x.T @ y / spread**2)
        spread = max(1.4826 * float(np.median(np.abs(y - x @ b))), 1e-4)
    return b


def _inliers(x: Floats, y: Floats, prior: Floats) -> Bools:
    rest = y - x @ _solved(x, y, prior)
    good: Bools = np.abs(rest) < _OUTLIERS * 1.4826 * np.median(np.abs(rest))
    return good


def _fit(x: Floats, y: Floats, prior: Floats, block: Ints) -> tuple[Floats, Floats]:
    """Return coefficients and covariance, widened where blocks scatter more than points (White 1980)."""
    b = _solved(x, y, prior)
    rest = y - x @ b
    spread2 = float(np.mean(rest**2))
    inverse = np.linalg.inv(x.T @ x / spread2 + np.diag(prior))
    scores = np.zeros((int(block.max()) + 1, x.shape[1]))
    np.add.at(scores, block, x * (rest / spread2)[:, None])
    robust = inverse @ (scores.T @ scores) @ inverse
    wide = np.sqrt(np.maximum(np.diag(robust) / np.diag(inverse), 1.0))
    return b, inverse * np.outer(wide, wide)


def _held_out(x: Floats, y: Floats, prior: Floats, chosen: Bools, test: Bools) -> tuple[float, float]:
    """Return the mean squares of held-out points without and with the radius of the others."""
    radius = x[test, 0] * _solved(x[chosen], y[chosen], prior)[0]
    # the other numbers belong to the held-out points themselves
    own, others = _solved(x[test], y[test], prior)[1:], x[test, 1:]
    left = y[test] - radius
    left = left - others @ _solved(others, left, prior[1:])
    return float(np.mean((y[test] - others @ own) ** 2)), float(np.mean(left**2))


def _corner(tool: object) -> float:
    """Return the height above the tip from which a cutter has its whole radius."""
    kind, diameter = getattr(tool, "kind", "flat"), float(getattr(tool, "diameter_mm", 0.0))
    return diameter / 2.0 if kind == "ball" else float(getattr(tool, "corner_radius_mm", 0.0))


def _upright(up: Floats) -> Floats:
    """Return a rotation (3, 3) that turns a direction to z."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = helper - up * float(helper @ up)
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up])
