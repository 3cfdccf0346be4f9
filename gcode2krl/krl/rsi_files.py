"""What the controller needs for RSI beside the program: the Ethernet file and the signal flow.

Written after KUKA's examples for KSS 8.3 and RSI 3, object numbers and all; nobody has loaded these files
into a controller yet. Both belong together: the numbers of the channels are those of both. The tags are
those that the online side parses.
"""

import re
from dataclasses import dataclass
from typing import Literal

from gcode2krl import krl_words as w
from gcode2krl.cell.sections import Pilot
from gcode2krl.cell.sections.online import Online
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


def file_names(name: str) -> tuple[str, str]:
    """Return the names of the Ethernet file and the signal flow; raises where the name is none for KUKA."""
    if not is_file_name(name):
        allowed = f"1 to {w.LONGEST_RSI_NAME} letters, digits and _, and no name of a device"
        raise input_error("option-value", f"name of the RSI files: found {name!r}, allowed: {allowed}")
    return f"{name}{w.ETHERNET_SUFFIX}", f"{name}{w.SIGNAL_FLOW_SUFFIX}"


def rsi_texts(name: str, settings: Online, pilot: Pilot, form: Form) -> dict[str, str]:
    """Return file name → text of both files of ``name``."""
    ethernet, flow = file_names(name)
    return {
        ethernet: ethernet_xml(settings, form),
        flow: signal_flow_xml(settings, pilot, form, ethernet),
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


def signal_flow_xml(settings: Online, pilot: Pilot, form: Form, ethernet_file: str) -> str:
    """Return the signal flow (``.rsi.xml``) with the limits of the settings on the controller's side.

    Raises `RefusedError` where RSI cannot read the variables of the pilot force.
    """
    objects = [
        *_sources(settings, pilot, form),
        *_corrections(settings),
        _ethernet(settings, form, ethernet_file),
    ]
    schema = "/Roboter/Config/System/Common/Schemes/RSIContext.xsd"
    lines = [
        '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>',
        f'<RSIObjects xsi:noNamespaceSchemaLocation="{schema}" '
        'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">',
    ]
    for one in objects:
        lines.append(f'<RSIObject ObjType="{one.kind}" ObjTypeID="{one.number}" ObjID="{one.name}">')
        if one.inputs:
            wires = (f'<Input InIdx="{i}" OutObjID="{o}" OutIdx="{k}"/>' for i, o, k in one.inputs)
            lines += ["<Inputs>", *wires, "</Inputs>"]
        if one.parameters:
            lines += ["<Parameters>", *(_parameter(*each) for each in one.parameters), "</Parameters>"]
        lines.append("</RSIObject>")
    return "\n".join([*lines, "</RSIObjects>"]) + "\n"


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
    found = [_Object("OV_PRO", 63, "OV_PRO1"), _Object("DIGOUT", 43, "DIGOUT1", parameters=bit)]
    if form == "index":
        found.append(numbered("SEN_PINT", 57, 1, _index(pilot.index_variable, _INTEGER)))
    if form == "values":
        _index(pilot.value_variable, _REAL)
        found += [numbered("SEN_PREA", 58, k, k) for k in (1, 2, 3, 4)]
    if form != "none":
        found.append(numbered("SEN_PINT", 57, 2, _index(pilot.hash_variable, _INTEGER)))
    return found


def _index(variable: str, pattern: str) -> int:
    """Return the index of a variable that RSI can read, 0 of one without."""
    found = re.fullmatch(pattern, variable, re.IGNORECASE)
    if found is None:
        sentence = f"RSI cannot read {variable} of [pilot], only $SEN_PINT[n] and $SEN_PREA"
        raise RefusedError(Issue("error", "online-pilot", 0, sentence, "correct [pilot], or --pilot none"))
    return int(found[1]) if found.groups() else 0


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
    text = f"{value:g}" if isinstance(value, float) else str(value)
    fixed = "" if at_runtime else ' IsRuntime="false"'
    return f'<Parameter Name="{name}" ParamID="{number}" ParamValue="{text}"{fixed}/>'
