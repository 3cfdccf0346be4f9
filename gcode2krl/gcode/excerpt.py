"""The block of a finding, quoted on one line, with a caret before the word that is wrong."""

import re

from gcode2krl.ascii_codes import FIRST_FOREIGN
from gcode2krl.gcode import cycle_findings as c
from gcode2krl.gcode import findings as f
from gcode2krl.gcode import offset_findings as of_offsets
from gcode2krl.gcode import polar_findings as p
from gcode2krl.gcode.sentences import letters_of
from gcode2krl.gcode.vocabulary import TENFOLD

_BEFORE, _AFTER = 24, 32
_ANY_WORD = r"[^\s/]"
_COMMENT = re.compile(r"\([^()]*\)|;.*")
_FEED_WORD = r"G\s*0*[123](?![\d.])|[XYZIJK]"
_ARC_WORD = r"[IJKR]|G\s*0*[23](?![\d.])"
_OF_LETTER_A = {
    f.NUMBER_TOO_LONG,
    f.UNKNOWN_LETTER,
    f.ROTARY_WORD,
    f.BAD_INTEGER,
    f.ARC_WRONG_OFFSET,
    f.COUNTED_FROM_UNKNOWN,
    of_offsets.TOOL_ACROSS,
}
_FIXED = {
    f.COMMENT_OPEN: r"\((?!.*\))",
    f.COMMENT_NESTED: r"(?<=\()[^()]*(?P<culprit>\()",
    f.O_WORD: r"GOTO|DO\s*\d|END\s*\d|M\s*0*9[89](?!\d)|G\s*65|O",
    f.EXPRESSION: r"[A-Z]?\s*[-+]?\s*[#\[\]=]|[A-Z](?=[A-Z]+\[)",
    f.NEGATIVE_FEED: "F",
    f.NEGATIVE_SPEED: "S",
    f.DWELL_NEGATIVE: "P",
    f.NEGATIVE_TOLERANCE: "P",
    f.ARC_TURNS: "P",
    f.NO_FEED: _FEED_WORD,
    f.NO_INVERSE_TIME: _FEED_WORD,
    f.FEED_PER_REV_STOPPED: _FEED_WORD,
    f.NO_MOTION_MODE: "[XYZABCUVW]",
    f.TOOL_NOT_SELECTED: r"M\s*0*6(?!\d)",
    f.DWELL_NO_P: r"G\s*0*4(?![\d.])",
    f.ARC_NO_CENTRE: r"G\s*0*[23](?![\d.])|[XYZ]",
    f.ARC_BOTH_FORMATS: "R",
    f.ARC_RADIUS_MISMATCH: _ARC_WORD,
    f.ARC_RADIUS_TOO_SMALL: "R",
    f.ARC_R_FULL_CIRCLE: "R",
    f.ARC_ZERO_RADIUS: _ARC_WORD,
    f.ARC_NEEDS_OFFSETS: "[IJK]",
    f.N_NOT_FIRST: "N",
    f.BAD_LINE_NUMBER: "N",
    f.TOO_FAR: "[XYZ]",
    f.G53_NEEDS_RAPID_OR_FEED: r"G\s*53",
    f.G53_INCREMENTAL: r"G\s*53",
    f.DWELL_WITH_ARC: r"G\s*0*4(?![\d.])",
    f.H_DIFFERS: "H",
    f.CUTTER_EXIT_ARC: r"G\s*0*[23](?![\d.])|[XYZ]",
    f.CUTTER_LATHE: "L",
    f.CUTTER_NO_DIAMETER: r"D|G\s*4[12]",
    f.CUTTER_DIFFERS: r"D|G\s*4[12]",
    f.TOO_MANY_M: r"M(?=[^M]*$)",
    f.BAD_M: "M",
    f.DIALECT_STATEMENT: r"\$|[A-Z_]{2,}|[@^]|[A-Z]\d*\s*=|#|\[|M\s*0*(?:9[89]|7[0-3])(?!\d)|G\s*0*4(?!\d)",
    of_offsets.WITHOUT_L: r"G\s*10",
    of_offsets.UNKNOWN_L: "L",
    of_offsets.WRONG_SYSTEM: r"P|G\s*10",
    of_offsets.WRONG_TOOL: r"P|G\s*10",
    of_offsets.TOOL_UNDECLARED: "P",
    of_offsets.NO_LENGTH: r"G\s*10",
    of_offsets.ROTATION_BY_POSITION: "R",
    of_offsets.ADDED_BY_WORDS: "[XYZABCUVW]",
    of_offsets.ADDED_WITHOUT_H: r"G\s*43",
    of_offsets.AT_START: r"G\s*(92|10)",
    of_offsets.LENGTH_DIFFERS: "[ZH]",
    f.VECTOR_ZERO: "[IJK]",
    f.VECTOR_ARC: _ARC_WORD,
    f.CYCLE_TURNED: r"G\s*[78]\d|[XYZABC]",
    f.TURN_PER_REV: "[ABC]",
    f.TURN_TOO_FAR: "[ABC]",
    c.R_BELOW_DEPTH: "R",
    p.PLANE: r"[@\^]",
    p.WITH_AXIS: r"[@\^]",
    p.G53: r"[@\^]",
    p.AT_ZERO: r"[@\^]",
    c.REPEATS: "L",
    c.DWELL_NEGATIVE: "P",
    c.PECK_NOT_POSITIVE: "Q",
    c.CLEARANCE_NEGATIVE: "D",
}


def quote(block: bytes, number: int, a: float, b: float, c: float = -1.0) -> str:
    """Return the block with a caret before what finding ``number`` is about: ``G1 X10 ^I5``."""
    text = _text(block)
    at, _ = _place(text, number, a, b, c)
    start = max(0, at - _BEFORE)
    stop = min(len(text), at + _AFTER)
    before, after = (_printable(part) for part in (text[start:at].lstrip(), text[at:stop].rstrip()))
    return ("..." if start else "") + before + "^" + after + ("..." if stop < len(text) else "")


def column(block: bytes, number: int, a: float, b: float, c: float = -1.0) -> int:
    """Return the 1-based place of the caret, in characters; 0 where it may be another word's."""
    at, is_certain = _place(_text(block), number, a, b, c)
    return len(block[:at].decode("utf-8", "replace")) + 1 if is_certain else 0


def _text(block: bytes) -> str:
    return block.decode("latin-1").expandtabs(1).rstrip("\r\n\x1a ")


def _printable(text: str) -> str:
    return "".join(c if 32 <= ord(c) < 127 else "?" for c in text)


def _place(text: str, number: int, a: float, b: float, c: float) -> tuple[int, bool]:
    """Return the place of the culprit, the first word where it cannot be told; and whether it is certain.

    It is where it has been told, or where only one word of the block can be meant.
    """
    if number in f.WITH_COLUMN and c >= 0:
        return min(int(c), len(text)), True
    code = text.upper() if len(text.upper()) == len(text) else text
    if number not in (f.COMMENT_OPEN, f.COMMENT_NESTED):
        code = _COMMENT.sub(lambda comment: " " * len(comment[0]), code)
    pattern = re.compile(_pattern(number, a, b))
    group = "culprit" if "culprit" in pattern.groupindex else 0
    places = [found.start(group) for found in pattern.finditer(code)]
    if places:
        return places[0], len(places) == 1 and pattern.pattern != _ANY_WORD
    first = re.search(_ANY_WORD, code)
    return (first.start() if first else 0), False


def _pattern(number: int, a: float, b: float) -> str:
    letter = re.escape(chr(int(a))) if 0 <= a < 256 else "?"
    if number == f.BAD_CHARACTER:
        return letter if a < FIRST_FOREIGN else r"[^\x00-\x7f]"
    if number == f.NO_NUMBER:
        return letter + r"(?!\s*[-+]?\s*\.?\s*\d)"
    if number == f.REPEATED_WORD:
        return f"{letter}(?=[^{letter}]*$)"
    if number in _OF_LETTER_A:
        return letter
    if number == of_offsets.FROM_UNKNOWN:
        return f"[{re.escape(letters_of(b))}]"
    if number in (f.UNUSED_WORD, f.VECTOR_AND_ANGLE, of_offsets.ROTARY):
        return f"[{re.escape(letters_of(a))}]"
    if number == f.CUTTER_ON:
        return _word("M" if a < 0 else "G", abs(a))
    if number in (f.CUTTER_PLANE, f.CUTTER_NO_D, f.CUTTER_NO_TOOL):
        return _word("G", a)
    if number in (f.UNKNOWN_G, f.UNSUPPORTED_G, f.NO_MACHINE, of_offsets.NO_AXES):
        return _word("G", a)
    if number == f.NO_POINT:
        return letter + r"\s*[-+]?\d+(?![\d.])"
    if number in (f.SAME_GROUP_G, f.TWO_AXIS_CODES, f.DIALECT_CODE):
        return _word("G", b)
    if number in (f.UNSUPPORTED_M, f.SAME_GROUP_M):
        return _word("M", a if number == f.UNSUPPORTED_M else b)
    return _FIXED.get(number, _ANY_WORD)


def _word(letter: str, tenfold: float) -> str:
    """Return the pattern of a G or M word, its number given as ten times its value."""
    return rf"{letter}\s*0*{re.escape(f'{tenfold / TENFOLD:g}')}(?:\.0*)?(?![\d.])"
