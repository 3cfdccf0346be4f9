"""The block of a finding, quoted on one line, with a caret before the word that is wrong."""

import re

from gcode2krl.ascii_codes import FIRST_FOREIGN
from gcode2krl.gcode.findings import ANY_WORD, all_findings
from gcode2krl.gcode.sentences import letters_of
from gcode2krl.gcode.vocabulary import TENFOLD

_BEFORE, _AFTER = 24, 32
_COMMENT = re.compile(r"\([^()]*\)|;.*")


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
    finding = all_findings()[number]
    if finding.column and c >= 0:
        return min(int(c), len(text)), True
    code = text.upper() if len(text.upper()) == len(text) else text
    if finding.name not in ("F.COMMENT_OPEN", "F.COMMENT_NESTED"):
        code = _COMMENT.sub(lambda comment: " " * len(comment[0]), code)
    pattern = re.compile(_pattern(finding.culprit, a, b))
    group = "culprit" if "culprit" in pattern.groupindex else 0
    places = [found.start(group) for found in pattern.finditer(code)]
    if places:
        return places[0], len(places) == 1 and pattern.pattern != ANY_WORD
    first = re.search(ANY_WORD, code)
    return (first.start() if first else 0), False


def _pattern(culprit: str, a: float, b: float) -> str:
    """Return the pattern of a culprit, with the letters and numbers that were found."""
    if "{word}" in culprit:
        letter = re.escape(chr(int(a))) if 0 <= a < FIRST_FOREIGN else r"[^\x00-\x7f]"
        culprit = culprit.replace("{word}", letter)
    if "{words}" in culprit:
        culprit = culprit.replace("{words}", re.escape(letters_of(a)))
    if "{axes}" in culprit:
        culprit = culprit.replace("{axes}", re.escape(letters_of(b)))
    code = f"{'M' if a < 0 else 'G'}{_number(abs(a))}"
    return culprit.replace("{g}", _number(a)).replace("{h}", _number(b)).replace("{code}", code)


def _number(tenfold: float) -> str:
    """Return the pattern of the number of a G- or M-word, given as ten times its value."""
    return rf"\s*0*{re.escape(f'{tenfold / TENFOLD:g}')}(?:\.0*)?(?![\d.])"
