"""The `Issue` of a finding of the core, which has a number and three figures: its sentence and remedy."""

import math
import unicodedata

from gcode2krl.ascii_codes import FIRST_FOREIGN
from gcode2krl.errors import Issue
from gcode2krl.gcode import cycle_findings as of_cycles
from gcode2krl.gcode import findings as f
from gcode2krl.gcode import mode_findings as of_modes
from gcode2krl.gcode import offset_findings as of_offsets
from gcode2krl.gcode import vocabulary as v
from gcode2krl.gcode.dialects import REASONS
from gcode2krl.gcode.never_read import NEVER_READ
from gcode2krl.gcode.program_faults import (
    EXPRESSION_FAULTS,
    O_WORD_FAULTS,
    VALUE_FAULTS,
    VALUE_REMEDIES,
    VALUE_REMEDY,
)
from gcode2krl.units import MM_PER_INCH

_OF_CHARACTER = {
    "*": "let the post write no checksums (*57)",
    ":": "write a program number as O1000, or remove the line",
    "$": "remove the line: $ begins a command to the control, not a block",
    "%": "write % alone on its line, and nothing behind it",
    ",": "write a decimal point for a decimal comma, and no commas between words",
    ")": "write ( before the comment, or remove the )",
}
"""What to do about a character, where simply removing it would leave another mistake."""
_LATER = "not read yet"
_UNSUPPORTED_G_REASONS: dict[int, tuple[str, str]] = {
    v.G43_4: (f"tool offsets with rotary axes: {_LATER}", "use G43 H"),
    **NEVER_READ,
}
_UNSUPPORTED_M_REASONS: dict[int, tuple[str, str]] = {
    v.TENFOLD * v.M19: (
        "spindle orientation is not mapped",
        "map it in [m_code] of the cell once it is read",
    ),
    v.TENFOLD * v.M66: (
        "it waits for an input and keeps its value in #5399, which is not known in translation",
        'write an M-code of your own, and map it in [m_code] of the cell: M150 = "WAIT FOR $IN[7]"',
    ),
}

_OF_LETTERS = (f.UNUSED_WORD, f.ROTARY_UNKNOWN, f.VECTOR_AND_ANGLE)
"""Findings whose first number has the bits of letters."""

SPIRAL_SENTENCE = (
    "{count} with radii that differ at start and end, most by {difference:.4f} mm "
    "({a:.4f} and {b:.4f} mm); read as a spiral"
)
SPIRAL_REMEDY = "let the post write X, Y, Z, I, J, K with {decimals} decimals"
_DIFFERENCE_MM = 0.01
_LAST_PLACES = 2.0 * math.sqrt(2.0)
"""Radii of an arc differ by at most so many units of the last place that its words are rounded to: start
and end are each off by half a unit in two coordinates, the centre by as much and twice, on both radii."""


def decimals_needed(unit_mm: float) -> int:
    """Return the decimals that keep the radii of an arc within 0.01 mm, for words in units of ``unit_mm``."""
    return math.ceil(math.log10(_LAST_PLACES * unit_mm / _DIFFERENCE_MM))


def _listed(letters: str) -> str:
    """Return letters as ``X, Y and Z``."""
    return " and ".join(", ".join(letters).rsplit(", ", 1))


def letters_of(bits: float) -> str:
    """Return the letters whose bits are set, A first."""
    return "".join(letter for k, letter in enumerate(v.ALPHABET) if int(bits) >> k & 1)


def make_issue(number: int, line: int, a: float, b: float = 0.0, c: float = 0.0, excerpt: str = "") -> Issue:
    """Return the `Issue` for one row of the core's findings."""
    finding = f.FINDINGS[number]
    reason, remedy = "", ""
    if number in (f.UNSUPPORTED_G, f.UNSUPPORTED_M):
        reasons = _UNSUPPORTED_G_REASONS if number == f.UNSUPPORTED_G else _UNSUPPORTED_M_REASONS
        reason, remedy = _nearest_below(reasons, int(a))
    if number in (f.DIALECT_CODE, f.DIALECT_STATEMENT):
        reason, remedy = REASONS[int(a)]
    character = int(a) if number == f.BAD_CHARACTER else 0
    values = {
        "a": a,
        "b": b,
        "c": c,
        "word": chr(int(a)) if 0 < a < FIRST_FOREIGN else "?",
        "words": " and ".join(letters_of(a)) if number in (*_OF_LETTERS, of_offsets.ROTARY) else "",
        "axes": _listed(letters_of(b)) if number == of_offsets.FROM_UNKNOWN else "",
        "char": _printable(character),
        "replacement": _replacement(character),
        "g": f"{a / v.TENFOLD:g}",
        "h": f"{b / v.TENFOLD:g}",
        "difference": abs(a - b),
        "half": abs(c - b) / 2.0,
        "code": f"{'M' if a < 0 else 'G'}{abs(a) / v.TENFOLD:g}",
        "decimals": decimals_needed(MM_PER_INCH if c < 0 else 1.0),
        "letter": chr(int(b)) if number in of_cycles.TEXTS and 0 < b < FIRST_FOREIGN else "",
        **_of_modes(number, b, c),
        "state": _state(number, line, a, b, c),
        "reason": reason,
        "remedy": remedy,
        **_program_fault(number, a, b),
    }
    return Issue(
        finding.severity,
        finding.code,
        line,
        _sentence(finding, number, a, b).format(**values),
        _remedy(finding, number, a, b).format(**values),
        excerpt,
    )


def _of_modes(number: int, b: float, c: float) -> dict[str, str]:
    """Return which word an output lacks, or which tool is in the spindle."""
    if number == of_modes.IO_WORD:
        letter = chr(int(b))
        return {"number": letter, "value": "" if math.isnan(c) else f", not {letter}{c:g}"}
    return {"there": f"tool {b:.0f}" if b else "none"} if number == of_modes.TOOL_NUMBER else {}


def _program_fault(number: int, a: float, b: float) -> dict[str, str]:
    """Return what is wrong with an expression or an O-word, and the remedy."""
    if number in (f.EXPRESSION, f.O_WORD):
        faults = EXPRESSION_FAULTS if number == f.EXPRESSION else O_WORD_FAULTS
        fault, remedy = faults.get(int(a), faults[0])
        return {"fault": fault, "remedy": remedy}
    if number == f.EXPRESSION_VALUE:
        return {"fault": VALUE_FAULTS[int(a)].format(b=b), "remedy": VALUE_REMEDIES.get(int(a), VALUE_REMEDY)}
    return {}


def _sentence(finding: f.Finding, number: int, a: float, b: float) -> str:
    """Return the sentence of a finding; a code does not exclude itself, it stands twice."""
    twice = {
        f.SAME_GROUP_G: "G{g} stands twice in the block",
        f.SAME_GROUP_M: "M{g} stands twice in the block",
    }
    return twice[number] if a == b and number in twice else finding.sentence


def _remedy(finding: f.Finding, number: int, a: float, b: float) -> str:
    """Return the remedy of a finding, where it depends on what was found."""
    if number == f.BAD_CHARACTER and 0 < a < FIRST_FOREIGN:
        return _OF_CHARACTER.get(chr(int(a)), finding.remedy)
    if number in (f.SAME_GROUP_G, f.SAME_GROUP_M) and a == b:
        return "keep one"
    return finding.remedy


def _state(number: int, line: int, a: float, b: float, c: float) -> str:
    """Name the modal state that led to a finding."""
    if number == f.NO_FEED:
        return f"G{b:.0f} of line {a:.0f}" if a else "the start"
    if number == f.NO_MOTION_MODE:
        return f"G80 of line {a:.0f} ended the motion mode" if a else "none has been programmed before"
    if number == f.UNKNOWN_START:
        return f", G91 of line {a:.0f} is in force" if a else ""
    if number == f.ARC_NO_CENTRE:
        return f"; it is in force since line {b:.0f}" if b != line else ""
    if number == f.UNUSED_WORD and set(letters_of(a)) & set("IJKPR"):
        return f"; G{b:.0f} is in force since line {c:.0f}" if b >= 0 else "; no motion mode is in force"
    return ""


def _nearest_below(reasons: dict[int, tuple[str, str]], number: int) -> tuple[str, str]:
    return reasons[max(key for key in reasons if key <= number)]


def _printable(code: int) -> str:
    if code < FIRST_FOREIGN:
        return f"'{chr(code)}'" if 32 < code < 127 else f"0x{max(code, 0):02x}"
    character = _foreign(code)
    name = unicodedata.name(character, "") if character else ""
    return f"U+{ord(character):04X} {name}" if name else f"0x{code:02x}"


def _replacement(code: int) -> str:
    """Return what to write instead of a character; a document turns - into its own minus signs and dashes."""
    character = _foreign(code) if code >= FIRST_FOREIGN else ""
    if (character and unicodedata.category(character) == "Pd") or character == "\u2212":
        return "write - (the minus sign of the keyboard)"
    if character and unicodedata.category(character) == "Zs":
        return "write a plain blank"
    return "remove it, or put it in a comment ( )"


def _foreign(code: int) -> str:
    """Return the character of a code point, empty for none; below 0xA0 it is a byte of code page 1252."""
    return bytes([code]).decode("cp1252", "ignore") if code < 0xA0 else chr(code)
