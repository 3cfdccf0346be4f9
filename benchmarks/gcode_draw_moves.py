"""Moves, arcs and modes of random programs."""

import math

import numpy as np
from gcode_draw_words import Words

AXES = {17: "XYZ", 18: "ZXY", 19: "YZX"}
CENTRES = {"X": "I", "Y": "J", "Z": "K"}


class Moves(Words):
    """Steps of a program; ``here`` is where the programmed axes stand, empty while that is not known."""

    def __init__(self, rng: np.random.Generator) -> None:
        super().__init__(rng)
        self.subs: list[str] = []
        self.programs: list[str] = []
        self.here: dict[str, float] = {}
        self.plane, self.absolute, self.centre_absolute = 17, True, False
        self.spindle, self.labels, self.offset_rotated, self.length = False, 0, False, False

    def stand(self) -> None:
        """Move to a stated point, so that the next arc knows where it begins."""
        if len(self.here) == 3:
            return
        self.set_absolute(True)
        self.here = {axis: self.size(-60, 60) for axis in "XYZ"}
        self.block("G0", *(self.word(axis, value) for axis, value in self.here.items()))

    def set_absolute(self, absolute: bool) -> None:
        if self.absolute != absolute:
            self.absolute = absolute
            self.block("G90" if absolute else "G91")

    def axis_word(self, axis: str, to: float) -> str:
        return self.word(axis, to if self.absolute else to - self.here[axis])

    def go(self, axis: str, to: float) -> None:
        """Remember where an axis was sent, as it was rounded in its word."""
        self.here[axis] = round(to, 7)

    def set_plane(self, plane: int) -> None:
        if plane != self.plane and not (self.offset_rotated and plane != 17):
            self.plane = plane
            self.block(f"G{plane}")

    def set_unit(self, inches: bool) -> None:
        if inches == self.inches:
            return
        self.inches = inches
        self.block("G20" if inches else "G21", "F20" if inches and self.feed_mode == 94 else "")
        self.here = {}

    def mode_of_feed(self, mode: int) -> None:
        self.feed_mode = mode
        if mode == 95 and not self.spindle:
            self.turn()
        feed = {
            93: "",
            94: self.word("F", self.size(100, 2000) + 1),
            95: self.word("F", abs(self.size(0.1, 1)) + 0.01),
        }
        self.block(f"G{mode}", feed[mode])

    def turn(self) -> None:
        self.spindle = True
        self.block(f"S{int(self.rng.integers(500, 9000))}", self.one_of(("M3", "M03")))

    def straight(self) -> None:
        self.stand()
        axes = [axis for axis in "XYZ" if self.chance(0.55)] or ["X"]
        code = self.one_of(("G0", "G1", "G01", "G1"))
        words = []
        for axis in axes:
            to = self.size(-80, 80)
            words.append(self.axis_word(axis, to))
            self.go(axis, to)
        self.block(code, *words, self.feed_word() if code != "G0" else "")
        for _ in range(int(self.rng.integers(0, 4)) if self.feed_mode != 93 or code == "G0" else 0):
            axis, to = self.one_of(("X", "Y", "Z")), self.size(-80, 80)
            self.block(self.axis_word(axis, to))
            self.go(axis, to)

    def arc(self) -> None:
        self.stand()
        first, second, along = AXES[self.plane]
        radius, begin = abs(self.size(1, 60)) + 0.2, float(self.rng.uniform(0, math.tau))
        sweep = float(self.rng.uniform(0.1, math.tau - 0.1))
        left = self.chance(0.5)
        centre = (self.here[first] - radius * math.cos(begin), self.here[second] - radius * math.sin(begin))
        end_angle = begin + (sweep if left else -sweep)
        whole = self.chance(0.15)
        end = (
            round(centre[0] + radius * math.cos(end_angle), 7),
            round(centre[1] + radius * math.sin(end_angle), 7),
        )
        words = ["G3" if left else "G2"]
        if not whole:
            words += [self.axis_word(first, end[0]), self.axis_word(second, end[1])]
        if self.chance(0.3):
            to = self.size(-40, 40)
            words.append(self.axis_word(along, to))
            self.go(along, to)
        by_radius = (
            not whole and 0.4 < sweep < math.tau - 0.4 and abs(sweep - math.pi) > 0.2 and self.chance(0.3)
        )
        if by_radius:
            words.append(self.word("R", radius if sweep < math.pi else -radius))
        else:
            for axis, at in ((first, centre[0]), (second, centre[1])):
                words.append(self.word(CENTRES[axis], at if self.centre_absolute else at - self.here[axis]))
            if self.chance(0.1):
                words.append(f"P{int(self.rng.integers(1, 4))}")
        if not whole:
            self.go(first, end[0])
            self.go(second, end[1])
        self.block(*words, self.feed_word())

    def polar(self) -> None:
        self.set_plane(17)
        self.stand()
        distance, angle = abs(self.size(5, 50)) + 1.0, float(self.rng.integers(-180, 181))
        self.set_absolute(True)
        self.block(
            self.one_of(("G0", "G1")), self.word("@", distance), self.word("^", angle), self.feed_word()
        )
        self.here = {}

    def feeds(self) -> None:
        self.mode_of_feed(self.one_of((93, 94, 95, 94)))

    def spindle_step(self) -> None:
        if self.spindle and self.feed_mode != 95 and self.chance(0.2):
            self.spindle = False
            self.block("M5")
        else:
            self.turn()

    def modes(self) -> None:
        kind = int(self.rng.integers(6))
        if kind == 0:
            self.set_absolute(not self.absolute)
        elif kind == 1:
            self.centre_absolute = not self.centre_absolute
            self.block("G90.1" if self.centre_absolute else "G91.1")
        elif kind == 2:
            self.set_plane(self.one_of((17, 18, 19)))
        elif kind == 3 and not self.length:
            self.set_unit(not self.inches)
        elif kind == 4:
            codes = ("G61", "G61.1", "G64", "G64 P0.05", "G64 P.02 Q0.01", "G97", "G40", "G17 G90")
            code = self.one_of(codes)
            self.block(code)
            if code == codes[-1]:
                self.plane, self.absolute = 17, True
        else:
            self.block(
                self.one_of(
                    ("M7", "M8", "M9", "M1", "M0", "M60", "(MSG, hello)", "G4 P0.5", "G4 P.25", "; note")
                )
            )
