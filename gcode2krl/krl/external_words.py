"""Comment lines of a program's header: where the external axes stand, and what is assumed of them."""

from collections.abc import Iterator

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.krl.number_text import fixed
from gcode2krl.tables import Targets


def external_lines(targets: Targets, cell: Cell) -> list[str]:
    """Return a line for each external axis, and one on what is assumed; none without axes."""
    lines = list(axes_words(targets, cell))
    if lines:
        lines.append("rails and tables are taken as rigid; a move takes them along evenly (ASSUMED)")
    return lines


def axes_words(targets: Targets, cell: Cell) -> Iterator[str]:
    """Yield for each external axis of a cell where it stands."""
    for column, key in enumerate(w.EXTERNAL_KEYS):
        if key not in cell.external:
            continue
        axis, at = cell.external[key], targets.external[:, column]
        places, home = np.unique(at[~targets.home]), np.unique(at[targets.home])
        if len(places) == 1:
            why = "stated" if not axis.moves else "chosen"
            words = f"at {fixed(places[0], 3)} {axis.unit} throughout ({why})"
        else:
            words = f"moves from {fixed(places[0], 3)} to {fixed(places[-1], 3)} {axis.unit}"
        if len(home) and not np.array_equal(home, places):
            words += f", HOME at {fixed(home[0], 3)}"
        yield f"{key} {axis.kind}: {words}"
