"""The edge forces are larger than the coefficients say."""

from gcode2krl.cell import Cell
from gcode2krl.effects.arm import Load
from gcode2krl.effects.coefficients import with_scaled_edge
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import NO_TARGET, Applied, Effect, Target
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter


class EdgeForce(Effect):
    """Kte, Kre and Kae are ``scale`` times the material's: a worn edge rubs and ploughs more.

    Only with linear edge coefficients; Kienzle's law knows no edge force.
    """

    name = "edge_force"
    family = "force"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.FORCE})
    is_nuisance = True
    needs = frozenset({"cut"})
    parameters = (
        Parameter(
            name="scale",
            unit="",
            low=0.0,
            high=5.0,
            nominal=1.0,
            start=1.5,
            linear=True,
            minimum=0.0,
            usual=lambda mismatch: mismatch.coefficients,
            source="edge coefficients grow by factors over a tool's life, cutting ones hardly",
        ),
    )

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return (None,) where the material has edge coefficients."""
        has_edges = cell.material is not None and cell.material.linear_edge is not None
        return NO_TARGET if has_edges else ()

    def why_not(self, cell: Cell, target: Target) -> str:
        """Say that the material has no edge coefficients."""
        return "" if self.targets(cell) else "the material has no linear edge coefficients"

    def cut(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load with the edge forces scaled."""
        more = applied["scale"] - 1.0
        if more == 0.0:
            return load
        force_N, moment_Nmm = inputs.recut(with_scaled_edge(inputs.cell, 2.0))
        return (
            load[0] + more * (force_N - inputs.force_base_N),
            load[1] + more * (moment_Nmm - inputs.moment_base_Nmm),
        )


EFFECT = EdgeForce()
