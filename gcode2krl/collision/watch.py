"""The watch over everything that a program does: its samples, and the ways between."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell import Cell, carriers
from gcode2krl.cell.carried import standing, to_rest
from gcode2krl.cell.carriers import rails_of, tables_of
from gcode2krl.cell.sections.external import EXTERNAL_NAMES
from gcode2krl.collision.along import Clearances, Way
from gcode2krl.collision.bodies import CABLES, Capsule, capsules_of, parts_of
from gcode2krl.collision.contacts import Contacts
from gcode2krl.collision.gaps import obstacle_gaps, placed
from gcode2krl.collision.scene import Bodies, Obstacles
from gcode2krl.collision.surroundings import (
    STOCK,
    Pair,
    ReadMesh,
    Surroundings,
    is_held,
    pairs_of,
    root_of,
    surroundings_of,
)
from gcode2krl.errors import Issue
from gcode2krl.units import RAD_PER_DEG

# What a table carries while it turns, against arm, spindle and tool.
#
# Everything is seen from the table, which then stands still while the robot goes round it. Looked at is one
# row after the other, as far apart as no body can have used up its gap on the way: a body end goes no
# farther than the turns of the joints times their levers, plus those of the tables times its distance from
# their axes, plus the way of the rails. Where a row cannot be told from the next, the way between them is
# gone in steps of the gap that is left (conservative advancement), joints and external axes evenly.

_WINDOW_ROWS = 48
_TOUCHES_MM = 0.01
_MOST_STEPS = 400
"""Between two rows; what is not decided by then counts as touching."""


class Turning:
    """Pairs of bodies and carried obstacles along rows in which tables turn."""

    def __init__(
        self,
        cell: Cell,
        bodies: Bodies,
        shapes: Obstacles,
        pairs: Sequence[Pair],
        *,
        near_mm: float,
        horizon_mm: float,
    ) -> None:
        """Take the pairs (body, obstacle, _), and up to which gap they are noted and told."""
        self._cell, self._bodies = cell, bodies
        self._near_mm, self._told_mm = near_mm, max(horizon_mm, near_mm)
        self._geometry = cell.robot.geometry.array()
        self._base = cell.base_matrix()
        self._pairs = np.array(pairs, dtype=np.int64).reshape(-1, 3)
        body, obstacle = self._pairs[:, 0], self._pairs[:, 1]
        self._radius_mm = bodies.radius_mm[body]
        rows = [(int(number), np.flatnonzero(obstacle == number)) for number in np.unique(obstacle)]
        self._shapes = [(_single(shapes, number), own, body[own]) for number, own in rows]
        tables = tables_of(cell.external, cell.frames.base_on)
        self._tables = [EXTERNAL_NAMES.index(name) for name in tables]
        self._rails = [EXTERNAL_NAMES.index(name) for name in rails_of(cell.external)]
        lengths = [float(np.linalg.norm(cell.external[name].origin_matrix()[:3, 3])) for name in tables]
        to_base = float(np.linalg.norm(cell.stated_base()[:3, 3]))
        self._from_axis_mm = np.array([sum(lengths[k + 1 :]) + to_base for k in range(len(tables))])

    def take(self, q_rad: Floats, external: Floats) -> Clearances:
        """Return what rows of angles in rad and E1 to E6 (n, 6) bring; behind one of NaN another way begins.

        Of a pair that comes near only between two rows the least gap is that of the steps between.
        """
        nearest = _Found(
            self._near_mm, np.full(len(q_rad), self._told_mm), np.full(len(q_rad), -1, dtype=np.int32)
        )
        known = np.isfinite(q_rad).all(axis=1)
        nearest.gap_mm[~known] = np.nan
        borders = np.flatnonzero(np.diff(known, prepend=False, append=False))
        if len(self._pairs):
            for start, end in zip(borders[::2].tolist(), borders[1::2].tolist(), strict=True):
                self._along(q_rad[start:end], external[start:end], start, nearest)
        return nearest.clearances()

    def apart(self, q_rad: Floats, external: Floats) -> Floats:
        """Return the least gap (n,) at single rows of angles in rad and E1 to E6 (n, 6)."""
        ends, _ = self._seen(q_rad, external)
        least = np.full(len(ends), np.inf)
        for shape, rows, body in self._shapes:
            gaps, _ = obstacle_gaps(ends[:, body].reshape(-1, 6), 0.0, shape)
            least = np.minimum(least, (gaps.reshape(len(ends), -1) - self._radius_mm[rows]).min(axis=1))
        return least

    def _along(self, q_rad: Floats, external: Floats, first: int, nearest: "_Found") -> None:
        """Go along rows without a break, of which the first has this number."""
        arm, table, farther = self._gone(q_rad, external)
        ends, away = self._seen(q_rad, external)
        row, (gaps, places) = 0, self._gaps(ends[0])
        nearest.tell(first, gaps, places)
        while row < len(q_rad) - 1:
            room = self._room(gaps)
            rows = slice(row + 1, row + 1 + _WINDOW_ROWS)
            around = away[row] + np.where(np.isfinite(room), np.maximum(room, 0.0), 0.0)
            used = arm[rows] - arm[row] + (farther[rows] - farther[row])[:, None]
            used = used + (table[rows] - table[row])[:, None] * around
            late = (used >= room).any(axis=1)
            passed = int(np.argmax(late)) if late.any() else len(late)
            if passed == 0:
                both = slice(row, row + 2)
                least, where = self._between(q_rad[both], external[both], gaps, places, used[0])
                nearest.tell(first + row + 1, least, where)
            row += max(passed, 1)
            gaps, places = self._gaps(ends[row])

    def _gone(self, q_rad: Floats, external: Floats) -> tuple[Floats, Floats, Floats]:
        """Return how far each body has gone up to each row.

        By the joints (n, b) in mm, by the tables (n,) in rad, and (n,) in mm by rails, and by the tables for
        what ``$BASE`` is away from their axes.
        """
        step = np.abs(np.diff(q_rad, axis=0, prepend=q_rad[:1]))
        bent = np.zeros_like(step)
        # a sample may be off the way of the joints
        bent[2:] = np.abs(q_rad[2:] - 2.0 * q_rad[1:-1] + q_rad[:-2])
        arm = np.cumsum((step + 0.125 * bent) @ self._bodies.lever_mm.T, axis=0)
        moved = np.abs(np.diff(external, axis=0, prepend=external[:1]))
        turned = moved[:, self._tables] * RAD_PER_DEG
        farther = turned @ self._from_axis_mm + moved[:, self._rails].sum(axis=1)
        return arm, np.cumsum(turned.sum(axis=1)), np.cumsum(farther)

    def _seen(self, q_rad: Floats, external: Floats) -> tuple[Floats, Floats]:
        """Return where the ends of bodies are seen from the tables, and how far they are from ``$BASE``.

        The ends (n, b, 6) in the root, tables and rails at rest; the distances (n, b).
        """
        ends = placed(q_rad, self._geometry, self._bodies)
        by, to_base = to_rest(external, self._cell), fr.invert(self._base)
        seen = (to_base if by is None else fr.invert(by) @ to_base).reshape(-1, 4, 4)
        points = ends.reshape(len(q_rad), -1, 3)
        in_base = points @ seen[:, :3, :3].transpose(0, 2, 1) + seen[:, None, :3, 3]
        at_rest = in_base @ self._base[:3, :3].T + self._base[:3, 3]
        away = np.sqrt((in_base**2).sum(axis=2)).reshape(len(q_rad), -1, 2).max(axis=2)
        return at_rest.reshape(ends.shape), away

    def _gaps(self, ends_mm: Floats) -> tuple[Floats, Floats]:
        """Return gaps (p,) and places (p, 3) of bodies with these ends (b, 6)."""
        gaps, places = np.empty(len(self._pairs)), np.empty((len(self._pairs), 3))
        for shape, rows, body in self._shapes:
            gaps[rows], places[rows] = obstacle_gaps(ends_mm[body], 0.0, shape)
        return gaps - self._radius_mm, places

    def _room(self, gaps: Floats) -> Floats:
        """Return how far each body (b,) may go before one of its pairs has to be told."""
        room = np.full(len(self._bodies.radius_mm), np.inf)
        np.minimum.at(room, self._pairs[:, 0], gaps - self._told_mm)
        return room

    def _between(
        self, q_rad: Floats, external: Floats, gaps: Floats, places: Floats, used: Floats
    ) -> tuple[Floats, Floats]:
        """Return the least gaps (p,) between two rows and their places (p, 3), from those at the first on.

        ``used`` (b,) is how far each body goes between them at most.
        """
        least, where, share = gaps.copy(), places.copy(), 0.0
        per_pair = np.maximum(used[self._pairs[:, 0]], 1e-9)
        for _ in range(_MOST_STEPS):
            if share >= 1.0 or least.min() <= _TOUCHES_MM:
                break
            share = min(1.0, share + float((np.maximum(gaps, _TOUCHES_MM) / per_pair).min()))
            at = q_rad[:1] + share * np.diff(q_rad, axis=0), external[:1] + share * np.diff(external, axis=0)
            gaps, places = self._gaps(self._seen(*at)[0][0])
            nearer = gaps < least
            least, where = np.where(nearer, gaps, least), np.where(nearer[:, None], places, where)
        touches = (least <= _TOUCHES_MM) | ((share < 1.0) & (least == least.min()))
        return np.where(touches, np.minimum(least, 0.0), least), where


@dataclass
class _Found:
    """What has been told of rows (n)."""

    near_mm: float
    gap_mm: Floats
    pair: Ints32
    notes: list[tuple[int, int, float, Floats]] = field(default_factory=list)

    def tell(self, row: int, gaps: Floats, places: Floats) -> None:
        """Note the pairs that are near, and the nearest of them."""
        nearest = int(np.argmin(gaps))
        if gaps[nearest] >= self.gap_mm[row]:
            return
        for number in np.flatnonzero(gaps < self.near_mm).tolist():
            self.notes.append((row, number, float(gaps[number]), places[number]))
        self.gap_mm[row], self.pair[row] = gaps[nearest], nearest

    def clearances(self) -> Clearances:
        """Return it as what other ways return."""
        return Clearances(
            self.gap_mm,
            self.pair,
            np.array([row for row, *_ in self.notes], dtype=np.int64),
            np.array([number for _, number, *_ in self.notes], dtype=np.int64),
            np.array([gap for *_, gap, _ in self.notes]),
            np.array([place for *_, place in self.notes]).reshape(-1, 3),
        )


def _single(shapes: Obstacles, number: int) -> Obstacles:
    """Return one obstacle of several, with the triangles of all."""
    row = slice(number, number + 1)
    return shapes._replace(kind=shapes.kind[row], numbers=shapes.numbers[row], tree=shapes.tree[row])


HORIZON_MM = 50.0
"""Clearances are told up to here; what is farther away costs less, and nobody acts on it."""
ITSELF = " of the arm itself"


class _Setting(NamedTuple):
    """What is watched with a tool in the spindle."""

    parts: list[Capsule]
    bodies: Bodies
    pairs: list[Pair]
    names: list[tuple[str, str]]
    places: Ints32
    """(p + 1, 2) of each pair the places of its names in `Watch.links` and `Watch.obstacles`, then -1, -1."""

    def only(self, held: list[bool]) -> "_Setting":
        """Return the setting with those pairs alone."""
        rows = [row for row, is_held in enumerate(held) if is_held]
        pairs, names = [self.pairs[row] for row in rows], [self.names[row] for row in rows]
        return self._replace(pairs=pairs, names=names, places=self.places[[*rows, -1]])

    def not_round(self) -> "_Setting":
        """Return the setting without what cutter and holder may hit, but for the arm itself."""
        return self.only([p[1] < 0 or self.parts[p[0]].kind in ("arm", "spindle") for p in self.pairs])


class _Stand(NamedTuple):
    """What stands around the robot root at rest, and what takes its places to ``$BASE``."""

    around: Surroundings
    to_base: Floats


class Watch:
    """Whether arm, spindle and tool hit anything; see `collision.along` for what "along" means."""

    def __init__(self, cell: Cell, read_mesh: ReadMesh, *, tells: bool = False) -> None:
        """Take the cell and what reads a mesh file; ``tells`` where every row's clearance is asked for."""
        self._cell, self._read_mesh = cell, read_mesh
        self._geometry = cell.robot.geometry.array()
        self._settings: dict[int, _Setting] = {}
        self._of_ways: dict[tuple[int, bool, bool, bool], _Setting] = {}
        self._stands: dict[bytes, _Stand] = {}
        self._contacts = Contacts(cell.collision.clearance_mm, only_hits=STOCK, only_near=CABLES)
        self._horizon_mm = HORIZON_MM if tells else 0.0
        self._way: Way | None = None
        self._where = (-1, b"")
        self.links: list[str] = []
        """Names of what may hit, as far as tools have come up."""
        self.obstacles: list[str] = []
        self._last: tuple[Floats, Floats] = (np.zeros((0, 6)), np.zeros((0, 6)))
        at_rest = cell.external_rest()
        self._from_rest = fr.invert(root_of(cell, at_rest))
        self._rest_to_base = fr.invert(cell.base_matrix()) if cell.external else np.eye(4)
        tables = carriers.tables_of(cell.external, cell.frames.base_on)
        self._table_columns = [EXTERNAL_NAMES.index(name) for name in tables]

    def _stand(self, external: Floats) -> "_Stand":
        """Return what stands around while the tables are where E1 to E6 (6,) say."""
        key = external[self._table_columns].tobytes()
        if key not in self._stands:
            at = self._cell.external_rest()
            at[self._table_columns] = external[self._table_columns]
            cell = standing(self._cell, at)
            around = surroundings_of(cell, self._read_mesh)
            self._stands[key] = _Stand(around, fr.invert(cell.base_matrix()))
        return self._stands[key]

    def _shift_mm(self, external: Floats) -> Floats:
        """Return how far rails have taken the robot root (n, 3) with E1 to E6 at (n, 6), along its axes."""
        if external.strides[0] == 0 or not self._cell.external:
            external = external[:1]
        robroot = self._cell.frames.robroot
        root = np.eye(4) if robroot is None else robroot.matrix()
        moved = self._from_rest @ carriers.root_in_world(self._cell.external, external, root)
        shift: Floats = np.ascontiguousarray(moved[:, :3, 3])
        return shift

    def samples(
        self, q_rad: Floats, tool: Ints32, line: Ints32, external: Floats | None = None
    ) -> tuple[Floats, Ints32]:
        """Go on along the samples of a Motion: angles (n, 6) in rad, tools (n,), lines (n,), E1 to E6 (n, 6).

        Returns the clearance (n,) in mm, and who is near what (n, 2): places in `links` and `obstacles`, -1
        where nothing is. Both are of use only where the watch ``tells``.
        """
        gap, near = np.full(len(q_rad), np.nan), np.full((len(q_rad), 2), -1, dtype=np.int32)
        if external is None:
            external = np.broadcast_to(self._cell.external_rest(), (len(q_rad), 6))
        turns = self._turning(external)
        changes = (tool[1:] != tool[:-1]) | (turns[1:] != turns[:-1])
        borders = [0, *(np.flatnonzero(changes) + 1).tolist(), len(tool)]
        for start, end in itertools.pairwise(borders):
            if start == end:
                continue
            rows, number, is_turning = slice(start, end), int(tool[start]), bool(turns[start])
            stand = self._stand(external[start])
            setting = self._held(number, against_raw=False, is_ptp=False, turns=is_turning)
            q, at, lines, skip = q_rad[rows], external[rows], line[rows], 0
            where = number, b"turns" if is_turning else external[start, self._table_columns].tobytes()
            if self._way is None or where != self._where:
                self._way, self._where = self._new_way(setting, stand, is_sampled=True), where
                skip = len(self._last[0])  # the new way begins where the old one ended
                q, at = (np.concatenate(pair) for pair in zip(self._last, (q, at), strict=True))
                lines = np.concatenate([lines[:skip], lines])
            clearance = self._way.take(q, self._shift_mm(at))
            self._contacts.take(clearance, setting.names, lines, stand.to_base)
            gap[rows], near[rows] = clearance.gap_mm[skip:], setting.places[clearance.pair[skip:]]
            if is_turning:
                carried = self._carried(number, against_raw=False, is_ptp=False)
                seen = self._take_turning(carried, q_rad, external, lines[skip:], slice(start, end))
                nearer = seen.gap_mm < gap[rows]
                gap[rows] = np.where(nearer, seen.gap_mm, gap[rows])
                near[rows] = np.where(nearer[:, None], carried.places[seen.pair], near[rows])
            self._last = q[-1:].copy(), at[-1:].copy()
        return gap, near

    def _turning(self, external: Floats) -> Bools:
        """Mark the rows (n,) into which a table turns."""
        if not self._table_columns or (external.strides[0] == 0 and not len(self._last[1])):
            return np.zeros(len(external), dtype=np.bool_)
        before = np.concatenate([self._last[1] if len(self._last[1]) else external[:1], external[:-1]])
        columns = self._table_columns
        turns: Bools = (external[:, columns] != before[:, columns]).any(axis=1)
        return turns

    def way(
        self,
        q_rad: Floats,
        tool: int,
        line: int,
        words: str,
        *,
        is_ptp: bool,
        against_raw: bool = False,
        external: Floats | None = None,
    ) -> Clearances:
        """Go along a way of its own, angles (n, 6) in rad; ``words`` say which, `` on the way to HOME``.

        ``external`` (n, 6) is where E1 to E6 are, at rest by default.

        It is held ``against_raw`` where nothing has been cut yet: against the raw part, where that is stated.
        """
        if external is None:
            external = np.broadcast_to(self._cell.external_rest(), (len(q_rad), 6))
        columns, stand = self._table_columns, self._stand(external[-1])
        turns = bool((external[:, columns] != external[-1, columns]).any())
        setting = self._held(tool, against_raw=against_raw, is_ptp=is_ptp, turns=turns)
        clearance = self._new_way(setting, stand, is_sampled=not is_ptp).take(q_rad, self._shift_mm(external))
        lines = np.full(len(q_rad), line, dtype=np.int32)
        self._contacts.take(clearance, setting.names, lines, stand.to_base, words)
        if not turns:
            return clearance
        carried = self._carried(tool, against_raw=against_raw, is_ptp=is_ptp)
        seen = self._turn(carried).take(q_rad, external)
        self._contacts.take(seen, carried.names, lines, self._rest_to_base, words)
        return seen if seen.hits else clearance

    def _take_turning(
        self, carried: "_Setting", q_rad: Floats, external: Floats, lines: Ints32, rows: slice
    ) -> Clearances:
        """Go along rows in which tables turn, from the row before them on, and note what is near."""
        before = (
            (each[-1:] for each in self._last)
            if rows.start == 0
            else (each[rows.start - 1 : rows.start] for each in (q_rad, external))
        )
        q, at = (np.concatenate([b, each[rows]]) for b, each in zip(before, (q_rad, external), strict=True))
        skip = len(q) - len(lines)
        clearance = self._turn(carried).take(q, at)
        all_lines = np.concatenate([lines[:skip], lines])
        self._contacts.take(clearance, carried.names, all_lines, self._rest_to_base)
        return replace(clearance, gap_mm=clearance.gap_mm[skip:], pair=clearance.pair[skip:])

    def _turn(self, carried: "_Setting") -> Turning:
        shapes = self._stand(self._cell.external_rest()).around.shapes
        return Turning(
            self._cell,
            carried.bodies,
            shapes,
            carried.pairs,
            near_mm=self._cell.collision.clearance_mm,
            horizon_mm=self._horizon_mm,
        )

    def _carried(self, tool: int, *, against_raw: bool, is_ptp: bool) -> "_Setting":
        """Return the setting with what a table carries alone."""
        whole, around = self._setting(tool), self._stand(self._cell.external_rest()).around
        return whole.only(
            [
                pair[1] >= 0
                and around.names[pair[1]] in around.carried
                and is_held(pair, whole.parts, around, against_raw=against_raw, is_ptp=is_ptp)
                for pair in whole.pairs
            ]
        )

    def poses(self, q_rad: Floats, tool: int, horizon_mm: float, external: Floats | None = None) -> Floats:
        """Return the least distance (n,) at single poses, angles (n, 6) in rad, at most the horizon.

        ``external`` (n, 6) is where E1 to E6 are, at rest by default. Of what is round about the tool axis,
        cutter and holder, only the distance to the arm itself counts.
        """
        if external is None:
            external = np.broadcast_to(self._cell.external_rest(), (len(q_rad), 6))
        if not len(q_rad):
            return np.zeros(0)
        columns = self._table_columns
        turns = bool((external[:, columns] != external[-1, columns]).any())
        setting = self._held(tool, against_raw=False, is_ptp=False, turns=turns).not_round()
        way = Way(
            setting.bodies,
            self._stand(external[-1]).around.shapes,
            setting.pairs,
            self._geometry,
            near_mm=self._cell.collision.clearance_mm,
            horizon_mm=horizon_mm,
            is_sampled=False,
        )
        single = np.full((2 * len(q_rad), 6), np.nan)  # behind a row of NaN another way begins
        single[::2] = q_rad
        shift_mm = np.repeat(np.broadcast_to(self._shift_mm(external), (len(q_rad), 3)), 2, axis=0)
        gap_mm: Floats = way.take(single, shift_mm).gap_mm[::2]
        if not turns:
            return gap_mm
        carried = self._carried(tool, against_raw=False, is_ptp=False).not_round()
        return np.minimum(gap_mm, self._turn(carried).apart(q_rad, external))

    def advise(self, line: int, words: str, remedy: str) -> None:
        """Say what helps against the collisions on a way."""
        self._contacts.advise(line, words, remedy)

    def issues(self) -> tuple[Issue, ...]:
        """Return what was found so far, `collision` and `near`."""
        return tuple(self._contacts.issues())

    def _new_way(self, setting: _Setting, stand: "_Stand", *, is_sampled: bool) -> Way:
        return Way(
            setting.bodies,
            stand.around.shapes,
            setting.pairs,
            self._geometry,
            near_mm=self._cell.collision.clearance_mm,
            horizon_mm=self._horizon_mm,
            is_sampled=is_sampled,
        )

    def _held(self, tool: int, *, against_raw: bool, is_ptp: bool, turns: bool = False) -> _Setting:
        key = (tool, against_raw, is_ptp, turns)
        if key not in self._of_ways:
            whole, around = self._setting(tool), self._stand(self._cell.external_rest()).around
            held = [
                is_held(pair, whole.parts, around, against_raw=against_raw, is_ptp=is_ptp, turns=turns)
                for pair in whole.pairs
            ]
            self._of_ways[key] = whole.only(held)
        return self._of_ways[key]

    def _setting(self, tool: int) -> _Setting:
        if tool not in self._settings:
            parts = parts_of(self._cell, tool)
            around = self._stand(self._cell.external_rest()).around
            pairs = pairs_of(parts, around.names)
            names = [
                (parts[a].name, around.names[o] if o >= 0 else parts[b].name + ITSELF) for a, o, b in pairs
            ]
            places = [(_place(who, self.links), _place(what, self.obstacles)) for who, what in names]
            numbers = np.array([*places, (-1, -1)], dtype=np.int32)
            self._settings[tool] = _Setting(parts, capsules_of(parts, self._geometry), pairs, names, numbers)
        return self._settings[tool]


def _place(name: str, names: list[str]) -> int:
    """Return the place of a name, which is added where it is new."""
    if name not in names:
        names.append(name)
    return names.index(name)
