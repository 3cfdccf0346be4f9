"""Numbers of a cell that contradict each other: of cutters, spindle, arm, controller and pilot."""

import re
from collections.abc import Iterator

import numpy as np

from gcode2krl.cell.definition import Cell
from gcode2krl.cell.layout import reach_mm
from gcode2krl.cell.sections import Tool
from gcode2krl.errors import Issue, Severity
from gcode2krl.units import RAD_PER_REV, S_PER_MIN

_FASTEST_EDGE_M_MIN = 12_000.0
"""High-speed milling of aluminium: 2,000 to 8,000 m/min."""
_MANY_TEETH, _TEETH_PER_MM = 4, 2.0
_END_MILL_MM = 20.0
"""Thicker cutters sit on an arbor that may be thinner than they are."""
_NARROW_DEG = 5.0
_RADIANS = 2.0 * np.pi + 0.1
_REACH_SHARE = 0.15
"""Data sheets measure the reach to the wrist's centre or to the flange."""
_LONG_TRAVEL_S = 600.0
_SHORT_RAIL_MM = 100.0
_ROBOT_NAME = re.compile(r"\bKR ?(\d+)\b")
_START_S = 30.0


def proportion_issues(cell: Cell) -> Iterator[Issue]:
    """Yield the numbers that cannot both be true, or hardly are."""
    for number, tool in cell.tool.items():
        yield from _cutter(f"tool.{number}", tool, cell)
    yield from _spindle(cell)
    yield from _robot(cell)
    yield from _external(cell)
    yield from _controller(cell)
    yield from _variables(cell)
    yield from _online(cell)


def _cutter(key: str, tool: Tool, cell: Cell) -> Iterator[Issue]:
    diameter_mm, flute_mm, out_mm = tool.diameter_mm, tool.flute_length_mm, tool.stick_out_mm
    holder_mm = tool.holder_diameter_mm
    shank_mm = tool.shank_diameter_mm or diameter_mm
    if (
        holder_mm is not None
        and holder_mm < shank_mm
        and (tool.shank_diameter_mm or diameter_mm <= _END_MILL_MM)
    ):
        text = f"= {holder_mm:g} is less than the shank in it, {shank_mm:g}"
        yield _wrong("error", f"{key}.holder_diameter_mm", text)
    if flute_mm is not None and out_mm is not None and flute_mm > out_mm + 1.0:
        text = f"= {out_mm:g}: the holder would clamp the edges, which are {flute_mm:g} mm long"
        yield _wrong("warning", f"{key}.stick_out_mm", text)
    if flute_mm is not None and tool.max_depth_mm is not None and tool.max_depth_mm > flute_mm:
        text = f"= {tool.max_depth_mm:g} is deeper than the edges are long, {flute_mm:g}"
        yield _wrong("warning", f"{key}.max_depth_mm", text)
    if tool.kind == "drill" and not tool.centre_cutting:
        yield _wrong("error", f"{key}.centre_cutting", "is false: a drill cuts at its centre")
    if tool.point_deg is not None and tool.kind != "drill":
        yield _wrong("warning", f"{key}.point_deg", f"is the point of a drill, and the tool is {tool.kind}")
    if tool.taper_deg > 0.0 and tool.kind in ("flat", "ball", "bull-nose", "drill"):
        yield _wrong("warning", f"{key}.taper_deg", f"= {tool.taper_deg:g}, and the tool is {tool.kind}")
    if tool.teeth > _MANY_TEETH and tool.teeth > _TEETH_PER_MM * diameter_mm:
        text = f"= {tool.teeth} on {diameter_mm:g} mm: exchanged with diameter_mm?"
        yield _wrong("warning", f"{key}.teeth", text)
    if tool.max_rpm is not None:
        edge_m_min = np.pi * diameter_mm * tool.max_rpm / 1000.0
        if edge_m_min > _FASTEST_EDGE_M_MIN:
            text = f"= {tool.max_rpm:g}: its edges would have {edge_m_min:.0f} m/min"
            yield _wrong("warning", f"{key}.max_rpm", text)
        if cell.spindle.max_rpm is not None and tool.max_rpm < 0.01 * cell.spindle.max_rpm:
            text = f"= {tool.max_rpm:g} is below 1 % of spindle.max_rpm"
            yield _wrong("warning", f"{key}.max_rpm", text)
    if tool.max_force_N is not None and tool.max_force_N > 10.0 * cell.limits.force_N:
        text = f"= {tool.max_force_N:g} is ten times limits.force_N, {cell.limits.force_N:g}"
        yield _wrong("warning", f"{key}.max_force_N", text)


def _spindle(cell: Cell) -> Iterator[Issue]:
    spindle = cell.spindle
    if spindle.max_power_W is not None and spindle.max_torque_Nm is not None and spindle.max_rpm is not None:
        most_W = spindle.max_torque_Nm * spindle.max_rpm * RAD_PER_REV / S_PER_MIN
        if spindle.max_power_W > 1.2 * most_W:
            text = f"= {spindle.max_torque_Nm:g} makes {most_W:.0f} W at most, not {spindle.max_power_W:g}"
            yield _wrong("warning", "spindle.max_torque_Nm", text)
    for key, code in (
        ("run_cw_output", "M3"),
        ("run_ccw_output", "M4"),
        ("flood_output", "M8"),
        ("mist_output", "M7"),
    ):
        if (
            key in ("flood_output", "mist_output")
            and getattr(spindle, key) is not None
            and code not in cell.m_code
        ):
            other = "M8" if code == "M7" else "M7"
            if other not in cell.m_code:
                yield _wrong("warning", f"spindle.{key}", f"is stated, and no {code} switches it")
        if key == "run_cw_output" and spindle.run_cw_output is None and spindle.run_ccw_output is not None:
            yield _wrong("warning", "spindle.run_ccw_output", "is stated without run_cw_output: exchanged?")


def _robot(cell: Cell) -> Iterator[Issue]:
    robot = cell.robot
    reach, stated = reach_mm(cell), robot.payload.reach_mm
    if reach is not None and stated is not None:
        whole = reach + (robot.geometry.a1_mm or 0.0)
        if abs(stated - whole) > _REACH_SHARE * whole:
            text = f"= {stated:g}, and the lengths of the arm reach {whole:.0f} mm"
            yield _wrong("warning", "robot.payload.reach_mm", text)
    limits = robot.limits.q_deg
    if limits is not None and max(abs(angle) for pair in limits for angle in pair) < _RADIANS:
        yield _wrong("error", "robot.limits.q_deg", "are all below 2 pi: radians, where degrees are meant")
    elif limits is not None:
        for number, (low, high) in enumerate(limits, start=1):
            if high - low < _NARROW_DEG:
                text = f": A{number} moves from {low:g} to {high:g} only"
                yield _wrong("warning", "robot.limits.q_deg", text)
    model, trafo = _ROBOT_NAME.search(robot.title), re.match(r"#?KR ?(\d+)", robot.trafo_name)
    if model and trafo and model[1] != trafo[1]:
        text = f"= {robot.trafo_name!r}, and the robot is a {robot.title}: the guard would stop each program"
        yield _wrong("warning", "robot.trafo_name", text)
    name = _ROBOT_NAME.search(cell.name)
    if name and model and name[1] != model[1]:
        yield _wrong("warning", "robot.model", f"is {robot.title}, and the cell is called {cell.name!r}")


def _external(cell: Cell) -> Iterator[Issue]:
    for name, axis in cell.external.items():
        low, high = axis.limits
        if axis.is_rail and high - low < _SHORT_RAIL_MM and axis.moves:
            yield _wrong("warning", f"external.{name}.limits", f"are {high - low:g} mm of travel: metres?")
        elif (
            axis.speed is not None
            and min(high - low, 20_000.0) / axis.speed > _LONG_TRAVEL_S
            and axis.is_rail
        ):
            needed_min = (high - low) / axis.speed / S_PER_MIN
            text = f"= {axis.speed:g} mm/s needs {needed_min:.0f} min from end to end: m/s?"
            yield _wrong("warning", f"external.{name}.speed", text)
        elif not axis.is_rail and axis.moves and max(abs(low), abs(high)) < _RADIANS:
            yield _wrong(
                "warning", f"external.{name}.limits", "are below 2 pi: radians, where degrees are meant"
            )


def _controller(cell: Cell) -> Iterator[Issue]:
    controller = cell.controller
    if controller.rapid_m_s > controller.vel_cp_m_s * 1.0001:
        most_m_s = controller.vel_cp_m_s
        text = f"= {controller.rapid_m_s:g} is more than vel_cp_m_s, the largest path speed, {most_m_s:g}"
        yield _wrong("warning", "controller.rapid_m_s", text)
    if controller.rapid_m_s / controller.acc_cp_m_s2 > _START_S / 6.0:
        start_s = controller.rapid_m_s / controller.acc_cp_m_s2
        yield _wrong("warning", "controller.acc_cp_m_s2", f": rapid moves take {start_s:.0f} s to start")
    if controller.vel_ori_deg_s < RAD_PER_REV:
        text = f"= {controller.vel_ori_deg_s:g}: turning about takes {180 / controller.vel_ori_deg_s:.0f} s"
        yield _wrong("warning", "controller.vel_ori_deg_s", text)
    elif controller.vel_ori_deg_s / controller.acc_ori_deg_s2 > 10.0:
        start_s = controller.vel_ori_deg_s / controller.acc_ori_deg_s2
        yield _wrong("warning", "controller.acc_ori_deg_s2", f": turning takes {start_s:.0f} s to start")


def _variables(cell: Cell) -> Iterator[Issue]:
    pilot = cell.pilot
    names = {
        "pilot.index_variable": pilot.index_variable,
        "pilot.hash_variable": pilot.hash_variable,
        "pilot.value_variable": pilot.value_variable,
    }
    seen: dict[str, str] = {}
    for key, name in names.items():
        whole = name.upper().replace(" ", "")
        if whole in seen:
            yield _wrong("error", key, f"= {name}, and so is {seen[whole]}: one overwrites the other")
        seen.setdefault(whole, key)
    for key, text in cell.templates().items():
        for variable_key, name in names.items():  # of $SEN_… the rules of templates speak
            if not name.startswith("$") and re.search(rf"(?im)^\s*{re.escape(name)}\s*=(?!=)", text):
                yield _wrong("error", variable_key, f"= {name} is set by {key} as well")
    if pilot.lead_s < cell.controller.cycle_s:
        text = f"= {pilot.lead_s:g} is less than a cycle of the controller, {cell.controller.cycle_s:g}"
        yield _wrong("warning", "pilot.lead_s", text)


def _online(cell: Cell) -> Iterator[Issue]:
    online = cell.online
    rows: tuple[tuple[str, bool, Severity, str], ...] = (
        (
            "threshold_N",
            online.threshold_N >= online.most_force_N,
            "error",
            "is not below most_force_N: nothing is ever corrected",
        ),
        ("step_mm", online.step_mm > online.most_mm, "error", "is more than most_mm, the largest correction"),
        (
            "step_mm",
            online.step_mm * 10.0 < online.rate_mm_s * online.cycle_s,
            "warning",
            "allows less than a tenth of rate_mm_s in a cycle",
        ),
        (
            "lowpass_hz",
            online.lowpass_hz > 0.5 / online.cycle_s,
            "error",
            "is above half the rate of the cycles",
        ),
        ("blend_s", online.blend_s < online.cycle_s, "error", "is less than a cycle"),
        (
            "probe.rest_mm",
            online.probe.rest_mm >= online.probe.amplitude_mm,
            "error",
            "is not less than probe.amplitude_mm: no movement is seen",
        ),
        ("most_mm", online.probe.amplitude_mm > online.most_mm, "error", "is less than probe.amplitude_mm"),
        (
            "most_force_N",
            online.most_force_N < 0.05 * cell.limits.force_N,
            "warning",
            "is a small part of limits.force_N: each cut is held",
        ),
    )
    for key, is_wrong, severity, text in rows:
        if is_wrong:
            yield _wrong(severity, f"online.{key}", text)


def _wrong(severity: Severity, key: str, text: str) -> Issue:
    remedy = f"correct {key}, or what it contradicts, in the cell file"
    return Issue(severity, "cell-contradiction", 0, f"{key} {text}".replace(" :", ":"), remedy, key=key)
