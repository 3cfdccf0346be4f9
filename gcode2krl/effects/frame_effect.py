"""Parameters and matrix of effects that move or turn a whole frame."""

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections import Frame
from gcode2krl.effects.effect import Applied
from gcode2krl.effects.parameter import Bound, Parameter

FRAME_NAMES = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")


def frame_parameters(
    most_mm: float,
    most_deg: float,
    start_mm: float,
    start_deg: float,
    source: str,
    usual_mm: Bound | None = None,
    usual_deg: Bound | None = None,
) -> tuple[Parameter, ...]:
    """Return the six parameters of a frame, X to C as KUKA has them."""
    return tuple(
        Parameter(
            name=name,
            unit=unit,
            low=-most,
            high=most,
            nominal=0.0,
            start=start,
            linear=True,
            usual=usual,
            source=source,
        )
        for names, unit, most, start, usual in (
            (FRAME_NAMES[:3], "mm", most_mm, start_mm, usual_mm),
            (FRAME_NAMES[3:], "deg", most_deg, start_deg, usual_deg),
        )
        for name in names
    )


def is_nothing(applied: Applied) -> bool:
    """Tell whether all six are zero."""
    return not applied.vector(FRAME_NAMES).any()


def frame_of(applied: Applied) -> Floats:
    """Return the frame (4, 4): Rz(A)·Ry(B)·Rx(C) and a shift in mm."""
    return Frame(**{name: applied[name] for name in FRAME_NAMES}).matrix()
