"""A run of another program, by its commanded path: where that lies, and how fast it goes along its moves.

A program that was edited keeps to the predicted curve for a good part of its way and leaves it for a stretch.
A blended corner leaves it near that corner only, another base or an accurate model of the robot everywhere.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Effect
from gcode2krl.gap.beside.commanded import CommandedPath, Curve, commanded_path
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.slips.feeds import other_feeds
from gcode2krl.gap.slips.slip import Slip, final_slip
from gcode2krl.gap.thresholds import THRESHOLDS

_NAME = "other_program"
_LIMITS = THRESHOLDS.slips


class ProgramTest:
    """Another program than the predicted one. Nothing is compared beyond it."""

    effects = (_NAME,)

    def find(self, pairs: Sequence[Pair], library: Mapping[str, Effect]) -> list[Slip]:
        """Return the slip where a commanded path shows another program."""
        effect = library.get(_NAME)
        words = other_program(pairs) if effect is not None else None
        return [] if effect is None or words is None else [final_slip(effect, None, words, pairs)]


def other_program(pairs: Sequence[Pair]) -> str | None:
    """Return what shows that the runs are of another program, as a sentence; None where nothing does."""
    paths = [path for pair in pairs if (path := commanded_path(pair)) is not None]
    for path in paths:
        words = _beside(path)
        if words is not None:
            return f"{path.name}: {words}: the run is of another program"
    return other_feeds(paths)


def _beside(path: CommandedPath) -> str | None:
    """Return from when on a path is beside the curve, where part of it is right on it; None otherwise."""
    on = _long_stretches(path.apart_mm <= path.on_mm, path.way_mm)
    on_way_mm = sum(float(path.way_mm[rows].sum()) for rows in on)
    if not on or on_way_mm < _LIMITS.program_on_share * path.way_mm.sum():
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
    """Return the stretches of True rows (n,) whose way is longer than that of corners."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(np.int8)))
    stretches = [slice(int(start), int(end)) for start, end in edges.reshape(-1, 2)]
    return [each for each in stretches if float(way_mm[each].sum()) > _LIMITS.program_off_way_mm]


def _in_corners(path: CommandedPath, rows: slice) -> bool:
    """Tell whether a stretch may be blended corners, whatever their approximation distance.

    A blend stays in the triangle of its corner and of a point on each leg, at most half a move away from it.
    """
    targets = path.inputs.targets
    if targets is None or len(targets.position_mm) < 3:
        return False
    blended = targets.cdis_mm[1:-1] > 0.0
    moves_mm = np.diff(targets.position_mm, axis=0)
    corner_mm = targets.position_mm[1:-1][blended]
    legs_mm = -_leg_mm(moves_mm[:-1][blended]), _leg_mm(moves_mm[1:][blended])
    chosen = np.unique(np.linspace(rows.start, rows.stop - 1, _LIMITS.program_corner_rows).astype(np.int64))
    outside = [not _in_a_triangle(tip, corner_mm, *legs_mm, path.off_mm) for tip in path.tip_mm[chosen]]
    way_mm = float(path.way_mm[rows].sum())
    return float(np.mean(outside)) * way_mm <= _LIMITS.program_off_way_mm


def _leg_mm(move_mm: Floats) -> Floats:
    """Return half of each move (c, 3), at most the largest approximation distance."""
    length = np.maximum(np.linalg.norm(move_mm, axis=1, keepdims=True), 1e-12)
    leg: Floats = move_mm * np.minimum(0.5, _LIMITS.corner_blend_mm / length)
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
    """Tell whether one shift and turn bring the whole path onto the curve: then it is in another frame.

    Points to lines by least squares, each step from the feet of the one before (Chen & Medioni 1992).
    """
    rows = np.unique(np.linspace(0, len(path.tip_mm) - 1, _LIMITS.program_frame_rows).astype(np.int64))
    moved, way_mm, curve = path.tip_mm[rows], path.way_mm[rows], Curve(path.inputs.position_mm)
    for _ in range(_LIMITS.program_frame_steps):
        feet, apart_mm, along = curve.foot(moved)
        on_way_mm = float(way_mm[apart_mm <= path.on_mm].sum())
        if on_way_mm > _LIMITS.program_frame_share * float(way_mm.sum()):
            return True
        moved = moved + _twist(moved, feet - moved, along)
    return False


def _twist(points_mm: Floats, wanted_mm: Floats, along: Floats) -> Floats:
    """Return the displacement (n, 3) by the small shift and turn that best bring points onto lines.

    ``wanted_mm`` : (n, 3) from each point to its line, whose direction is ``along``.
    """
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
