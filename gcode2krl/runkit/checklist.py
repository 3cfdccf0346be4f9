"""The check list: one printed page with what a person compares at the cell before the program runs."""

from collections.abc import Iterator, Sequence
from typing import Any

import jinja2
import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.krl import statements as st
from gcode2krl.prediction import Prediction
from gcode2krl.runkit.accepted import Accepted, Switch, position_text
from gcode2krl.units import DEG_PER_RAD, MM_PER_M, S_PER_MIN
from gcode2krl.version import __version__

_MOST_SWITCH_LINES, _MOST_TOOLS, _MOST_INPUTS = 10, 4, 3
"""What fits on one page."""
_LINE_CHARACTERS = 80
_FLOW_WORDS = {
    True: {"object": "RSIObject", "kind": "ObjTypeID", "number": "ParamID"},
    False: {"object": "RsiObject", "kind": "ObjTypeId", "number": "ParamId"},
}
"""How a signal flow of RSI 3, and of later ones, spells what a person compares."""


def page(accepted: Accepted, prediction: Prediction, cell: Cell, air_name: str, lift_mm: float) -> str:
    """Return the page as one HTML file without network; ``prediction`` is that of the program itself."""
    targets, motion, joints = accepted.targets, prediction.motion, prediction.joints
    if motion is None or joints is None:
        raise ValueError("the program has no motion")
    away, lin = ~targets.home, ~targets.ptp
    first = int(np.flatnonzero(away)[0])
    rapid_mm_s = cell.controller.rapid_m_s * MM_PER_M
    feed = targets.speed_mm_s[lin & (targets.speed_mm_s < rapid_mm_s)]
    tools = list(dict.fromkeys(targets.tool[away].tolist()))
    switches = list(_fitting(accepted.switches))
    low, high = targets.position_mm[away].min(axis=0), targets.position_mm[away].max(axis=0)
    return (
        _environment()
        .get_template("checklist.html.j2")
        .render(
            accepted=accepted,
            cell=cell,
            version=__version__,
            air_name=air_name,
            lift_mm=lift_mm,
            first_mm=position_text(targets.position_mm[first]),
            first_deg=_angles(joints.q_rad[0] * DEG_PER_RAD),
            home_deg=_angles(np.array(cell.home.q_deg)),
            base=_base_lines(cell),
            tools=[(number, _tool_lines(cell, number)) for number in tools[:_MOST_TOOLS]],
            more_tools=max(len(tools) - _MOST_TOOLS, 0),
            switches=switches,
            more_switches=len(accepted.switches) - len(switches),
            inputs=cell.guard_inputs[:_MOST_INPUTS],
            more_inputs=max(len(cell.guard_inputs) - _MOST_INPUTS, 0),
            minutes=f"{motion.time_s[-1] / S_PER_MIN:.1f}",
            seconds=f"{motion.time_s[-1]:.1f}",
            motions=len(targets),
            feed=f"{feed.max() * S_PER_MIN:.0f}" if len(feed) else "none",
            rapid=f"{rapid_mm_s * S_PER_MIN:.0f}",
            joint_speeds=_joint_speeds(joints.qd_rad_s, cell),
            limit_deg=f"{np.nanmin(joints.limit_margin_rad) * DEG_PER_RAD:.1f}",
            flow_suffix=w.SIGNAL_FLOW_SUFFIXES[cell.controller.rsi_version],
            flow_words=_FLOW_WORDS[cell.controller.rsi_version == "3"],
            low=position_text(low),
            high=position_text(high),
        )
    )


def _base_lines(cell: Cell) -> list[str]:
    """Return the statement that sets ``$BASE``, with what stands in the controller's table under a number."""
    number, at = cell.frames.base_data, cell.external_rest()
    if number is None:
        return st.base_statement(cell, at).split("\n")
    frame = st.frame_text(st.base_of_controller(cell, at))
    return [f"{st.base_statement(cell, at)}: {w.BASE_DATA}[{number}]={frame}"]


def _tool_lines(cell: Cell, number: int) -> list[str]:
    """Return the same for ``$TOOL`` and ``$LOAD``."""
    text = st.tool_statements(cell, number)
    data, load = cell.tool[number].tool_data, cell.load_of(number)
    if data is None:
        return text.split("\n")
    lines = [f"{text}: {w.TOOL_DATA}[{data}]={st.frame_text(st.written_tool(cell, number))}"]
    if load.mass_kg is not None:
        centre = f"X {load.x_mm:g}, Y {load.y_mm:g}, Z {load.z_mm:g} mm"
        lines.append(f"LOAD_DATA[{data}]: {load.mass_kg:g} kg at {centre} (as the cell states it)")
    return lines


def _angles(q_deg: "np.ndarray[Any, np.dtype[np.float64]]") -> str:
    return "  ".join(f"A{k} {round(float(angle), 1) + 0.0:.1f}°" for k, angle in enumerate(q_deg, start=1))


def _joint_speeds(qd_rad_s: "np.ndarray[Any, np.dtype[np.float64]]", cell: Cell) -> str:
    """Return the largest speed of each joint in degrees per second, as a share of its limit where known."""
    largest = np.nanmax(np.abs(qd_rad_s), axis=0) * DEG_PER_RAD
    limits = cell.robot.speeds.qd_deg_s
    if limits is None:
        return "  ".join(f"A{k} {speed:.1f}°/s" for k, speed in enumerate(largest, start=1))
    shares = largest / np.array(limits)
    return "  ".join(
        f"A{k} {s:.1f}°/s ({share:.0%})"
        for k, (s, share) in enumerate(zip(largest, shares, strict=True), start=1)
    )


def _fitting(switches: Sequence[Switch]) -> Iterator[dict[str, str]]:
    """Yield the words of the first switches, as many as fit on the page."""
    lines = 0
    for switch in switches:
        words = _words(switch)
        lines += -(-len(words["does"]) // _LINE_CHARACTERS)
        if lines > _MOST_SWITCH_LINES:
            return
        yield words


def _words(switch: Switch) -> dict[str, str]:
    where = f"line {switch.first_line}" if switch.first_line else "at the end"
    times = "" if switch.count == 1 else f", {switch.count} times"
    return {"code": switch.code, "does": "; ".join(switch.statements), "where": f"{where}{times}"}


def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("gcode2krl.runkit", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
