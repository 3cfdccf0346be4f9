"""Short programs, each written twice: as G-code text and as plain waypoints for the plant."""

from dataclasses import dataclass

import numpy as np

from tests.plant.scene import CDIS_mm, RAPID_mm_s


@dataclass(frozen=True)
class Waypoints:
    """Row i is the end of move i; row 0 is where the robot waits."""

    position_mm: np.ndarray
    speed_mm_s: np.ndarray
    cdis_mm: np.ndarray  # 0 is an exact stop
    hold_s: np.ndarray
    cutting: np.ndarray  # a feed move
    turns_deg: np.ndarray | None = None  # A, B, C of the tool in `$BASE`, (n, 3); none is upright
    left_out_s: np.ndarray | None = None  # of each hold: not simulated, 5 s after its begin

    def __len__(self) -> int:
        return len(self.position_mm)


class Writer:
    """Collects moves; knows the words of G-code and the numbers behind them."""

    def __init__(self, title: str, x: float, y: float, z: float):
        self.at = [x, y, z]
        self.lines = ["%", f"({title})", "G21 G90 G17 G40 G49 G80 G94", "G54", "T1 M6", "S13000 M3"]
        self.lines.append(f"G0 G43 H1 X{x:.3f} Y{y:.3f} Z{z:.3f}")
        self.rows = [(tuple(self.at), RAPID_mm_s, False)]
        self.word = "G0"

    def _move(self, word: str, speed_mm_s: float, target: dict) -> "Writer":
        text = [word]
        for i, axis in enumerate("xyz"):
            if axis in target:
                self.at[i] = round(float(target[axis]), 3)
                text.append(f"{axis.upper()}{self.at[i]:.3f}")
        if word == "G1":
            text.append(f"F{60.0 * speed_mm_s:.0f}")
        self.lines.append(" ".join(text))
        self.rows.append((tuple(self.at), speed_mm_s, word == "G1"))
        return self

    def rapid(self, **target) -> "Writer":
        """A rapid move, straight."""
        return self._move("G0", RAPID_mm_s, target)

    def feed(self, speed_mm_s: float, **target) -> "Writer":
        """A feed move."""
        return self._move("G1", speed_mm_s, target)

    def text(self) -> str:
        """The program."""
        return "\n".join([*self.lines, "M5", "M30", "%", ""])

    def waypoints(self) -> Waypoints:
        """The same moves as numbers; rapid to feed and feed to rapid stop exactly."""
        position = np.array([row[0] for row in self.rows])
        feed = np.array([row[2] for row in self.rows])
        stop = np.append(feed[1:] != feed[:-1], True)
        stop[0] = True
        cdis = np.where(stop, 0.0, CDIS_mm)
        speed = np.array([row[1] for row in self.rows])
        return Waypoints(position, speed, cdis, np.zeros(len(feed)), feed)


def slots() -> Writer:
    """Two slots along x, one across them."""
    w = Writer("SLOTS", -22, -38, 30)
    for y in (-38, -4):
        w.rapid(x=-22, y=y, z=30).rapid(z=2).feed(50, z=-5).feed(50, x=184).rapid(z=30)
    w.rapid(x=96, y=92).rapid(z=2).feed(40, z=-4).feed(40, y=-94).rapid(z=30)
    return w


def contour() -> Writer:
    """Twice around the block with part of the cutter, once climbing and once conventional."""
    w = Writer("CONTOUR", -25, -74, 30)
    w.rapid(z=2).feed(60, z=-6)
    w.feed(60, x=164).feed(60, y=74).feed(60, x=-4).feed(60, y=-90).rapid(z=30)
    w.rapid(x=-30, y=66).rapid(z=2).feed(60, z=-5).feed(60, x=156).feed(60, y=-90).rapid(z=30)
    return w


def ramps() -> Writer:
    """Rising ramps along x and y, dived into outside the block, with a change of feed on the way."""
    w = Writer("RAMPS", -24, -45, 30)
    w.rapid(z=2).feed(40, z=-7).feed(40, x=4).feed(40, x=128, z=3).feed(90, x=60, y=-20, z=12).rapid(z=30)
    w.rapid(x=40, y=95).rapid(z=2).feed(40, z=-6).feed(40, y=66).feed(40, y=-34, z=2).rapid(z=30)
    w.rapid(x=184, y=30).rapid(z=2).feed(40, z=-6).feed(40, x=150).feed(40, x=66, y=34, z=1).rapid(z=30)
    return w


def pocket() -> Writer:
    """A groove to the middle, then twice round a polygon, open to the side."""
    w = Writer("POCKET", 182, 0, 30)
    w.rapid(z=2).feed(40, z=-4).feed(50, x=106)
    for radius in (26, 34):
        for i in range(1, 17):
            angle = 2.0 * np.pi * i / 16.0
            w.feed(40, x=80 + radius * np.cos(angle), y=radius * np.sin(angle))
        w.feed(40, x=114 if radius == 26 else 120)
    w.feed(40, x=182).rapid(z=30)
    return w


def zigzag() -> Writer:
    """Rows along y with 10 mm stepover, to and fro, then a corner cut across."""
    w = Writer("ZIGZAG", -4, -92, 30)
    w.rapid(z=2).feed(60, z=-3)
    for i in range(4):
        w.feed(60, x=-4 + 10 * i).feed(60, y=92 if i % 2 == 0 else -92)
    w.rapid(z=30).rapid(x=190, y=-20).rapid(z=2).feed(60, z=-6).feed(60, x=110, y=-92).rapid(z=30)
    return w


def air() -> Writer:
    """A wide path in the air: every joint turns round several times, at two speeds."""
    w = Writer("AIR", -120, -220, 60)
    for x, y, z, speed in (
        (-100, 230, 40, 150),
        (60, 150, 85, 150),
        (90, -160, 35, 150),
        (250, -60, 70, 75),
        (330, 60, 30, 75),
        (300, 200, 75, 150),
        (120, 60, 30, 150),
        (-60, -20, 80, 150),
        (200, -240, 50, 150),
        (40, -120, 30, 150),
    ):
        w.feed(speed, x=x, y=y, z=z)
    w.rapid(x=-40, y=0, z=70).rapid(x=-60, y=-40, z=60)
    return w


PROGRAMS = {p.__name__: p for p in (slots, contour, ramps, pocket, zigzag, air)}
CUTTING = ("slots", "contour", "ramps", "pocket", "zigzag")
