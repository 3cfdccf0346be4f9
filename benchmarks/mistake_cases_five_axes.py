"""Wrong declarations of the machine of a five-axis program: each passes as a cell, and cuts another part.

The programs are sound ones of `five_axis_programs`, posted for the right machine; the cell declares another.
Any move with turned axes shows the mistake, so any line of a move is right; a length in metres is the
cell's, line 0.
"""

from typing import Any

from five_axis_programs import LENGTHS, MACHINES, cell_text, posted
from mistake_cases import Mistake

TABLE = {**MACHINES["table-table AC"], **LENGTHS}
HEAD = {**MACHINES["head-head CA"], **LENGTHS}
TIP, AXES = "G43.4 H1", "G43 H1"


def _case(title: str, key: str, text: str, machine: dict[str, Any], *, tcpm: bool = False) -> Mistake:
    count = text.count("\n")
    return Mistake(
        title,
        key,
        data=text.encode("ascii"),
        cell=cell_text(machine, tcpm=tcpm),
        tools="",
        severity="warning",
        expected=tuple(range(7, count)),
        or_whole=True,
    )


FIVE_AXES = (
    _case(
        "sign of A: tilted pockets under TCPM",
        r"machine\.signs",
        posted("tilted pockets", TABLE, tip=TIP),
        {**TABLE, "signs": [1, -1]},
    ),
    _case(
        "sign of A: a dome by the machine's axes",
        r"machine\.signs",
        posted("dome raster", TABLE, tip=AXES),
        {**TABLE, "signs": [1, -1]},
    ),
    _case(
        "sign of C: an impeller under TCPM",
        r"machine\.signs",
        posted("impeller", TABLE, tip=TIP),
        {**TABLE, "signs": [-1, 1]},
    ),
    _case(
        "sign of a head's C: tilted planes by the machine's axes",
        r"machine\.signs",
        posted("tilted planes", HEAD, tip=AXES),
        {**HEAD, "signs": [-1, 1]},
    ),
    _case(
        "order of A and C: a dome under TCPM",
        r"machine\.axes",
        posted("dome raster", TABLE, tip=TIP),
        {**TABLE, "axes": ["C", "A"]},
    ),
    _case(
        "order of A and B: tilted holes under TCPM",
        r"machine\.axes",
        posted("tilted holes", {**MACHINES["head-head AB"], **LENGTHS}, tip=TIP),
        {**MACHINES["head-head AB"], **LENGTHS, "axes": ["B", "A"]},
    ),
    _case(
        "head for table: a dome by the machine's axes",
        r"machine\.kind",
        posted("dome raster", TABLE, tip=AXES),
        {**TABLE, "kind": "head-head"},
    ),
    _case(
        "table for head: tilted pockets under TCPM",
        r"machine\.kind",
        posted("tilted pockets", HEAD, tip=TIP),
        {**HEAD, "kind": "table-table", "signs": [1, 1]},
    ),
    _case(
        "G43 for G43.4: tilted pockets",
        r"machine\.tcpm",
        posted("tilted pockets", TABLE, tip=TIP).replace("G43.4", "G43"),
        TABLE,
    ),
    _case(
        "tcpm = true for machine axes: tilted planes",
        r"machine\.tcpm",
        posted("tilted planes", HEAD, tip=AXES),
        HEAD,
        tcpm=True,
    ),
    _case(
        "centre in metres: a dome by the machine's axes",
        r"machine\.centre_mm",
        posted("dome raster", TABLE, tip=AXES),
        {**TABLE, "centre_mm": [0.01, -0.015, -0.14]},
    ),
    _case(
        "centre in metres: tilted pockets under TCPM",
        r"machine\.centre_mm",
        posted("tilted pockets", TABLE, tip=TIP),
        {**TABLE, "centre_mm": [0.01, -0.015, -0.14]},
    ),
    _case(
        "A and C in radians: a dome under TCPM",
        r"A and C .*radians",
        posted("dome raster", TABLE, tip=TIP, radians=True),
        TABLE,
    ),
    _case(
        "A and C in radians: tilted pockets under TCPM",
        r"A and C .*radians",
        posted("tilted pockets", HEAD, tip=TIP, radians=True),
        HEAD,
    ),
    _case(
        "pivot 100 mm too short: tilted planes in a stated stock",
        r"machine\.pivot_mm",
        posted("tilted planes", HEAD, tip=AXES),
        {**HEAD, "pivot_mm": 80.0},
    ),
    _case(
        "pivot 100 mm too long: a dome under G93",
        r"machine\.pivot_mm",
        posted("dome raster", HEAD, tip=AXES, per_block_time=True),
        {**HEAD, "pivot_mm": 280.0},
    ),
)
