"""What a table carries while it turns, against arm, spindle and tool.

Everything is seen from the table, which then stands still while the robot goes round it. Looked at is one row
after the other, as far apart as no body can have used up its gap on the way: a body end goes no farther than
the turns of the joints times their levers, plus those of the tables times its distance from their axes, plus
the way of the rails. Where a row cannot be told from the next, the way between them is gone in steps of the
gap that is left (conservative advancement), joints and external axes evenly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import to_rest
from gcode2krl.cell.carriers import rails_of, tables_of
from gcode2krl.cell.sections.external import EXTERNAL_NAMES
from gcode2krl.collision.along import Clearances
from gcode2krl.collision.gaps import obstacle_gaps, placed
from gcode2krl.collision.scene import Bodies, Obstacles
from gcode2krl.collision.surroundings import Pair
from gcode2krl.units import RAD_PER_DEG

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
        found = _Found(
            self._near_mm, np.full(len(q_rad), self._told_mm), np.full(len(q_rad), -1, dtype=np.int32)
        )
        known = np.isfinite(q_rad).all(axis=1)
        found.gap_mm[~known] = np.nan
        borders = np.flatnonzero(np.diff(known, prepend=False, append=False))
        if len(self._pairs):
            for start, end in zip(borders[::2].tolist(), borders[1::2].tolist(), strict=True):
                self._along(q_rad[start:end], external[start:end], start, found)
        return found.clearances()

    def apart(self, q_rad: Floats, external: Floats) -> Floats:
        """Return the least gap (n,) at single rows of angles in rad and E1 to E6 (n, 6)."""
        ends, _ = self._seen(q_rad, external)
        least = np.full(len(ends), np.inf)
        for shape, rows, body in self._shapes:
            gaps, _ = obstacle_gaps(ends[:, body].reshape(-1, 6), 0.0, shape)
            least = np.minimum(least, (gaps.reshape(len(ends), -1) - self._radius_mm[rows]).min(axis=1))
        return least

    def _along(self, q_rad: Floats, external: Floats, first: int, found: "_Found") -> None:
        """Go along rows without a break, of which the first has this number."""
        arm, table, farther = self._gone(q_rad, external)
        ends, away = self._seen(q_rad, external)
        row, (gaps, places) = 0, self._gaps(ends[0])
        found.tell(first, gaps, places)
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
                found.tell(first + row + 1, least, where)
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
    own = slice(number, number + 1)
    return shapes._replace(kind=shapes.kind[own], numbers=shapes.numbers[own], tree=shapes.tree[own])
