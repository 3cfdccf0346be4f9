"""Text from outside, such as names and messages, in files that others read."""

import re

_NOT_PRINTED = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff"  # not in XML, or better not
    "\u200e\u200f\u202a-\u202e\u2066-\u2069]"  # turn the direction of writing
)
_IN_MARKDOWN = re.compile(r"[\\`*{}\[\]<>|&~#@!$^]|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])|(?<=:)//|[\n\r\t]+")
_C0_PICTURES = 0x2400
_FIRST_PRINTED = 0x20
_REPLACEMENT = "\ufffd"


def printable(text: str) -> str:
    """Return a text with a sign for what is not printed.

    These are control characters and halves of surrogates, which XML 1.0 cannot hold, and the marks that turn
    the direction of writing, with which a name can pretend to be another.
    """
    return _NOT_PRINTED.sub(_picture, text)


def _picture(found: re.Match[str]) -> str:
    number = ord(found[0])
    return chr(_C0_PICTURES + number) if number < _FIRST_PRINTED else _REPLACEMENT


def one_line(text: str, most: int) -> str:
    """Return a text on one line, of at most so many characters."""
    line = " ".join(printable(text).split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


def markdown(text: str) -> str:
    """Return a text that Markdown shows as it is, in a cell of a table too.

    What could be markup becomes a character reference, which no parser takes for structure.
    """
    return _IN_MARKDOWN.sub(_references, printable(text))


def _references(found: re.Match[str]) -> str:
    return "".join(" " if character.isspace() else f"&#{ord(character)};" for character in found[0])
