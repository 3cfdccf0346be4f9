"""Looking a word up in the G-code itself, for findings whose table knows only the move before it."""

import re
from itertools import islice
from pathlib import Path

MOST_LINES = 1000


def line_with(source: str, pattern: str, first: int, last: int, *, from_end: bool = False) -> int | None:
    """Return the 1-based line between two lines (both included) whose code matches a pattern.

    ``pattern`` is compared with the text in capitals, without comments and blanks. None where no line does,
    or the file cannot be read again (standard input).
    """
    first = max(first, last - MOST_LINES if from_end else first, 1)
    try:
        with Path(source).open(encoding="latin-1") as file:
            lines = list(islice(file, first - 1, min(last, first + MOST_LINES)))
    except (OSError, ValueError):
        return None
    wanted = re.compile(pattern)
    matching = [k for k, text in enumerate(lines, start=first) if wanted.search(_code(text))]
    if not matching:
        return None
    return matching[-1] if from_end else matching[0]


def _code(text: str) -> str:
    return re.sub(r"\([^)]*\)?|;.*|\s+", "", text).upper()
