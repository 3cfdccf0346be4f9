"""The columns of a Toolpath, into which the interpreter writes its rows."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcode2krl.compiled.core import OUT_BOOLS, OUT_FLOATS, OUT_INTS32, Struct, StructOf
from gcode2krl.gcode.state import KNOWN_AXES
from gcode2krl.units import RAD_PER_REV, S_PER_MIN

_COLUMNS = {
    "position_mm": OUT_FLOATS,
    "rapid": OUT_BOOLS,
    "feed_mm_s": OUT_FLOATS,
    "spindle_rad_s": OUT_FLOATS,
    "tool": OUT_INTS32,
    "exact_stop": OUT_BOOLS,
    "tolerance_mm": OUT_FLOATS,
    "dwell_s": OUT_FLOATS,
    "source_line": OUT_INTS32,
    "arc": OUT_INTS32,
    "machine": OUT_BOOLS,
    "known": OUT_BOOLS,
    "length_offset_mm": OUT_FLOATS,
    "length_offset_tool": OUT_INTS32,
    "turn": OUT_FLOATS,
    "turn_mode": OUT_INTS32,
    "time_s": OUT_FLOATS,
}
"""Column of the Toolpath: its type."""
_WIDTH = {"position_mm": 3, "known": 3, "turn": 3}
ROTARY = ("turn", "turn_mode", "time_s")
"""Columns that are filled only where the cell declares a machine: angles A, B, C in deg or a tool vector,
what they mean (`vocabulary.TURN_MACHINE` …), and the time that the block asks for, NaN where it asks for a
speed. `rotary.in_part` makes tip and tool axis of them."""
_START = {
    "rapid": True,
    "feed_mm_s": np.inf,
    "tolerance_mm": np.nan,
    "arc": -1,
    "time_s": np.nan,
}
"""What neither the state says nor 0 is in a row that stands before the first block."""
ROWS = StructOf(**_COLUMNS)


class Columns:
    """Columns with room for more rows; pages that no row has reached yet cost nothing."""

    def __init__(self, room: int, *, with_rotary: bool = False) -> None:
        unused = () if with_rotary else ROTARY
        self._arrays = {name: self._empty(name, 0 if name in unused else room) for name in _COLUMNS}
        self.room = room
        self._filled = tuple(name for name in _COLUMNS if name not in unused)

    def begin(self, state: np.void) -> int:
        """Write the row of the start point and, where the state has a place, one that goes there; return
        how many."""
        rows = 1 + all(state[known] for known in KNOWN_AXES)
        length_mm = float(state["length_offset"])
        of_state = {
            "tool": state["tool"],
            "spindle_rad_s": state["direction"] * state["rpm"] * RAD_PER_REV / S_PER_MIN,
            "length_offset_mm": length_mm,
            "length_offset_tool": state["offset_tool"],
        }
        for row in range(rows):
            there = {"position_mm": [state[axis] for axis in "xyz"], "known": True} if row else {}
            values = _START | of_state | there
            for name in self._filled:
                self._arrays[name][row] = values.get(name, 0)
        return rows

    @staticmethod
    def _empty(name: str, room: int) -> NDArray[Any]:
        tail = (_WIDTH[name],) if name in _WIDTH else ()
        return np.empty((room, *tail), _COLUMNS[name].dtype)

    def reserve(self, rows: int, used: int) -> None:
        """Make room for so many rows in all; the first ``used`` are kept."""
        if rows <= self.room:
            return
        self.room = max(rows, self.room * 3 // 2)
        for name in self._filled:
            old = self._arrays[name]
            larger = self._empty(name, self.room)
            larger[:used] = old[:used]
            self._arrays[name] = larger

    def views(self) -> Struct:
        """Return what the core writes to, until more room is made."""
        return ROWS(**self._arrays)

    def finished(self, count: int) -> dict[str, NDArray[Any]]:
        """Return the first ``count`` rows of the columns by their names in the Toolpath."""
        return {name: self._arrays[name][:count] for name in self._filled}
