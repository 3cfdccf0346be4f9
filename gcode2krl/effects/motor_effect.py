"""What effects of a turning motor have in common: they need the gear ratio of their joint."""

from gcode2krl.cell import Cell
from gcode2krl.effects.effect import JOINTS, Effect, Target


class MotorEffect(Effect):
    """An effect that repeats with the motor's turn; possible where the cell states the gear ratio."""

    def targets(self, cell: Cell) -> tuple[Target, ...]:
        """Return the joints whose gear ratio the cell states."""
        ratios = cell.robot.drives.gear_ratio
        return () if ratios is None else tuple(j for j, n in zip(JOINTS, ratios, strict=True) if n != 0.0)

    def why_not(self, cell: Cell, target: Target) -> str:
        """Say that the gear ratio is missing."""
        if target not in JOINTS or target in self.targets(cell):
            return ""
        return (
            f"the gear ratio of {target} of {cell.robot.title} is not known: state robot.drives.gear_ratio, "
            "N over D of $RAT_MOT_AX in the controller's $machine.dat (init --controller ARCHIVE reads it)"
        )
