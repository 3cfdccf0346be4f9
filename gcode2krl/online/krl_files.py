"""What the controller needs for RSI: the Ethernet file, the signal flow, and the lines of KRL around the cut.

Written after KUKA's examples for KSS 8.3 and RSI 3, object numbers and all; nobody has loaded these files
into a controller yet. Both files of one program belong together: the numbers of the channels are those of
both.
"""

from dataclasses import dataclass
from typing import Literal

from gcode2krl.cell import Cell
from gcode2krl.errors import input_error
from gcode2krl.online.settings import Online

Form = Literal["index", "values", "none"]
LONGEST_NAME = 16
INTERRUPT = 21
READY_SUBPROGRAM = "GK_RSI_LOST"
MOST_TURN_DEG = 0.1
"""We correct positions, no orientations: a turn beyond is none of ours."""
MONITOR_SHARE = 1.2
"""The monitor of the sum stops the program; the limits themselves only clip, and come first."""
_XYZABC = ("X", "Y", "Z", "A", "B", "C")
_AXES = ("A1", "A2", "A3", "A4", "A5", "A6")
_IN_BASE = 1
"""``RefCorrSys``: the corrections are along ``$BASE``."""


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


def file_names(name: str) -> tuple[str, str]:
    """Return the names of the Ethernet file and the signal flow; raises where the name is none for KUKA."""
    if not (name.isascii() and name.replace("_", "a").isalnum() and 0 < len(name) <= LONGEST_NAME):
        allowed = f"1 to {LONGEST_NAME} letters, digits and _"
        raise input_error("option-value", f"--online: found {name!r}, allowed: {allowed}")
    return f"{name}_ETH.xml", f"{name}.rsi.xml"


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


def signal_flow_xml(settings: Online, form: Form, ethernet_file: str) -> str:
    """Return the signal flow (``.rsi.xml``) with the limits of the settings on the controller's side."""
    objects = [*_sources(settings, form), *_corrections(settings), _ethernet(settings, form, ethernet_file)]
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


DECLARATIONS = "DECL INT GK_RSI_RET,GK_RSI_ID"


def start_statements(name: str, settings: Online) -> str:
    """Return the KRL that switches RSI on: on the clearance plane, behind the exact stop above the first cut.

    The program waits until the server has proven the absolute mode; the robot must not move meanwhile.
    """
    cycle = "#IPO_FAST" if settings.cycle_s < 0.012 else "#IPO"
    ready = f"$OUT[{settings.link.ready_output}]"
    return "\n".join(
        [
            "; corrections by RSI: gcode2krl online serve must listen before the next line",
            f'GK_RSI_RET=RSI_CREATE("{name}.rsi",GK_RSI_ID,TRUE)',
            *_unless_ok("RSI_CREATE failed"),
            f"GK_RSI_RET=RSI_ON(#ABSOLUTE,{cycle})",
            *_unless_ok("RSI_ON failed"),
            f"WAIT FOR {ready} ; the absolute mode is proven",
            f"INTERRUPT DECL {INTERRUPT} WHEN {ready}==FALSE DO {READY_SUBPROGRAM}( )",
            f"INTERRUPT ON {INTERRUPT}",
        ]
    )


def end_statements() -> str:
    """Return the KRL that switches RSI off: on the clearance plane, behind the last retract."""
    return "\n".join(
        [
            f"INTERRUPT OFF {INTERRUPT}",
            "GK_RSI_RET=RSI_OFF()",
            *_unless_ok("RSI_OFF failed"),
            "GK_RSI_RET=RSI_DELETE(GK_RSI_ID)",
        ]
    )


def lost_subprogram(settings: Online, cell: Cell, tool: int) -> str:
    """Return the subprogram of the interrupt: stop on the path, out along the tool axis, halt.

    RSI holds the correction (``HOLDON``): it is never taken back in material.
    """
    axis = cell.tool[tool].axis or "+z"
    away = settings.link.retract_mm if axis[0] == "+" else -settings.link.retract_mm
    return "\n".join(
        [
            f"DEF {READY_SUBPROGRAM}( )",
            f"INTERRUPT OFF {INTERRUPT}",
            "BRAKE",
            f"LIN_REL {{{axis[1].upper()} {away:.3f}}} #TOOL",
            f"WHILE NOT $OUT[{settings.link.ready_output}]",
            "HALT ; the link is lost: switch the spindle off, cancel the program",
            "ENDWHILE",
            "HALT ; the link was lost: the cut has a mark; cancel, or go on above it",
            "END",
        ]
    )


def used_variables(settings: Online, cell: Cell, form: Form) -> str:
    """Return the note which variables and signals of the controller the files use."""
    pilot = {
        "index": f"{cell.pilot.index_variable} number of the knot, {cell.pilot.hash_variable} checksum",
        "values": f"{cell.pilot.value_variable}[1..4] next knot, {cell.pilot.hash_variable} checksum",
        "none": "none for the pilot",
    }[form]
    return (
        f"RSI reads {pilot}, $OV_PRO, $OUT[{settings.link.t1_output}] (T1); "
        f"it writes $OUT[{settings.link.ready_output}] (corrections are made)"
    )


def _unless_ok(message: str) -> tuple[str, ...]:
    return ("IF GK_RSI_RET<>RSIOK THEN", f"HALT ; {message}", "ENDIF")


def _correction_tags(settings: Online) -> list[str]:
    if settings.mode == "cartesian":
        return [f"RKorr.{name}" for name in _XYZABC]
    return [f"AKorr.{name}" for name in _AXES]


def _channels(settings: Online, form: Form) -> list[_Channel]:
    """Return the values that are sent, in the order of their numbers."""
    channels = [_Channel("OvPro", "LONG", "OV_PRO1"), _Channel("T1", "LONG", "DIGOUT1")]
    if settings.mode == "cartesian":
        channels += [
            _Channel(f"PosCorrMon.{n}", "DOUBLE", "POSCORRMON1", k) for k, n in enumerate("XYZ", start=1)
        ]
    if form == "index":
        channels.append(_Channel("SenPInt1", "LONG", "SEN_PINT1"))
    if form == "values":
        channels += [_Channel(f"SenPrea{k}", "DOUBLE", f"SEN_PREA{k}") for k in (1, 2, 3, 4)]
    if form != "none":
        channels.append(_Channel("SenPInt2", "LONG", "SEN_PINT2"))
    return channels


def _sources(settings: Online, form: Form) -> list[_Object]:
    def numbered(kind: str, number: int, index: int) -> _Object:
        return _Object(kind, number, f"{kind}{index}", parameters=(("Index", 1, index, True),))

    bit = (("Index", 1, settings.link.t1_output, True), ("DataSize", 2, 0, True))
    found = [_Object("OV_PRO", 63, "OV_PRO1"), _Object("DIGOUT", 43, "DIGOUT1", parameters=bit)]
    if form == "index":
        found.append(numbered("SEN_PINT", 57, 1))
    if form == "values":
        found += [numbered("SEN_PREA", 58, k) for k in (1, 2, 3, 4)]
    if form != "none":
        found.append(numbered("SEN_PINT", 57, 2))
    return found


def _corrections(settings: Online) -> list[_Object]:
    """Return the object that corrects with its limits, the monitor of the sum, and what shows readiness."""
    wires = tuple((k, "ETHERNET1", k) for k in range(1, 7))
    most = settings.most_mm
    if settings.mode == "cartesian":
        limits = [(f"LowerLim{n}", k, -most, True) for k, n in enumerate("XYZ", start=1)]
        limits += [(f"UpperLim{n}", k, most, True) for k, n in enumerate("XYZ", start=4)]
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
