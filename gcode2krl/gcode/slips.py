"""Slips of the hand and of posts that a block shows: the sentence and the remedy that name them."""

import re

_COMMENT = re.compile(r"\([^()]*\)|;.*")
_LETTER_O = re.compile(r"[A-MP-Z]\s*[-+]?[\d.]*O[\d.]*")
_MACRO_STATEMENT = re.compile(r"[A-Z]O[A-Z]|(?:^|\])\s*(?:N\d+\s*)?DO\s*\d")
"""GOTO, POPEN, DO1: statements of a macro."""
_EXPONENT = re.compile(r"[\d.]E[-+]?\d")


def slip(block: bytes, code: str, letter: str) -> tuple[str, str] | None:
    """Return sentence and remedy for a finding ``code`` on ``letter`` if its block shows a usual slip."""
    text = _COMMENT.sub(" ", block.decode("latin-1")).rstrip()
    capitals = text.upper() if len(text.upper()) == len(text) else text
    match = _LETTER_O.search(capitals)
    if code in ("o-word", "no-number") and match and not _MACRO_STATEMENT.search(capitals):
        word = match[0].replace(" ", "")
        if code == "o-word" or word[0] == letter:
            return (
                f"the letter O stands in the number of {word[0]}",
                f"write the digit 0: {word.replace('O', '0')}",
            )
    if code == "no-number" and re.search(rf"{letter}\s*[-+]?l(?![A-Za-z])", text, re.IGNORECASE):
        return f"the letter l stands in the number of {letter}", "write the digit 1"
    if code == "no-number" and re.search(rf"{letter}\s*[-+]\s*[-+]", capitals):
        return f"two signs stand before the number of {letter}", "write one sign"
    if code == "unknown-letter" and letter == "E":
        if _EXPONENT.search(capitals):
            return "a number with an exponent E", "write it out, as 0.001"
        return "E is not a word of this dialect", "remove it; E drives the extruder of a 3D printer"
    return None
