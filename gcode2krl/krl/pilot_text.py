"""The pilot force in a program's text: triggers, subprogram, checksum."""

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gcode2krl import krl_words as w
from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.compiled.chunks import chunk_borders
from gcode2krl.krl.number_text import NOTHING_BEFORE, in_decimals
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

    def before(self, start: int, end: int) -> tuple[NDArray[np.uint8], Ints]:
        """Return the text of the triggers before motions start..end, and where in it that of each begins."""
        first, behind = self._triggers_of(start, end)
        if first == behind or self.triggers is None:
            return NOTHING_BEFORE
        written = slice(first, behind)
        lines = [
            f"{w.TRIGGER} {w.WHEN} {w.DISTANCE}=0 {w.DELAY}={delay} {w.DO} {action}\r\n"
            for delay, action in zip(
                self.triggers.delay_ms[written].tolist(), self._actions(written), strict=True
            )
        ]
        size = np.concatenate([[0], np.cumsum([len(line) for line in lines])]).astype(np.int64)
        begins = size[np.searchsorted(self.triggers.row[written], np.arange(start, end + 1))]
        return np.frombuffer("".join(lines).encode("ascii"), dtype=np.uint8), begins

    def calls_in(self, start: int, end: int) -> bool:
        """Tell whether triggers before motions start..end call the subprogram."""
        first, behind = self._triggers_of(start, end)
        return self.header.form == "values" and behind > first

    def _triggers_of(self, start: int, end: int) -> tuple[int, int]:
        """Return the first trigger of motions start..end, and the one behind the last."""
        if self.triggers is None:
            return 0, 0
        first, behind = np.searchsorted(self.triggers.row, (start, end)).tolist()
        return first, behind

    def _actions(self, rows: slice) -> list[str]:
        """Return what triggers do; ``PRIO=-1`` lets the controller choose the priority."""
        count = len(self.knots)
        end = [self._no_knot()] if rows.stop > count else []
        if self.header.form == "index":
            known = range(rows.start, min(rows.stop, count))
            return [*(f"{self.header.variable}={knot}" for knot in known), *end]
        columns = [*self.knots.force_N[rows].T.tolist(), self.knots.lead_s[rows].tolist()]
        n, s = FORCE_DECIMALS, LEAD_DECIMALS
        lines = [
            f"{w.PILOT_SUBPROGRAM}({x:.{n}f},{y:.{n}f},{z:.{n}f},{lead_s:.{s}f}) {_PRIO}"
            for x, y, z, lead_s in zip(*columns, strict=True)
        ]
        return [*lines, *end]

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
    joint_rows: Ints,
    joint_deg: Floats,
    ptp: Bools,
    speed_mm_s: Floats,
    cdis_mm: Floats,
    rows: bytes,
    home: Bools | None = None,
    external: Floats | None = None,
) -> int:
    """Return 31 bits over the targets and knots as written; what is not stated of a motion is NaN.

    Targets count as the decimals they are written in, so the text's layout does not matter; ``joint_deg``
    (j, 6) are the joint targets of the motions ``joint_rows`` (j,), ``rows`` those of the sidecar. With
    ``home`` (p,), whatever the columns say, positions count only where it is not. ``external`` (p, 6) counts
    where there is any.
    """
    count = len(ptp)

    def cartesian(column: Floats, decimals: int, part: slice) -> Ints:
        whole = in_decimals(column[part], decimals)
        if home is not None:
            whole[home[part]] = 0  # as what is not stated
        return whole

    def joint(angles: Ints, part: slice) -> Ints:
        whole = np.zeros(part.stop - part.start, dtype=np.int64)
        first, behind = np.searchsorted(joint_rows, (part.start, part.stop))
        whole[joint_rows[first:behind] - part.start] = angles[first:behind]
        return whole

    columns: list[Callable[[slice], Ints]] = [
        *(partial(cartesian, column, 3) for column in position_mm.T),
        *(partial(cartesian, column, 4) for column in abc_deg.T),
        *(partial(joint, in_decimals(column, 4)) for column in joint_deg.T),
        lambda part: ptp[part].astype(np.int64),
        lambda part: in_decimals(speed_mm_s[part] / MM_PER_M, 7),
        lambda part: in_decimals(cdis_mm[part], 3),
    ]
    if external is not None and _are_carried(external):
        columns += [partial(_thousandths, column) for column in external.T]
    value = 0
    for column in columns:
        for start, end in pairwise(chunk_borders(count)):
            whole = column(slice(start, end))
            value = zlib.crc32(np.ascontiguousarray(whole, dtype="<i8").data, value)
    return zlib.crc32(rows, value) & _CHECKSUM_BITS


def _are_carried(external: Floats) -> bool:
    """Tell whether any external axis is anywhere but at 0."""
    rows = external[:1] if external.strides[0] == 0 else external
    return bool(np.nan_to_num(rows).any())


def _thousandths(column: Floats, part: slice) -> Ints:
    return in_decimals(column[part], 3)
