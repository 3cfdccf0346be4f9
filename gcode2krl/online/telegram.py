"""KUKA's telegrams: ``<Rob …>`` as the controller sends it, ``<Sen …>`` as it is answered.

The parser is our own, because data from a network must not be able to do more than state numbers: an XML
library supports entities, document types, nesting and encodings, each of which has been used to hang a reader
or to read files. Here a telegram is at most 8 kB of ASCII: one element ``Rob`` whose children have attributes
or a text and no children of their own. Anything else is refused.
"""

import math
import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.cell.sections.online import Online
from gcode2krl.units import DEG_PER_RAD, RAD_PER_DEG

LONGEST = 8192
MOST_ELEMENTS = 64
IPOC_DIGITS = 18
CORRECTION_DECIMALS, AXIS_DECIMALS = 4, 6
_NO_TEXT = re.compile(rb"[^\t\n\r\x20-\x7e]")
_ROB = re.compile(rb"\s*<Rob(?:\s+Type=\"\w{1,32}\")?\s*>(.*)</Rob>\s*\Z", re.DOTALL)
_ELEMENT = re.compile(
    rb"\s*<([A-Za-z_]\w{0,31})((?:\s+[A-Za-z_]\w{0,31}\s*=\s*\"[^\"<>&]{0,64}\"){0,32})\s*"
    rb"(?:/>|>([^<>&]{0,256})</\1\s*>)"
)
_ATTRIBUTE = re.compile(rb"([A-Za-z_]\w{0,31})\s*=\s*\"([^\"<>&]{0,64})\"")
_XYZ, _ABC = ("X", "Y", "Z"), ("A", "B", "C")
_AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
_NEEDED = {"RIst": _XYZ, "RSol": _XYZ, "AIPos": _AXES, "ASPos": _AXES}


class MalformedError(ValueError):
    """The data received is not a telegram; the text says why."""


@dataclass(frozen=True)
class Telegram:
    """What the controller reports in one cycle."""

    ipoc: int
    """ms on the controller's clock."""
    position_mm: Floats
    """(3,) actual tip in ``$BASE`` (RIst)."""
    command_mm: Floats
    """(3,) of the program, without correction (RSol)."""
    q_rad: Floats
    """(6,) actual joints (AIPos)."""
    q_command_rad: Floats
    """(6,) of the program (ASPos)."""
    late: float
    """Late answers so far, as the controller counts them; NaN = not reported."""
    monitor_mm: Floats
    """(3,) correction applied so far (POSCORRMON); NaN = not reported."""
    knot: float
    checksum: float
    override_percent: float
    t1: float
    """1 in T1. All four NaN = not reported."""
    values: Floats
    """(4,) pilot force x, y, z and seconds until it, of the form ``values``; NaN = not reported."""
    load: Floats
    """(6,) force sensor, where the controller reads it; NaN = not reported."""


def parse(data: bytes) -> Telegram:
    """Return the telegram of a datagram; raises `MalformedError`.

    Tags are those of the Ethernet file that `krl.rsi_files.rsi_texts` writes. RIst, RSol, AIPos, ASPos
    and IPOC must be there.
    """
    values = _elements(data)
    ipoc = values.get("IPOC", {}).get("", b"")
    if not re.fullmatch(rb"\d{1,18}", ipoc):
        raise MalformedError("no IPOC")
    numbers = {tag: _numbers(values, tag, names) for tag, names in _NEEDED.items()}
    if any(np.isnan(part).any() for part in numbers.values()):
        raise MalformedError("RIst, RSol, AIPos and ASPos must all be there")
    pint = [_text_number(values, f"SenPInt{k}") for k in (1, 2)]
    return Telegram(
        ipoc=int(ipoc),
        position_mm=numbers["RIst"],
        command_mm=numbers["RSol"],
        q_rad=numbers["AIPos"] * RAD_PER_DEG,
        q_command_rad=numbers["ASPos"] * RAD_PER_DEG,
        late=float(_numbers(values, "Delay", ("D",))[0]),
        monitor_mm=_numbers(values, "PosCorrMon", _XYZ),
        knot=pint[0],
        checksum=pint[1],
        override_percent=_text_number(values, "OvPro"),
        t1=_text_number(values, "T1"),
        values=np.array([_text_number(values, f"SenPrea{k}") for k in (1, 2, 3, 4)]),
        load=_numbers(values, "Force", (*_XYZ, "MX", "MY", "MZ")),
    )


class Answer(NamedTuple):
    """The answer to a telegram."""

    ipoc: int
    correction: Floats
    """(3,) mm along ``$BASE``, or (6,) rad."""
    ready: bool
    """True once the absolute mode is proven: the program may go on."""


def answer_text(answer: Answer, settings: Online) -> bytes:
    """Return the telegram of an answer; the IPOC unchanged."""
    head = f'<Sen Type="{settings.link.sensor_type}">'
    if len(answer.correction) == 3:
        words = " ".join(
            f'{name}="{value:.{CORRECTION_DECIMALS}f}"'
            for name, value in zip((*_XYZ, *_ABC), (*answer.correction.tolist(), 0.0, 0.0, 0.0), strict=True)
        )
        body = f"<RKorr {words}/>"
    else:
        words = " ".join(
            f'{name}="{value * DEG_PER_RAD:.{AXIS_DECIMALS}f}"'
            for name, value in zip(_AXES, answer.correction.tolist(), strict=True)
        )
        body = f"<AKorr {words}/>"
    return f"{head}{body}<Ready>{int(answer.ready)}</Ready><IPOC>{answer.ipoc}</IPOC></Sen>".encode("ascii")


def _elements(data: bytes) -> dict[str, dict[str, bytes]]:
    """Return tag → attribute → value; a text has the attribute "". A tag or attribute may come once."""
    if len(data) > LONGEST:
        raise MalformedError("too long")
    if _NO_TEXT.search(data):
        raise MalformedError("not ASCII text")
    body = _ROB.match(data)
    if body is None:
        raise MalformedError("not one <Rob> element")
    elements: dict[str, dict[str, bytes]] = {}
    text, at = body[1], 0
    while at < len(text) and text[at:].strip():
        element = _ELEMENT.match(text, at)
        if element is None or len(elements) >= MOST_ELEMENTS:
            raise MalformedError("not a flat list of elements")
        tag = element[1].decode("ascii")
        if tag in elements:
            raise MalformedError(f"{tag} twice")
        attributes = _ATTRIBUTE.findall(element[2])
        values = {name.decode("ascii"): value for name, value in attributes}
        if len(values) < len(attributes):
            raise MalformedError(f"an attribute of {tag} twice")
        if element[3] is not None:
            values[""] = element[3].strip()
        elements[tag], at = values, element.end()
    return elements


def _numbers(values: dict[str, dict[str, bytes]], tag: str, names: tuple[str, ...]) -> Floats:
    """Return the attributes of a tag; all NaN where it is not there, or not whole."""
    attributes = values.get(tag)
    if attributes is None or any(name not in attributes for name in names):
        return np.full(len(names), math.nan)
    return np.array([_number(attributes[name], tag) for name in names])


def _text_number(values: dict[str, dict[str, bytes]], tag: str) -> float:
    text = values.get(tag, {}).get("", b"")
    return _number(text, tag) if text else math.nan


def _number(word: bytes, tag: str) -> float:
    """Return a finite decimal number."""
    if not re.fullmatch(rb"\s*[-+]?\d{1,15}(\.\d{0,15})?([eE][-+]?\d{1,2})?\s*", word):
        raise MalformedError(f"{tag}: not a number")
    return float(word)
