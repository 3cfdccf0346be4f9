"""Words and figures on forces and deflection that several commands share."""

from collections.abc import Iterator

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.prediction import Prediction
from gcode2krl.units import MM_PER_M


def largest(vectors: Floats) -> float:
    """Return the largest length of vectors (n, 3); 0 where all are unknown."""
    size = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return float(np.fmax.reduce(size, initial=0.0))


def load_lines(prediction: Prediction) -> Iterator[str]:
    """Yield the lines on forces and deflection, with their 90 % bands."""
    forces, deflection = prediction.forces, prediction.deflection
    if forces is None:
        yield "  force      not known"
        return
    cutting = np.isfinite(forces.phi_rad[:, 0])
    force_N, torque_Nm = largest(forces.force_base_N), forces.torque_Nmm.max(initial=0.0) / MM_PER_M
    material = prediction.cell.material
    name = f", {material.model or material.name or 'own coefficients'}" if material is not None else ""
    yield (
        f"  force      up to {force_N:.0f} N +- {forces.relative_band:.0%} (90 %), "
        f"torque {torque_Nm:.2f} Nm{name}"
    )
    fraction = np.count_nonzero(cutting) / max(len(cutting), 1)
    depth_mm, width_mm = forces.a_p_mm.max(initial=0.0), forces.a_e_mm.max(initial=0.0)
    yield f"  cut        {fraction:.0%} of the time, a_p up to {depth_mm:.2f} mm, a_e up to {width_mm:.2f} mm"
    if deflection is None:
        yield "  deflection not known"
        return
    bent_mm, across_mm = largest(deflection.deflection_base_mm), largest(deflection.correction_base_mm)
    yield (
        f"  deflection up to {bent_mm:.2f} mm +- {deflection.relative_band:.0%} (90 %), "
        f"{across_mm:.2f} mm normal to the feed"
    )
