"""A canned program as the inputs of the measuring chain: what a run of it would be simulated from."""

import functools
from dataclasses import dataclass, replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.canned.catalogue import PROGRAMS
from gcode2krl.canned.draft import Draft
from gcode2krl.canned.place import place_of
from gcode2krl.canned.program import COARSE_S, HALT_S, draft_of, predicted
from gcode2krl.cell import Cell
from gcode2krl.effects import Inputs, inputs_of
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.units import S_PER_MIN

_MOST_ROWS = 1500
"""Slow programs are sampled coarsely: nothing fast happens in them."""
_RAD_S_PER_RPM = 2.0 * np.pi / S_PER_MIN


@dataclass(frozen=True, eq=False)
class Trial:
    """A program, how long it takes, and the nominal chain of its run."""

    name: str
    minutes: float
    inputs: Inputs


def trials_of(cell: Cell) -> tuple[Trial, ...]:
    """Return the programs that can run in a cell, at their default place; none where it states too little.

    Remembered for the last few cells. A program that would be refused is left out.
    """
    return _trials(cell.model_dump_json())


@functools.lru_cache(maxsize=4)
def _trials(cell_json: str) -> tuple[Trial, ...]:
    cell = Cell.model_validate_json(cell_json)
    trials = (_trial(name, cell) for name, program in PROGRAMS.items() if not program.takes_part)
    return tuple(trial for trial in trials if trial is not None)


def _trial(name: str, cell: Cell) -> Trial | None:
    try:
        draft = draft_of(name, place_of(cell))
        prediction = predicted(draft, cell)
        motion = prediction.motion
        if motion is not None and len(motion) > _MOST_ROWS:
            dt_s = COARSE_S * np.ceil(len(motion) / _MOST_ROWS)
            prediction = predicted(draft, cell, float(dt_s))
        inputs = inputs_of(prediction)
    except Gcode2KrlError:
        return None
    if any(issue.severity == "error" for issue in prediction.targets.issues):
        return None
    if not np.isfinite(inputs.q_cmd_rad).all():
        return None
    motion_s = float(inputs.time_s[-1])
    minutes = motion_s + draft.starts * (cell.spindle.start_s or 0.0) + draft.halts * HALT_S
    return Trial(name, minutes / S_PER_MIN, with_states(inputs, draft))


def with_states(inputs: Inputs, draft: Draft) -> Inputs:
    """Return inputs with what a person hangs on the tool and the speeds of the spindle."""
    force_N, spindle_rad_s = np.zeros((len(inputs), 3)), np.zeros(len(inputs))
    for state in draft.states:
        since = inputs.time_s >= _time_of(inputs, state.line, state.stood_s)
        force_N[since], spindle_rad_s[since] = state.pull_N, state.rpm * _RAD_S_PER_RPM
    return replace(inputs, force_base_N=force_N, spindle_rad_s=spindle_rad_s)


def _time_of(inputs: Inputs, line: int, stood_s: float) -> float:
    """Return when the robot has stood for a time after the move of a line."""
    there = np.flatnonzero(inputs.source_line <= line)
    if len(there) == 0:
        return float(inputs.time_s[0])
    last = int(there[-1])
    end_mm: Floats = inputs.position_mm[last]
    away = np.linalg.norm(inputs.position_mm[: last + 1] - end_mm, axis=1) > 1e-6
    moving = np.flatnonzero(away)
    arrived = int(moving[-1]) + 1 if len(moving) else 0
    return float(inputs.time_s[min(arrived, last)] + stood_s)
