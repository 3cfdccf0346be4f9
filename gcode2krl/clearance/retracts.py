"""Collisions of the retract that an online session makes where its link is lost: out along the tool axis.

It may begin anywhere between the first cut and the last. It is looked at from the targets and from places
10 mm apart on the lines between them, from up to `MOST` of these evenly through the program: each way out is
checked without gaps, but not every place has one. Where the correction has moved the tip is not known here.
"""

import numpy as np

from gcode2krl import robot
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell
from gcode2krl.clearance.beside import watch_of
from gcode2krl.errors import Issue
from gcode2krl.tables import Targets

MOST = 2000
"""Places from which the way out is checked, some 0.2 ms each."""
_STEP_MM = 5.0
_WORDS = " on the retract of a lost link"


def collisions_on_retracts(
    targets: Targets, first: int, last: int, retract_mm: float, cell: Cell
) -> tuple[Issue, ...]:
    """Return what a retract hits that begins at a row of ``first`` to ``last``, or on the way to it."""
    watch = watch_of(cell)
    if watch is None:
        return ()
    place = robot.places_between(targets, first, last, cell)
    rows = np.unique(np.linspace(0, len(place.target) - 1, min(MOST, len(place.target))).astype(np.int64))
    for row in rows.tolist():
        way = _way_out(place, row, retract_mm, cell)
        if np.isfinite(way).all():
            target, at = int(place.target[row]), np.broadcast_to(place.external[row], (len(way), 6))
            line = int(targets.source_line[target])
            watch.way(way, int(targets.tool[target]), line, _WORDS, is_ptp=False, external=at)
    return watch.issues()


def _way_out(place: robot.Places, row: int, retract_mm: float, cell: Cell) -> Floats:
    """Return the joints (n, 6) of the way out along the tool axis, NaN where it is out of reach."""
    steps = np.linspace(0.0, retract_mm, int(np.ceil(retract_mm / _STEP_MM)) + 1)
    return robot.angles_along(place, row, steps, cell)
