"""Section of the machine that a five-axis program was made for; nothing of it is in the robot's cell."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from gcode2krl.cell.sections.fields import Finite, NotNegative, Section, YesNo

_AXES_OF = {"head": 1, "table": 1, "head-head": 2, "table-table": 2, "table-head": 2}


class Machine(Section):
    """Rotary axes of the machine tool whose G-code is read, at zero parallel to X, Y and Z of the part.

    Both axes of a head meet in its pivot, both axes of a table in its centre.
    """

    kind: Literal["head", "table", "head-head", "table-table", "table-head"]
    axes: Annotated[tuple[Literal["A", "B", "C"], ...], Field(min_length=1, max_length=2)]
    """From the base to the tool, or from the base to the part; of a table-head the table's first."""
    signs: tuple[Literal[1, -1], ...]
    """1 where a positive angle turns head or table right-handed about +X, +Y or +Z, else -1."""
    tcpm: YesNo
    """True: X, Y, Z are the tip in the part without G43.4 too; else they are the machine's linear axes."""
    pivot_mm: NotNegative | None = None
    """From the pivot of the head to the gauge line of the spindle; needed without TCPM."""
    centre_mm: Annotated[tuple[Finite, ...], Field(min_length=3, max_length=3)] | None = None
    """The rotation centre of the table in ``$BASE``; needed without TCPM."""
    axis_step_deg: Annotated[float, Field(strict=True, ge=0.1, le=10.0)] = 2.0
    """Largest turn of the tool axis in one motion of a feed move."""
    axis_tolerance_deg: Annotated[float, Field(strict=True, ge=0.001, le=1.0)] = 0.02
    """How far the tool axis may be from where this machine turns it, between two motions."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        count = _AXES_OF[self.kind]
        for name in ("axes", "signs"):
            if len(getattr(self, name)) != count:
                stated = len(getattr(self, name))
                raise ValueError(f"{name} of a {self.kind} machine has {count}, here {stated}")
        if len(set(self.axes)) != count:
            raise ValueError(f"axes names {self.axes[0]} twice")
        return self

    @property
    def table_axes(self) -> tuple[tuple[str, int], ...]:
        """Return letter and sign of the axes that turn the part, from the base to the part."""
        pairs = tuple(zip(self.axes, self.signs, strict=True))
        return pairs[:1] if self.kind == "table-head" else pairs if self.kind.startswith("table") else ()

    @property
    def head_axes(self) -> tuple[tuple[str, int], ...]:
        """Return letter and sign of the axes that turn the tool, from the base to the tool."""
        pairs = tuple(zip(self.axes, self.signs, strict=True))
        return pairs[len(self.table_axes) :]
