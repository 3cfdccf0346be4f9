"""Arm and spindle alone: where they are, and when they come into a box."""

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell import Cell
from gcode2krl.collision.along import Way
from gcode2krl.collision.bodies import FOOT, arm_and_spindle, capsules_of
from gcode2krl.collision.gaps import placed
from gcode2krl.collision.scene import box


class Carried:
    """The capsules of arm and spindle (b)."""

    def __init__(self, cell: Cell) -> None:
        """Take those of the cell; the foot stands still, and is left out."""
        parts = [part for part in arm_and_spindle(cell) if part.link != FOOT]
        self.geometry = cell.robot.geometry.array()
        self.bodies = capsules_of(parts, self.geometry)
        self.names = [part.name for part in parts]
        self.radius_mm = self.bodies.radius_mm

    def ends_mm(self, q_rad: Floats) -> Floats:
        """Return both ends (n, b, 6) of the capsules in the robot root for angles (n, 6) in rad."""
        return placed(q_rad, self.geometry, self.bodies)


class Dips:
    """Tells the rows of joints on the way to which a capsule comes into a box, or as near as a margin."""

    def __init__(
        self, carried: Carried, low_mm: Floats, high_mm: Floats, frame: Floats, margin_mm: float
    ) -> None:
        """Take the corners (3,) of the box along the axes of a frame (4, 4) of the robot root."""
        self._margin_mm = margin_mm
        self._way = Way(
            carried.bodies,
            box(low_mm, high_mm, frame),
            [(body, 0, 0) for body in range(len(carried.names))],
            carried.geometry,
            near_mm=margin_mm,
            horizon_mm=margin_mm,
            is_sampled=True,
        )

    def take(self, q_rad: Floats) -> Bools:
        """Go on along rows (n, 6) in rad; True where one is within, or has been since the row before."""
        within: Bools = self._way.take(q_rad).gap_mm < self._margin_mm
        return within
