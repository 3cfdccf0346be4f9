"""A chain of elementary motions, each about or along one local axis, and its exact derivatives.

The pose of the last frame is the product of turns and shifts, v = nominal + C·theta each, linear in the small
numbers theta. The derivative of the tip by v is the axis (shift) or axis x lever (turn), as in any geometric
Jacobian; that by theta follows by the chain rule.
"""

from dataclasses import dataclass, field

import numpy as np

from gcode2krl.arrays import Floats


@dataclass(eq=False)
class Motion:
    """One elementary motion of all rows (n): a turn (rad) or a shift (mm) about or along a local axis."""

    axis: int
    """0, 1, 2: x, y, z."""
    turns: bool
    nominal: Floats
    """(n,)"""
    terms: list[tuple[int, Floats | float]] = field(default_factory=list)
    """Number of a small number, and by how much the motion changes with it: (n,), or one for all rows."""

    def values(self, theta: Floats) -> Floats:
        """Return the motion (n,) with the small numbers (p,)."""
        value = self.nominal
        for number, slope in self.terms:
            if theta[number] != 0.0:
                value = value + slope * theta[number]
        return value


@dataclass(eq=False)
class Chain:
    """Elementary motions by name, in order from the frame in which is measured to the tip."""

    rows: int
    motions: dict[str, Motion] = field(default_factory=dict)

    def turn(self, name: str, axis: int, nominal: Floats | float = 0.0) -> None:
        """Add a turn in rad about a local axis."""
        self.motions[name] = Motion(axis, True, np.broadcast_to(np.asarray(nominal, float), self.rows))

    def shift(self, name: str, axis: int, nominal: Floats | float = 0.0) -> None:
        """Add a shift in mm along a local axis."""
        self.motions[name] = Motion(axis, False, np.broadcast_to(np.asarray(nominal, float), self.rows))

    def walk(self, theta: Floats) -> tuple[Floats, Floats, dict[str, tuple[Floats, Floats]]]:
        """Return tips (n, 3), rotations (n, 3, 3), and by motion its axis and where it acts (n, 3)."""
        columns = [np.tile(unit, (self.rows, 1)) for unit in np.eye(3)]
        place = np.zeros((self.rows, 3))
        acts = {}
        for name, motion in self.motions.items():
            value = motion.values(theta)[:, None]
            axis = columns[motion.axis]
            acts[name] = (axis, place)
            if motion.turns:
                i, j = (motion.axis + 1) % 3, (motion.axis + 2) % 3
                cos, sin = np.cos(value), np.sin(value)
                first, second = columns[i], columns[j]
                columns[i], columns[j] = cos * first + sin * second, cos * second - sin * first
            else:
                place = place + value * axis
        return place, np.stack(columns, axis=2), acts

    def slopes(self, theta: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return tips (n, 3), rotations (n, 3, 3) and their derivatives by theta (n, 3, p), twice.

        The derivative of a rotation is the vector of the turn, along the axes of the first frame.
        """
        tip, rotation, acts = self.walk(theta)
        moved, turned = (np.zeros((self.rows, 3, len(theta))) for _ in range(2))
        for name, motion in self.motions.items():
            if not motion.terms:
                continue
            axis, place = acts[name]
            effect = np.cross(axis, tip - place) if motion.turns else axis
            for number, slope in motion.terms:
                slope = slope[:, None] if isinstance(slope, np.ndarray) else slope
                moved[:, :, number] += slope * effect
                if motion.turns:
                    turned[:, :, number] += slope * axis
        return tip, rotation, moved, turned
