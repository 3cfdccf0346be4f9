"""Scenes whose engagement is known exactly: an oracle that shares nothing with the height field.

A way is a list of corners; what a flat mill has cut on it is a union of capsules, and a point of its rim is
engaged where the raw stock has material and no earlier capsule contains it. Forces are integrated numerically
over the rim, 7200 points all around.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from gcode2krl.cutting.height_field import HeightField

LAW = np.array([0.0, 796.1, 168.8, 222.0, 27.7, 30.8, 1.4, 0.0])
TEETH = 3
F_Z_MM = 0.1
PHI = (np.arange(3600) + 0.5) * math.pi / 3600


@dataclass(frozen=True)
class Scene:
    """A flat mill on a path through a stock."""

    name: str
    top: Callable  # (x, y) -> height of the raw stock, -inf where there is none
    low: tuple
    high: tuple
    corners: np.ndarray  # (c, 3)
    radius_mm: float = 8.0
    step_mm: float = 0.5
    steady: tuple = field(default=())  # places on the path between which the engagement does not change

    def turned(self, degrees: float, bound_mm: float, step_mm: float = 0.5, name: str = "") -> "Scene":
        """The scene turned about the origin, within bounds of so much to each side."""
        low, high = (-bound_mm, -bound_mm), (bound_mm, bound_mm)
        top, corners = turned(self.top, degrees), turn(self.corners, degrees)
        name = name or f"{self.name}, turned {degrees:g}°"
        return replace(self, name=name, top=top, low=low, high=high, corners=corners, step_mm=step_mm)

    def field(self, cell_mm: float) -> HeightField:
        """The stock at the middle of cells that fill its bounds; the bounds are faces of a block in it."""
        low, high = np.array(self.low, float), np.array(self.high, float)
        count = np.ceil((high - low) / cell_mm - 1e-9).astype(int)
        size = (high - low) / count
        x = low[0] + (np.arange(count[0]) + 0.5) * size[0]
        y = low[1] + (np.arange(count[1]) + 0.5) * size[1]
        height = self.top(*np.meshgrid(x, y)).astype(np.float32)
        return HeightField(height, low, size, -30.0)

    def samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, 3) every step, corners included, and their place on the path (n,)."""
        points, ways, way = [self.corners[:1]], [np.zeros(1)], 0.0
        for a, b in zip(self.corners, self.corners[1:], strict=False):
            length = float(np.linalg.norm(b - a))
            at = np.linspace(0.0, 1.0, math.ceil(length / self.step_mm - 1e-9) + 1)[1:]
            points.append(a + at[:, None] * (b - a))
            ways.append(way + at * length)
            way += length
        return np.concatenate(points), np.concatenate(ways)

    def exact(self, way: float) -> np.ndarray:
        """Feed, normal and axial force at a place on the path, N."""
        here, before, direction = self._history(way)
        feed, normal = direction[:2], np.array([-direction[1], direction[0]])
        rim = here[:2] + self.radius_mm * (np.sin(PHI)[:, None] * feed + np.cos(PHI)[:, None] * normal)
        top = self.top(rim[:, 0], rim[:, 1])
        for a, b in before:
            inside = _distance(rim, a[:2], b[:2]) < self.radius_mm - 1e-9
            top = np.where(inside, np.minimum(top, max(a[2], b[2])), top)
        return rim_force(PHI, np.maximum(top - here[2], 0.0))

    def _history(self, way: float) -> tuple[np.ndarray, list, np.ndarray]:
        before, walked = [], 0.0
        for a, b in zip(self.corners, self.corners[1:], strict=False):
            length = float(np.linalg.norm(b - a))
            if walked + length >= way - 1e-9:
                here = a + (way - walked) / length * (b - a)
                return here, [*before, (a, here)], (b - a) / length
            before.append((a, b))
            walked += length
        raise ValueError("beyond the end")


def rim_force(phi: np.ndarray, depth_mm: np.ndarray) -> np.ndarray:
    """Mean force of a flat mill, its depth given at each angle of an even table (Altintas 2012, ch. 2)."""
    h = F_Z_MM * np.sin(phi)
    tangential, radial, axial = (LAW[1 + q] * h + LAW[4 + q] for q in range(3))
    step = (phi[1] - phi[0]) * depth_mm * TEETH / (2 * math.pi)
    feed = -tangential * np.cos(phi) - radial * np.sin(phi)
    normal = tangential * np.sin(phi) - radial * np.cos(phi)
    return np.array([(feed * step).sum(), (normal * step).sum(), (axial * step).sum()])


def _distance(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    along = b - a
    square = float(along @ along)
    share = np.clip((points - a) @ along / square, 0.0, 1.0) if square > 0 else np.zeros(len(points))
    return np.linalg.norm(points - a - share[:, None] * along, axis=1)


def box(low: tuple, high: tuple, top: float = 0.0) -> Callable:
    """A block with faces along the axes."""

    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        inside = (x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])
        return np.where(inside, top, -np.inf)

    return height


def turned(shape: Callable, degrees: float) -> Callable:
    """A shape turned about the origin."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return lambda x, y: shape(cos * x + sin * y, cos * y - sin * x)


def turn(corners: np.ndarray, degrees: float) -> np.ndarray:
    """Corners turned about the origin."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return corners @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def way(*corners: tuple) -> np.ndarray:
    return np.array(corners, dtype=float)


def transitions() -> list[Scene]:
    """A slot through a block, normal to its faces: entry, steady cut, exit."""
    low, high = (-22.0, -20.0), (23.0, 20.0)
    off_low, off_high = (-22.0371, -20.0193), (23.0139, 20.0527)
    straight = way((-34, 0, -5), (35, 0, -5))
    slot = Scene("slot", box(low, high), low, high, straight, steady=(25, 45))
    off_grid = {"top": box(off_low, off_high), "low": off_low, "high": off_high, "step_mm": 0.37}
    return [
        slot,
        replace(slot, name="slot, off the grid", corners=straight + way((0.0173, 0.0311, 0.0)), **off_grid),
        slot.turned(30, 32.0, 0.37, "slot and stock turned 30°"),
        slot.turned(77, 32.0, 0.05, "slot and stock turned 77°, short steps"),
    ]


def steady_scenes() -> list[Scene]:
    """Cuts whose engagement is constant over some distance, or changes within a corner."""
    low, high = (-25.0, -20.0), (25.0, 20.0)
    shape = box(low, high)
    up, down = way((-35, -20, -5), (35, -20, -5)), way((-35, 20, -5), (35, 20, -5))
    thin = way((-35, 27.5, -5), (35, 27.5, -5))
    second = way((-35, 0, -5), (35, 0, -5), (35, 30, -5), (-35, 30, -5), (-35, 0.63, -5), (35, 0.63, -5))
    corners = ((-12, -6), (6, -6), (6, 12), (-12, 12), (-12, -5), (-11, -10), (10, -10), (10, 12))
    pocket = way(*((x, y, -5) for x, y in corners))

    def step(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(y > 2.3, shape(x, y), shape(x, y) - 3.0)

    half_down = Scene("half immersion, down", shape, low, high, down, steady=(25, 50))
    beside_slot = Scene("0.63 mm beside a slot", shape, low, high, second, steady=(225, 250))
    stepped = Scene("step in the stock", step, low, high, way((-35, 0, -5), (35, 0, -5)), steady=(25, 50))
    in_corner = Scene("pocket corner", shape, low, high, pocket, step_mm=0.5, steady=(85, 112))
    return [
        Scene("half immersion, up", shape, low, high, up, steady=(25, 50)),
        half_down,
        half_down.turned(30, 33.0, 0.43),
        Scene("0.5 mm beside a face", shape, low, high, thin, steady=(25, 50)),
        beside_slot,
        beside_slot.turned(30, 33.0, 0.41),
        stepped,
        stepped.turned(30, 33.0),
        in_corner,
        in_corner.turned(30, 33.0),
    ]
