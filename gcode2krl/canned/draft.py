"""Lines of G-code of a test program, and beside them what G-code cannot say: turns of the tool, weights."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gcode2krl.canned.place import Point, ProgramPlace
from gcode2krl.canned.turning import Pose, Turn
from gcode2krl.cell import Cell
from gcode2krl.units import S_PER_MIN

REFERENCE_DWELL_S = 3.0
"""Long enough for a tracker to average, short enough that nothing drifts."""
GESTURE_MM = (20.0, -20.0, 10.0, -10.0, 20.0, -20.0)
"""Strokes along the diagonal of x, y and z: long, short, long, so that no other move is taken for it."""
GESTURE_PAUSE_S = 0.5
DIAGONAL = np.array([1.0, 1.0, -1.0]) / 3.0**0.5
"""Nothing goes above the program's place: a stock is guessed below the feeds of what rises above them."""
REFERENCES = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, -0.2))
"""The three points that every program measures first and last, in units of its size."""
Turning = Callable[[Pose, ProgramPlace, Cell], Turn]


class State(NamedTuple):
    """What changes while the robot stands: from here on it holds."""

    line: int
    """1-based, of the move that led here."""
    stood_s: float
    """Dwell after that move before the change."""
    pull_N: Point
    """On the tool along ``$BASE``."""
    rpm: float


def around_minutes() -> float:
    """Return how long gestures and reference points take, without the moves between them."""
    gesture_s = GESTURE_PAUSE_S * (2.0 + len(GESTURE_MM))
    return 2.0 * (gesture_s + len(REFERENCES) * REFERENCE_DWELL_S) / S_PER_MIN


@dataclass
class Draft:
    """A program as it grows. Points are relative to its place."""

    place: ProgramPlace
    lines: list[str] = field(default_factory=list)
    turns: list[tuple[int, Turning]] = field(default_factory=list)
    """After the move of this line the tool turns."""
    states: list["State"] = field(default_factory=list)
    """Pulls and spindle speeds, in the order of time."""
    halts: int = 0
    starts: int = 0
    """How often the spindle is started or stopped."""

    stood_s: float = 0.0
    """Dwell since the last move."""
    moved: tuple[int, Point] = (0, (float("nan"),) * 3)
    """Line and end of the last move."""

    @property
    def line(self) -> int:
        """Return the number of the last line."""
        return len(self.lines)

    def at(self, x_mm: float = 0.0, y_mm: float = 0.0, z_mm: float = 0.0) -> Point:
        """Return a point in ``$BASE``."""
        x, y, z = self.place.origin_mm
        return x + x_mm, y + y_mm, z + z_mm

    def say(self, text: str) -> None:
        """Write a comment."""
        self.lines.append(f"({text.upper()})")

    def go(self, x_mm: float = 0.0, y_mm: float = 0.0, z_mm: float = 0.0) -> None:
        """Write a rapid move, which needs no spindle."""
        x, y, z = self.at(x_mm, y_mm, z_mm)
        self.lines.append(f"G0 X{x:.3f} Y{y:.3f} Z{z:.3f}")
        self._moved_to((x, y, z))

    def feed(self, point: Point, speed_mm_s: float) -> None:
        """Write a line at a speed, before the place's percentage."""
        x, y, z = self.at(*point)
        self.lines.append(f"G1 X{x:.3f} Y{y:.3f} Z{z:.3f} F{self.feed_rate(speed_mm_s):g}")
        self._moved_to((x, y, z))

    def _moved_to(self, point: Point) -> None:
        """Begin to count dwells anew; a line that leads nowhere is no move."""
        if point != self.moved[1]:
            self.moved, self.stood_s = (self.line, point), 0.0

    def feed_rate(self, speed_mm_s: float) -> float:
        """Return a feed in mm/min."""
        return speed_mm_s * self.place.share * S_PER_MIN

    def turn(self, turning: Turning) -> None:
        """Turn the tool where it stands, in the KRL form."""
        self.turns.append((self.line, turning))

    def stay(self, time_s: float) -> None:
        """Write a dwell."""
        self.lines.append(f"G4 P{time_s:g}")
        self.stood_s += time_s

    def spindle(self, rpm: float) -> None:
        """Turn the spindle at a speed, 0 = off."""
        self.lines.append(f"S{rpm:.0f} M3" if rpm > 0.0 else "M5")
        self.starts += 1
        self._change(rpm=rpm)

    def pull(self, force_N: Point) -> None:
        """Note that a person has hung another load on the tool."""
        self._change(pull_N=force_N)

    def _change(self, pull_N: Point | None = None, rpm: float | None = None) -> None:
        last = self.states[-1] if self.states else State(0, 0.0, (0.0, 0.0, 0.0), 0.0)
        self.states.append(
            State(
                line=self.moved[0],
                stood_s=self.stood_s,
                pull_N=last.pull_N if pull_N is None else pull_N,
                rpm=last.rpm if rpm is None else rpm,
            )
        )

    def halt(self, text: str) -> None:
        """Stop the program until a person starts it again."""
        self.lines += [f"(MSG, {text.upper()})", "M0"]
        self.halts += 1

    def head(self, what: str) -> None:
        """Write settings, the sync gesture and the reference points."""
        tool = self.place.tool
        x, y, z = self.at()
        self.lines += [
            "%",
            f"(TEST PROGRAM {what.upper()}: AIR MOVES, NOTHING NEAR THE TOOL, OVERRIDE 100 PERCENT)",
            "(RECORD ALL INSTRUMENTS FROM BEFORE THE FIRST TO AFTER THE LAST MOVE)",
            "G21 G90 G17 G40 G49 G80 G94 G61",
            f"T{tool} M6",
            f"G0 G43 H{tool} Z{z:.3f}",
            f"G0 X{x:.3f} Y{y:.3f}",
        ]
        self.gesture()
        self.references()

    def tail(self) -> None:
        """Write the reference points, the sync gesture and the end."""
        self.references()
        self.gesture()
        self.lines += ["M30", "%"]

    def gesture(self) -> None:
        """Write the move by which the instruments' clocks are aligned."""
        self.say("sync gesture")
        self.go()
        self.stay(2.0 * GESTURE_PAUSE_S)
        for stroke_mm in GESTURE_MM:
            away = np.maximum(stroke_mm, 0.0) * DIAGONAL
            self.go(*(float(value) for value in away))
            self.stay(GESTURE_PAUSE_S)

    def references(self) -> None:
        """Write the three reference points, each with a dwell."""
        self.say("reference points")
        for point in REFERENCES:
            self.go(*(value * self.place.size_mm for value in point))
            self.stay(REFERENCE_DWELL_S)
        self.go()
