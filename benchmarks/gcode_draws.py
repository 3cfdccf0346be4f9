"""Random programs that are valid by LinuxCNC's rules, and one-letter slips of them.

A program is a head, then steps of many kinds: moves, arcs, polar moves, cycles, offsets, tools, machine
moves, loops, subprograms, compensated contours.
"""

from collections.abc import Callable

import numpy as np
from gcode_draw_moves import AXES, Moves

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
