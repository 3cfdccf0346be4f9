"""Which programs must not be corrected online, or only after a person has read a warning."""

import re
from collections.abc import Iterator, Sequence
from ipaddress import IPv4Address

import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.cell.carriers import tables_of
from gcode2krl.cell.sections.external import EXTERNAL_NAMES
from gcode2krl.clearance import collisions_on_retracts
from gcode2krl.errors import Issue
from gcode2krl.krl.rsi_text import rsi_rows
from gcode2krl.krl.statements import event_statements
from gcode2krl.tables import Targets

_HALT = re.compile(rf"^\s*{w.HALT}\b", re.IGNORECASE | re.MULTILINE)


def online_issues(targets: Targets, cell: Cell) -> Iterator[Issue]:
    """Yield what forbids RSI between the approach and the last retract, or should be known.

    There corrections are on all the time: for one tool, without a way over HOME, and not while a person is
    asked to the machine.
    """
    on, off = rsi_rows(targets)
    if off <= on:
        yield Issue(
            "error",
            "online-nothing",
            0,
            "there is no move that could be corrected online",
            "leave out --online",
        )
        return
    yield from _tools(targets, on, off)
    yield from _homes(targets, on, off)
    yield from _halts(targets, cell, on, off)
    yield from _tables(targets, cell)
    address = IPv4Address(cell.online.link.address)
    if address.is_unspecified:
        sentence = f"the controller cannot look for the server at {address}"
        yield Issue("error", "online-address", 0, sentence, "give [online.link] address of the PC")
    if address.is_loopback:
        sentence = f"the controller will look for the server at itself, {cell.online.link.address}"
        yield Issue("warning", "online-address", 0, sentence, "give [online.link] address of the PC")


def retract_issues(targets: Targets, cell: Cell) -> Sequence[Issue]:
    """Return what the retract of a lost link would hit, wherever RSI is on."""
    on, off = rsi_rows(targets)
    return collisions_on_retracts(targets, on, off, cell.online.link.retract_mm, cell) if off > on else ()


def _tables(targets: Targets, cell: Cell) -> Iterator[Issue]:
    """Yield the tables that turn: the online side does not know how the part lies then."""
    for name in tables_of(cell.external, cell.frames.base_on):
        if np.ptp(targets.external[:, EXTERNAL_NAMES.index(name)]) > 0.0:
            sentence = f"{name} turns the part, which the online compensation does not know of"
            yield Issue("error", "external-moves", 0, sentence, f"state [external.{name}] position and home")


def _tools(targets: Targets, on: int, off: int) -> Iterator[Issue]:
    """RSI is on once: what is corrected, and the weight that the sensor carries, are those of one tool."""
    changes = [event for event in targets.events if event.kind == "tool" and on < event.row < off]
    tools = np.unique(targets.tool[on + 1 : off + 1])
    if changes or len(tools) > 1:
        line = int(changes[0].values["line"]) if changes else _line_of_change(targets, on)
        yield Issue(
            "error",
            "online-tool",
            line,
            "a tool change between cuts that are corrected online",
            "translate a program for each tool",
        )


def _line_of_change(targets: Targets, on: int) -> int:
    other = np.flatnonzero(targets.tool[on + 1 :] != targets.tool[on + 1])
    return int(targets.source_line[on + 1 + int(other[0])])


def _homes(targets: Targets, on: int, off: int) -> Iterator[Issue]:
    """A PTP moves the axes together, not the tip along a line: no correction has a direction there."""
    for row in on + 1 + np.flatnonzero(targets.ptp[on + 1 : off + 1]):
        if targets.home[row]:
            yield Issue(
                "error",
                "online-home",
                int(targets.source_line[row]),
                "a way over HOME between cuts that are corrected online",
                "retract in Z only (G28 Z, G53 Z), or one program for each stretch",
            )


def _halts(targets: Targets, cell: Cell, on: int, off: int) -> Iterator[Issue]:
    for event in targets.events:
        if on < event.row < off and event.kind != "tool" and _HALT.search(event_statements(event, cell)):
            yield Issue(
                "error",
                "online-halt",
                int(event.values["line"]),
                "the program halts for a person while the robot follows corrections",
                "leave the halt out, or one program for each stretch",
            )
