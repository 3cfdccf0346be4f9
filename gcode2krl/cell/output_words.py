"""Outputs that a template takes from the words of a block: ``$OUT[{{ p | int }}]`` of M62 P3.

Which they are only a program says, so they are compared with those of the spindle there, not in the cell.
"""

from typing import Any

from gcode2krl.cell.definition import Cell, plain_view
from gcode2krl.cell.krl_effect import effect_of
from gcode2krl.cell.switching import SAMPLE, WORDS, rendered_widely
from gcode2krl.cell.templates import TemplateError, render
from gcode2krl.tables import Event

_SPINDLE = ("m_code.M3", "m_code.M4")


def reserved_outputs(cell: Cell) -> dict[str, str]:
    """Return the outputs that no word of a block may name, and whose they are."""
    spindle, link = cell.spindle, cell.online.link
    named = {
        "the spindle": (spindle.run_cw_output, spindle.run_ccw_output),
        "the coolant": (spindle.flood_output, spindle.mist_output),
        "the online side": (link.t1_output, link.ready_output),
    }
    reserved = {
        f"$OUT[{number}]": whose
        for whose, numbers in named.items()
        for number in numbers
        if number is not None
    }
    templates = {key: text for key, text in cell.templates().items() if key in _SPINDLE}
    for texts in rendered_widely(templates, _view(cell)).values():
        reserved |= {name: "the spindle" for text in texts for name in effect_of(text).signals}
    return reserved


def switched_by_words(event: Event, cell: Cell) -> frozenset[str]:
    """Return the outputs that an M-code with words of its own switches."""
    template = cell.templates().get(f"m_code.M{event.values.get('m')}", "")
    words = {word: event.values.get(word) for word in WORDS}
    if not template or not any(value is not None for value in words.values()):
        return frozenset()
    try:
        text = render(template, {**SAMPLE, **_view(cell), "m": event.values["m"], **words})
    except TemplateError:  # reported where it is written
        return frozenset()
    return frozenset(effect_of(text).signals)


def _view(cell: Cell) -> dict[str, Any]:
    return {"cell": plain_view(cell), "spindle": cell.spindle.model_dump()}
