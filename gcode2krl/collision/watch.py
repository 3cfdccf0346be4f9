"""The watch over everything that a program does: its samples, and the ways between."""

import itertools
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Bools, Floats, Ints32
from gcode2krl.cell import Cell, carriers
from gcode2krl.cell.carried import standing
from gcode2krl.cell.sections.external import EXTERNAL_NAMES
from gcode2krl.collision.along import Clearances, Way
from gcode2krl.collision.bodies import CABLES, Part, capsules_of, parts_of
from gcode2krl.collision.contacts import Contacts
from gcode2krl.collision.scene import Bodies
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
from gcode2krl.collision.turning import Turning
from gcode2krl.errors import Issue

HORIZON_MM = 50.0
"""Clearances are told up to here; what is farther away costs less, and nobody acts on it."""
ITSELF = " of the arm itself"


class _Setting(NamedTuple):
    """What is watched with a tool in the spindle."""

    parts: list[Part]
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
            found = self._way.take(q, self._shift_mm(at))
            self._contacts.take(found, setting.names, lines, stand.to_base)
            gap[rows], near[rows] = found.gap_mm[skip:], setting.places[found.pair[skip:]]
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
        found = self._new_way(setting, stand, is_sampled=not is_ptp).take(q_rad, self._shift_mm(external))
        lines = np.full(len(q_rad), line, dtype=np.int32)
        self._contacts.take(found, setting.names, lines, stand.to_base, words)
        if not turns:
            return found
        carried = self._carried(tool, against_raw=against_raw, is_ptp=is_ptp)
        seen = self._turn(carried).take(q_rad, external)
        self._contacts.take(seen, carried.names, lines, self._rest_to_base, words)
        return seen if seen.hits else found

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
        found = self._turn(carried).take(q, at)
        all_lines = np.concatenate([lines[:skip], lines])
        self._contacts.take(found, carried.names, all_lines, self._rest_to_base)
        return replace(found, gap_mm=found.gap_mm[skip:], pair=found.pair[skip:])

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
