"""A cell whose force law has some of its coefficients scaled."""

from collections.abc import Mapping

from gcode2krl.cell import Cell
from gcode2krl.cell.sections import LinearEdge, Material, Tool

_KIENZLE = {"radial": "radial_ratio", "axial": "axial_ratio"}


def with_scaled_direction(cell: Cell, direction: str, scale: float) -> Cell:
    """Return the cell with the tangential, radial or axial direction of the force law scaled.

    In Kienzle's law the radial and axial forces are shares of the tangential one, scaled here so that the
    other two stay as they are.
    """
    material = cell.material
    if material is None:
        return cell
    if material.kienzle is not None:
        law = material.kienzle
        if direction == "tangential":
            change = {"kc11": law.kc11 * scale} | {
                name: getattr(law, name) / scale for name in _KIENZLE.values()
            }
        else:
            change = {_KIENZLE[direction]: getattr(law, _KIENZLE[direction]) * scale}
        return _with_material(cell, material.model_copy(update={"kienzle": law.model_copy(update=change)}))
    letter = direction[0]
    return _with_edge(cell, {f"K{letter}c": scale, f"K{letter}e": scale})


def with_scaled_edge(cell: Cell, scale: float) -> Cell:
    """Return the cell with the edge coefficients Kte, Kre, Kae scaled."""
    return _with_edge(cell, {"Kte": scale, "Kre": scale, "Kae": scale})


def edge_only(material: Material) -> Material:
    """Return the material with nothing but its edge forces; Kienzle's law has none."""
    law = material.linear_edge
    edges = LinearEdge(
        Ktc=0.0,
        Krc=0.0,
        Kac=0.0,
        Kte=law.Kte if law else 0.0,
        Kre=law.Kre if law else 0.0,
        Kae=(law.Kae or 0.0) if law else 0.0,
    )
    return material.model_copy(update={"linear_edge": edges, "kienzle": None})


def with_larger_tools(cell: Cell, offset_mm: float) -> Cell:
    """Return the cell with all cutters larger in diameter; a corner radius stays within half of it."""
    return cell.model_copy(update={"tool": {n: _larger(tool, offset_mm) for n, tool in cell.tool.items()}})


def _larger(tool: Tool, offset_mm: float) -> Tool:
    diameter = max(tool.diameter_mm + offset_mm, 0.01 * tool.diameter_mm)
    corner = min(tool.corner_radius_mm, diameter / 2.0)
    return tool.model_copy(update={"diameter_mm": diameter, "corner_radius_mm": corner})


def _with_edge(cell: Cell, factors: Mapping[str, float]) -> Cell:
    material = cell.material
    if material is None or material.linear_edge is None:
        return cell
    law = material.linear_edge
    change = {name: (getattr(law, name) or 0.0) * factor for name, factor in factors.items()}
    return _with_material(cell, material.model_copy(update={"linear_edge": law.model_copy(update=change)}))


def _with_material(cell: Cell, material: Material) -> Cell:
    return cell.model_copy(update={"material": material})
