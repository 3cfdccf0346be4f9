"""Sections of what can hit and what can be hit: capsules of the arm and the spindle, obstacles, clearance."""

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from gcode2krl.cell.sections.fields import Finite, Positive, Provenance, Section

Point = tuple[Finite, Finite, Finite]


class Capsule(Section):
    """A segment with a radius, in the frame of what carries it; both ends may be the same point."""

    from_mm: Point
    to_mm: Point
    radius_mm: Positive


class LinkCapsule(Capsule):
    """A capsule of the arm, in the frame of its link (`gcode2krl/collision/scene.py`)."""

    link: Literal["foot", "A1", "A2", "A3", "A4", "A5", "A6"]


class RobotBody(Provenance):
    """The shape of the arm; without capsules it is not checked for collisions."""

    capsules: Annotated[tuple[LinkCapsule, ...], Field(max_length=40)] = ()


class SpindleBody(Provenance):
    """Spindle, bracket and sensor, in the flange frame; holder and cutter come from the tool."""

    capsules: Annotated[tuple[Capsule, ...], Field(min_length=1, max_length=20)]


class CableCapsule(Capsule):
    """A stretch of cables: it begins on A3 (``from_mm`` in the frame of that link) and ends at the flange."""


class Cables(Provenance):
    """Cables and hoses from the forearm to the spindle, as stretched and as fat as they ever hang."""

    capsules: Annotated[tuple[CableCapsule, ...], Field(min_length=1, max_length=4)]


class Plane(Section):
    """A half-space: everything behind the plane is solid."""

    point_mm: Point
    normal: Point
    """Any length; points to the free side."""

    @model_validator(mode="after")
    def _has_direction(self) -> Self:
        if math.hypot(*self.normal) < 1e-6:
            raise ValueError("normal is zero: it points from the plane to the free side")
        return self


class Obstacle(Section):
    """Something that stands in the cell: one of `box_mm`, `mesh` and `plane`."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 _.+\-]{0,39}$")]
    frame: Literal["base", "robroot", "world"] = "base"
    """``$BASE``, the robot root with its rails at 0, or ``$WORLD``."""
    box_mm: tuple[Point, Point] | None = None
    mesh: str | None = None
    """STL, PLY or 3MF in mm, relative to the cell file."""
    plane: Plane | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        given = [name for name in ("box_mm", "mesh", "plane") if getattr(self, name) is not None]
        if len(given) != 1:
            stated = " and ".join(given) if given else "none"
            raise ValueError(f"give one of box_mm, mesh and plane, found {stated}")
        if self.box_mm is not None:
            for axis, low, high in zip("xyz", *self.box_mm, strict=True):
                if low >= high:
                    raise ValueError(
                        f"box_mm: {axis} from {low:g} is not below {high:g}: the low corner comes first"
                    )
        return self


class Collision(Section):
    """How near is too near."""

    clearance_mm: Positive = 5.0
    """A smaller distance of arm, spindle or tool from an obstacle is a warning."""
