"""Section of the external axes E1 to E6: rails that carry the robot, tables that carry the part."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections.fields import Finite, Frame, Positive, Provenance, YesNo
from gcode2krl.cell.sections.surroundings import Point

ExternalName = Literal["E1", "E2", "E3", "E4", "E5", "E6"]
EXTERNAL_NAMES: tuple[ExternalName, ...] = ("E1", "E2", "E3", "E4", "E5", "E6")
_LETTERS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_Letter = Literal["x", "y", "z", "+x", "+y", "+z", "-x", "-y", "-z"]


class ExternalAxis(Provenance):
    """An axis beside A1 to A6; lengths in mm and angles in degrees, as E1 to E6 have them."""

    kind: Literal["rail", "turntable", "tilt"]
    """``rail`` carries the robot along, ``turntable`` turns the part; a ``tilt`` carries the turntable
    behind it, or the part."""
    axis: _Letter | Point
    """Direction of travel, or of a right-handed turn, in the frame of ``origin``."""
    origin: Frame | Point = (0.0, 0.0, 0.0)
    """Where its zero is: in ``$WORLD``, or in what carries it."""
    limits: tuple[Finite, Finite]
    speed: Positive | None = None
    acceleration: Positive | None = None
    ratio: Finite | None = None
    """Turns of the motor a mm, or a turn; negative where it turns the other way."""
    position: Finite | None = None
    """Where it stays; without, the program moves it."""
    follows: Literal["tool"] | None = None
    """``tool``: the table turns so that a tilted tool stays in one plane, as on a machine with this table."""
    home: Finite | None = None
    """Where it is at HOME; without, where the cut begins and ends."""
    coupled: YesNo = True
    """False where the controller does not know that this rail carries the robot."""
    machine_def: Annotated[int, Field(strict=True, ge=1, le=16)] | None = None
    """Number of the table in ``MACHINE_DEF``; without it ``$BASE`` does not move with the table."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not isinstance(self.axis, str) and math.hypot(*self.axis) < 1e-6:
            raise ValueError("axis is zero: it is the direction of travel, or of the turn")
        low, high = self.limits
        if low >= high:
            raise ValueError(f"limits: low {low:g} is not below high {high:g}")
        for name in ("position", "home"):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f"{name} {value:g} is beyond the limits, {low:g} to {high:g}")
        if self.kind == "rail" and self.machine_def is not None:
            raise ValueError("machine_def of a rail: only tables are coupled by EK")
        if self.follows is not None and (self.kind != "turntable" or self.position is not None):
            raise ValueError("follows: only a turntable without a position follows the tool")
        if self.follows is not None and self.machine_def is None:
            raise ValueError("follows without machine_def: $BASE has to turn with the table")
        if self.kind != "rail" and not self.coupled:
            raise ValueError("coupled of a table: leave out machine_def instead")
        return self

    @property
    def is_rail(self) -> bool:
        """True where it carries the robot, False where it carries the part."""
        return self.kind == "rail"

    @property
    def is_coupled(self) -> bool:
        """True where the controller moves ``$ROBROOT`` or ``$BASE`` with the axis."""
        return self.coupled if self.is_rail else self.machine_def is not None

    @property
    def moves(self) -> bool:
        """True where a program may choose where it stands."""
        return self.position is None

    @property
    def unit(self) -> str:
        """``mm`` or ``deg``."""
        return "mm" if self.is_rail else "deg"

    def direction(self) -> Floats:
        """Return the unit vector (3,) of ``axis``."""
        if isinstance(self.axis, str):
            sign = -1.0 if self.axis.startswith("-") else 1.0
            return sign * np.array(_LETTERS[self.axis[-1]])
        vector = np.array(self.axis, dtype=float)
        unit: Floats = vector / np.linalg.norm(vector)
        return unit

    def origin_matrix(self) -> Floats:
        """Return the frame of ``origin`` (4, 4)."""
        if isinstance(self.origin, Frame):
            return self.origin.matrix()
        matrix = np.eye(4)
        matrix[:3, 3] = self.origin
        return matrix

    def resting_place(self) -> float:
        """Return where it stands when nobody says otherwise: ``position``, ``home``, or nearest to 0."""
        stated = self.position if self.position is not None else self.home
        return stated if stated is not None else min(max(0.0, self.limits[0]), self.limits[1])
