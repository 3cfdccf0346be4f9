"""What the controller needs for RSI beside the program: the Ethernet file and the signal flow.

RSI 3 reads a ``.rsi.xml`` whose inputs, outputs and parameters count from 1; RSI 4 and 5 read a ``.rsix``
that counts from 0, spells some kinds differently and has one numbering for the axes of the robot alone.
Numbers and names are those of files that RSI Visual has made (docs/krl_truth.md); nobody has loaded ours
into a controller yet. Both files belong together: the numbers of the channels are those of both. The tags
are those that the online side parses.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from gcode2krl import krl_words as w
from gcode2krl.cell.sections import Pilot
from gcode2krl.cell.sections.online import Online
from gcode2krl.cell.sections.robot import RsiVersion
from gcode2krl.errors import Issue, RefusedError, input_error

Form = Literal["index", "values", "none"]
MOST_TURN_DEG = 0.1
"""We correct positions, no orientations: a turn beyond is none of ours."""
MONITOR_SHARE = 1.2
"""The monitor of the sum stops the program; the limits themselves only clip, and come first."""
_IN_BASE = 1
"""``RefCorrSys``: the corrections are along ``$BASE``."""
_INTEGER, _REAL = r"\$SEN_PINT\[(\d{1,2})\]", r"\$SEN_PREA"
"""What the objects SEN_PINT and SEN_PREA of a signal flow can read."""
_RSIX_KIND = {
    "ETHERNET": "Ethernet",
    "POSCORR": "PosCorr",
    "POSCORRMON": "PosCorrMon",
    "AXISCORR": "AxisCorr",
    "AXISCORRMON": "AxisCorrMon",
    "DIGOUT": "DigOut",
    "MAP2DIGOUT": "Map2DigOut",
    "SEN_PINT": "Sen_PInt",
    "SEN_PREA": "Sen_PRea",
    "OV_PRO": "OV_PRO",
}
"""How a ``.rsix`` spells the kinds of objects; the numbers ``ObjTypeID`` are the same."""
_HIGHEST_INDEX = {"3": (20, 4096), "4": (128, 8192), "5": (128, 8192)}
"""Largest index of ``$SEN_PINT`` and ``$SEN_PREA``, and of an output, in an object of each version."""


@dataclass(frozen=True)
class _Object:
    """An object of the signal flow."""

    kind: str
    number: int
    """``ObjTypeID``"""
    name: str
    inputs: tuple[tuple[int, str, int], ...] = ()
    """Own input, object and output that feed it."""
    parameters: tuple[tuple[str, int, float | int | str, bool], ...] = ()
    """Name, ``ParamID``, value, and whether it may be changed while running."""


@dataclass(frozen=True)
class _Channel:
    """A value that the controller sends beside its poses."""

    tag: str
    kind: str
    source: str
    output: int = 1


def is_file_name(name: str) -> bool:
    """Tell whether files of that name can be named on a controller."""
    return re.fullmatch(rf"[A-Za-z0-9_]{{1,{w.LONGEST_RSI_NAME}}}", name) is not None and (
        name.upper() not in w.DEVICES
    )


def refuse_file_name(name: str) -> None:
    """Raise where the RSI files cannot have that name."""
    if not is_file_name(name):
        allowed = f"1 to {w.LONGEST_RSI_NAME} letters, digits and _, and no name of a device"
        raise input_error("option-value", f"name of the RSI files: found {name!r}, allowed: {allowed}")


def file_names(name: str, rsi: RsiVersion) -> tuple[str, str]:
    """Return the names of the Ethernet file and the signal flow; raises where the name is none for KUKA."""
    refuse_file_name(name)
    return f"{name}{w.ETHERNET_SUFFIX}", f"{name}{w.SIGNAL_FLOW_SUFFIXES[rsi]}"


def created_name(name: str, rsi: RsiVersion) -> str:
    """Return what RSI_CREATE is given: RSI 3 takes the name with ``.rsi``, later ones without."""
    return f"{name}.rsi" if rsi == "3" else name


def rsi_texts(name: str, settings: Online, pilot: Pilot, form: Form, rsi: RsiVersion) -> dict[str, str]:
    """Return file name → text of both files of ``name``."""
    ethernet, flow = file_names(name, rsi)
    objects = _objects(settings, pilot, form, ethernet)
    _refuse_index(objects, rsi)
    return {
        ethernet: ethernet_xml(settings, form),
        flow: _signal_flow_xml(objects) if rsi == "3" else _signal_flow_rsix(objects),
    }


def ethernet_xml(settings: Online, form: Form) -> str:
    """Return the file of the ETHERNET object: address, what is sent, what is received."""
    link = settings.link
    poses = ("DEF_RIst", "DEF_RSol", "DEF_AIPos", "DEF_ASPos")
    sent = [f'<ELEMENT TAG="{tag}" TYPE="DOUBLE" INDX="INTERNAL"/>' for tag in poses]
    sent.append('<ELEMENT TAG="DEF_Delay" TYPE="LONG" INDX="INTERNAL"/>')
    sent += [
        f'<ELEMENT TAG="{channel.tag}" TYPE="{channel.kind}" INDX="{index}"/>'
        for index, channel in enumerate(_channels(settings, form), start=1)
    ]
    received = [
        f'<ELEMENT TAG="{tag}" TYPE="DOUBLE" INDX="{index}" HOLDON="1"/>'
        for index, tag in enumerate(_correction_tags(settings), start=1)
    ]
    received.append('<ELEMENT TAG="Ready" TYPE="BOOL" INDX="7" HOLDON="0"/>')
    lines = [
        "<ROOT>",
        "<CONFIG>",
        f"<IP_NUMBER>{link.address}</IP_NUMBER>",
        f"<PORT>{link.port}</PORT>",
        f"<SENTYPE>{link.sensor_type}</SENTYPE>",
        "<ONLYSEND>FALSE</ONLYSEND>",
        "</CONFIG>",
        "<!-- HOLDON 1: a correction stays when an answer is late. HOLDON 0: Ready falls at once. -->",
        *("<SEND>", "<ELEMENTS>", *sent, "</ELEMENTS>", "</SEND>"),
        *("<RECEIVE>", "<ELEMENTS>", *received, "</ELEMENTS>", "</RECEIVE>"),
        "</ROOT>",
    ]
    return "\n".join(lines) + "\n"


def _refuse_index(objects: Iterable[_Object], rsi: RsiVersion) -> None:
    """Raise where an object has an index that this version of RSI does not know."""
    variables, outputs = _HIGHEST_INDEX[rsi]
    for thing in objects:
        index = next((value for name, _, value, _ in thing.parameters if name == "Index"), 0)
        most = variables if thing.kind.startswith("SEN_") else outputs
        if isinstance(index, int) and index > most:
            sentence = f"{thing.kind} of RSI {rsi} has an index up to {most}, the cell asks for {index}"
            remedy = "choose a lower number in [pilot] or [online.link]"
            raise RefusedError(Issue("error", "rsi-index", 0, sentence, remedy))


def _signal_flow_xml(objects: Iterable[_Object]) -> str:
    """Return the signal flow of RSI 3 (``.rsi.xml``), with the limits on the controller's side."""
    schema = "/Roboter/Config/System/Common/Schemes/RSIContext.xsd"
    lines = [
        '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>',
        f'<RSIObjects xsi:noNamespaceSchemaLocation="{schema}" '
        'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">',
    ]
    for thing in objects:
        lines.append(f'<RSIObject ObjType="{thing.kind}" ObjTypeID="{thing.number}" ObjID="{thing.name}">')
        if thing.inputs:
            wires = (f'<Input InIdx="{i}" OutObjID="{o}" OutIdx="{k}"/>' for i, o, k in thing.inputs)
            lines += ["<Inputs>", *wires, "</Inputs>"]
        if thing.parameters:
            lines += ["<Parameters>", *(_parameter(*each) for each in thing.parameters), "</Parameters>"]
        lines.append("</RSIObject>")
    return "\n".join([*lines, "</RSIObjects>"]) + "\n"


def _signal_flow_rsix(objects: Iterable[_Object]) -> str:
    """Return the same signal flow as a ``.rsix`` of RSI 4 and 5."""
    schema = 'xsi:schemaLocation="RsiContext RsiContext.xsd" SchemaVersion="2.0.0"'
    lines = [
        '<?xml version="1.0" encoding="utf-8"?>',
        f'<RsiContext {schema} xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xmlns="RsiContext">',
        '<RsiObjects xmlns="RsiDriver">',
    ]
    for thing in objects:
        kind = _RSIX_KIND[thing.kind]
        lines.append(f'<RsiObject ObjTypeId="{thing.number}" ObjType="{kind}" ObjId="{thing.name}">')
        if thing.inputs:
            wires = (f'<Input InIdx="{i - 1}" OutObjId="{o}" OutIdx="{k - 1}"/>' for i, o, k in thing.inputs)
            lines += ["<Inputs>", *wires, "</Inputs>"]
        if thing.parameters:
            parameters = (_rsix_parameter(thing.kind, *parameter) for parameter in thing.parameters)
            lines += ["<Parameters>", *parameters, "</Parameters>"]
        lines.append("</RsiObject>")
    return "\n".join([*lines, "</RsiObjects>", "</RsiContext>"]) + "\n"


def numbers_to_compare(settings: Online, pilot: Pilot, form: Form, rsi: RsiVersion) -> list[tuple[str, str]]:
    """Return each kind of object with its number, and the numbers of its parameters, as our file has them."""
    rows = {}
    for thing in _objects(settings, pilot, form, ""):
        numbers = ((name, number) for name, number, _, _ in thing.parameters)
        if rsi != "3":
            numbers = ((_RSIX_NAME.get(name, name), _rsix_number(thing.kind, name, k)) for name, k in numbers)
        kind = thing.kind if rsi == "3" else _RSIX_KIND[thing.kind]
        rows[f"{kind} {thing.number}"] = ", ".join(f"{name} {number}" for name, number in numbers)
    return list(rows.items())


_RSIX_NAME = {"DataSize": "DataType"}
"""Parameters that a ``.rsix`` names otherwise; 0 is a single bit in both."""


def _rsix_number(kind: str, name: str, number: int) -> int:
    """Return the ``ParamId`` of a ``.rsix``: from 0, and without room for external axes in AxisCorr."""
    return number - 7 if kind == "AXISCORR" and name.startswith("UpperLim") else number - 1


def _rsix_parameter(kind: str, name: str, number: int, value: float | int | str, at_runtime: bool) -> str:
    fixed = "" if at_runtime else 'IsRuntime="false" '
    named = f'Name="{_RSIX_NAME.get(name, name)}" ParamId="{_rsix_number(kind, name, number)}"'
    return f'<Parameter {fixed}{named} ParamValue="{_value(value)}"/>'


def _objects(settings: Online, pilot: Pilot, form: Form, ethernet_file: str) -> list[_Object]:
    """Return the objects of the signal flow, numbered as in RSI 3.

    Raises `RefusedError` where RSI cannot read the variables of the pilot force.
    """
    return [
        *_sources(settings, pilot, form),
        *_corrections(settings),
        _ethernet(settings, form, ethernet_file),
    ]


def _correction_tags(settings: Online) -> list[str]:
    if settings.mode == "cartesian":
        return [f"RKorr.{name}" for name in w.POSE_KEYS]
    return [f"AKorr.{name}" for name in w.AXIS_KEYS]


def _channels(settings: Online, form: Form) -> list[_Channel]:
    """Return the values that are sent, in the order of their numbers."""
    channels = [_Channel("OvPro", "LONG", "OV_PRO1"), _Channel("T1", "LONG", "DIGOUT1")]
    if settings.mode == "cartesian":
        channels += [
            _Channel(f"PosCorrMon.{n}", "DOUBLE", "POSCORRMON1", k)
            for k, n in enumerate(w.POSE_KEYS[:3], start=1)
        ]
    if form == "index":
        channels.append(_Channel("SenPInt1", "LONG", "SEN_PINT1"))
    if form == "values":
        channels += [_Channel(f"SenPrea{k}", "DOUBLE", f"SEN_PREA{k}") for k in (1, 2, 3, 4)]
    if form != "none":
        channels.append(_Channel("SenPInt2", "LONG", "SEN_PINT2"))
    return channels


def _sources(settings: Online, pilot: Pilot, form: Form) -> list[_Object]:
    """Return the objects that feed the channels; their names are those of the channels, not of the index."""

    def numbered(kind: str, number: int, name: int, index: int) -> _Object:
        return _Object(kind, number, f"{kind}{name}", parameters=(("Index", 1, index, True),))

    bit = (("Index", 1, settings.link.t1_output, True), ("DataSize", 2, 0, True))
    objects = [_Object("OV_PRO", 63, "OV_PRO1"), _Object("DIGOUT", 43, "DIGOUT1", parameters=bit)]
    if form == "index":
        objects.append(numbered("SEN_PINT", 57, 1, _index(pilot.index_variable, _INTEGER)))
    if form == "values":
        _index(pilot.value_variable, _REAL)
        objects += [numbered("SEN_PREA", 58, k, k) for k in (1, 2, 3, 4)]
    if form != "none":
        objects.append(numbered("SEN_PINT", 57, 2, _index(pilot.hash_variable, _INTEGER)))
    return objects


def _index(variable: str, pattern: str) -> int:
    """Return the index of a variable that RSI can read, 0 of one without."""
    match = re.fullmatch(pattern, variable, re.IGNORECASE)
    if match is None:
        sentence = f"RSI cannot read {variable} of [pilot], only $SEN_PINT[n] and $SEN_PREA"
        raise RefusedError(Issue("error", "online-pilot", 0, sentence, "correct [pilot], or --pilot none"))
    return int(match[1]) if match.groups() else 0


def _corrections(settings: Online) -> list[_Object]:
    """Return the object that corrects with its limits, the monitor of the sum, and what shows readiness."""
    wires = tuple((k, "ETHERNET1", k) for k in range(1, 7))
    most = settings.most_mm
    if settings.mode == "cartesian":
        limits = [(f"LowerLim{n}", k, -most, True) for k, n in enumerate(w.POSE_KEYS[:3], start=1)]
        limits += [(f"UpperLim{n}", k, most, True) for k, n in enumerate(w.POSE_KEYS[:3], start=4)]
        limits.append(("MaxRotAngle", 7, MOST_TURN_DEG, True))
        corrects = _Object("POSCORR", 27, "POSCORR1", wires, (*limits, ("RefCorrSys", 1, _IN_BASE, False)))
        sums = (("MaxTrans", 1, MONITOR_SHARE * most, True), ("MaxRotAngle", 2, MOST_TURN_DEG, True))
        watches = _Object("POSCORRMON", 81, "POSCORRMON1", parameters=sums)
    else:
        degrees = settings.axis_most_deg
        low = tuple((f"LowerLimA{k}", k, -v, True) for k, v in enumerate(degrees, start=1))
        high = tuple((f"UpperLimA{k}", k + 12, v, True) for k, v in enumerate(degrees, start=1))
        corrects = _Object("AXISCORR", 33, "AXISCORR1", wires, (*low, *high))
        most_of_axis = tuple((f"MaxA{k}", k, MONITOR_SHARE * v, True) for k, v in enumerate(degrees, start=1))
        watches = _Object("AXISCORRMON", 82, "AXISCORRMON1", parameters=most_of_axis)
    bit = (("Index", 1, settings.link.ready_output, True), ("DataSize", 2, 0, True))
    shows = _Object("MAP2DIGOUT", 14, "MAP2DIGOUT1", ((1, "ETHERNET1", 7),), bit)
    return [corrects, watches, shows]


def _ethernet(settings: Online, form: Form, ethernet_file: str) -> _Object:
    wires = tuple((k, c.source, c.output) for k, c in enumerate(_channels(settings, form), start=1))
    parameters = (
        ("ConfigFile", 1, ethernet_file, False),
        ("Timeout", 1, settings.link.timeout_cycles, True),
        ("Precision", 8, settings.link.decimals, True),
    )
    return _Object("ETHERNET", 64, "ETHERNET1", wires, parameters)


def _parameter(name: str, number: int, value: float | int | str, at_runtime: bool) -> str:
    fixed = "" if at_runtime else ' IsRuntime="false"'
    return f'<Parameter Name="{name}" ParamID="{number}" ParamValue="{_value(value)}"{fixed}/>'


def _value(value: float | int | str) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
