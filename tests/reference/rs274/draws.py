"""Random programs that are valid by LinuxCNC's rules, one-letter slips of them, and random blocks.

A program is a head, then steps of many kinds: moves, arcs, polar moves, cycles, offsets, tools, machine
moves, loops, subprograms, compensated contours. `Words` writes blocks, `Moves` moves, `Draw` all the others.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np


class Words:
    """The lines of a program, and the modes that say what a word means."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.lines: list[str] = []
        self.inches, self.feed_mode = False, 94

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def one_of(self, choices: Sequence[Any]) -> Any:
        return choices[int(self.rng.integers(len(choices)))]

    def size(self, low: float, high: float) -> float:
        """Return a length in the unit in force, rounded as a post rounds."""
        value = float(self.rng.uniform(low, high)) / (25.4 if self.inches else 1.0)
        return round(value, int(self.rng.integers(0 if not self.inches else 2, 6)))

    def number(self, value: float) -> str:
        text = f"{value:.7f}".rstrip("0")
        text = text.rstrip(".") if self.chance(0.6) else text
        if text.startswith(("0.", "-0.")) and len(text.partition(".")[2]) > 0 and self.chance(0.3):
            text = text.replace("0.", ".", 1)
        if text in ("-0", "-0.", ""):
            text = "0"
        return f"+{text}" if value > 0 and self.chance(0.05) else text

    def word(self, letter: str, value: float) -> str:
        blank = " " if self.chance(0.05) else ""
        return f"{letter}{blank}{self.number(value)}"

    def block(self, *words: str) -> None:
        text = (" " if self.chance(0.8) else "").join(word for word in words if word)
        if self.chance(0.05):
            text = text.lower()
        if self.chance(0.1):
            text = f"N{len(self.lines) * 5 + 5} {text}"
        if self.chance(0.05):
            text += self.one_of([" (a comment)", " ; tail", "(x1)", "\t"])
        if self.chance(0.03):
            text = f"/{text}"
        self.lines += [text] if self.chance(0.97) else [text, ""]

    def feed_word(self) -> str:
        """Return F where the feed mode wants one in each block, or by chance."""
        if self.feed_mode == 93:
            return self.word("F", self.size(1.0, 60.0) + 0.5)
        return (
            self.word("F", self.size(0.05, 2.0) + 0.01 if self.feed_mode == 95 else self.size(50, 3000) + 1)
            if self.chance(0.3)
            else ""
        )


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


HEAD = "G21 G90 G17 G94 F500\nT1 M6\nS1000 M3\nG0 X0 Y0 Z5\n"
END = "\nG0 X1 Y2 Z3\nM2\n"
_ALONE = (
    *("G80", "G17", "G18", "G19", "G90", "G91", "G90.1", "G91.1", "G20", "G21", "G93", "G94", "G95"),
    *("G94 F100", "G95 F0.1", "G93 F4", "G92.1", "G92.2", "G92.3", "G54", "G55", "G59.3", "G28.1", "G30.1"),
    *(
        "G43",
        "G43 H1",
        "G43 H2",
        "G43 H0",
        "G49",
        "G43.1 Z4",
        "G43.2 H2",
        "T1 M6",
        "T2 M6",
        "T7 M6",
        "M6",
        "T1",
    ),
    *("T0 M6", "M3 S500", "M4 S600", "M5", "S0", "S900", "G4 P1", "G4 P0", "G61", "G61.1", "G64", "G64 P0.1"),
    *("G64 P0.1 Q0.2", "G40", "G40 G1 X-5 Y2", "M7", "M9", "M8 M7", "X[#5420 + 1] Y2", "G0 Y#5421"),
)
_CYCLES = ("G81", "G82", "G83", "G73", "G85", "G86", "G89", "G84", "G74", "")


class Blocks:
    """Draws blocks, each with words that may be missing or too many."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def any_of(self, *choices: str) -> str:
        return choices[int(self.rng.integers(len(choices)))]

    def axes(self, share: float) -> str:
        return " ".join(
            f"{axis}{self.rng.uniform(-20, 20):.3f}" for axis in "XYZ" if self.rng.random() < share
        )

    def block(self) -> str:
        any_of = self.any_of
        x, y = f"X{self.rng.uniform(0, 20):.3f}", f"Y{self.rng.uniform(0, 20):.3f}"
        kinds = (
            f"{any_of('G0', 'G1', '')} {self.axes(0.5)} {any_of('', 'F200', 'F9')}",
            f"{any_of('G2', 'G3', '')} {x} {y} R{any_of('30', '-30', '25', '20')} {any_of('', 'Z3', 'P2')}",
            f"{any_of('G2', 'G3')} {any_of('I5', 'J-5', 'I3 J4', 'K4 I1', 'J2 K2')} {any_of('', 'Z3', 'P2')}",
            " ".join(
                (
                    f"{any_of('G98', 'G99', '')} {any_of(*_CYCLES)} {self.axes(0.4)}",
                    f"{any_of('Z-5', 'Y-9', 'X-7', '', '')} {any_of('R2', 'R1', 'R-3', '')}",
                    f"{any_of('', '', 'P0.5', 'P1')} {any_of('', 'Q1', 'Q2')}",
                    any_of("", "", "L2", "L0", "L3"),
                )
            ),
            f"{any_of('G92', 'G52', 'G28', 'G30')} {self.axes(0.5)}",
            f"G10 {any_of('L2', 'L20')} P{any_of(*'0129')} {self.axes(0.5)} {any_of('', '', 'R30', 'R-90')}",
            f"G10 {any_of('L1', 'L10', 'L11')} P{any_of(*'127')} {any_of('Z5', 'Z-3', 'Z5 R2', '')}",
            f"G53 {any_of('G0', 'G1', '')} {self.axes(0.6)}",
            f"{any_of('G41.1', 'G42.1')} D{any_of('2', '0', '-1', '6')} {any_of('', 'G1 X5', 'G1 X30 Y3')}",
            f"G0 @{self.rng.uniform(1, 20):.3f} ^{self.rng.uniform(-180, 180):.3f}",
            any_of(*_ALONE),
        )
        weights = np.array([5, 3, 3, 6, 3, 2, 1, 1, 1, 1, 14], dtype=float)
        return kinds[int(self.rng.choice(len(kinds), p=weights / weights.sum()))]


def blocks(rng: np.random.Generator) -> bytes:
    """Return a program of a few random blocks."""
    drawn = Blocks(rng)
    return (HEAD + "\n".join(drawn.block() for _ in range(int(rng.integers(1, 7)))) + END).encode("ascii")


TOOLS = (1, 2, 7)
STATE = ("#5420", "#5421", "#5422", "#<_x>", "#<_z>", "#<_absolute>", "#<_metric>", "#<_line>")
"""Parameters that show where the tool stands, and modes."""
SYSTEMS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
LETTERS = "ABCDFGHIJKLMNOPQRSTXYZ"


class Draw(Moves):
    """One program."""

    def cycle(self) -> None:
        self.stand()
        if self.feed_mode != 94:
            self.mode_of_feed(94)
        if not self.spindle:
            self.turn()
        code = self.one_of(("G81", "G82", "G83", "G73", "G85", "G86", "G89", "G84"))
        if code == "G84":
            self.set_plane(17)
        first, second, along = AXES[self.plane]
        if self.chance(0.7):
            self.block(self.one_of(("G98", "G99")))
        depth_words = {"G82": "P", "G86": "P", "G89": "P", "G83": "Q", "G73": "Q"}
        level = self.here[along]
        retract = level - abs(self.size(0, 10)) if self.chance(0.7) else level + abs(self.size(1, 5)) + 0.1
        depth = retract - abs(self.size(1, 12)) - 0.2
        words = [code]
        for axis in (first, second):
            to = self.size(-50, 50)
            words.append(self.axis_word(axis, to))
        if self.absolute:
            words += [self.word(along, depth), self.word("R", retract)]
        else:
            words += [self.word(along, depth - retract), self.word("R", retract - level)]
        extra = depth_words.get(code)
        if extra == "P":
            words.append(self.word("P", round(float(self.rng.uniform(0, 2)), 2)))
        elif extra == "Q":
            words.append(self.word("Q", abs(self.size(0.5, 4)) + 0.2))
        if self.chance(0.15):
            words.append(f"L{int(self.rng.integers(1, 4))}")
        self.block(*words, self.feed_word())
        for _ in range(int(self.rng.integers(0, 3))):
            self.block(*(self.word(axis, self.size(-20, 20)) for axis in (first, second)))
        self.block("G80")
        self.here = {}

    def offsets(self) -> None:
        system = int(self.rng.integers(1, 10))
        xyz = [self.word(axis, self.size(-30, 30)) for axis in "XYZ" if self.chance(0.6)] or ["X1"]
        kind = int(self.rng.integers(8))
        if kind == 0:
            self.block("G10", "L2", f"P{system}", *xyz)
        elif kind == 1:
            self.block("G10", "L20", f"P{self.one_of((0, system))}", *xyz)
        elif kind == 2:
            self.block("G92", *xyz)
        elif kind == 3:
            self.block(self.one_of(("G92.1", "G92.2", "G92.3")))
        elif kind == 4:
            self.block("G52", *xyz)
        elif kind == 5 and self.plane == 17:
            self.block("G92.1")
            self.block("G10", "L2", f"P{system}", self.word("R", float(self.rng.integers(-180, 181))))
            self.offset_rotated = True
        else:
            self.block(self.one_of(SYSTEMS))
        self.here = {}

    def tools(self) -> None:
        self.set_unit(False)
        kind = int(self.rng.integers(6))
        tool = self.one_of(TOOLS)
        if kind < 3:
            self.block(f"T{tool}", self.one_of(("M6", "M06")))
            self.spindle = False
            if self.feed_mode == 95:
                self.mode_of_feed(94)
            self.block("G43", "" if self.chance(0.4) else f"H{tool}")
            self.length = True
        elif kind == 3:
            self.block("G49")
            self.length = False
        elif kind == 4:
            self.block("G43.1", self.word("Z", self.size(-20, 60)))
            self.length = True
        else:
            self.block(
                "G10", self.one_of(("L1", "L10", "L11")), f"P{tool}", self.word("Z", self.size(10, 60))
            )
        self.stand_anew()

    def stand_anew(self) -> None:
        """Move behind a change of length, which LinuxCNC forgets at M6 where no move has followed."""
        self.here = {}
        self.stand()

    def machine(self) -> None:
        axes = [self.word(axis, self.size(-50, 50)) for axis in "XYZ" if self.chance(0.5)] or ["Z0"]
        kind = int(self.rng.integers(5))
        if kind == 0:
            self.set_absolute(True)
            self.block("G53", self.one_of(("G0", "G1")), *axes, self.feed_word())
        elif kind == 1:
            self.block(self.one_of(("G28", "G30")), *axes)
        elif kind == 2:
            self.block(self.one_of(("G28", "G30")))
        else:
            self.block(self.one_of(("G28.1", "G30.1")))
        self.here = {}

    def loop(self) -> None:
        self.labels += 1
        label, count = f"O{100 + self.labels}", int(self.rng.integers(0, 4))
        axis, step = self.one_of(("X", "Y", "Z")), self.size(-9, 9)
        self.stand()
        self.set_absolute(False)
        body = [f"G{self.one_of((0, 1))} {self.word(axis, step)}{' F9' if self.feed_mode == 93 else ''}"]
        kind = int(self.rng.integers(4))
        if kind == 0:
            self.lines += [f"{label} repeat [{count}]", *body, f"{label} endrepeat"]
        elif kind == 1:
            self.lines += [f"#{self.labels} = 0", f"{label} while [#{self.labels} LT {count}]", *body]
            self.lines += [f"#{self.labels} = [#{self.labels} + 1]", f"{label} endwhile"]
        elif kind == 2:
            self.lines += [f"#{self.labels} = {count}", f"{label} if [#{self.labels} GT 1]", *body]
            self.lines += [f"{label} else", f"G0 {axis}[#{self.labels} * 2.5]", f"{label} endif"]
        else:
            self.lines += [f"{label} call [{step}] [{count}]"]
            inside = ["#3 = [#1 / 2 + SIN[30]]", f"G0 {axis}#3", "#<deep> = [#2 * 2]", f"G0 {axis}[#<deep>]"]
            self.subs += [f"{label} sub", *inside, f"{label} endsub"]
        self.here = {}

    def expression(self, depth: int = 0) -> str:
        """Return an expression of a size up to some hundreds."""
        kind = int(self.rng.integers(7)) if depth < 3 else int(self.rng.integers(2))
        if kind == 0:
            return self.number(self.size(-9, 9))
        if kind == 1:
            return self.one_of(("#11", "#12", "#<side>", "#[5 + 6]", *STATE))
        one, other = self.expression(depth + 1), self.expression(depth + 1)
        if kind == 2:
            return f"{self.one_of(('SIN', 'cos', 'ABS', 'FIX', 'ROUND', 'FUP'))}[{one}]"
        if kind == 3:
            return f"[{one} {self.one_of(('LT', 'gt', 'AND', 'or', 'XOR'))} {other}]"
        if kind == 4:
            return f"[{one} MOD 7]"
        return f"[{one} {self.one_of('+-*')} {other}]"

    def computed(self) -> None:
        self.set_absolute(True)
        self.lines += [f"#11 = {self.number(self.size(-9, 9))} #12 = [2 ** 3 - 1]", "#<side> = [#11 / 4]"]
        for _ in range(int(self.rng.integers(1, 4))):
            self.lines.append(f"#{self.one_of((11, 12))} = [{self.expression()}]")
            code = self.one_of(("G0", "G0 Z[-#11 * 2]", "G[0]", "G0 (c) Z1 2.5"))
            self.block(code, f"X[{self.expression()}]", self.one_of(("Y#12", "Y-#12", "Y[ATAN[#11]/[2]]")))
        self.here = {}

    def program_call(self) -> None:
        """Call a program O1000 … M99 behind the end by M98."""
        self.labels += 1
        number, times = 1000 + self.labels, int(self.rng.integers(1, 4))
        self.stand()
        self.block("M98", f"P{number}", f"L{times}" if times > 1 or self.chance(0.3) else "")
        step = self.word(self.one_of(("X", "Y", "Z")), self.size(-9, 9))
        self.programs += [f"O{number}", "G91", f"G0 {step}", "G90" if self.absolute else "", "M99"]
        self.here = {}

    def contour(self) -> None:
        self.set_plane(17)
        if self.offset_rotated:
            return
        self.set_absolute(True)
        if self.feed_mode != 94:
            self.mode_of_feed(94)
        x, y, side = (
            self.size(-30, 0),
            self.size(-30, 0),
            abs(self.size(15, 50)) + 15.0 / (25.4 if self.inches else 1),
        )
        self.here = {"X": x - side, "Y": y, "Z": self.here.get("Z", 0.0)}
        self.block("G0", self.word("X", x - side), self.word("Y", y - side / 2))
        self.block(
            self.one_of(("G41.1", "G42.1")),
            self.word("D", abs(self.size(1, 8)) + 0.1 / (25.4 if self.inches else 1)),
        )
        for to in ((x, y), (x, y + side), (x + side, y + side), (x + side, y)):
            self.block("G1", self.word("X", to[0]), self.word("Y", to[1]), self.feed_word())
        self.block("G40")
        self.block("G0", self.word("X", x - side), self.word("Y", y - side))
        self.here = {}

    def program(self, steps: int) -> bytes:
        self.lines += ["G21 G90 G17 G94 F500"] if self.chance(0.8) else ["G90", "G17", "F300", "G21"]
        if self.chance(0.7):
            self.tools()
        kinds: list[Callable[[], None]] = [self.straight] * 8 + [self.arc] * 7 + [self.modes] * 6
        kinds += [self.cycle] * 2 + [self.offsets] * 3 + [self.computed] * 2
        kinds += [self.machine, self.loop, self.contour, self.program_call]
        kinds += [self.polar, self.feeds, self.spindle_step, self.tools]
        for _ in range(steps):
            self.one_of(kinds)()
        end = self.one_of(("M2", "M30", "M2"))
        return ("\n".join([*self.subs, *self.lines, end, *self.programs]) + "\n").encode("ascii")


def drawn(rng: np.random.Generator) -> bytes:
    """Return a random valid program."""
    return Draw(rng).program(int(rng.integers(1, 14)))


def slipped(rng: np.random.Generator, program: bytes) -> bytes:
    """Return a program with one letter or digit changed, dropped, doubled, or swapped with the next."""
    text = bytearray(program)
    places = [at for at, byte in enumerate(text) if byte not in b"\n "]
    at = places[int(rng.integers(len(places)))]
    kind = int(rng.integers(4))
    if kind == 0:
        alike = "0123456789" if text[at : at + 1].isdigit() else LETTERS
        text[at] = ord(alike[int(rng.integers(len(alike)))])
    elif kind == 1:
        del text[at]
    elif kind == 2:
        text.insert(at, text[at])
    elif at + 1 < len(text) and text[at + 1] != ord("\n"):
        text[at], text[at + 1] = text[at + 1], text[at]
    return bytes(text)
