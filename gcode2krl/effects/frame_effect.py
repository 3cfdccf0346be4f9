"""What the effects that move or turn a whole frame share."""

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections import Frame
from gcode2krl.effects.effect import Applied, Parameter

FRAME_NAMES = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")


def frame_parameters(
    most_mm: float, most_deg: float, start_mm: float, start_deg: float, source: str
) -> tuple[Parameter, ...]:
    """Return the six parameters of a frame, X to C as KUKA has them."""
    return tuple(
        Parameter(name, "mm", -most_mm, most_mm, nominal=0.0, start=start_mm, linear=True, source=source)
        if name.endswith("_mm")
        else Parameter(
            name, "deg", -most_deg, most_deg, nominal=0.0, start=start_deg, linear=True, source=source
        )
        for name in FRAME_NAMES
    )


def is_nothing(applied: Applied) -> bool:
    """Tell whether all six are zero."""
    return not applied.vector(FRAME_NAMES).any()


def frame_of(applied: Applied) -> Floats:
    """Return the frame (4, 4): Rz(A)·Ry(B)·Rx(C) and a shift in mm."""
    return Frame(**{name: applied[name] for name in FRAME_NAMES}).matrix()
