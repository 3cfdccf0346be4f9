"""Which parts of a cell are checked for collisions, and which are not, in the words of header and report."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from gcode2krl.cell.carriers import rails_of
from gcode2krl.cell.definition import Cell
from gcode2krl.cell.sections import Capsule

_ESTIMATES = ("assumption", "memory", "unknown")


@dataclass(frozen=True)
class CollisionScope:
    """What is held against what; each a list of words."""

    movers: tuple[str, ...]
    """What may hit."""
    obstacles: tuple[str, ...]
    """What may be hit."""
    unchecked: tuple[str, ...]
    """What is not known of the cell, or not looked at."""


def checks_collisions(cell: Cell) -> bool:
    """Tell whether the cell describes anything that may hit or be hit."""
    return bool(cell.obstacle) or cell.table is not None or cell.spindle.body is not None


def collision_scope(cell: Cell, tools: Collection[int], *, is_cut: bool) -> CollisionScope | None:
    """Return what is checked in a program with these tools; None where the cell describes nothing.

    ``is_cut`` where the removal of the stock has been simulated.
    """
    if not checks_collisions(cell):
        return None
    movers, unchecked = [], []
    arm, spindle = cell.robot.body, cell.spindle.body
    if arm.capsules:
        movers.append(f"arm ({_count(arm.capsules)}{_estimated(arm.sure)})")
    else:
        unchecked.append("arm ([robot.body] is not stated)")
    if spindle is not None:
        movers.append(f"spindle ({_count(spindle.capsules)}{_estimated(spindle.sure)})")
    else:
        unchecked.append("spindle and bracket ([spindle.body] is not stated)")
    known = [number for number in sorted(tools) if number in cell.tool]
    with_holder = [n for n in known if _has_holder(cell, n)]
    without = [n for n in known if n not in with_holder]
    movers.append(f"cutter of {_named(known)}")
    if with_holder:
        movers.append(f"holder of {_named(with_holder)}")
    if without:
        unchecked.append(f"holder of {_named(without)} (stick_out_mm or holder_diameter_mm is not stated)")
    obstacles = [each.name for each in cell.obstacle]
    if cell.table is not None:
        obstacles.insert(0, f"table at z = {cell.table.z_mm:g} (by wrist, spindle, holder)")
    if not cell.obstacle:
        unchecked.append("fixtures ([[obstacle]] is not stated)")
    if cell.table is None:
        unchecked.append("table ([table] is not stated)")
    if arm.capsules:
        obstacles.append("arm itself (by wrist, spindle, tool)")
    carried = [word for word, is_stated in (("arm", arm.capsules), ("spindle", spindle)) if is_stated]
    if carried and is_cut:
        obstacles.append(f"stock as it stands (by {' and '.join(carried)})")
    else:
        unchecked.append("stock by arm and spindle, and by the tool on PTP")
    if cell.cables is not None:
        movers.append(f"cables ({_count(cell.cables.capsules)}, warnings only)")
    else:
        unchecked.append("cables ([cables] is not stated)")
    unchecked += _carriers(cell)
    unchecked.append("the way to the first HOME")
    return CollisionScope(tuple(movers), tuple(obstacles), tuple(unchecked))


def _carriers(cell: Cell) -> list[str]:
    """Return what is not checked of rails."""
    rails = [name for name in rails_of(cell.external) if cell.external[name].moves]
    return [f"carriage and foot of the robot on {name}" for name in rails]


def _count(capsules: Sequence[Capsule]) -> str:
    return f"{len(capsules)} capsule{'s' if len(capsules) != 1 else ''}"


def _estimated(sure: str) -> str:
    return ", ESTIMATED" if sure in _ESTIMATES else ""


def _has_holder(cell: Cell, number: int) -> bool:
    tool = cell.tool[number]
    return None not in (tool.stick_out_mm, tool.holder_diameter_mm, tool.length_mm)


def _named(tools: list[int]) -> str:
    return ", ".join(f"T{number}" for number in tools)
