"""Every effect the plant can have, in three shelves: of the library, of no library, slips of the set-up."""

from tests.plant.effects import (
    body,
    drives,
    events,
    filters,
    forces,
    joints,
    open_forces,
    open_joints,
    open_tips,
    readings,
    shaking,
    slips,
    steps,
    structure,
    surroundings,
    timing,
)
from tests.plant.effects.registry import LIBRARY, SLIPS, UNKNOWN, Draw, Kind

__all__ = ["LIBRARY", "SLIPS", "UNKNOWN", "Draw", "Kind"]
