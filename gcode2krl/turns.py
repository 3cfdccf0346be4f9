"""The turn about the tool axis that a cell leaves open: what chooses it, at targets and between them."""

from gcode2krl import compliance, program
from gcode2krl.arrays import Bools, Floats, Ints, Ints32
from gcode2krl.cell import Cell
from gcode2krl.cell.carried import points_moved, to_rest, vectors_turned
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.posture import bending_mm, quality_of
from gcode2krl.units import RAD_PER_DEG


def spin_of(cell: Cell, external: Floats | None = None) -> program.SpinOf:
    """Return what chooses the turn about the tool axis at targets in ``$BASE``, and between them.

    ``external`` (p, 6) is where E1 to E6 are at the targets, at rest by default. The turn is that which the
    robot sees. Raises `NotUnderstoodError` where the stiffest one is asked for, and the stiffness of the
    robot is not known.
    """
    spin = cell.frames.spin
    if not isinstance(spin, str):
        return lambda *_: float(spin) * RAD_PER_DEG
    if spin == "stiffest":
        missing = compliance.missing_stiffness(cell)
        if missing is not None:
            raise NotUnderstoodError(missing, source=cell.name)

    def searched(position: Floats, axis: Floats, tool: Ints32, lines: Bools) -> Floats | float:
        in_view = None if external is None else seen_at_rest(position, axis, external, cell)[0]
        points = program.between(position, lines, in_view)
        path, axis, tool = points.of(position), points.directions(axis), tool[points.before]
        at = None if external is None else points.of(external)
        seen, seen_axis = (path, axis) if at is None else seen_at_rest(path, axis, at, cell)

        def quality(rows: Ints, spin_rad: float) -> Floats:
            rotation = program.tool_rotation(seen_axis[rows], spin_rad)
            return quality_of(seen[rows], rotation, tool[rows], cell, None if at is None else at[rows])

        def bending(rows: Ints, spin_rad: float) -> Floats:
            rotation = program.tool_rotation(seen_axis[rows], spin_rad)
            return bending_mm(seen[rows], rotation, seen_axis[rows], tool[rows], cell)

        is_target = points.share == 0.0
        if spin == "stiffest":
            found = program.stiffest_spin(path, quality, bending, seen_axis, is_target)
        else:
            found = program.smooth_spin(path, quality, seen_axis, is_target)
        return found if isinstance(found, float) else found[is_target]

    return searched


def seen_at_rest(position_mm: Floats, axis: Floats, external: Floats, cell: Cell) -> tuple[Floats, Floats]:
    """Return positions (p, 3) and tool axes (p, 3) in ``$BASE`` as seen with the external axes at rest.

    ``external`` (p, 6) is where E1 to E6 are.
    """
    by = to_rest(external, cell)
    return (position_mm, axis) if by is None else (points_moved(position_mm, by), vectors_turned(axis, by))
