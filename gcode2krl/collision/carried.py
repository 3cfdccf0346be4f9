"""What the robot carries: where it is, and when it comes into a box."""

from gcode2krl.arrays import Bools, Floats
from gcode2krl.cell import Cell
from gcode2krl.collision.along import Way
from gcode2krl.collision.bodies import FOOT, arm_and_spindle, capsules_of, parts_of
from gcode2krl.collision.gaps import placed
from gcode2krl.collision.scene import box


class Carried:
    """The capsules of arm and spindle (b), and of a tool where one is asked for."""

    def __init__(self, cell: Cell, tool: int | None = None, *, cuts: bool = False) -> None:
        """Take those of the cell; the foot stands still, and is left out, as are cables.

        Where the ``tool`` ``cuts``, its cutter is left out, as that may be in the material.
        """
        parts = arm_and_spindle(cell) if tool is None else parts_of(cell, tool)
        left_out = {"cables", "cutter"} if cuts else {"cables"}
        parts = [part for part in parts if part.link != FOOT and part.kind not in left_out]
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
