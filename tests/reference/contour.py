"""The path of a tool's centre beside a contour, once more: in complex numbers, from the manuals' figures.

Nothing of the package is used. An element is (start, end, centre, turn), a line where turn is 0, an arc
counterclockwise where it is 1; a corner behind it is (kind, value) with RND, CHR or CHF. `tool_path` rounds
corners first, then moves every element aside by the radius and looks for where neighbours meet: inside of a
corner it takes, of all common points, the one nearest to the programmed corner.
"""

import cmath
import math
from itertools import pairwise

SMOOTH_RAD, MEETING_DEG, NEAR_MM = 1e-6, 100.0, 1e-9


class OffPathError(Exception):
    """The contour has no path of this kind."""


def line(start, end):
    """Return a line."""
    return start, end, None, 0


def direction(element, at_end):
    """Return the unit direction of an element at its start or its end."""
    start, end, centre, turn = element
    if turn == 0:
        return (end - start) / abs(end - start)
    radius = (end if at_end else start) - centre
    return turn * 1j * radius / abs(radius)


def bend(before, after):
    """Return by how much a path turns to the left from one direction to another, rad."""
    return cmath.phase(after / before)


def rounded(elements, corners):
    """Return elements with the corners behind them made: ``corners`` has one an element, None for none."""
    found, begin = [], None
    for k, element in enumerate(elements):
        start, end, centre, turn = element
        start = start if begin is None else begin
        begin = None
        if corners[k] is None:
            found.append((start, end, centre, turn))
            continue
        kind, value = corners[k]
        following = elements[k + 1]
        if turn or following[3]:
            raise OffPathError("a corner at an arc")
        a, c = direction(element, at_end=True), direction(following, at_end=False)
        half = abs(bend(a, c)) / 2
        taken = {"RND": value * math.tan(half), "CHR": value, "CHF": value / 2 / math.cos(half)}[kind]
        first, last = end - taken * a, end + taken * c
        found.append(line(start, first))
        if kind == "RND":
            way = math.copysign(1, bend(a, c))
            found.append((first, last, first + way * 1j * a * value, int(way)))
        else:
            found.append(line(first, last))
        begin = last
    return found


def _common(one, other, side, radius):
    """Return all points that two elements have in common, both moved aside and prolonged."""

    def beside(element):
        start, _, centre, turn = element
        if turn == 0:
            along = direction(element, at_end=False)
            return start + side * radius * 1j * along, along
        return centre, abs(start - centre) - side * turn * radius

    (p, a), (q, c) = beside(one), beside(other)
    if one[3] == 0 and other[3] == 0:
        sine = (a.conjugate() * c).imag
        return [p + a * ((q - p).conjugate() * c).imag / sine] if abs(sine) > NEAR_MM else []
    if one[3] != 0 and other[3] != 0:
        between, apart = q - p, abs(q - p)
        along = (apart**2 + a**2 - c**2) / (2 * apart) if apart else math.inf
        square = a**2 - along**2
        return (
            [p + between / apart * (along + s * 1j * math.sqrt(square)) for s in (1, -1)]
            if square >= 0
            else []
        )
    (at, way), (middle, size) = ((p, a), (q, c)) if one[3] == 0 else ((q, c), (p, a))
    foot = at + way * ((middle - at) * way.conjugate()).real
    square = size**2 - abs(foot - middle) ** 2
    return [foot + s * way * math.sqrt(square) for s in (1, -1)] if square >= 0 else []


def _around(one, other, side, radius, corners):
    """Return the points by which the tool leaves one element for another, but for the start of that."""
    corner, a, c = one[1], direction(one, at_end=True), direction(other, at_end=False)
    turned = -side * bend(a, c)  # above 0 outside
    left, reached = corner + side * radius * 1j * a, corner + side * radius * 1j * c
    if abs(turned) < SMOOTH_RAD:
        return [left]
    if turned > 0:
        met = _common(one, other, side, radius)
        if corners == "meeting" and math.degrees(turned) <= MEETING_DEG:
            return [left, min(met, key=lambda z: abs(z - corner)), reached]
        return [left, reached]
    met = _common(one, other, side, radius)
    if not met:
        raise OffPathError("no room in the corner")
    return [min(met, key=lambda z: abs(z - corner))]


def tool_path(elements, side, radius, corners="arc", roundings=None):
    """Return the tool's centre beside a contour: its start, and what follows up to its end; of arcs the ends.

    ``elements`` are those of the contour without what leads in and out; ``corners`` is ``"arc"`` (G450)
    or ``"meeting"`` (G451).
    """
    made = rounded(elements, roundings or [None] * len(elements))
    places = [made[0][0] + side * radius * 1j * direction(made[0], at_end=False)]
    for one, other in pairwise(made):
        places += _around(one, other, side, radius, corners)
    places.append(made[-1][1] + side * radius * 1j * direction(made[-1], at_end=True))
    return places
