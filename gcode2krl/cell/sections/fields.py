"""What the sections of a cell file are made of: kinds of values, places, and the error of a missing key."""

from functools import lru_cache
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from gcode2krl import frames as fr
from gcode2krl.arrays import Floats
from gcode2krl.errors import Issue, RefusedError
from gcode2krl.units import RAD_PER_DEG

Sure = Literal["verified", "checked", "memory", "assumption", "unknown"]
Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Positive = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
YesNo = Annotated[bool, Field(strict=True)]
OneLine = Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f\x85\u2028\u2029]*$")]
"""Text that goes into a line of the program: it cannot begin another line."""
SixFloats = Annotated[tuple[Finite, ...], Field(min_length=6, max_length=6)]
DataNumber = Annotated[int, Field(strict=True, ge=1, le=32)]
SignalNumber = Annotated[int, Field(strict=True, ge=1, le=8192)]


def missing(*keys: str) -> RefusedError:
    """Return the error of a stage that needs keys which the cell does not name."""
    return RefusedError([missing_key(key) for key in keys])


def missing_key(key: str, reason: str = "") -> Issue:
    """Return the finding that a key is needed and not stated."""
    text = f"the cell does not name {key}" + (f": {reason}" if reason else "")
    remedy = f'give {key} in the cell file, or say whose it is with based_on = "…"'
    return Issue("error", "cell-missing", 0, text, remedy)


class Section(BaseModel):
    """A table of the cell file: unknown keys are errors, values do not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class Provenance(Section):
    """Where values come from and how reliable they are."""

    source: str = ""
    sure: Sure = "assumption"


class Place(Section):
    """A place: position in mm and A, B, C in degrees (Rz·Ry·Rx); what is left out is 0."""

    x_mm: Finite = 0.0
    y_mm: Finite = 0.0
    z_mm: Finite = 0.0
    a_deg: Finite = 0.0
    b_deg: Finite = 0.0
    c_deg: Finite = 0.0

    def matrix(self) -> Floats:
        """Return the homogeneous transform (4, 4)."""
        return _transform(self.x_mm, self.y_mm, self.z_mm, self.a_deg, self.b_deg, self.c_deg).copy()


@lru_cache(maxsize=64)
def _transform(x_mm: float, y_mm: float, z_mm: float, a_deg: float, b_deg: float, c_deg: float) -> Floats:
    """Return the transform (4, 4) of a place: the few of a cell are asked for thousands of times."""
    rotation = fr.rotation_from_abc(np.array([a_deg, b_deg, c_deg]) * RAD_PER_DEG)
    return fr.transform([x_mm, y_mm, z_mm], rotation)


class Frame(Place):
    """A KUKA frame of the cell with all six values: a missing one could only come from another cell."""

    @model_validator(mode="before")
    @classmethod
    def _all_six(cls, given: Any) -> Any:
        if isinstance(given, dict):
            lacking = [name for name in cls.model_fields if name not in given]
            unknown = [str(name)[:40] for name in given if name not in cls.model_fields][:6]
            words = f" (there is no such key: {', '.join(unknown)})" if unknown else ""
            if lacking:
                raise ValueError(
                    f"{', '.join(lacking)} missing: a frame states all six of x_mm to c_deg{words}"
                )
        return given
