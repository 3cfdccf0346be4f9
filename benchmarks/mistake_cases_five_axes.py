"""Wrong declarations of the machine of a five-axis program: each passes as a cell, and cuts another part.

The programs are sound ones of `tests.gcode.five_axis_programs`, posted for the right machine; the cell
declares another. Any move with turned axes shows the mistake, so any line of a move is right; a length in
metres is the cell's, line 0.
"""

from typing import Any

from mistake_cases import Mistake

from tests.gcode.five_axis_programs import LENGTHS, MACHINES, cell_text, posted

TABLE = {**MACHINES["table-table AC"], **LENGTHS}
HEAD = {**MACHINES["head-head CA"], **LENGTHS}
HEAD_AB = {**MACHINES["head-head AB"], **LENGTHS}
TIP, AXES = "G43.4 H1", "G43 H1"
METRES = {"centre_mm": [0.01, -0.015, -0.14]}
RADIANS, G93 = {"radians": True}, {"per_block_time": True}
_ROWS: tuple[tuple[str, str, str, dict[str, Any], str, dict[str, Any], dict[str, Any]], ...] = (
    ("sign of A", "signs", "tilted pockets", TABLE, TIP, {}, {"signs": [1, -1]}),
    ("sign of A", "signs", "dome raster", TABLE, AXES, {}, {"signs": [1, -1]}),
    ("sign of C", "signs", "impeller", TABLE, TIP, {}, {"signs": [-1, 1]}),
    ("sign of a head's C", "signs", "tilted planes", HEAD, AXES, {}, {"signs": [-1, 1]}),
    ("order of A and C", "axes", "dome raster", TABLE, TIP, {}, {"axes": ["C", "A"]}),
    ("order of A and B", "axes", "tilted holes", HEAD_AB, TIP, {}, {"axes": ["B", "A"]}),
    ("head for table", "kind", "dome raster", TABLE, AXES, {}, {"kind": "head-head"}),
    ("table for head", "kind", "tilted pockets", HEAD, TIP, {}, {"kind": "table-table", "signs": [1, 1]}),
    ("G43 for G43.4", "tcpm", "tilted pockets", TABLE, AXES, {}, {}),
    ("tcpm = true for machine axes", "tcpm", "tilted planes", HEAD, AXES, {}, {"tcpm": True}),
    ("centre in metres", "centre_mm", "dome raster", TABLE, AXES, {}, METRES),
    ("centre in metres", "centre_mm", "tilted pockets", TABLE, TIP, {}, METRES),
    ("A and C in radians", "radians", "dome raster", TABLE, TIP, RADIANS, {}),
    ("A and C in radians", "radians", "tilted pockets", HEAD, TIP, RADIANS, {}),
    ("pivot 100 mm too short", "pivot_mm", "tilted planes", HEAD, AXES, {}, {"pivot_mm": 80.0}),
    ("pivot 100 mm too long", "pivot_mm", "dome raster", HEAD, AXES, G93, {"pivot_mm": 280.0}),
)
"""Mistake, key of the machine, program, its machine, how it is posted, and what the cell says instead."""


def _case(what: str, key: str, part: str, right: dict[str, Any], tip: str, how: Any, wrong: Any) -> Mistake:
    text = posted(part, right, tip=TIP if "G43.4" in what else tip, **how)
    if "G43.4" in what:
        text = text.replace("G43.4", "G43")
    declared = {name: value for name, value in {**right, **wrong}.items() if name != "tcpm"}
    return Mistake(
        f"{what}: {part}, {'tip' if tip == TIP else 'axes'}",
        r"A and C .*radians" if key == "radians" else rf"machine\.{key}",
        data=text.encode("ascii"),
        cell=cell_text(declared, tcpm=wrong.get("tcpm", False)),
        tools="",
        severity="warning",
        expected=tuple(range(7, text.count("\n"))),
        or_whole=True,
    )


FIVE_AXES = tuple(_case(*row) for row in _ROWS)
