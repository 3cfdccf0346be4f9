"""Targets to Motion: the chain of LIN motions as the controller will command it."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carriers import most_of
from gcode2krl.cell.tool_tips import external_starts, motion_starts
from gcode2krl.compiled.chunks import chunk_borders, in_chunks
from gcode2krl.compiled.inputs import distinct
from gcode2krl.errors import Issue
from gcode2krl.krc4.laws import parabola_distance
from gcode2krl.krc4.profile import UNLIMITED, Profile, plan_profile
from gcode2krl.tables import Targets
from gcode2krl.units import MM_PER_M, RAD_PER_DEG

SIMPLIFY_MM = 0.01
"""The tolerance to merge moves within that is proposed: a tenth of what a robot's milling usually keeps."""
_WORTH_SAYING = 0.01
"""Fraction of the time above which a loss is reported."""
_NO_LENGTH_MM = 1e-6
"""A shorter move is rounding, as when another tool's tip is at the same place."""
Changes = Literal["where it fits", "never", "always"]
_STRAIGHT_COS, _NEARLY_STRAIGHT_COS = 1e-7, 0.01
"""cos(alpha/2) below which a line goes straight on without a corner, and below which it may do so."""
_WRITTEN_MM = 1e-3
"""The last decimal of a position in the KRL text."""


@dataclass(frozen=True)
class Chain:
    """The moves of a Motion: n moves between the first and the last programmed position."""

    first: int
    """Row of Targets at which the motion starts at rest."""
    start_mm: Floats
    end_mm: Floats
    from_rotation: Floats
    to_rotation: Floats
    length_mm: Floats
    """(n,) lengths over ``scale``; a mere reorientation has the length that takes as much time."""
    speed_mm_s: Floats
    """(n,) programmed speeds over ``scale``."""
    acceleration_mm_s2: Floats
    """(n,) ``$ACC.CP``, lowered where ``$ACC.ORI`` limits it, over ``scale``."""
    angle_rad: Floats
    """(n,) angle that the tool turns by."""
    blend_mm: Floats
    """(n,) min(CDIS, half lines) at the end of each move; 0 = exact stop, or straight on."""
    stop: Bools
    """(n,) True where the end of a move is an exact stop."""
    wait_s: Floats
    move: Ints32
    source_line: Ints32
    tool: Ints32
    cos_half: Floats
    """(n,) cos(alpha/2) at the end of each move, alpha = interior angle."""
    scale: Floats
    """(n,) unit of length of each move: 1, but after a corner that makes a change of speed v1 to v2 it is
    v2/v1 times the unit before. In these units such a corner has one speed and equal distances, which is a
    constant acceleration vector between v1 and v2 with d1/d2 = v1/v2."""
    from_external: Floats
    """(n, 6) E1 to E6 at which each move begins."""
    to_external: Floats

    def corner_error_mm(self) -> Floats:
        """Return the corner errors (n,): the distance of the vertex to the parabola."""
        error = np.zeros(len(self.blend_mm))
        corners = np.flatnonzero(self.blend_mm > 0)
        before, after = self.corner_distances_mm()
        error[corners] = parabola_distance(before[corners], after[corners], self.cos_half[corners])
        return error

    def corner_distances_mm(self) -> tuple[Floats, Floats]:
        """Return the distances (n,) before and behind each corner at which its parabola begins and ends."""
        next_scale = np.append(self.scale[1:], self.scale[-1:])  # there may be no move at all
        return self.blend_mm * self.scale, self.blend_mm * next_scale


def build_chain(targets: Targets, cell: Cell, changes: Changes = "where it fits") -> Chain:
    """Return the chain of a program. PTP motions inside it are modelled as straight, at the rapid speed.

    ``changes`` says which corners between unequal speeds make the change of speed; see `_scales`.
    """
    programmed = np.flatnonzero(targets.move >= 0)
    first, last = int(programmed[0]), int(programmed[-1])
    rows = slice(first + 1, last + 1)
    start, from_rotation = motion_starts(targets, cell, rows)
    end, to_rotation = targets.position_mm[rows], targets.rotation[rows]
    size = _sizes(start, end)
    rapid = cell.controller.rapid_m_s * MM_PER_M
    speed = np.where(targets.ptp[rows], rapid, targets.speed_mm_s[rows])
    length, speed, acceleration, angle = _with_orientation(size, speed, from_rotation, to_rotation, cell)
    from_external, to_external = external_starts(targets, rows), targets.external[rows]
    if cell.external:
        way = np.abs(to_external - from_external)
        length, speed, acceleration = _with_external(length, speed, acceleration, way, cell)
    d, cos_half = _blends(start, end, size, length, targets.cdis_mm[rows])
    stop = (d <= 0.0) | (cell.controller.advance == 0)
    d[stop | _goes_straight_on(d, cos_half)] = 0.0
    scale = _scales(length, speed, acceleration, d, targets.cdis_mm[rows], stop, cell, changes)
    return Chain(
        first=first,
        start_mm=start,
        end_mm=end,
        from_rotation=from_rotation,
        to_rotation=to_rotation,
        length_mm=_over(length, scale),
        speed_mm_s=_over(speed, scale),
        acceleration_mm_s2=_over(acceleration, scale),
        angle_rad=angle,
        blend_mm=d,
        stop=stop,
        wait_s=targets.wait_s[rows],
        move=_owners(targets.move[rows]),
        source_line=targets.source_line[rows],
        tool=targets.tool[rows],
        cos_half=cos_half,
        scale=scale,
        from_external=from_external,
        to_external=to_external,
    )


def with_corners(chain: Chain, cdis_mm: Floats, cell: Cell, changes: Changes = "where it fits") -> Chain:
    """Return the chain with other CDIS, none larger, or other corners that make a change of speed.

    ``cdis_mm`` (n,) at the end of each move; ``changes`` as in `build_chain`.
    """
    scale = chain.scale
    length, speed, acceleration = (
        column * scale for column in (chain.length_mm, chain.speed_mm_s, chain.acceleration_mm_s2)
    )
    d = np.zeros(len(length))
    corners = np.flatnonzero(chain.blend_mm > 0.0)
    d[corners] = np.minimum(cdis_mm[corners], np.minimum(length[corners], length[corners + 1]) / 2)
    scale = _scales(length, speed, acceleration, d, cdis_mm, chain.stop, cell, changes)
    return replace(
        chain,
        length_mm=_over(length, scale),
        speed_mm_s=_over(speed, scale),
        acceleration_mm_s2=_over(acceleration, scale),
        blend_mm=d,
        scale=scale,
    )


def _over(column: Floats, scale: Floats) -> Floats:
    """Return a column in units of the scale, as it is where that is 1."""
    return column if scale.strides[0] == 0 else column / scale


def _owners(move: Ints32) -> Ints32:
    """Return the row of the Toolpath (n,) of each motion; added motions have that of the next one."""
    owner = np.array(move)
    added, programmed = np.flatnonzero(move < 0), np.flatnonzero(move >= 0)
    if len(added) and len(programmed):
        after = np.minimum(np.searchsorted(programmed, added), len(programmed) - 1)
        owner[added] = move[programmed[after]]
    return owner


def _sizes(start: Floats, end: Floats) -> Floats:
    """Return the lengths (n,) of the moves in space."""
    size = np.empty(len(end))

    def part(first: int, behind: int) -> None:
        x, y, z = (end[first:behind] - start[first:behind]).T
        np.sqrt(x * x + y * y + z * z, out=size[first:behind])
        size[first:behind][size[first:behind] < _NO_LENGTH_MM] = 0.0

    in_chunks(part, chunk_borders(len(size)))
    return size


def plan(
    chain: Chain,
    cell: Cell,
    *,
    look_ahead: bool = True,
    pieces: bool = True,
    both_laws: bool = False,
    speed_mm_s: Floats | None = None,
) -> Profile:
    """Return the profile of a chain; ``look_ahead`` False leaves the model of ``$ADVANCE`` out.

    Without ``pieces`` it says no more than how long the motion lasts, in half the time.
    """
    controller = cell.controller
    in_view = UNLIMITED if controller.advance == "unlimited" or not look_ahead else int(controller.advance)
    return plan_profile(
        chain.length_mm,
        chain.speed_mm_s if speed_mm_s is None else speed_mm_s,
        chain.blend_mm,
        chain.stop,
        chain.wait_s,
        chain.acceleration_mm_s2,
        controller.k_s,
        in_view,
        controller.law == "averages",
        pieces=pieces,
        both_laws=both_laws,
    )


def motion_issues(
    chain: Chain, profile: Profile, free: Profile, cell: Cell, simplify_mm: float | None = None
) -> tuple[Issue, ...]:
    """Return findings on lost time: look-ahead on short moves, stops, and the difference of the two laws.

    ``profile`` is by both laws, ``free`` without the model of ``$ADVANCE``; ``simplify_mm`` the tolerance in
    which moves have been merged already. Notes; together above ``[limits] lost_time_share`` warnings.
    """
    issues: list[Issue] = []
    lost_whole_s = 0.0
    if cell.controller.advance != "unlimited" and len(chain.length_mm):
        lost_s = lost_whole_s = profile.total_s - free.total_s
        if lost_s > _WORTH_SAYING * profile.total_s:
            planned, ideal = (np.diff(p.move_end_s, prepend=0.0) for p in (profile, free))
            worst = int(np.argmax(planned - ideal))
            sentence = (
                f"moves too short for a look-ahead of {cell.controller.advance} cost {lost_s:.1f} s of "
                f"{profile.total_s:.1f} s, most at this line (unverified: how the controller plans ahead)"
            )
            first = f"--simplify {SIMPLIFY_MM:g}" if simplify_mm is None else "a larger --simplify"
            remedy = f"{first}, a larger chord tolerance, or longer moves from the CAM"
            issues.append(Issue("note", "short-moves", int(chain.source_line[worst]), sentence, remedy))
    stops_s = _lost_by_stops(chain, cell)
    lost_whole_s += float(stops_s.sum())
    issues += _stop_issues(chain, stops_s, profile)
    if lost_whole_s > cell.limits.lost_time_share * profile.total_s:
        issues = [replace(issue, severity="warning") for issue in issues]
    if "controller.law" in cell.defaults:  # who states it has identified it, or answers for it
        law = cell.controller.law
        other_law = "trapezoid" if law == "averages" else "averages"
        other_s = profile.by_other_law_s
        if abs(other_s - profile.total_s) > 0.05 * profile.total_s:
            sentence = f"time by law {law} {profile.total_s:.1f} s, by {other_law} {other_s:.1f} s"
            remedy = "`gcode2krl identify controller` writes the law of a trace into the cell"
            issues.append(Issue("note", "law-undecided", 0, sentence, remedy))
    return tuple(issues)


def _lost_by_stops(chain: Chain, cell: Cell) -> Floats:
    """Return the time in s that each exact stop between moves costs against passing, k + (v1 + v2)/(2·a)."""
    stops = np.flatnonzero(chain.stop[:-1])
    speed_mm_s = chain.speed_mm_s * chain.scale
    ramps = (speed_mm_s[stops] + speed_mm_s[stops + 1]) / (2.0 * cell.controller.acc_cp_m_s2 * MM_PER_M)
    return np.asarray(cell.controller.k_s + ramps + chain.wait_s[stops])


def _stop_issues(chain: Chain, lost: Floats, profile: Profile) -> list[Issue]:
    """Return the finding on the time of exact stops, dwells included."""
    if lost.sum() <= _WORTH_SAYING * profile.total_s:
        return []
    stops = np.flatnonzero(chain.stop[:-1])
    worst = int(stops[np.argmax(lost)])
    sentence = (
        f"{len(stops)} exact stops (rapid to feed, G61, dwells, M-codes) cost about {lost.sum():.1f} s of "
        f"{profile.total_s:.1f} s, most at this line"
    )
    remedy = "use fewer retracts, G64 instead of G61, shorter dwells"
    return [Issue("note", "exact-stops", int(chain.source_line[worst]), sentence, remedy)]


def _with_orientation(
    length: Floats, speed: Floats, from_rotation: Floats, to_rotation: Floats, cell: Cell
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return length, speed, acceleration and angle (n,) of moves, limited by ``$VEL.ORI`` and ``$ACC.ORI``.

    Position and orientation share one time law: an angle w over a length l limits the speed to
    ``$VEL.ORI``·l/w and the acceleration to ``$ACC.ORI``·l/w (assumption, the paper has no turns). A
    reorientation on the spot gets the length that takes as much time.
    """
    controller = cell.controller
    a_cp = np.broadcast_to(controller.acc_cp_m_s2 * MM_PER_M, len(length))
    if one_orientation(from_rotation, to_rotation):
        return length, speed, a_cp, np.broadcast_to(0.0, len(length))
    angle = fr.angle_between(from_rotation, to_rotation)
    turning = angle > 1e-12
    most_rad_s, most_rad_s2 = controller.vel_ori_deg_s * RAD_PER_DEG, controller.acc_ori_deg_s2 * RAD_PER_DEG
    on_spot = turning & (length < 1e-9)
    length = np.where(on_spot, angle * speed / most_rad_s, length)
    mm_per_rad = np.where(turning, length / np.where(turning, angle, 1.0), np.inf)
    a_ori = most_rad_s2 * mm_per_rad
    return (
        length,
        np.minimum(speed, most_rad_s * mm_per_rad),
        np.where(on_spot, a_ori, np.minimum(a_cp, a_ori)),
        angle,
    )


def _with_external(
    length: Floats, speed: Floats, acceleration: Floats, way: Floats, cell: Cell
) -> tuple[Floats, Floats, Floats]:
    """Return length, speed and acceleration (n,) of moves, limited by the external axes that go ways (n, 6).

    As with the orientation, position and external axes share one time law, along which E1 to E6 go evenly:
    a way e over a length l limits the speed to its largest speed times l/e, and the acceleration likewise
    (assumption). Where nothing but external axes moves, the length is the one that takes as much time.
    """
    most, most_2 = (most_of(cell.external, what) for what in ("speed", "acceleration"))
    times_s = (way / most).max(axis=1)  # 0 where no speed is stated
    moves = way.max(axis=1) > 0.0
    on_spot = moves & (length < 1e-9)
    length = np.where(on_spot, np.maximum(times_s, 1e-3) * speed, length)
    with np.errstate(divide="ignore", invalid="ignore"):  # 0/0 where nothing moves
        limited = np.where(moves, np.minimum(speed, length / times_s), speed)
        per_mm = np.where(moves, (way / most_2).max(axis=1) / np.where(moves, length, 1.0), 0.0)
        slower = np.where(moves, np.minimum(acceleration, 1.0 / per_mm), acceleration)
    return length, limited, slower


def _blends(start: Floats, end: Floats, size: Floats, length: Floats, cdis: Floats) -> tuple[Floats, Floats]:
    """Return (d, cos(alpha/2)) at the end of each move: d = min(CDIS, L1/2, L2/2), 0 at the last."""
    d, cos_half = np.zeros(len(size)), np.zeros(len(size))

    def part(first: int, behind: int) -> None:
        here, after = slice(first, behind), slice(first + 1, behind + 1)
        way = end[first : behind + 1] - start[first : behind + 1]
        product = size[here] * size[after]
        real = product > 0
        dot = np.einsum("ij,ij->i", way[:-1], way[1:])
        cos_turn = np.clip(dot / np.where(real, product, 1.0), -1.0, 1.0)
        cos_half[here] = np.where(real, np.sqrt((1.0 - cos_turn) / 2.0), 0.0)
        widest = np.minimum(cdis[here], np.minimum(length[here], length[after]) / 2)
        d[here] = np.where(real & (cos_turn > -1.0 + 1e-12), widest, 0.0)

    in_chunks(part, chunk_borders(max(len(size) - 1, 0)))
    return d, cos_half


def _goes_straight_on(d: Floats, cos_half: Floats) -> Bools:
    """Mark the vertices (n,) that are not corners: they are off by less than the last decimal of the text.

    So a tangent remains one when its points are rounded to the decimals of the text.
    """
    near = (cos_half < _NEARLY_STRAIGHT_COS) & (d * cos_half / 2.0 < _WRITTEN_MM / 2.0)
    return np.asarray((cos_half < _STRAIGHT_COS) | near)


def _scales(
    length: Floats,
    speed: Floats,
    acceleration: Floats,
    blend: Floats,
    cdis: Floats,
    stop: Bools,
    cell: Cell,
    changes: Changes,
) -> Floats:
    """Return the unit of length of each move; ``blend`` gets the distances in these units.

    One number stands for all where it is 1.

    A corner makes a change of speed where |v2 - v1|/a + k <= T, its duration (our assumption, the paper does
    not say), and where the look-ahead lets the faster of the two be reached. Other assumptions are that no
    corner does (``changes`` = "never"), or each that may ("always").
    """
    if changes == "never":
        return np.broadcast_to(1.0, len(length))
    rows = _changing_corners(length, speed, acceleration, blend, cdis, stop, cell, changes == "always")
    a, k = np.minimum(acceleration[rows], acceleration[rows + 1]), cell.controller.k_s
    fastest = np.maximum(speed[rows], speed[rows + 1])
    rows = rows[fastest * (fastest / a + k) / 2 <= _in_view(length, rows, cell)]
    if not len(rows):
        return np.broadcast_to(1.0, len(length))
    scale = np.ones(len(length))
    ratio = speed[rows + 1] / speed[rows]
    blend[rows] = _widest(length, ratio, cdis, rows)
    scale[rows + 1] = ratio
    ends = np.append(np.flatnonzero(stop), len(length) - 1)
    chain_end = ends[np.searchsorted(ends, rows + 1)]
    for last in distinct(chain_end):
        moves = slice(rows[chain_end == last][0] + 1, last + 1)
        scale[moves] = np.cumprod(scale[moves])
    blend[:-1] /= scale[:-1]
    return scale


def _changing_corners(
    length: Floats,
    speed: Floats,
    acceleration: Floats,
    blend: Floats,
    cdis: Floats,
    stop: Bools,
    cell: Cell,
    every: bool,
) -> Ints:
    """Return the moves that end in a corner between unequal speeds, long enough for it or ``every`` one."""

    def part(first: int, behind: int) -> Ints:
        here = slice(first, behind)
        changing = (blend[here] > 0) & ~stop[here] & (speed[here] != speed[first + 1 : behind + 1])
        rows = np.flatnonzero(changing) + first
        if every:
            return rows
        v1, v2 = speed[rows], speed[rows + 1]
        widest = _widest(length, v2 / v1, cdis, rows)
        a = np.minimum(acceleration[rows], acceleration[rows + 1])
        return rows[np.abs(v2 - v1) / a + cell.controller.k_s <= 2.0 * widest / v1]

    return np.concatenate(
        in_chunks(part, chunk_borders(max(len(length) - 1, 0))) or [np.zeros(0, dtype=np.int64)]
    )


def _widest(length: Floats, ratio: Floats, cdis: Floats, rows: Ints) -> Floats:
    """Return the distance before the corners at the ends of some moves whose speeds have this ratio."""
    lines = np.minimum(length[rows], length[rows + 1] / ratio) / 2
    return np.minimum(cdis[rows] / np.maximum(1.0, ratio), lines)


def _in_view(length: Floats, rows: Ints, cell: Cell) -> Floats:
    """Return the length of the moves after the corners of some moves, as far as the look-ahead sees."""
    way = np.concatenate([[0.0], np.cumsum(length)]) if len(rows) else np.zeros(1)
    advance = cell.controller.advance
    seen = len(length) if advance == "unlimited" else rows + 1 + advance
    return way[np.minimum(seen, len(way) - 1)] - way[np.minimum(rows + 1, len(way) - 1)]


def one_orientation(from_rotation: Floats, to_rotation: Floats) -> bool:
    """Tell whether the tool never turns."""

    def same(start: int, end: int) -> bool:
        first = to_rotation[0]
        return bool((to_rotation[start:end] == first).all() and (from_rotation[start:end] == first).all())

    return all(in_chunks(same, chunk_borders(len(to_rotation))))


def with_speed(chain: Chain, speed_mm_s: Floats) -> Chain:
    """Return the chain with other speeds (n,)."""
    return replace(chain, speed_mm_s=speed_mm_s)
