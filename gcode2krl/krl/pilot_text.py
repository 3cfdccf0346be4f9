"""The pilot force in a program's text: triggers, subprogram, checksum."""

import zlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gcode2krl import krl_words as w
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.krl.number_text import in_decimals
from gcode2krl.krl.triggers import Triggers
from gcode2krl.pilot import Knots, PilotHeader, knot_rows, sidecar_head
from gcode2krl.pilot.knots import FORCE_DECIMALS, LEAD_DECIMALS
from gcode2krl.units import MM_PER_M

NO_KNOT_YET = -1
"""What the variable of the form ``index`` holds before knot 0 is announced."""
VALUES = 4
"""Components written by the form ``values``: force x, y, z and the seconds until it."""
_CHECKSUM_BITS = 0x7FFFFFFF
_PRIO = f"{w.PRIO}={w.PRIO_BY_CONTROLLER}"


@dataclass(frozen=True)
class PilotText:
    """Knots, what announces them, and the names by which the program does it."""

    knots: Knots
    header: PilotHeader
    """Its checksum is known once the program is composed."""
    hash_variable: str
    triggers: Triggers | None = None
    sidecar: bool = True
    """False on standard output."""
    stated: int | None = None
    """The checksum to state; None = that of the targets and knots."""
    end_line: int | None = None
    """G-code line from which on the program has no pilot force any more; None = it has one throughout.
    The triggers are one more than the knots then: the last says that there is no knot."""

    def before(self, motions: int) -> tuple[NDArray[np.uint8], Ints]:
        """Return the text of all triggers, and where in it that of each motion (p + 1,) begins."""
        triggers = self.triggers
        if triggers is None:
            return np.zeros(0, dtype=np.uint8), np.zeros(motions + 1, dtype=np.int64)
        lines = [
            f"{w.TRIGGER} {w.WHEN} {w.DISTANCE}=0 {w.DELAY}={delay} {w.DO} {action}\r\n"
            for delay, action in zip(triggers.delay_ms.tolist(), self._actions(), strict=True)
        ]
        size = np.concatenate([[0], np.cumsum([len(line) for line in lines])]).astype(np.int64)
        start = size[np.searchsorted(triggers.row, np.arange(motions + 1))]
        return np.frombuffer("".join(lines).encode("ascii"), dtype=np.uint8), start

    def _actions(self) -> list[str]:
        """Return what each trigger does; ``PRIO=-1`` lets the controller choose the priority."""
        end = [self._no_knot()] if self.end_line is not None else []
        if self.header.form == "index":
            return [*(f"{self.header.variable}={knot}" for knot in range(len(self.knots))), *end]
        columns = [*self.knots.force_N.T.tolist(), self.knots.lead_s.tolist()]
        n, s = FORCE_DECIMALS, LEAD_DECIMALS
        told = [
            f"{w.PILOT_SUBPROGRAM}({x:.{n}f},{y:.{n}f},{z:.{n}f},{lead_s:.{s}f}) {_PRIO}"
            for x, y, z, lead_s in zip(*columns, strict=True)
        ]
        return [*told, *end]

    def _no_knot(self) -> str:
        """Return what puts the receiver back to where it was before the first knot: it knows no force."""
        if self.header.form == "index":
            return f"{self.header.variable}={NO_KNOT_YET}"
        return f"{w.PILOT_SUBPROGRAM}({','.join(['0.0'] * VALUES)}) {_PRIO}"

    def start_statements(self, checksum: int) -> str:
        """Return what the program sets before its first motion."""
        if self.header.form == "index":
            first = [f"{self.header.variable}={NO_KNOT_YET}"]
        else:
            first = [f"{self.header.variable}[{k}]=0.0" for k in range(1, VALUES + 1)]
        return "\n".join([*first, f"{self.hash_variable}={checksum}"])

    @cached_property
    def subprogram(self) -> str:
        """The subprogram that the triggers call, empty where they call none."""
        if self.header.form == "index":
            return ""
        names = ("GK_X", "GK_Y", "GK_Z", "GK_T")
        parameters = ",".join(f"{name}:IN" for name in names)
        assignments = "\n".join(
            f"{self.header.variable}[{k}]={name}" for k, name in enumerate(names, start=1)
        )
        return f"{w.DEF} {w.PILOT_SUBPROGRAM}({parameters})\nREAL {','.join(names)}\n{assignments}\n{w.END}"

    @cached_property
    def rows(self) -> bytes:
        """The rows of the sidecar, which the checksum covers."""
        return knot_rows(self.knots)

    def file(self, checksum: int) -> bytes:
        """Return the sidecar."""
        return sidecar_head(replace(self.header, checksum=checksum)) + self.rows


def checksum(
    position_mm: Floats,
    abc_deg: Floats,
    q_deg: Floats,
    ptp: Bools,
    speed_mm_s: Floats,
    cdis_mm: Floats,
    rows: bytes,
    home: Bools | None = None,
) -> int:
    """Return 31 bits over the targets and knots as written; what is not stated of a motion is NaN.

    Targets count as the decimals they are written in, so the text's layout does not matter; ``rows`` are
    those of the sidecar. With ``home`` (p,), whatever the columns say, positions count where it is not, and
    joints where it is.
    """
    away = None if home is None else ~home
    columns = (
        *((column, 3, away) for column in position_mm.T),
        *((column, 4, away) for column in abc_deg.T),
        *((column, 4, home) for column in q_deg.T),
    )
    value = 0
    for column, decimals, counts in columns:
        whole = in_decimals(column, decimals)
        if counts is not None:
            whole[~counts] = 0  # as what is not stated
        value = _crc(whole, value)
    value = _crc(ptp.astype(np.int64), value)
    value = _crc(in_decimals(speed_mm_s / MM_PER_M, 7), value)
    value = _crc(in_decimals(cdis_mm, 3), value)
    return zlib.crc32(rows, value) & _CHECKSUM_BITS


def _crc(column: Ints, value: int) -> int:
    return zlib.crc32(np.ascontiguousarray(column, dtype="<i8").data, value)
