"""A canned program as G-code, as targets of a KRL program, and as a prediction."""

import io
import re
from dataclasses import fields, replace
from typing import Any

import numpy as np

from gcode2krl import frames as fr
from gcode2krl import gcode
from gcode2krl.arrays import Floats
from gcode2krl.canned.catalogue import PROGRAMS
from gcode2krl.canned.draft import Draft
from gcode2krl.canned.place import ProgramPlace
from gcode2krl.canned.turning import Pose, Turn
from gcode2krl.cell import Cell
from gcode2krl.chain import Plan, collect, prepare
from gcode2krl.errors import input_error
from gcode2krl.pipeline import plan_motion
from gcode2krl.prediction import Prediction
from gcode2krl.tables import Joints, Targets, Toolpath
from gcode2krl.units import S_PER_MIN

HALT_S = 60.0
"""A person's way to the tool and back; assumed."""
COARSE_S = 0.048
"""Sample time of a prediction that only weighs programs against each other."""
_END = re.compile(r"^\s*(N\d+\s*)?(M0?2|M30|%)\s*(\(.*\)|;.*)?$", re.IGNORECASE)


def draft_of(name: str, place: ProgramPlace, part: str | None = None) -> Draft:
    """Return a program's lines; ``part`` is the G-code that ``repeat`` runs.

    Raises `NotUnderstoodError` where a part is given to a program that takes none, or the other way round.
    """
    program = PROGRAMS[name]
    if program.takes_part != (part is not None):
        words = "needs the G-code that it repeats" if program.takes_part else "takes no G-code"
        raise input_error("option-value", f"make-test {name} {words}", "see gcode2krl make-test --help")
    draft = Draft(place)
    if program.turns:
        draft.say("what turns the tool is only in the krl form of this test")
    draft.head(name)
    program.body(draft)
    if part is not None:
        _repeat(draft, part)
    draft.tail()
    return draft


def _repeat(draft: Draft, part: str) -> None:
    """Write a given program without its end, and the way back from wherever it stops."""
    draft.say("the same program again: into a new blank, or with nothing clamped")
    draft.lines.append("G49 G64")
    draft.lines += [line for line in part.splitlines() if not _END.match(line)]
    draft.say("back to the reference points")
    draft.lines += ["M5", "G21 G90 G17 G40 G49 G80 G94 G54 G61", f"T{draft.place.tool} M6"]
    draft.lines += [f"G0 G43 H{draft.place.tool} Z{draft.at()[2]:.3f}"]
    draft.go()


def gcode_of(draft: Draft) -> str:
    """Return the G-code form, which lacks what turns the tool."""
    return "\n".join(draft.lines) + "\n"


def toolpath_of(draft: Draft, cell: Cell) -> Toolpath:
    """Return what the G-code form says."""
    return gcode.read_stream(io.BytesIO(gcode_of(draft).encode("utf-8")), "test program", cell)


def targets_of(draft: Draft, cell: Cell) -> Targets:
    """Return the targets of the KRL form, with the findings of the cell and the robot.

    Raises what `pipeline.set_targets` raises.
    """
    return _plan(draft, cell).targets


def _plan(draft: Draft, cell: Cell) -> Plan:
    plan = prepare(toolpath_of(draft, cell), cell)
    if not draft.turns:
        return plan
    targets, joints = plan.targets, plan.joints
    programmed = np.flatnonzero(targets.move >= 0)
    lines = targets.source_line[programmed]
    for line, turning in reversed(draft.turns):
        row = int(programmed[lines <= line][-1])  # a line that leads nowhere has no row of its own
        turn = turning(_pose(targets, joints, row), draft.place, cell)
        targets = _inserted(targets, row, turn)
    turned = Plan.of(plan.toolpath, targets, cell).judged()
    once = tuple(dict.fromkeys(turned.targets.issues))
    return replace(turned, targets=replace(turned.targets, issues=once))


def _pose(targets: Targets, joints: Joints, row: int) -> Pose:
    rotation = fr.rotation_from_quaternion(targets.rotation[row : row + 1])[0]
    return Pose(position_mm=targets.position_mm[row], rotation=rotation, q_rad=joints.q_rad[row])


def _inserted(targets: Targets, row: int, turn: Turn) -> Targets:
    """Return targets with motions after a row; they carry its row of the Toolpath and its line."""
    count = len(turn.position_mm)
    added: dict[str, Floats] = {
        "position_mm": turn.position_mm,
        "rotation": fr.quaternion_from_rotation(turn.rotation),
        "speed_mm_s": turn.speed_mm_s,
        "cdis_mm": turn.cdis_mm,
        "wait_s": turn.wait_s,
    }
    columns: dict[str, Any] = {}
    for spec in fields(targets):
        if "tail" in spec.metadata:
            values = getattr(targets, spec.name)
            new = added.get(spec.name, np.repeat(values[row : row + 1], count, axis=0))
            columns[spec.name] = np.concatenate([values[: row + 1], new, values[row + 1 :]])
    events = tuple(
        event._replace(row=event.row + count) if event.row > row else event for event in targets.events
    )
    return replace(targets, **columns, events=events)


def predicted(draft: Draft, cell: Cell, dt_s: float = COARSE_S) -> Prediction:
    """Return the prediction of the KRL form, in air."""
    return collect(_plan(draft, cell), dt_s, forces=False)


def minutes_of(draft: Draft, targets: Targets, cell: Cell) -> float:
    """Return how long a program takes: its predicted motion, the spindle's starts and a person's halts."""
    motion_s = float(plan_motion(targets, cell, COARSE_S, watches=False).time_s[-1])
    return (motion_s + draft.starts * (cell.spindle.start_s or 0.0) + draft.halts * HALT_S) / S_PER_MIN
