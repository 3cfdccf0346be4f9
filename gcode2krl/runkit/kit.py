"""The run kit of a program: `make_kit` writes the folder."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from gcode2krl import krl_words as w
from gcode2krl.cell import Cell
from gcode2krl.chain import Plan, collect
from gcode2krl.errors import Issue, input_error
from gcode2krl.files import make_folder, refuse_inputs, write_together
from gcode2krl.krl import output_files, write_krl
from gcode2krl.krl import statements as st
from gcode2krl.krl.release import released
from gcode2krl.prediction import Prediction
from gcode2krl.runkit.accepted import Accepted, Switch, position_text, read_program, toolpath_of
from gcode2krl.tables import Targets
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


# How the controller's own recorder is set up for the run in air, and where the recording belongs.

_CYCLE_MS = 12
_TEXT = """Trace of {name} on the controller (KSS 8, oscilloscope)

What is recorded is compared with the prediction beside this file. Names of channels and variables are those
that public readers of KRC traces use; no controller has confirmed them. Differs yours, keep the channels.

1  Channels, all of the interpolator (KRCIpo), every {cycle} ms:
     X_CmdIpo Y_CmdIpo Z_CmdIpo A_CmdIpo B_CmdIpo C_CmdIpo
     AxisPos_CmdIpo1 to AxisPos_CmdIpo6
     AxisPos_Act1 to AxisPos_Act6
   and of each drive (NextGenDrive#1 to #6), where they can be had:
     Sollposition, Istposition, Iststrom, Istmoment
2  Length: {seconds} s. The motion takes {motion:.1f} s at 100 %, and halts come on top.
   Where the recorder holds less, record stretches one after the other, or log by RSI (docs/runs.md).
3  Trigger: by hand, or by these statements before the first PTP of a copy of {name}:
     $TRACE.NAME[]="{name}"
     $TRACE.CONFIG[]="GCODE2KRL.xml"     ; the configuration saved on the smartPAD under that name
     $TRACE.MODE=#T_START                ; $TRACE.STATE is #T_WAIT or #TRIGGERED when it runs
   and behind the last motion:
     $TRACE.MODE=#T_STOP                 ; copy when $TRACE.STATE is #T_END, not while it is #T_WRITING
4  Run {name} in AUT at 100 % override: not T1, and no other override. Predictions hold at 100 % only.
5  Copy {name}_KRCIpo.dat, {name}_NextGenDrive#1.dat and so on, each with its .r64, from
   C:\\KRC\\ROBOTER\\TRACE into {run}.
6  gcode2krl diagnose {prediction} {run}
"""
_RUN = """# The run in air at 100 % override. Put the trace, or controller.csv, beside this file.
mode = "AUT"
override_percent = 100
prediction = "../prediction"
"""
_MARGIN_S = 30.0


def set_up_text(name: str, air: Prediction) -> str:
    """Return what to set on the controller to record the variant in air."""
    motion_s = float(air.motion.time_s[-1]) if air.motion is not None else 0.0
    seconds = int(motion_s + _MARGIN_S) + 1
    return _TEXT.format(
        name=name, cycle=_CYCLE_MS, seconds=seconds, motion=motion_s, run="run_air/", prediction="prediction/"
    )


def run_text() -> str:
    """Return the head of the run that the trace becomes."""
    return _RUN


LIFT_MM = 100.0
"""Height above the program at which it is run in air (acceptance, step 5)."""
CHECKLIST, SET_UP, PREDICTION, RUN = "checklist.html", "trace.txt", "prediction", "run_air"
_SUFFIX = "_AIR"


@dataclass(frozen=True)
class RunKit:
    """What `make_kit` wrote."""

    files: tuple[Path, ...]
    air_name: str
    source: str
    """Name of the G-code, whose lines the findings name."""
    time_s: float
    """Predicted motion at 100 % override."""
    issues: tuple[Issue, ...]


def make_kit(
    program: str | Path,
    folder: str | Path,
    cell: Cell,
    *,
    lift_mm: float = LIFT_MM,
    inputs: Sequence[str | Path] = (),
) -> RunKit:
    """Write the run kit of a ``.src`` that was written for a cell.

    The folder (made if missing) gets the program lifted by ``lift_mm`` along Z of ``$BASE``, without spindle,
    coolant and other M-codes; its prediction; a set-up of the controller's trace; a folder for the recording;
    and a check list of one printed page with the values of the program itself.

    Raises
    ------
    RefusedError
        Where the program was made for another cell, or cannot be run that much higher.
    NotUnderstoodError
        Where a file cannot be read or written, or the lift is not positive.
    """
    if not (np.isfinite(lift_mm) and lift_mm > 0.0):
        raise input_error("option-value", f"--lift {lift_mm:g}: not a height in mm", "--lift 100")
    path, place = Path(program), Path(folder)
    accepted = read_program(path, cell)
    air_name = accepted.name[: w.LONGEST_NAME - len(_SUFFIX)] + _SUFFIX
    itself = _predicted(accepted.targets, cell)
    air = _predicted(lifted(accepted.targets, lift_mm), cell)
    released(air.issues, ())
    make_folder(place)
    texts = {
        place / CHECKLIST: page(accepted, itself, cell, air_name, lift_mm),
        place / SET_UP: set_up_text(air_name, air),
        place / RUN / "run.toml": run_text(),
    }
    air_file = place / f"{air_name}{w.SOURCE_SUFFIX}"
    named_files = [path.parent / name for name in _names_of(path)]
    refuse_inputs([*texts, *output_files(air_file, None)], [*inputs, *named_files])
    written = write_krl(
        air, air_file, cell, pilot="none", options=_options(accepted, lift_mm), inputs=[*inputs, *named_files]
    )
    tables = air.save(place / PREDICTION, csv=True, inputs=inputs)
    make_folder(place / RUN)
    write_together({file: text.encode("utf-8") for file, text in texts.items()}, inputs)
    motion = itself.motion
    time_s = float(motion.time_s[-1]) if motion is not None else 0.0
    return RunKit((*written.files, *texts, *tables), air_name, accepted.source, time_s, written.issues)


def lifted(targets: Targets, lift_mm: float) -> Targets:
    """Return the same path ``lift_mm`` higher; HOME stays where it is."""
    position = targets.position_mm + np.outer(~targets.home, [0.0, 0.0, lift_mm])
    return replace(targets, position_mm=position)


def _predicted(targets: Targets, cell: Cell) -> Prediction:
    return collect(Plan.of(toolpath_of(targets, cell), targets, cell).judged(), forces=False)


def _options(accepted: Accepted, lift_mm: float) -> str:
    left_out = "spindle, coolant, other M-codes, pilot and RSI left out"
    return f"IN AIR: {accepted.name} lifted by {lift_mm:g} mm, {left_out}"


def _names_of(path: Path) -> list[str]:
    return [f"{path.stem}{suffix}" for suffix in (w.SOURCE_SUFFIX, w.DATA_SUFFIX, w.SIDECAR_SUFFIX)]
