"""Restarts at lines of a program, judged by reading the written text back beside that of the whole program.

- path: positions, angles, speeds and waits behind the start are the last ones of the whole program;
- rapid: no rapid, and no way down, meets material that is not named for the whole program too;
- guard: what stands before the first motion is the same, but for the restart's own message.

Programs are put where the demonstration cell reaches them, and what the whole program is refused for is
released: its own mistakes are not those of a restart.
"""

import random
from dataclasses import dataclass

import numpy as np

from gcode2krl import Gcode2KrlError, load_cell, read_gcode, write_krl
from gcode2krl.krl.read import read_texts
from gcode2krl.krl.release import NEVER_RELEASED
from gcode2krl.pipeline import predict_toolpath
from gcode2krl.restart.material import restarted

COLLISIONS = frozenset({"rapid-in-stock", "shank-in-stock", "holder-in-stock"})
_OWN_MESSAGE = "NR 7,"


@dataclass(frozen=True)
class Trial:
    """One restart; each check is True where it holds, and the rest is empty where the line was refused."""

    line: int
    refused: str = ""
    path: bool = False
    rapid: bool = False
    guard: bool = False


def _into_reach(part):
    """Return a ``$BASE`` that puts the middle of the program where the demonstration cell reaches well."""
    try:
        path = read_gcode(part, load_cell())
    except Gcode2KrlError:
        return ""
    place = path.position_mm[1:][~path.machine[1:]]
    if len(place) == 0:
        return ""
    low, high = place.min(axis=0), place.max(axis=0)
    x_mm, y_mm, z_mm = (*(-(low + high)[:2] / 2.0), -low[2])
    base = f"x_mm = {1600.0 + x_mm:.1f}, y_mm = {y_mm:.1f}, z_mm = {760.0 + z_mm:.1f}"
    base += ", a_deg = 0.0, b_deg = 0.0, c_deg = 0.0"
    plane = f"[clearance]\nz_mm = {max(100.0, high[2] + 5.0):.1f}\n"
    return f'[frames]\nspin = "auto"\nbase = {{ {base} }}\n{plane}'


def cell_for(part, tools):
    """Return the demonstration cell with a ``$BASE`` within reach, and a mill for tools it does not know."""
    tools.write_text(
        'based_on = "demonstration"\n[program]\ntool_length = "from_table"\n' + _into_reach(part), "utf-8"
    )
    return load_cell(tools)


def text_of(prediction):
    """Return a prediction's program, composed and read back; its errors are released where possible."""
    errors = {i.code for i in prediction.issues if i.severity == "error"} | {
        i.code
        for i in prediction.issues
        if i.code in ("h-differs", "work-offset-unknown", "unit-doubtful", "cut-off")
    }
    allow = sorted(errors - NEVER_RELEASED)
    written = write_krl(prediction, None, name="PART", allow=allow, pilot="none")
    return read_texts(written.texts, "PART.src")


def same_path(whole, begun, way):
    """Tell whether the motions of a restart, behind HOME and its way down, are the whole program's last."""
    count = len(begun.ptp) - 1 - way
    return 0 < count <= len(whole.ptp) and all(
        np.array_equal(getattr(whole, name)[-count:], getattr(begun, name)[-count:], equal_nan=True)
        for name in ("position_mm", "abc_deg", "q_deg", "ptp", "speed_mm_s", "wait_s")
    )


def guard_of(program):
    """Return the statements before the first motion, without the restart's message and its HALT."""
    texts = [s.text for s in program.statements if s.motion == 0]
    own = next((k for k, text in enumerate(texts) if _OWN_MESSAGE in text), None)
    return texts if own is None else texts[:own] + texts[own + 3 :]


def has_pose_guard(program):
    """Tell whether the axes are compared behind the first PTP that is not HOME."""
    return any("$AXIS_ACT" in s.text for s in program.statements if s.motion == 2)


def new_collisions(whole, begun):
    """Return the collisions of a restart that the whole program does not have at their lines."""
    known = {(i.code, i.line) for i in whole.issues if i.code in COLLISIONS}
    return [i.text() for i in begun.issues if i.code in COLLISIONS and (i.code, i.line) not in known]


def trial(line, toolpath, cell, whole, text):
    """Begin a program at a line and judge it."""
    try:
        begun = restarted(toolpath, line, cell)
        prediction = predict_toolpath(begun, cell)
        program = text_of(prediction)
    except Gcode2KrlError as error:
        return Trial(line, next((i for i in error.issues if i.severity == "error"), error.issues[0]).code)
    moves = prediction.targets.move
    way = int(np.count_nonzero((moves > 0) & (moves <= begun.restart.way_rows)))
    guard = guard_of(program) == guard_of(text) and has_pose_guard(program)
    return Trial(line, "", same_path(text, program, way), not new_collisions(whole, prediction), guard)


def trials_of(part, count, seed, cell_file):
    """Return trials at random lines of a program that move the tool."""
    cell = cell_for(part, cell_file)
    toolpath = read_gcode(part, cell)
    whole = predict_toolpath(toolpath, cell)
    text = text_of(whole)
    lines = np.unique(toolpath.source_line[1:][~toolpath.machine[1:]]).tolist()
    chosen = random.Random(seed).sample(lines, min(count, len(lines)))
    return [trial(line, toolpath, cell, whole, text) for line in chosen]
