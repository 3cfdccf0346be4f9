"""The `Issue` of a finding of the core, which has a number and three figures: its sentence and remedy."""

import math
import unicodedata

from gcode2krl.ascii_codes import FIRST_FOREIGN
from gcode2krl.errors import Issue
from gcode2krl.gcode import findings
from gcode2krl.gcode import vocabulary as v
from gcode2krl.gcode.dialects import REASONS
from gcode2krl.gcode.findings import FindingKind
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
_SCALING_OFF, _REMOVE_G50 = 500, "remove G50, which ends a scaling: no G51 is read, so none is in force"
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
    finding = findings.all_findings()[number]
    sentence, remedy = _texts(finding, a, b)
    character = int(a) if finding.name == "F.BAD_CHARACTER" else 0
    why, what_to_do = _reason(finding.name, a, b)
    values = {
        "a": a,
        "b": b,
        "c": c,
        "word": chr(int(a)) if 0 < a < FIRST_FOREIGN else "?",
        "letter": chr(int(b)) if 0 < b < FIRST_FOREIGN else "",
        "words": " and ".join(letters_of(a)) if "{words}" in sentence else "",
        "axes": _listed(letters_of(b)) if "{axes}" in sentence else "",
        "char": _printable(character),
        "replacement": _replacement(character),
        "g": f"{a / v.TENFOLD:g}",
        "h": f"{b / v.TENFOLD:g}",
        "difference": abs(a - b),
        "half": abs(c - b) / 2.0,
        "code": f"{'M' if a < 0 else 'G'}{abs(a) / v.TENFOLD:g}",
        "decimals": decimals_needed(MM_PER_INCH if c < 0 else 1.0),
        "tool": f"tool {b:.0f}" if b else "none",
        "value": "" if math.isnan(c) else f", not {chr(int(b))}{c:g}" if finding.name == "FM.IO_WORD" else "",
        "state": _state(finding.name, line, a, b, c),
        "reason": why,
        "fault": why,
        "remedy": what_to_do,
    }
    return Issue(
        finding.severity, finding.code, line, sentence.format(**values), remedy.format(**values), excerpt
    )


def _texts(finding: FindingKind, a: float, b: float) -> tuple[str, str]:
    """Return sentence and remedy of a finding, where they depend on what was found."""
    if finding.name in ("F.SAME_GROUP_G", "F.SAME_GROUP_M") and a == b:
        return f"{finding.name[-1]}{{g}} stands twice in the block", "keep one"  # it does not exclude itself
    if finding.name == "F.BAD_CHARACTER" and 0 < a < FIRST_FOREIGN:
        return finding.sentence, _OF_CHARACTER.get(chr(int(a)), finding.remedy)
    if finding.name == "F.UNKNOWN_G" and a == _SCALING_OFF:
        return finding.sentence, _REMOVE_G50
    if finding.name == "F.NO_MOTION_MODE" and not a:
        return (
            finding.sentence,
            f"{finding.remedy}, or state the control's first one as motion in [program.start] of the cell",
        )
    return finding.sentence, finding.remedy


def _reason(name: str, a: float, b: float) -> tuple[str, str]:
    """Return why something is not read, or what is wrong with an expression or an O-word; and the remedy."""
    match name:
        case "F.UNSUPPORTED_G":
            return findings.unsupported("g", a / v.TENFOLD)
        case "F.UNSUPPORTED_M":
            return findings.unsupported("m", a / v.TENFOLD)
        case "F.DIALECT_CODE" | "F.DIALECT_STATEMENT":
            return REASONS[int(a)]
        case "F.EXPRESSION":
            return findings.fault("expression", int(a))
        case "F.O_WORD":
            return findings.fault("o_word", int(a))
        case "F.EXPRESSION_VALUE":
            why, remedy = findings.fault("value", int(a))
            return why.format(b=b), remedy
    return "", ""


def _state(name: str, line: int, a: float, b: float, c: float) -> str:
    """Name the modal state that led to a finding."""
    match name:
        case "F.NO_FEED":
            return f"G{b:.0f} of line {a:.0f}" if a else "the start"
        case "F.NO_MOTION_MODE":
            return f"G80 of line {a:.0f} ended the motion mode" if a else "none has been programmed before"
        case "F.UNKNOWN_START":
            return f", G91 of line {a:.0f} is in force" if a else ""
        case "F.ARC_NO_CENTRE":
            return f"; it is in force since line {b:.0f}" if b != line else ""
        case "F.UNUSED_WORD" if set(letters_of(a)) & set("IJKPR"):
            return f"; G{b:.0f} is in force since line {c:.0f}" if b >= 0 else "; no motion mode is in force"
    return ""


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
