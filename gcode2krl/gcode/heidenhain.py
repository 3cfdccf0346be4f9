"""Heidenhain's conversational programs: each line becomes one of a Sinumerik, which the core reads.

The two controls think alike: coordinates that count for themselves, corners that the block before names, a
path
offset that leads in at right angles to the contour and goes around corners by an arc. Lines keep their
numbers,
so rows and findings name those of the file. ``Q5`` becomes the variable ``QV5``, the pole CC ``QPX`` and
``QPY``, a
cycle's words ``QC1`` and so on where the program jumps or calls; else they are written out. What is not
sure is refused with a reason.

Facts: HEIDENHAIN iTNC 530 and TNC 426/430, User's Manuals, Conversational Programming: path functions, cycles
for drilling, subprograms and program section repeats, Q parameters, coordinate transformation cycles.
"""

import math
import re
from collections.abc import Callable
from typing import Final

from gcode2krl.gcode import dialects as r

_NUMBER = r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)"
_FIRST_OFFSETS = 4
"""G54 to G57; a Sinumerik's further ones are G505 to G599."""
_VALUE = rf"(?:{_NUMBER}|[+-]?Q\d+)"
_TOKEN = re.compile(
    rf"(?P<inc>I?)(?P<axis>[XYZABC]|PR|PA) *(?P<value>{_VALUE})|(?P<side>R[0LR])\b"
    rf"|F *(?P<feed>MAX|AUTO|{_VALUE})"
    rf"|DR(?P<way>[+-])|R(?P<radius>{_VALUE})|M(?P<m>\d+)\.?(?!\d)|(?P<limit>MB *MAX)|(?P<ahead>LA[\d.,]+)"
)
_HEAD = re.compile(r"\s*(?:\d+(?:\.\d+)?\s+)?")
_CYCLE = re.compile(r"CYCL DEF (\d+)(?:\.(\d+))?")
_Q_WORD = re.compile(rf"Q(\d+) *= *({_VALUE}|FMAX|FAUTO)")
_CALL = re.compile(r"CALL LBL (\d+|\"[^\"]*\")(?: *REP *(\d+)(?: */ *\d+)?)?$")
_LABEL = re.compile(r"LBL (\d+|\"[^\"]*\")$")
_TEST = re.compile(
    rf"FN ?(?:9|10|11|12) *: *IF *({_VALUE}) *(EQU|NE|GT|LT) *({_VALUE}) *GOTO *LBL *(\d+|\"[^\"]*\")$"
)
_FUNCTION = re.compile(rf"FN ?([0-7]) *: *Q(\d+) *= *({_VALUE}|SQRT|SIN|COS) *([+*-]|DIV)? *({_VALUE})?$")
_FORMULA = re.compile(r"Q(\d+) *=(.+)$")
_PLAIN_FORMULA = re.compile(
    r"(?:\d+[.,]?\d*|[.,]\d+|Q\d+|(?:SIN|COS|SQRT|ABS)(?= *\()|[-+*/() ])+$",
)
_TOOL = re.compile(
    rf"TOOL CALL(?: *(\d+|\"[^\"]*\"))?(?: +([XYZ]))?(?: +S *({_VALUE}))?(?: +F *({_VALUE}))?"
    rf"((?: +D[LR]2? *{_VALUE})*)$"
)
_SHIFT = re.compile(rf"(I?)([XYZ]) *({_VALUE})")
_TESTS = {"EQU": "==", "NE": "<>", "GT": ">", "LT": "<"}
_COMPUTES = re.compile(r"^\s*(?:\d+\s+)?(?:LBL|CALL LBL|FN)|^\s*\d+\s+Q\d+ *=", re.MULTILINE | re.IGNORECASE)
_SIDES = {"R0": "G40", "RL": "G41", "RR": "G42"}
_SAYS_NOTHING = ("BLK FORM", "TOOL DEF", "FUNCTION MODE", "PLANE RESET", "CYCL DEF 32")
_IDLE_M = (94, 107, 108, 116, 117, 120, 124, 127, 134, 135, 136, 137, 138)
_REFUSED: Final = (
    ("PLANE", r.REASON_TILTED),
    ("CYCL DEF 19", r.REASON_TILTED),
    ("CYCL DEF 8", r.REASON_SCALED),
    ("CYCL DEF 10", r.REASON_ROTATED),
    ("CYCL DEF 11", r.REASON_SCALED),
    ("CYCL DEF 26", r.REASON_SCALED),
    ("FUNCTION TCPM", r.REASON_TILTED),
    ("APPR", r.REASON_SMOOTH),
    ("DEP", r.REASON_SMOOTH),
    ("CYCL DEF 202", r.REASON_BORING),
    ("CYCL DEF 204", r.REASON_BORING),
    ("TCH PROBE", r.REASON_PROBING),
    ("CALL PGM", r.REASON_FLOW),
    ("LT", r.REASON_TNC_ARC),
    ("FN", r.REASON_VALUES),
    ("F", r.REASON_FREE_CONTOUR),
)
_CYCLE_WORDS: Final = {
    200: ("200", "201", "206", "202", "203"),
    201: ("200", "201", "206", "203"),
    203: ("200", "201", "206", "202", "203", "208"),
    207: ("200", "201", "239", "203"),
}
"""Cycles that are read, and the Q words that each must have."""
_NO_FEED_MM_MIN: Final = 99999.0


class _RefusedError(Exception):
    """A line is not read, for a reason of `dialects`."""


class Translator:
    """Turns the text of a conversational program into that of a Sinumerik, line by line."""

    def __init__(self, text: str) -> None:
        """Take the whole program."""
        self._lines = text.split("\n")
        self._computes = _COMPUTES.search(text) is not None
        self._out = [""] * len(self._lines)
        self._motion = -1
        """Line of the last motion, to which RND and CHF belong; -1 = none."""
        self._at: dict[str, float | None] = {"X": None, "Y": None, "Z": None}
        """Where the last block has led, in its coordinates; None where that is not sure."""
        self._pole: dict[str, str] = {}
        self._hole, self._modal = "", False
        self._pecking: dict[str, str] = {}
        """Values of cycle 1 by their numbers: its hole begins where the tool stands."""
        self._feed, self._speed = "", ""
        self._shift = {"X": "0", "Y": "0", "Z": "0"}
        self._labels: dict[str, str] = {}
        self._ends, self._shortest = 0, False
        self._kinds_of_holes = len(set(re.findall(r"CYCL DEF (20[0137])\b", text)))
        self._labels_at: dict[str, list[int]] = {}
        for k, line in enumerate(self._lines):
            if (label := _LABEL.match(_code(line)[0])) is not None:
                self._labels_at.setdefault(label[1], []).append(k)

    def text(self) -> str:
        """Return the program as a Sinumerik's."""
        k = 0
        while k < len(self._lines):
            first = k
            code, goes_on = _code(self._lines[k])
            k += 1
            while k < len(self._lines) and (goes_on or self._is_more_of_cycle(code, k)):
                more, goes_on = _code(self._lines[k])
                code = f"{code} {more}"
                k += 1
            if code:
                self._out[first] = self._read(first, code)
        return "\n".join(self._out)

    def variables(self) -> dict[str, int]:
        """Return the numbers, as parameters, of the variables in the translated text."""
        names = sorted(set(re.findall(r"\bQ[VPC][0-9XY]+\b", "\n".join(self._out))))
        return {name: number for number, name in enumerate(names, start=r.FIRST_VARIABLE)}

    def _is_more_of_cycle(self, code: str, k: int) -> bool:
        """Tell whether a line without a number of its own has words of the cycle that is being defined."""
        return code.startswith("CYCL DEF 2") and re.match(r"\s*Q\d+ *=", self._lines[k]) is not None

    def _read(self, k: int, code: str) -> str:
        self._k = k
        try:
            for begin, handler in self._HANDLERS:
                if code.startswith(begin):
                    moved = self._motion
                    out = handler(self, code)
                    if self._motion == moved and out:
                        self._motion = -1
                    return out
            for begin in _SAYS_NOTHING:
                if code.startswith(begin):
                    return "NOTED"
            other = r.REASON_CYCLE if code.startswith("CYCL") else r.REASON_TNC_WORD
            raise _RefusedError(next((reason for begin, reason in _REFUSED if code.startswith(begin)), other))
        except _RefusedError as refused:
            self._motion = -1
            return f"REFUSED_{refused.args[0]}"

    # --- head, tools, transformations ---------------------------------------------------------------

    def _begin(self, code: str) -> str:
        if not code.endswith(" MM"):
            raise _RefusedError(r.REASON_TNC_INCHES)
        return "G710 G90 G17 G94 G40 G64"

    def _end(self, _code: str) -> str:
        return "M30" if self._computes or not any("M30" in line for line in self._out) else ""

    def _tool_call(self, code: str) -> str:
        call = _TOOL.match(code)
        if call is None or call[2] not in (None, "Z") or any(_float(v) for v in re.findall(_VALUE, call[5])):
            raise _RefusedError(r.REASON_TOOL_CALL)
        words = []
        if call[1] is not None:
            self._forget_place()
            words.append(f"T={call[1]} M6" if call[1].startswith('"') else f"T{call[1]} M6")
        if call[3] is not None:
            self._speed = _expression(call[3])
            words.append(f"S={self._speed}")
        if call[4] is not None:
            self._feed = _expression(call[4])
            words.append(f"F={self._feed}")
        return " ".join(words)

    def _datum_shift(self, code: str) -> str:
        if code.startswith("CYCL DEF 7.0"):
            return ""
        given = code.partition("7.")[2].partition(" ")[2]
        words = _SHIFT.findall(given)
        if not words or _SHIFT.sub("", given).strip():
            raise _RefusedError(r.REASON_SHIFT)
        for incremental, axis, value in words:
            if (incremental or self._computes) and _float(value) != 0.0:
                raise _RefusedError(r.REASON_SHIFT)
            self._shift[axis] = self._shift[axis] if incremental else _expression(value)
        self._forget_place()
        return "TRANS " + " ".join(f"{axis}={value}" for axis, value in self._shift.items())

    def _datum_preset(self, code: str) -> str:
        """Return the n-th settable offset for preset n: the cell states where it lies, or it is reported."""
        number = re.fullmatch(r"\+?0*([1-9]\d?)", dict(_Q_WORD.findall(code)).get("339", ""))
        if number is None or any(value != "0" for value in self._shift.values()):  # a preset ends a shift
            raise _RefusedError(r.REASON_SHIFT)
        n = int(number[1])
        self._forget_place()
        return f"G{53 + n}" if n <= _FIRST_OFFSETS else f"G{500 + n}"

    def _forget_place(self) -> None:
        self._at = dict.fromkeys(self._at)

    def _tilt(self, code: str) -> str:
        if any(_float(value) != 0.0 for value in re.findall(rf"[ABC]({_VALUE})", code.partition("19.")[2])):
            raise _RefusedError(r.REASON_TILTED)
        return "NOTED"

    def _dwell(self, code: str) -> str:
        if code.startswith("CYCL DEF 9.0"):
            return ""
        match = re.match(rf"CYCL DEF 9\.1 [A-Z. ]*({_VALUE})$", code)
        if match is None:
            raise _RefusedError(r.REASON_TNC_WORD)
        return f"G4 F={_expression(match[1])}"

    def _stop(self, code: str) -> str:
        return " ".join(["M0", *self._m_words(_tokens(code.removeprefix("STOP")))])

    # --- parameters, labels -------------------------------------------------------------------------

    def _formula(self, code: str) -> str:
        match = _FORMULA.match(code)
        if match is None or not _PLAIN_FORMULA.match(match[2]):
            raise _RefusedError(r.REASON_VALUES)
        return f"QV{int(match[1])}={_expression(match[2].strip())}"

    def _function(self, code: str) -> str:
        if (test := _TEST.match(code)) is not None:
            lhs, rhs = _expression(test[1]), _expression(test[3])
            return f"IF {lhs}{_TESTS[test[2]]}{rhs} GOTO {self._label_of(test[4])}"
        match = _FUNCTION.match(code)
        if match is None:
            raise _RefusedError(r.REASON_VALUES)
        kind, target, first, sign, second = int(match[1]), int(match[2]), *match.groups()[2:]
        named = {5: "SQRT", 6: "SIN", 7: "COS"}.get(kind)
        if named is not None and first == named and sign is None and second is not None:
            return f"QV{target}={named}({_expression(second)})"
        if kind == 0 and sign is None and second is None and not first.isalpha():
            return f"QV{target}={_expression(first)}"
        if {1: "+", 2: "-", 3: "*", 4: "DIV"}.get(kind) == sign is not None and second is not None:
            return f"QV{target}={_expression(first)}{'/' if sign == 'DIV' else sign}({_expression(second)})"
        raise _RefusedError(r.REASON_VALUES)

    def _label_of(self, name: str) -> str:
        return self._labels.setdefault(name, f"LBL_{len(self._labels)}")

    def _label(self, code: str) -> str:
        match = _LABEL.match(code)
        if match is None:
            raise _RefusedError(r.REASON_FLOW)
        self._forget_place()  # other lines lead here too
        if match[1] == "0":
            self._ends += 1
            return f"LEND_{self._ends}:"
        return f"{self._label_of(match[1])}:"

    def _call_label(self, code: str) -> str:
        call = _CALL.match(code)
        begin = self._labels_at.get(call[1], []) if call is not None else []
        if call is None or len(begin) != 1 or (call[2] is not None and begin[0] > self._k):
            raise _RefusedError(r.REASON_TNC_LABEL)
        self._forget_place()
        if call[2] is not None:
            return f"REPEAT {self._label_of(call[1])} P={int(call[2])}"
        end = self._end_of(call[1])
        return f"REPEAT {self._label_of(call[1])} LEND_{end} P=1"

    def _end_of(self, name: str) -> int:
        """Return which LBL 0 is the first behind a label."""
        ends, inside = 0, False
        for line in self._lines:
            label = _LABEL.match(_code(line)[0])
            if label is not None and label[1] == "0":
                ends += 1
                if inside:
                    return ends
            inside = inside or (label is not None and label[1] == name)
        raise _RefusedError(r.REASON_TNC_LABEL)

    # --- moves --------------------------------------------------------------------------------------

    def _words(self, tokens: list[re.Match[str]]) -> list[str]:
        """Return side, coordinates and M-codes of a move."""
        words = [_SIDES[t["side"]] for t in tokens if t["side"]]
        for t in tokens:
            if t["axis"] in ("PR", "PA") or not t["axis"]:
                continue
            axis, value = t["axis"], _expression(t["value"])
            way = "DC" if self._shortest and axis in "ABC" and not t["inc"] else "IC" if t["inc"] else ""
            words.append(f"{axis}={way}({value})" if way else f"{axis}={value}")
            self._follow(axis, value, bool(t["inc"]))
        return words

    def _follow(self, axis: str, value: str, incremental: bool) -> None:
        if axis in self._at:
            number, before = _float(value), self._at[axis]
            known = number is not None and (not incremental or before is not None)
            self._at[axis] = (number or 0.0) + ((before or 0.0) if incremental else 0.0) if known else None

    def _m_words(self, tokens: list[re.Match[str]]) -> list[str]:
        words = []
        for t in tokens:
            m = int(t["m"]) if t["m"] else -1
            if m == 89 and self._computes:
                raise _RefusedError(r.REASON_HOLE)
            if m in (-1, 89, 91, 99, 140, *_IDLE_M):
                self._modal = self._modal or m == 89
            elif m == 126:
                self._shortest = True
            elif m in (13, 14):
                words.append(f"M{m - 10} M8")
            elif m in (128, 129):
                words.append("TRAORI" if m == 128 else "TRAFOOF")
            elif m == 2:
                words.append("M30")
            elif m in (92, 97, 98, 101, 103, 109, 110, 111, 112, 114, 118, 141, 144, 145, 148, 197):
                raise _RefusedError(r.REASON_TNC_M)
            else:
                words.append(f"M{m}")
        return words

    def _feed_words(self, tokens: list[re.Match[str]]) -> list[str]:
        feed = next((t["feed"] for t in tokens if t["feed"]), "")
        if feed == "AUTO" and not self._feed:
            raise _RefusedError(r.REASON_VALUES)
        return [f"F={self._feed if feed == 'AUTO' else _expression(feed)}"] if feed and feed != "MAX" else []

    def _moved(self, motion: str, tokens: list[re.Match[str]], words: list[str]) -> str:
        """Return a block that moves, with the hole behind it that M99 or M89 asks for."""
        self._motion = self._k
        ends = {int(t["m"]) for t in tokens if t["m"]} & {89, 99}
        m_words = self._m_words(tokens)
        hole = [self._hole_here()] if ends or self._modal else []
        self._modal = self._modal and 99 not in ends
        return " ".join([motion, *words, *self._feed_words(tokens), *m_words, *hole])

    def _line(self, code: str) -> str:
        tokens = _tokens(code[1:])
        moves = any(t["axis"] for t in tokens)
        machine = any(t["m"] == "91" for t in tokens)
        fast = any(t["feed"] == "MAX" for t in tokens)
        if any(t["radius"] or t["way"] or t["axis"] in ("PR", "PA") for t in tokens):
            raise _RefusedError(r.REASON_VALUES)
        if any(t["m"] == "140" for t in tokens):
            if moves or not any(t["limit"] for t in tokens):
                raise _RefusedError(r.REASON_TNC_M)
            self._forget_place()
            return "SUPA G0 Z0"
        words = self._words(tokens)
        if not moves:
            ends = {t["m"] for t in tokens} & {"89", "99"}
            if "89" in ends:
                raise _RefusedError(r.REASON_HOLE)
            hole = [self._hole_here()] if ends else []
            return " ".join([*words, *self._feed_words(tokens), *self._m_words(tokens), *hole])
        if machine:
            self._forget_place()
            return self._moved("SUPA G0" if fast else "SUPA G1", tokens, words)
        return self._moved("G0" if fast else "G1", tokens, words)

    def _m_alone(self, code: str) -> str:
        return self._line(f"L {code}")

    def _polar_line(self, code: str) -> str:
        tokens = _tokens(code[2:])
        polar = {t["axis"]: t for t in tokens if t["axis"] in ("PR", "PA")}
        if set(polar) != {"PR", "PA"} or any(t["inc"] for t in polar.values()):
            raise _RefusedError(r.REASON_TNC_POLE)
        radius, angle = (_expression(polar[name]["value"]) for name in ("PR", "PA"))
        words = self._words([t for t in tokens if t["axis"] not in ("PR", "PA", "X", "Y")])
        for axis, turn in (("X", "COS"), ("Y", "SIN")):
            pole = self._pole_word(axis)
            a, b, c = _float(pole), _float(radius), _float(angle)
            if a is not None and b is not None and c is not None:
                place = a + b * (math.cos if axis == "X" else math.sin)(math.radians(c))
                words.append(f"{axis}={place:.9f}")
                self._at[axis] = place
            else:
                words.append(f"{axis}={pole}+{radius}*{turn}({angle})")
                self._at[axis] = None
        fast = any(t["feed"] == "MAX" for t in tokens)
        return self._moved("G0" if fast else "G1", tokens, words)

    def _centre(self, code: str) -> str:
        coordinates = re.findall(rf"(I?)([XY]) *({_VALUE})", code)
        if not coordinates or any(incremental for incremental, _, _ in coordinates):
            raise _RefusedError(r.REASON_TNC_POLE)
        for _, axis, value in coordinates:
            self._pole[axis] = _expression(value)
        if not self._computes:
            return ""
        return " ".join(f"QP{axis}={_expression(value)}" for _, axis, value in coordinates)

    def _pole_word(self, axis: str) -> str:
        if axis not in self._pole and not self._computes:
            raise _RefusedError(r.REASON_TNC_POLE)
        return f"QP{axis}" if self._computes else self._pole[axis]

    def _arc(self, code: str) -> str:
        tokens = _tokens(code[1:])
        way = next((t["way"] for t in tokens if t["way"]), "")
        axes = {t["axis"] for t in tokens if t["axis"]}
        if not way or not axes <= {"X", "Y"}:  # without both it is a full circle
            raise _RefusedError(r.REASON_TNC_ARC)
        centre = [f"{letter}=AC({self._pole_word(axis)})" for letter, axis in (("I", "X"), ("J", "Y"))]
        return self._moved("G3" if way == "+" else "G2", tokens, [*self._words(tokens), *centre])

    def _arc_by_radius(self, code: str) -> str:
        tokens = _tokens(code[2:])
        way = next((t["way"] for t in tokens if t["way"]), "")
        radius = next((t["radius"] for t in tokens if t["radius"]), "")
        if not way or not radius:
            raise _RefusedError(r.REASON_TNC_ARC)
        return self._moved(
            "G3" if way == "+" else "G2", tokens, [*self._words(tokens), f"CR={_expression(radius)}"]
        )

    def _tangent(self, code: str) -> str:
        tokens = _tokens(code[2:])
        return self._moved("CT", tokens, self._words(tokens))

    def _polar_arc(self, code: str) -> str:
        tokens = _tokens(code[2:])
        way = next((t["way"] for t in tokens if t["way"]), "")
        turn = next((t for t in tokens if t["axis"] == "PA"), None)
        others = [t for t in tokens if t["axis"] not in ("PA",)]
        if not way or turn is None or any(t["axis"] in ("PR", "X", "Y") for t in others):
            raise _RefusedError(r.REASON_TNC_ARC)
        angle = _float(turn["value"])
        if angle is None or (turn["inc"] and (angle == 0.0 or (angle > 0.0) != (way == "+"))):
            raise _RefusedError(r.REASON_TNC_ARC)
        words = self._words(others)
        turns = int(abs(angle) / 360.0) if turn["inc"] else 0
        if not (turn["inc"] and angle % 360.0 == 0.0):
            words += self._end_of_turn(angle, bool(turn["inc"]))
        else:
            turns -= 1
        words += [f"{letter}=AC({self._pole_word(axis)})" for letter, axis in (("I", "X"), ("J", "Y"))]
        words += [f"TURN={turns}"] if turns else []
        return self._moved("G3" if way == "+" else "G2", tokens, words)

    def _end_of_turn(self, angle: float, incremental: bool) -> list[str]:
        x, y = (_float(self._pole_word(axis)) for axis in "XY")
        at_x, at_y = self._at["X"], self._at["Y"]
        if x is None or y is None or at_x is None or at_y is None:
            raise _RefusedError(r.REASON_TNC_POLE)
        radius, from_deg = math.hypot(at_x - x, at_y - y), math.degrees(math.atan2(at_y - y, at_x - x))
        to_rad = math.radians(angle + (from_deg if incremental else 0.0))
        end = {"X": x + radius * math.cos(to_rad), "Y": y + radius * math.sin(to_rad)}
        self._at.update(end)
        return [f"{axis}={value:.9f}" for axis, value in end.items()]

    def _corner(self, code: str) -> str:
        match = re.match(rf"(RND|CHF) *R?({_VALUE})(?: *F({_VALUE}))?$", code)
        if match is None or match[3] is not None or self._motion < 0:
            raise _RefusedError(r.REASON_CORNER)
        self._out[self._motion] += f" {'RND' if match[1] == 'RND' else 'CHR'}={_expression(match[2])}"
        return ""

    # --- cycles -------------------------------------------------------------------------------------

    def _define_pecking(self, code: str) -> str:
        if code.startswith("CYCL DEF 1.0"):
            self._hole, self._modal, self._pecking = "", False, {}
            return ""
        match = re.match(rf"CYCL DEF 1\.([1-5]) ?[A-Z ]*\.? ?({_VALUE})$", code)
        if match is None or self._computes:
            raise _RefusedError(r.REASON_HOLE)
        self._pecking[match[1]] = _expression(match[2])
        return ""

    def _define_hole(self, code: str) -> str:
        self._hole, self._modal, self._pecking = "", False, {}
        match = _CYCLE.match(code)
        number = int(match[1]) if match else 0
        words = dict(_Q_WORD.findall(code))
        mixed = self._computes and self._kinds_of_holes > 1  # a called label may not know which is defined
        if mixed or any(name not in words for name in _CYCLE_WORDS[number]):
            raise _RefusedError(r.REASON_HOLE)
        values = _hole_arguments(
            number, {name: _cycle_value(value) for name, value in words.items()}, self._speed
        )
        if not self._computes:
            self._hole = f"HOLE({','.join(values)})"
            return "NOTED"
        self._hole = f"HOLE({','.join(f'QC{k}' if value else '' for k, value in enumerate(values))})"
        return " ".join(f"QC{k}={value}" for k, value in enumerate(values) if value)

    def _hole_here(self) -> str:
        if len(self._pecking) == len("12345"):
            above = self._at["Z"]
            clearance, depth, stroke, dwell, feed = (_float(self._pecking[k]) for k in "12345")
            if above is None or clearance is None or depth is None or stroke is None or depth >= 0.0:
                raise _RefusedError(r.REASON_HOLE)
            first = min(stroke, -depth)
            heights = f"{above!r},{above - clearance!r},{clearance!r},,{-depth!r}"
            back = min(max(-depth / 50.0, 0.6), 7.0)
            return f"HOLE(83,{feed},{heights},,{first!r},-1,0,0,1,1,,,,{dwell},{back!r})"
        if not self._hole:
            raise _RefusedError(r.REASON_HOLE)
        return self._hole

    def _call_hole(self, code: str) -> str:
        operation = code.removeprefix("CYCL CALL").strip()
        if operation.startswith("PAT"):
            raise _RefusedError(r.REASON_CYCLE)
        if not operation.startswith("POS"):
            return " ".join([self._hole_here(), *self._m_words(_tokens(operation))])
        tokens = _tokens(operation.removeprefix("POS"))
        if any(t["axis"] not in ("X", "Y", None) for t in tokens):
            raise _RefusedError(r.REASON_HOLE)
        words = [*self._words(tokens), *self._m_words(tokens), self._hole_here()]
        motion = "G0" if any(t["feed"] == "MAX" for t in tokens) else "G1"
        return " ".join([motion, *words, *self._feed_words(tokens)])

    _HANDLERS: "tuple[tuple[str, Callable[[Translator, str], str]], ...]" = (
        ("BEGIN PGM", _begin),
        ("END PGM", _end),
        ("TOOL CALL", _tool_call),
        ("CYCL DEF 7.", _datum_shift),
        ("CYCL DEF 247", _datum_preset),
        ("CYCL DEF 19", _tilt),
        ("CYCL DEF 9.", _dwell),
        ("CYCL DEF 1.", _define_pecking),
        ("CYCL DEF 200", _define_hole),
        ("CYCL DEF 201", _define_hole),
        ("CYCL DEF 203", _define_hole),
        ("CYCL DEF 207", _define_hole),
        ("CYCL CALL", _call_hole),
        ("STOP", _stop),
        ("LBL ", _label),
        ("CALL LBL", _call_label),
        ("FN", _function),
        ("Q", _formula),
        ("LP ", _polar_line),
        ("L ", _line),
        ("M", _m_alone),
        ("CC", _centre),
        ("CR ", _arc_by_radius),
        ("CT ", _tangent),
        ("CP ", _polar_arc),
        ("C ", _arc),
        ("RND", _corner),
        ("CHF", _corner),
    )


def _code(line: str) -> tuple[str, bool]:
    """Return what a line says, in capitals and without its number and comment; and whether the next goes
    on."""
    goes_on = line.rstrip().endswith("~")
    text = line.rstrip(" \t\r~").split(";")[0]
    if text.lstrip().startswith("*"):
        return "", False
    head = _HEAD.match(text)
    code = "" if head is None or re.match(r"\s*\d+\s*$", text) else text[head.end() :]
    code = " ".join(re.sub(r'("[^"]*")|([^"]+)', lambda m: m[1] or m[2].upper(), code).split())
    code = code.replace("CYCLE DEF", "CYCL DEF")
    return ("" if code.startswith("*") else code), goes_on


def _tokens(text: str) -> list[re.Match[str]]:
    """Return the words of a move; what is none is refused."""
    tokens, at = [], 0
    for token in _TOKEN.finditer(text):
        if text[at : token.start()].strip():
            break
        tokens.append(token)
        at = token.end()
    if text[at:].strip():
        raise _RefusedError(r.REASON_TNC_WORD)
    return tokens


def _expression(value: str) -> str:
    """Return a value as the core reads it: ``+Q5`` is QV5."""
    value = re.sub(r"Q(\d+)", lambda q: f"QV{int(q[1])}", value.replace(",", ".").replace(" ", ""))
    return value.removeprefix("+")


def _float(value: str) -> float | None:
    try:
        return float(value.replace(",", "."))
    except ValueError:
        return None


def _cycle_value(value: str) -> str:
    return f"{_NO_FEED_MM_MIN:.0f}" if value == "FMAX" else value if value == "FAUTO" else _expression(value)


def _hole_arguments(number: int, q: dict[str, str], speed: str) -> list[str]:
    """Return kind, feed and the arguments of a Sinumerik's drilling cycle (CYCLE83 to CYCLE85)."""
    if "FAUTO" in q.values():
        raise _RefusedError(r.REASON_HOLE)
    surface, clearance, depth = q["203"], q["200"], f"-({q['201']})"
    above = [f"({surface})+MAXVAL({q.get('204', '0')},{clearance})", surface, clearance, "", depth]
    dwell = q.get("211", "0")
    if number == 207:
        if not speed:
            raise _RefusedError(r.REASON_HOLE)
        return ["84", "1", *above, "0", "3", "", q["239"], "", speed]
    feed = q["206"]
    out = q.get("208", "0")
    if number == 201:
        return ["85", feed, *above, dwell, feed, feed if _float(out) == 0.0 else out]
    if number == 203:
        plain = [_float(q.get(name, "0")) for name in ("212", "213")] == [0.0, 0.0]
        fast = (_float(out) or 0.0) >= _NO_FEED_MM_MIN
        if not plain or (not fast and not _is_one_stroke(q)):
            raise _RefusedError(r.REASON_HOLE)
        if not fast:
            return ["85", feed, *above, dwell, feed, feed if _float(out) == 0.0 else out]
    first, wait_above = f"MINVAL({q['202']},{depth})", q.get("210", "0")
    return ["83", feed, *above, "", first, "-1", "0", wait_above, "1", "1", "", "", "", dwell, clearance]


def _is_one_stroke(q: dict[str, str]) -> bool:
    stroke, depth = _float(q["202"]), _float(q["201"])
    return stroke is not None and depth is not None and stroke >= -depth
