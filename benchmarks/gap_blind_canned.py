"""The canned programs of `gcode2krl make-test`: their names, their predictions, and what the plant drives."""

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gcode2krl import Prediction, load_cell

STEP_s = 0.012
AT_REST_mm_s = 1e-6
AGAIN = "repeat"
"""Runs a program that is given: the plant does that without a canned one."""


class NotCannedError(Exception):
    """A canned program cannot be made; the message says why."""


@functools.cache
def names() -> tuple[str, ...]:
    """Return the names of the canned programs that need no part."""
    try:
        from gcode2krl.canned import NAMES
    except ImportError:
        return ()
    return tuple(name for name in NAMES if name != AGAIN)


def predicted(name: str, cell_file: Path, folder: Path) -> tuple[Path, dict[str, Any]]:
    """Return the folder of a canned program's prediction, made where it is not there yet, and plain data.

    The data are what the plant drives: the commanded joints over time, and the spindle and the hung weights
    that the program's lines ask for. Raises NotCannedError where there is no such program.
    """
    if name not in names():
        raise NotCannedError(f"make-test knows no {name!r}; it knows {', '.join(names()) or 'none'}")
    from gcode2krl import canned

    cell = load_cell(cell_file)
    draft = canned.draft_of(name, canned.place_of(cell))
    place = folder / f"canned-{name}"
    if not (place / "prediction.toml").exists():
        canned.predicted(draft, cell, STEP_s).save(place)
    prediction = Prediction.load(place)
    if prediction.motion is None or prediction.joints is None:
        raise NotCannedError(f"the prediction of {name} has no joints")
    motion = prediction.motion
    begun = moments(draft.states, motion, prediction.toolpath.source_line)
    track = {"t_s": motion.time_s.tolist(), "q_deg": np.degrees(prediction.joints.q_rad).tolist()}
    hung = weights(begun, float(motion.time_s[-1]))
    return place, {"name": name, "track": track, "spindle": spindle(begun), "weights": hung}


@dataclass(frozen=True)
class Moment:
    """From a time on: the pull on the tool along ``$BASE`` and the spindle's speed."""

    time_s: float
    pull_N: tuple[float, float, float]
    rpm: float


def moments(states: Iterable[Any], motion: Any, source_line: np.ndarray) -> list[Moment]:
    """Return when each state of a program begins: a dwell after the last move up to its line.

    ``source_line``: of each row of the Toolpath that the motion's samples name.
    """
    moving = motion.speed_mm_s > AT_REST_mm_s
    lines, times_s = source_line[motion.move][moving], motion.time_s[moving]
    found = []
    for state in states:
        before = np.flatnonzero(lines <= state.line)
        arrived_s = float(times_s[before[-1]]) if len(before) else 0.0
        time_s = min(arrived_s + state.stood_s, float(motion.time_s[-1]))
        found.append(Moment(time_s, tuple(map(float, state.pull_N)), float(state.rpm)))
    return found


def spindle(found: Sequence[Moment]) -> list[list[float]]:
    """Return time and speed of the spindle for the plant; it stands at first."""
    return [[0.0, 0.0], *([each.time_s, each.rpm] for each in found)]


def weights(found: Sequence[Moment], end_s: float) -> list[dict[str, Any]]:
    """Return the pulls on the tool for the plant, each until the next change."""
    ends_s = [*(each.time_s for each in found[1:]), end_s]
    return [
        {"from_s": each.time_s, "to_s": to_s, "pull_N": list(each.pull_N)}
        for each, to_s in zip(found, ends_s[: len(found)], strict=True)
        if any(each.pull_N)
    ]
