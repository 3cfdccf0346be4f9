"""A run of another program, found from its commanded path: where that lies, and how fast its moves are gone.

A program that was edited keeps to the predicted curve for a good part of its way and leaves it for a stretch.
A corner leaves it near that corner only, another base or an accurate model of the robot everywhere.
"""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.gap.beside.commanded import CommandedPath, Curve, commanded_path
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.slips.feeds import other_feeds

_ON_SHARE = 0.1
_STRETCH_MM = 30.0
_BLEND_MM = 50.0
"""Largest approximation distance that occurs (KUKA's examples, see the effect ``corner``)."""
_FRAME_STEPS, _ALL, _FRAME_ROWS = 8, 0.95, 4000
_MOST_CHECKED = 200


def other_program(pairs: Sequence[Pair]) -> str | None:
    """Return what shows that the runs are of another program, as a sentence; None where nothing does."""
    paths = [path for pair in pairs if (path := commanded_path(pair)) is not None]
    beside = [f"{path.name}: {words}" for path in paths if (words := _beside(path)) is not None]
    if beside:
        return f"{beside[0]}: the run is of another program"
    return other_feeds(paths)


def _beside(path: CommandedPath) -> str | None:
    """Return from when a path is beside the curve, where part of it is right on it; None otherwise."""
    on = _long_stretches(path.apart_mm <= path.on_mm, path.way_mm)
    if not on or sum(float(path.way_mm[rows].sum()) for rows in on) < _ON_SHARE * path.way_mm.sum():
        return None
    off = _long_stretches(path.apart_mm > path.off_mm, path.way_mm)
    off = [rows for rows in off if not _in_corners(path, rows)]
    if not off or _is_frame(path):
        return None
    most_mm = max(float(path.apart_mm[rows].max()) for rows in off)
    return (
        f"from t = {path.time_s[off[0].start]:.1f} s the commanded path is up to {most_mm:.3g} mm beside "
        "the predicted one"
    )


def _long_stretches(rows: Bools, way_mm: Floats) -> list[slice]:
    """Return the runs of True (n,) that go further than corners do."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(np.int8)))
    stretches = [slice(int(start), int(end)) for start, end in edges.reshape(-1, 2)]
    return [each for each in stretches if float(way_mm[each].sum()) > _STRETCH_MM]


def _in_corners(path: CommandedPath, rows: slice) -> bool:
    """Tell whether a stretch may be blended corners, whatever their approximation distance.

    A blend stays in the triangle of a corner and the points from which and to which it goes, which are at
    most half a move away.
    """
    targets = path.inputs.targets
    if targets is None or len(targets.position_mm) < 3:
        return False
    chosen = np.unique(np.linspace(rows.start, rows.stop - 1, _MOST_CHECKED).astype(np.int64))
    corner_mm = targets.position_mm[1:-1][targets.cdis_mm[1:-1] > 0.0]
    before, after = np.diff(targets.position_mm, axis=0)[:-1], np.diff(targets.position_mm, axis=0)[1:]
    blended = targets.cdis_mm[1:-1] > 0.0
    legs = -_leg_mm(before[blended]), _leg_mm(after[blended])
    outside = np.array(
        [not _in_a_triangle(tip, corner_mm, *legs, path.off_mm) for tip in path.tip_mm[chosen]]
    )
    way_mm = float(path.way_mm[rows].sum())
    return float(np.mean(outside)) * way_mm <= _STRETCH_MM


def _leg_mm(move_mm: Floats) -> Floats:
    """Return half of each move (c, 3), at most the largest approximation distance."""
    length = np.maximum(np.linalg.norm(move_mm, axis=1, keepdims=True), 1e-12)
    leg: Floats = move_mm * np.minimum(0.5, _BLEND_MM / length)
    return leg


def _in_a_triangle(
    tip_mm: Floats, corner_mm: Floats, back_mm: Floats, on_mm: Floats, slack_mm: float
) -> bool:
    """Tell whether a point (3,) is in one of the triangles corner, corner + back, corner + on (c, 3)."""
    to = tip_mm - corner_mm
    bb, oo, bo = (np.sum(u * v, axis=1) for u, v in ((back_mm, back_mm), (on_mm, on_mm), (back_mm, on_mm)))
    area = bb * oo - bo**2
    turns = area > 1e-6 * bb * oo
    tb, to_on = np.sum(to * back_mm, axis=1), np.sum(to * on_mm, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        along_back, along_on = (oo * tb - bo * to_on) / area, (bb * to_on - bo * tb) / area
        off_plane = np.linalg.norm(to - along_back[:, None] * back_mm - along_on[:, None] * on_mm, axis=1)
        least_back, least_on = -slack_mm / np.sqrt(bb), -slack_mm / np.sqrt(oo)
        inside = (along_back > least_back) & (along_on > least_on) & (along_back + along_on < 1.0)
    return bool(np.any(turns & inside & (off_plane < slack_mm)))


def _is_frame(path: CommandedPath) -> bool:
    """Tell whether a shift and a turn of all of the path bring it onto the curve: another frame, then.

    Points to lines by least squares, each step from the feet of the one before (Chen & Medioni 1992).
    """
    rows = np.unique(np.linspace(0, len(path.tip_mm) - 1, _FRAME_ROWS).astype(np.int64))
    moved, way_mm, curve = path.tip_mm[rows], path.way_mm[rows], Curve(path.inputs.position_mm)
    for _ in range(_FRAME_STEPS):
        feet, apart_mm, along = curve.foot(moved)
        if float(way_mm[apart_mm <= path.on_mm].sum()) > _ALL * float(way_mm.sum()):
            return True
        moved = moved + _twist(moved, feet - moved, along)
    return False


def _twist(points_mm: Floats, wanted_mm: Floats, along: Floats) -> Floats:
    """Return what a small shift and turn add to points (n, 3) that miss lines by vectors (n, 3)."""
    lever = points_mm - points_mm.mean(axis=0)
    scale_mm = float(np.sqrt(np.mean(np.sum(lever**2, axis=1)))) or 1.0
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    turns = np.cross(np.eye(3)[None], lever[:, None, :]) / scale_mm  # (n, 3 turns, 3)
    moves = np.concatenate([np.broadcast_to(np.eye(3), (len(lever), 3, 3)), turns], axis=1)
    design = np.einsum("nij,nkj->nik", across, moves).reshape(-1, 6)
    target = np.einsum("nij,nj->ni", across, wanted_mm).ravel()
    values = np.linalg.lstsq(design, target, rcond=1e-9)[0]
    added: Floats = np.einsum("k,nkj->nj", values, moves)
    return added
