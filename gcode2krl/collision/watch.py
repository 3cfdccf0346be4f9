"""The watch over everything that a program does: its samples, and the ways between."""

import itertools
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
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
    surroundings_of,
)
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


class Watch:
    """Whether arm, spindle and tool hit anything; see `collision.along` for what "along" means."""

    def __init__(self, cell: Cell, read_mesh: ReadMesh, *, tells: bool = False) -> None:
        """Take the cell and what reads a mesh file; ``tells`` where every row's clearance is asked for."""
        self._cell, self._read_mesh = cell, read_mesh
        self._geometry = cell.robot.geometry.array()
        self._settings: dict[int, _Setting] = {}
        self._of_ways: dict[tuple[int, bool, bool], _Setting] = {}
        self._contacts = Contacts(cell.collision.clearance_mm, only_hits=STOCK, only_near=CABLES)
        self._horizon_mm = HORIZON_MM if tells else 0.0
        self._way: Way | None = None
        self._tool = -1
        self.links: list[str] = []
        """Names of what may hit, as far as tools have come up."""
        self.obstacles: list[str] = []
        self._last: Floats = np.zeros((0, 6))

    @cached_property
    def _around(self) -> Surroundings:
        return surroundings_of(self._cell, self._read_mesh)

    @cached_property
    def _to_base(self) -> Floats:
        return fr.invert(self._cell.base_matrix())

    def samples(self, q_rad: Floats, tool: Ints32, line: Ints32) -> tuple[Floats, Ints32]:
        """Go on along the samples of a Motion: angles (n, 6) in rad, tools (n,) and lines (n,).

        Returns the clearance (n,) in mm, and who is near what (n, 2): places in `links` and `obstacles`, -1
        where nothing is. Both are of use only where the watch ``tells``.
        """
        gap, near = np.full(len(q_rad), np.nan), np.full((len(q_rad), 2), -1, dtype=np.int32)
        borders = [0, *(np.flatnonzero(np.diff(tool)) + 1).tolist(), len(tool)]
        for start, end in itertools.pairwise(borders):
            if start == end:
                continue
            rows, number = slice(start, end), int(tool[start])
            setting = self._held(number, against_raw=False, is_ptp=False)
            q, lines, skip = q_rad[rows], line[rows], 0
            if self._way is None or number != self._tool:
                self._way, self._tool = self._new_way(setting, is_sampled=True), number
                skip = len(self._last)  # the new tool's way begins where the old one's ended
                q, lines = np.concatenate([self._last, q]), np.concatenate([lines[:skip], lines])
            found = self._way.take(q)
            self._contacts.take(found, setting.names, lines, self._to_base)
            gap[rows], near[rows] = found.gap_mm[skip:], setting.places[found.pair[skip:]]
            self._last = q[-1:].copy()
        return gap, near

    def way(
        self, q_rad: Floats, tool: int, line: int, words: str, *, is_ptp: bool, against_raw: bool = False
    ) -> Clearances:
        """Go along a way of its own, angles (n, 6) in rad; ``words`` say which, `` on the way to HOME``.

        It is held ``against_raw`` where nothing has been cut yet: against the raw part, where that is stated.
        """
        setting = self._held(tool, against_raw=against_raw, is_ptp=is_ptp)
        found = self._new_way(setting, is_sampled=not is_ptp).take(q_rad)
        lines = np.full(len(q_rad), line, dtype=np.int32)
        self._contacts.take(found, setting.names, lines, self._to_base, words)
        return found

    def poses(self, q_rad: Floats, tool: int, horizon_mm: float) -> Floats:
        """Return the least distance (n,) at single poses, angles (n, 6) in rad, at most the horizon.

        Of what is round about the tool axis, cutter and holder, only the distance to the arm itself counts.
        """
        whole = self._held(tool, against_raw=False, is_ptp=False)
        kinds = [whole.parts[pair[0]].kind for pair in whole.pairs]
        setting = whole.only(
            [pair[1] < 0 or kind in ("arm", "spindle") for pair, kind in zip(whole.pairs, kinds, strict=True)]
        )
        way = Way(
            setting.bodies,
            self._around.shapes,
            setting.pairs,
            self._geometry,
            near_mm=self._cell.collision.clearance_mm,
            horizon_mm=horizon_mm,
            is_sampled=False,
        )
        apart = np.full((2 * len(q_rad), 6), np.nan)  # behind a row of NaN another way begins
        apart[::2] = q_rad
        gap_mm: Floats = way.take(apart).gap_mm[::2]
        return gap_mm

    def advise(self, line: int, words: str, remedy: str) -> None:
        """Say what helps against the collisions on a way."""
        self._contacts.advise(line, words, remedy)

    def issues(self) -> tuple[Issue, ...]:
        """Return what was found so far, `collision` and `near`."""
        return tuple(self._contacts.issues())

    def _new_way(self, setting: _Setting, *, is_sampled: bool) -> Way:
        return Way(
            setting.bodies,
            self._around.shapes,
            setting.pairs,
            self._geometry,
            near_mm=self._cell.collision.clearance_mm,
            horizon_mm=self._horizon_mm,
            is_sampled=is_sampled,
        )

    def _held(self, tool: int, *, against_raw: bool, is_ptp: bool) -> _Setting:
        key = (tool, against_raw, is_ptp)
        if key not in self._of_ways:
            whole, names = self._setting(tool), self._around.names
            held = [
                is_held(pair, whole.parts, names, against_raw=against_raw, is_ptp=is_ptp)
                for pair in whole.pairs
            ]
            self._of_ways[key] = whole.only(held)
        return self._of_ways[key]

    def _setting(self, tool: int) -> _Setting:
        if tool not in self._settings:
            parts = parts_of(self._cell, tool)
            pairs = pairs_of(parts, self._around.names)
            names = [
                (parts[a].name, self._around.names[o] if o >= 0 else parts[b].name + ITSELF)
                for a, o, b in pairs
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
