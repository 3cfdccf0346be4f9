"""What the stated controller and RSI mean for a program: none at all, and what its header says of them."""

from collections.abc import Iterable, Iterator

from gcode2krl.cell import Cell
from gcode2krl.errors import Issue
from gcode2krl.krl.constructs import assumed_in

ASSUMED = "ASSUMED, look at this in T1: "
"""Begins the lines of a header that name what nothing public confirms."""


def version_issues(cell: Cell) -> Iterator[Issue]:
    """Yield what forbids any program for the stated controller."""
    if cell.controller.kss == "iiqka":
        sentence = (
            "[controller] kss is iiqka: nothing public says which of our KRL it runs, and its RSI is "
            "switched by other calls (RSI_LOAD, RSI_ACTIVATE, RSI_PROCESS_ON)"
        )
        yield Issue("error", "kss-iiqka", 0, sentence, "use a controller that runs KSS 8, a KRC4 or KR C5")


def version_lines(cell: Cell, is_online: bool, texts: Iterable[str]) -> list[str]:
    """Return lines of a header: the versions it was written for, and what is assumed of its ``texts``."""
    kss, rsi = cell.controller.kss, cell.controller.rsi
    words = f"for KSS {kss}" if kss else "for KSS 8.x, assumed: the cell does not state [controller] kss"
    if is_online:
        words += f"; RSI {cell.controller.rsi_version}{'' if kss or rsi else ', assumed'}"
    return [words, *(f"{ASSUMED}{look}" for look in assumed_in(texts))]
