"""The canned programs of `gcode2krl make-test`: their names, their predictions, and what the plant drives."""

import functools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gcode2krl import Prediction, load_cell

STEP_s = 0.012
STANDARD_GRAVITY_m_s2 = 9.80665
AT_REST_mm_s = 1e-6
AGAIN = "repeat"
"""Runs a program that is given: the plant does that without a canned one."""
_SPINDLE = re.compile(r"^S(\d+) M3$|^M5$")
_DWELL = re.compile(r"^G4 P([\d.]+)$")


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
    clock = LineClock(draft.lines, prediction)
    track = {
        "t_s": prediction.motion.time_s.tolist(),
        "q_deg": np.degrees(prediction.joints.q_rad).tolist(),
    }
    data = {"name": name, "track": track, "spindle": list(clock.spindle())}
    return place, data | {"weights": list(clock.weights(draft.pulls_N))}


class LineClock:
    """When the lines of a program are reached: after the last move before, and the dwells since."""

    def __init__(self, lines: Sequence[str], prediction: Prediction):
        motion = prediction.motion
        if motion is None:
            raise NotCannedError("the prediction has no motion")
        self.lines = list(lines)
        self.end_s = float(motion.time_s[-1])
        moving = motion.speed_mm_s > AT_REST_mm_s
        self._line = prediction.toolpath.source_line[motion.move][moving]
        self._time_s = motion.time_s[moving]

    def at(self, line: int) -> float:
        """Return the time in seconds at which a line, the first being 1, is reached."""
        before = np.flatnonzero(self._line < line)
        arrived_s, last = (
            (float(self._time_s[before[-1]]), int(self._line[before[-1]])) if len(before) else (0.0, 0)
        )
        dwells = [_DWELL.match(text) for text in self.lines[last : line - 1]]
        return min(arrived_s + sum(float(dwell[1]) for dwell in dwells if dwell), self.end_s)

    def spindle(self) -> Iterator[list[float]]:
        """Yield time and speed of each change of the spindle; it stands at first."""
        yield [0.0, 0.0]
        for number, text in enumerate(self.lines, start=1):
            if found := _SPINDLE.match(text):
                yield [self.at(number), float(found[1] or 0.0)]

    def weights(self, pulls_N: Sequence[tuple[int, Sequence[float]]]) -> Iterator[dict[str, float]]:
        """Yield the weights that hang down; pulls to a side are left out: the plant has none."""
        times_s = [*(self.at(line + 1) for line, _ in pulls_N), self.end_s]
        for number, (_, (x_N, y_N, z_N)) in enumerate(pulls_N):
            if z_N < 0.0 and x_N == y_N == 0.0:
                from_s, to_s = times_s[number : number + 2]
                yield {"from_s": from_s, "to_s": to_s, "kg": -z_N / STANDARD_GRAVITY_m_s2}
