"""Words and figures on forces and deflection that several commands share."""

import math
from collections.abc import Iterator

from gcode2krl.cell import Cell
from gcode2krl.compliance import stiffness
from gcode2krl.prediction.forecast import LoadFigures
from gcode2krl.units import GRAVITY_M_S2, MM_PER_M

NONSENSE_PAYLOADS = 3.0
"""A force of so many rated payloads comes from a guessed stock that is too deep, not from a cut."""


def load_lines(loads: LoadFigures | None, cell: Cell) -> Iterator[str]:
    """Yield the lines on forces and deflection, with their 90 % bands."""
    if loads is None:
        yield "  force      not known"
        return
    rated_N = GRAVITY_M_S2 * (cell.robot.payload.mass_kg or math.inf)
    if cell.stock is None and loads.force_N > NONSENSE_PAYLOADS * rated_N:
        yield (
            f"  force      not known: the stock is guessed, and {loads.force_N:.0f} N says how deep that is; "
            "state [stock] in the cell"
        )
        yield "  deflection not known"
        return
    material = cell.material
    name = f", {material.model or material.name or 'own coefficients'}" if material is not None else ""
    yield (
        f"  force      up to {loads.force_N:.0f} N +- {loads.force_band:.0%} (90 %), "
        f"torque {loads.torque_Nmm / MM_PER_M:.2f} Nm{name}"
    )
    yield (
        f"  cut        {loads.in_cut:.0%} of the time, a_p up to {loads.a_p_mm:.2f} mm, "
        f"a_e up to {loads.a_e_mm:.2f} mm"
    )
    if loads.deflection_mm is None or loads.across_mm is None:
        yield "  deflection not known"
        return
    yield (
        f"  deflection up to {loads.deflection_mm:.2f} mm +- {loads.deflection_band:.0%} (90 %), "
        f"{loads.across_mm:.2f} mm normal to the feed"
    )
    if assumed := stiffness(cell).assumed:
        yield f"             {assumed}"
