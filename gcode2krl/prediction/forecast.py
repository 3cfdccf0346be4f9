"""What a program is written from and summed up by: a prediction without its tables of samples."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.errors import Issue
from gcode2krl.prediction.limits import longest
from gcode2krl.tables import Deflection, Forces, PilotForce, Targets, Toolpath


class Bend(NamedTuple):
    """The load on the arm where it bends most."""

    q_rad: Floats
    force_base_N: Floats
    moment_base_Nmm: Floats
    tool: int


@dataclass(frozen=True)
class LoadFigures:
    """The largest loads along a motion."""

    force_N: float
    torque_Nmm: float
    a_p_mm: float
    a_e_mm: float
    in_cut: float
    """Fraction of the time."""
    force_band: float
    """Half-width of the 90 % band, relative."""
    deflection_mm: float | None
    """None where it is not known."""
    across_mm: float | None
    """The deflection normal to the feed."""
    deflection_band: float
    worst: Bend | None = field(default=None, compare=False)
    """None where there is no deflection, or its joints were not taken."""


class LargestLoads:
    """The figures of loads that come some samples at a time."""

    def __init__(self) -> None:
        """Begin without a sample."""
        self._most = np.zeros(6)
        self._samples, self._cutting = 0, 0
        self._bands = (0.0, 0.0)
        self._worst: Bend | None = None

    def take(self, forces: Forces, deflection: Deflection | None, q_rad: Floats | None = None) -> None:
        """Add the next samples, of which the joints are ``q_rad`` (m, 6)."""
        bent, across = 0.0, 0.0
        if deflection is not None:
            row, bent, _ = longest(deflection.deflection_base_mm)
            across = longest(deflection.correction_base_mm).length
            if q_rad is not None and bent > self._most[4]:
                load = forces.force_base_N[row].copy(), forces.moment_base_Nmm[row].copy()
                self._worst = Bend(q_rad[row].copy(), *load, int(forces.tool[row]))
        most = [longest(forces.force_base_N).length]
        most += [
            float(column.max(initial=0.0)) for column in (forces.torque_Nmm, forces.a_p_mm, forces.a_e_mm)
        ]
        self._most = np.maximum(self._most, [*most, bent, across])
        self._samples += len(forces)
        self._cutting += int(np.count_nonzero(np.isfinite(forces.phi_rad[:, 0])))
        self._bands = (forces.relative_band, deflection.relative_band if deflection is not None else 0.0)

    def figures(self, with_deflection: bool) -> LoadFigures:
        """Return the figures; a deflection that is not known is None."""
        force, torque, a_p, a_e, bent, across = self._most.tolist()
        share = self._cutting / max(self._samples, 1)
        return LoadFigures(
            force_N=force,
            torque_Nmm=torque,
            a_p_mm=a_p,
            a_e_mm=a_e,
            in_cut=share,
            force_band=self._bands[0],
            deflection_mm=bent if with_deflection else None,
            across_mm=across if with_deflection else None,
            deflection_band=self._bands[1],
            worst=self._worst if with_deflection else None,
        )


def load_figures(forces: Forces, deflection: Deflection | None, q_rad: Floats | None = None) -> LoadFigures:
    """Return the figures of whole tables; ``q_rad`` (m, 6) are the joints of their samples."""
    loads = LargestLoads()
    loads.take(forces, deflection, q_rad)
    return loads.figures(with_deflection=deflection is not None)


@dataclass(frozen=True)
class Forecast:
    """What is kept of a prediction while its samples pass by; see `Prediction`."""

    toolpath: Toolpath | None
    """None where targets alone are known."""
    targets: Targets
    cell: Cell
    issues: tuple[Issue, ...]
    time_s: float
    """Of the whole motion."""
    path_mm: float
    loads: LoadFigures | None
    """None where forces are not known."""
    pilot: PilotForce | None
    """None where forces are not known."""

    @classmethod
    def of_targets(cls, targets: Targets, toolpath: Toolpath | None, cell: Cell) -> "Forecast":
        """Return what is known before a motion is planned."""
        return cls(toolpath, targets, cell, targets.issues, np.nan, np.nan, None, None)

    @property
    def has_motion(self) -> bool:
        """True where the motion is known."""
        return not np.isnan(self.time_s)

    @property
    def has_forces(self) -> bool:
        """True where forces are known."""
        return self.loads is not None
