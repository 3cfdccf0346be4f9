"""Runs of targets on an arc, which a program may write as one CIRC.

A G-code arc reaches the targets as chords whose ends lie on it. What becomes of a run is said in `krl.arcs`.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.tables import Targets

MOST_TURN_RAD = 0.95 * np.pi
"""Longest arc of one CIRC: where it ends opposite its start, three points would tell its plane badly."""
LEAST_RADIUS_MM, LEAST_CHORDS = 0.1, 3
OFF_MM = 0.0015
"""How far a target may be from the circle of the points as they are written."""
SAGITTA_MM = 0.02
"""How far the circle may go beside the chords of its targets."""
_STEP_MM = 1e-3
"""What positions are written in."""


class Arc(NamedTuple):
    """Rows of Targets that become one CIRC."""

    first: int
    """The first chord; the arc begins where the row before ends."""
    via: int
    end: int


class Circle(NamedTuple):
    """A circle in space, seen from its first point."""

    centre: Floats
    x: Floats
    """Unit vector to its first point."""
    y: Floats
    radius: float

    def at(self, angle: Floats) -> Floats:
        """Return the points (n, 3) at angles (n, 1) from the first point on."""
        points: Floats = self.centre + self.radius * (np.cos(angle) * self.x + np.sin(angle) * self.y)
        return points

    def seen(self, points: Floats) -> tuple[Floats, Floats]:
        """Return angle (n,) from the first point on, 0 to 2 pi, and distance (n,) from the circle."""
        from_centre = points - self.centre
        u, v = from_centre @ self.x, from_centre @ self.y
        height = from_centre @ np.cross(self.x, self.y)
        angle = np.arctan2(v, u) % (2.0 * np.pi)
        return angle, np.hypot(np.hypot(u, v) - self.radius, height)


def arcs_of(targets: Targets) -> list[Arc]:
    """Return the runs of targets that lie on arcs, in their order."""
    return [arc for first, end in _runs(targets) for arc in _arcs_in(targets, first, end)]


def _runs(targets: Targets) -> Iterator[tuple[int, int]]:
    """Yield rows first..end of LIN from one line, of one speed, tool and orientation, blended but at last."""
    same = (targets.source_line[1:] == targets.source_line[:-1]) & (targets.source_line[1:] > 0)
    same &= ~targets.ptp[1:] & ~targets.ptp[:-1] & (targets.move[1:] >= 0) & (targets.move[:-1] >= 0)
    same &= (targets.speed_mm_s[1:] == targets.speed_mm_s[:-1]) & (targets.tool[1:] == targets.tool[:-1])
    same &= (targets.rotation[1:] == targets.rotation[:-1]).all(axis=1)
    if targets.external.strides[0] != 0:
        same &= (targets.external[1:] == targets.external[:-1]).all(axis=1)
    same &= (targets.cdis_mm[:-1] > 0.0) & (targets.wait_s[:-1] == 0.0)
    standing = [event.row for event in targets.events if event.row < len(same)]
    same[standing] = False
    border = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    for first, end in border.reshape(-1, 2).tolist():
        if end - first + 1 >= LEAST_CHORDS and first > 0:
            yield first, end


def _arcs_in(targets: Targets, first: int, end: int) -> Iterator[Arc]:
    """Yield the arcs of a run, none where its rows and the row before them are not on one circle."""
    turned = (targets.rotation[first - 1] != targets.rotation[first]).any() or targets.home[first - 1]
    points = targets.position_mm[first - 1 : end + 1]
    count = len(points)
    whole = circle_through(points[0], points[count // 3], points[2 * count // 3])
    if whole is None or turned:
        return
    angle, off_mm = whole.seen(points)
    angle[0] = 0.0
    turn = np.diff(angle)
    turn[-1] = turn[-1] % (2.0 * np.pi)  # a full circle ends where it began
    if (off_mm > 0.02).any() or (turn <= 0.0).any() or (whole.radius < LEAST_RADIUS_MM):
        return
    pieces = int(np.ceil(turn.sum() / MOST_TURN_RAD))
    borders = np.searchsorted(np.cumsum(turn), turn.sum() * np.arange(1, pieces) / pieces).tolist()
    for start, stop in zip(
        [0, *(b + 1 for b in borders)], [*(b + 1 for b in borders), count - 1], strict=True
    ):
        arc = Arc(first + start, first + (start + stop) // 2 - 1, first + stop - 1)
        if stop - start >= LEAST_CHORDS - 1 and _fits(targets.position_mm, arc):
            yield arc


def _fits(position_mm: Floats, arc: Arc) -> bool:
    """Tell whether the circle of three points as they are written keeps to all targets."""
    start, via, end = (
        np.round(position_mm[row] / _STEP_MM) * _STEP_MM for row in (arc.first - 1, arc.via, arc.end)
    )
    circle = circle_through(start, via, end)
    if circle is None:
        return False
    return is_along(circle, position_mm[arc.first - 1 : arc.end + 1], end)


def is_along(circle: Circle, points: Floats, end: Floats) -> bool:
    """Tell whether points (n, 3) follow each other along a circle to its end."""
    angle, off_mm = circle.seen(points)
    to_end = circle.seen(end[None])[0][0]
    angle[0], angle[-1] = 0.0, to_end
    turn = np.diff(angle)
    sagitta_mm = circle.radius * (1.0 - np.cos(turn / 2.0))
    return bool((off_mm <= OFF_MM).all() and (turn > 0.0).all() and (sagitta_mm <= SAGITTA_MM).all())


def circle_through(start: Floats, via: Floats, end: Floats) -> Circle | None:
    """Return the circle through three points, from the first to the second; None where they are in a line."""
    a, b = via - start, end - start
    normal = np.cross(a, b)
    square = float(normal @ normal)
    if not square > 1e-12 * float(a @ a) * float(b @ b) or not square > 0.0:
        return None
    to_centre = (np.cross(normal, a) * (b @ b) + np.cross(b, normal) * (a @ a)) / (2.0 * square)
    radius = float(np.linalg.norm(to_centre))
    x = -to_centre / radius
    y = np.cross(normal / np.sqrt(square), x)
    return Circle(start + to_centre, x, y, radius)
