"""Logs of one run in the layouts of 24 exporters, each diagnosed by ``gcode2krl diagnose prediction/ FILE``.

``python benchmarks/run_layouts.py`` predicts a short dry program, drives it with the robot of the tests (a
servo lag in A3, the usual differences of a day) and writes the run as exporters do. Where the command asks,
``gcode2krl runs import`` is told what a person knows who has the robot. Printed is whether the columns were
read right (beside the truth that the log was made of), whether the lag was found, the number of commands, and
the seconds. A log that is read wrong without a question is "WRONG".

``--only WORDS`` runs the layouts whose name has them; ``--keep FOLDER`` keeps the logs.
"""

import argparse
import contextlib
import io
import json
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl
import scipy.io
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from gcode2krl import predict
from gcode2krl.cli.main import _run as command
from gcode2krl.runs import Run, load_run
from gcode2krl.runs.foreign import run_or_log
from tests.plant import faults, instruments, mismatch
from tests.plant.instruments import Instruments
from tests.plant.programs import Track
from tests.plant.robot import simulate
from tests.plant.scene import World

PROGRAM = """G21 G90 G17 G54 G94
T1 M6
S6000 M3
G0 X0 Y0 Z60
G1 X60 Y20 F3000
G1 X140 Y-40 Z40
G1 X150 Y60 Z70
G1 X40 Y70 Z50
G1 X0 Y-30 Z65
G1 X80 Y0 Z45
G1 X0 Y0 Z60
M30
"""
FAULT, SIZE = "servo_lag@A3", 0.02
AIMS = {"right": 17, "diagnosed": 18, "wrong": 0}
EPOCH_S = 1_715_000_000.0


class Log(NamedTuple):
    """What the plant's instruments recorded, on one clock: s, deg, mm, N."""

    t: np.ndarray
    cmd: np.ndarray
    """(n, 6) joints"""
    act: np.ndarray
    tip: np.ndarray
    """(n, 3) seen by an instrument"""
    abc: np.ndarray
    """(n, 3)"""
    force: np.ndarray


class Layout(NamedTuple):
    """How an exporter writes a log, and what a person knows of it."""

    name: str
    ending: str
    write: Callable[[Log], bytes]
    holds: str
    """Of what is read back: cmd, act, tip, force."""
    knows: dict[str, str]
    """An option of ``runs import`` as it is asked -> what the person who knows the robot says."""


def table(
    names: Sequence[str],
    columns: Sequence[Any],
    sep: str = ",",
    point: str = ".",
    above: str = "",
    form: str = "{:.8g}",
) -> bytes:
    """Return a table as text in UTF-8; columns of numbers or of words."""
    cells = [
        [c if isinstance(c, str) else form.format(c).replace(".", point) for c in row] for row in columns
    ]
    rows = (sep.join(row) for row in zip(*cells, strict=True))
    return (above + sep.join(names) + "\n" + "\n".join(rows) + "\n").encode()


def six(pattern: str, first: int = 1) -> list[str]:
    return [pattern.format(n) for n in range(first, first + 6)]


def stamps(t: np.ndarray, form: str) -> list[str]:
    """Return date and time of each row."""
    made = np.datetime64("2024-05-06T07:08:09.000000") + np.round(t * 1e6).astype("timedelta64[us]")
    return [f"{stamp.astype(object):{form}}"[:-3] for stamp in made]


def rsi_telegrams(log: Log) -> bytes:
    """Return the telegrams of KUKA.RobotSensorInterface, one a line."""

    def axes(tag: str, values: np.ndarray) -> str:
        return f"<{tag} " + " ".join(f'A{j + 1}="{v:.5f}"' for j, v in enumerate(values)) + "/>"

    lines = [
        f'<Rob Type="KUKA">{axes("AIPos", act)}{axes("ASPos", cmd)}<Delay D="0"/>'
        f"<IPOC>{4208100000 + round(1e3 * t)}</IPOC></Rob>"
        for t, act, cmd in zip(log.t, log.act, log.cmd, strict=True)
    ]
    return ("\n".join(lines) + "\n").encode()


def xlsx(names: Sequence[str], columns: Sequence[np.ndarray]) -> bytes:
    """Return a sheet as Excel writes it: shared strings, numbers in cells, a second sheet behind."""

    def cell(row: int, column: int, value: str, kind: str = "") -> str:
        letters = (chr(64 + column // 26) if column >= 26 else "") + chr(65 + column % 26)
        return f'<c r="{letters}{row}"{kind}><v>{value}</v></c>'

    rows = ["".join(cell(1, k, str(k), ' t="s"') for k in range(len(names)))]
    rows += [
        "".join(cell(r, k, repr(float(v))) for k, v in enumerate(row))
        for r, row in enumerate(zip(*columns, strict=True), 2)
    ]
    main = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
    body = "".join(f'<row r="{r}">{cells}</row>' for r, cells in enumerate(rows, 1))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("[Content_Types].xml", "<Types/>")
        file.writestr(
            "xl/sharedStrings.xml",
            f"<sst {main}>" + "".join(f"<si><t>{n}</t></si>" for n in names) + "</sst>",
        )
        file.writestr(
            "xl/worksheets/sheet1.xml", f"<worksheet {main}><sheetData>{body}</sheetData></worksheet>"
        )
        file.writestr("xl/worksheets/sheet2.xml", f"<worksheet {main}><sheetData/></worksheet>")
    return stream.getvalue()


def parquet(columns: dict[str, Any]) -> bytes:
    stream = io.BytesIO()
    pl.DataFrame(columns).write_parquet(stream)
    return stream.getvalue()


def matlab(variables: dict[str, Any]) -> bytes:
    stream = io.BytesIO()
    scipy.io.savemat(stream, variables, format="5")
    return stream.getvalue()


def rad(values: np.ndarray) -> np.ndarray:
    return np.radians(values)


UR = [2, 1, 0, 3, 4, 5]
LAYOUTS = (
    Layout("RSI telegrams, XML", ".xml", rsi_telegrams, "cmd act", {}),
    Layout(
        "RSI logger, semicolons",
        ".csv",
        lambda log: table(
            [
                "Timestamp",
                *(f"RIst_{x}" for x in "XYZABC"),
                *six("AIPos_A{}"),
                *six("ASPos_A{}"),
                "Delay_D",
                "IPOC",
            ],
            [
                stamps(log.t, "%d-%m-%Y %H:%M:%S.%f"),
                *log.tip.T,
                *log.abc.T,
                *log.act.T,
                *log.cmd.T,
                0.0 * log.t,
                np.round(4e3 * log.t) / 4 + 4.2081e9,
            ],
            ";",
            form="{:.13g}",
        ),
        "cmd act",
        {},
    ),
    Layout(
        "KUKA trace, German Excel",
        ".csv",
        lambda log: (
            table(
                ["Zeit [s]", *six("$AXIS_ACT_MEAS.A{} [°]"), *six("$AXIS_ACT.A{} [°]")],
                [log.t, *log.act.T, *log.cmd.T],
                ";",
                ",",
            )
            .decode()
            .encode("cp1252")
        ),
        "act",
        {},
    ),
    Layout(
        "KUKA system variables, read by a script",
        ".txt",
        lambda log: table(
            ["time_ms", *six("AXIS_ACT_A{}"), *(f"POS_ACT_{x}" for x in "XYZABC"), "OV_PRO"],
            [1e3 * log.t, *log.act.T, *log.tip.T, *log.abc.T, 0.0 * log.t + 100.0],
            "\t",
        ),
        "act",
        {},
    ),
    Layout(
        "rostopic echo -p /joint_states",
        ".csv",
        lambda log: table(
            [
                "%time",
                "field.header.seq",
                "field.header.stamp",
                "field.header.frame_id",
                *six("field.name{}", 0),
                *six("field.position{}", 0),
                *six("field.velocity{}", 0),
                *six("field.effort{}", 0),
            ],
            [
                [f"{(t + EPOCH_S) * 1e9 + 40000:.0f}" for t in log.t],
                [str(k) for k in range(len(log.t))],
                [f"{(t + EPOCH_S) * 1e9:.0f}" for t in log.t],
                [""] * len(log.t),
                *([f"joint_a{n}"] * len(log.t) for n in range(1, 7)),
                *rad(log.act).T,
                *(np.gradient(rad(log.act), log.t, axis=0).T),
                *(0.0 * log.act.T),
            ],
        ),
        "act",
        {"joints": "123456"},
    ),
    Layout(
        "trajectory controller's state, PlotJuggler",
        ".csv",
        lambda log: table(
            [
                "__time",
                *six("/arm_controller/state/actual/positions[{}]", 0),
                *six("/arm_controller/state/desired/positions[{}]", 0),
                *six("/arm_controller/state/error/positions[{}]", 0),
            ],
            [
                [f"{t + EPOCH_S:.6f}" for t in log.t],
                *rad(log.act).T,
                *rad(log.cmd).T,
                *rad(log.cmd - log.act).T,
            ],
        ),
        "cmd act",
        {"joints": "123456"},
    ),
    Layout(
        "ROS 2 joint_states by name, driver's order",
        ".csv",
        lambda log: table(
            [
                "timestamp",
                *(f"/joint_states/position/joint_{j + 1}" for j in UR),
                *(f"/joint_states/velocity/joint_{j + 1}" for j in UR),
            ],
            [[f"{t + EPOCH_S:.6f}" for t in log.t], *rad(log.act)[:, UR].T, *(0.0 * log.act.T)],
        ),
        "act",
        {},
    ),
    Layout(
        "RTDE client, blanks",
        ".csv",
        lambda log: table(
            [
                "timestamp",
                *six("target_q_{}", 0),
                *six("target_qd_{}", 0),
                *six("actual_q_{}", 0),
                *six("actual_current_{}", 0),
                *six("actual_TCP_pose_{}", 0),
                *six("actual_TCP_force_{}", 0),
                "output_int_register_0",
            ],
            [
                log.t + 8123.0,
                *rad(log.cmd).T,
                *(0.0 * log.cmd.T),
                *rad(log.act).T,
                *(0.0 * log.cmd.T + 1.0),
                *(1e-3 * log.tip.T),
                *Rotation.from_euler("ZYX", log.abc, degrees=True).as_rotvec().T,
                *log.force.T,
                *(0.0 * log.force.T),
                [str(0)] * len(log.t),
            ],
            " ",
            form="{:.10g}",
        ),
        "cmd act",
        {},
    ),
    Layout(
        "RTDE by pandas, short names",
        ".csv",
        lambda log: table(
            ["", "t", *six("q{}", 0), "px", "py", "pz", "rx", "ry", "rz"],
            [
                [str(k) for k in range(len(log.t))],
                log.t,
                *rad(log.act).T,
                *(1e-3 * log.tip.T),
                *Rotation.from_euler("ZYX", log.abc, degrees=True).as_rotvec().T,
            ],
        ),
        "act",
        {"order": "rotvec"},
    ),
    Layout(
        "EGM messages, flattened",
        ".csv",
        lambda log: table(
            [
                "header.seqno",
                "header.tm",
                *six("feedBack.joints.joints[{}]", 0),
                *(f"feedBack.cartesian.pos.{x}" for x in "xyz"),
                *(f"feedBack.cartesian.orient.u{k}" for k in range(4)),
                *six("planned.joints.joints[{}]", 0),
            ],
            [
                [str(k) for k in range(len(log.t))],
                np.round(1e3 * log.t + 1e6),
                *log.act.T,
                *log.tip.T,
                *Rotation.from_euler("ZYX", log.abc, degrees=True).as_quat()[:, [3, 0, 1, 2]].T,
                *log.cmd.T,
            ],
            form="{:.9g}",
        ),
        "cmd act",
        {},
    ),
    Layout(
        "RobotStudio, signals",
        ".csv",
        lambda log: table(
            ["Time (s)", *six("IRB_1 Joint {} position (deg)"), "IRB_1 TCP speed (mm/s)"],
            [log.t, *log.act.T, 0.0 * log.t],
            ";",
            ",",
        ),
        "act",
        {},
    ),
    Layout(
        "Staeubli recorder",
        ".csv",
        lambda log: table(
            ["Time[ms]", *six("JntCmd[{}]", 0), *six("JntFbk[{}]", 0), *six("JntErr[{}]", 0)],
            [np.round(1e3 * log.t), *log.cmd.T, *log.act.T, *(log.cmd - log.act).T],
            ";",
        ),
        "cmd act",
        {},
    ),
    Layout(
        "FANUC, position register log",
        ".csv",
        lambda log: table(
            ["TICK", "TIME", "X", "Y", "Z", "W", "P", "R", *six("J{}")],
            [[str(k) for k in range(len(log.t))], log.t, *log.tip.T, *log.abc[:, ::-1].T, *log.act.T],
            form="{:.7g}",
        ),
        "act",
        {"order": "xyz-fixed"},
    ),
    Layout(
        "Kawasaki, JT names",
        ".csv",
        lambda log: table(
            ["Time[sec]", *six("JT{}[deg]"), *six("JT{}_cmd[deg]")], [log.t, *log.act.T, *log.cmd.T]
        ),
        "cmd act",
        {},
    ),
    Layout(
        "RoboDK, joints of a program",
        ".csv",
        lambda log: table(
            [*six("J{}"), "ERROR", "MM_STEP", "DEG_STEP", "MOVE_ID", "TIME", "X", "Y", "Z"],
            [*log.act.T, 0.0 * log.t, 0.0 * log.t + 1, 0.0 * log.t + 1, 0.0 * log.t + 4, log.t, *log.tip.T],
        ),
        "act",
        {},
    ),
    Layout(
        "Leica tracker, stamps with an apostrophe",
        ".csv",
        lambda log: (
            table(
                [
                    "X  [mm]",
                    "Y  [mm]",
                    "Z  [mm]",
                    "U(95)  [mm]",
                    "U(95) X  [mm]",
                    *(f"Q{k} " for k in range(4)),
                    "Target",
                    "Temperature  [°C]",
                    "Time Stamp",
                    "OTG Applied",
                    "Delete",
                ],
                [
                    *log.tip.T,
                    0.0 * log.t + 0.01,
                    0.0 * log.t + 0.005,
                    *Rotation.from_euler("ZYX", log.abc, degrees=True).as_quat()[:, [3, 0, 1, 2]].T,
                    ["TMC 30-B #5320"] * len(log.t),
                    0.0 * log.t + 22.8,
                    [f"'{s}" for s in stamps(log.t, "%d.%m.%Y %H:%M:%S.%f")],
                    ["FALSE"] * len(log.t),
                    [""] * len(log.t),
                ],
            )
            .decode()
            .encode("cp1252")
        ),
        "tip",
        {},
    ),
    Layout(
        "SpatialAnalyzer, points with names",
        ".txt",
        lambda log: table(
            ["Collection", "Group", "Point", "X (m)", "Y (m)", "Z (m)", "Timestamp"],
            [
                ["A"] * len(log.t),
                ["Scan 1"] * len(log.t),
                [f"p{k}" for k in range(len(log.t))],
                *(1e-3 * log.tip.T),
                stamps(log.t, "%m/%d/%Y %H:%M:%S.%f"),
            ],
            "\t",
            above="// exported\n",
        ),
        "tip",
        {},
    ),
    Layout(
        "FARO, metres with decimal comma, unit unstated",
        ".csv",
        lambda log: table(["Zeit", "X", "Y", "Z"], [log.t, *(1e-3 * log.tip.T)], ";", ",", form="{:.7f}"),
        "tip",
        {},
    ),
    Layout(
        "motion capture, frames and seconds",
        ".csv",
        lambda log: table(
            ["Frame", "Time (Seconds)", "X", "Y", "Z"],
            [[str(k) for k in range(len(log.t))], log.t, *log.tip.T],
            above="Format Version,1.23,Take Name,run 1,Capture Frame Rate,250.0,Length Units,Millimeters\n\n"
            ",Type,Marker,Marker,Marker\n,Name,tcp,tcp,tcp\n,,Position,Position,Position\n",
        ),
        "tip",
        {},
    ),
    Layout(
        "LabVIEW measurement file",
        ".lvm",
        lambda log: table(
            ["X_Value", *six("A{}"), "Fx", "Fy", "Fz", "Comment"],
            [log.t, *log.act.T, *log.force.T, [""] * len(log.t)],
            "\t",
            ",",
            above="LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
            "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n***End_of_Header***\t\n\t\nChannels\t9\n"
            "***End_of_Header***\n",
        ),
        "act",
        {"columns": "X_Value=t", "unit": "force=N"},
    ),
    Layout(
        "Excel",
        ".xlsx",
        lambda log: xlsx(
            ["Time [s]", *six("A{} [deg]"), *(f"F{x} [N]" for x in "xyz")], [log.t, *log.act.T, *log.force.T]
        ),
        "act",
        {},
    ),
    Layout(
        "Parquet, lists of joints as columns",
        ".parquet",
        lambda log: parquet(
            {"ts": np.datetime64("2024-05-06T07:08:09") + np.round(log.t * 1e9).astype("timedelta64[ns]")}
            | dict(zip(six("actual_joint_position_{}", 0), rad(log.act).T, strict=True))
            | dict(zip(six("target_joint_position_{}", 0), rad(log.cmd).T, strict=True))
        ),
        "cmd act",
        {},
    ),
    Layout(
        "Simulink, structure with time",
        ".mat",
        lambda log: matlab(
            {
                "q_meas": {
                    "time": log.t[:, None],
                    "signals": {"values": rad(log.act), "label": "q", "dimensions": 6},
                    "blockName": "arm/q_meas",
                }
            }
        ),
        "act",
        {},
    ),
    Layout(
        "MATLAB, matrices",
        ".mat",
        lambda log: matlab({"t": log.t, "q": log.act, "q_des": log.cmd, "p_ee": log.tip}),
        "cmd act",
        {},
    ),
)


def recorded(prediction: Any) -> Log:
    """Return what a short run of a prediction recorded, driven by the plant with a lag in A3."""
    track = Track(prediction.motion.time_s, prediction.joints.q_rad)
    rng = np.random.default_rng(7)
    today = mismatch.of_day(mismatch.of_robot(rng, mismatch.USUAL), rng, mismatch.USUAL)
    lag = faults.build(FAULT, "same", 7).hooks(SIZE)
    run = simulate(track, World(stock_mm=np.array([[0.0, 0.0, -1030.0], [9.0, 9.0, -1000.0]])), [lag], today)
    how = Instruments(tracker_hz=1 / 0.012, force_hz=1 / 0.012, q_load=False, drop_outs=False)
    seen = instruments.noisy(instruments.clean(run, how), how, run.units, rng)
    rows = min(len(each["t_s"]) for each in seen.values())

    def columns(name: str, pattern: str, parts: Sequence[Any]) -> np.ndarray:
        return np.stack([seen[name][pattern.format(part)][:rows] for part in parts], axis=1)

    joints = range(1, 7)
    return Log(
        seen["controller"]["t_s"][:rows],
        columns("controller", "q{}_cmd_deg", joints),
        columns("controller", "q{}_act_deg", joints),
        columns("tracker", "{}_mm", "xyz"),
        columns("controller", "{}_cmd_deg", "abc") + np.array([12.0, 5.0, -3.0]),
        columns("force", "f{}_N", "xyz"),
    )


@dataclass
class Outcome:
    """What became of one log."""

    right: bool = False
    wrong: str = ""
    diagnosed: bool = False
    commands: int = 0
    words: str = ""


def typed(words: Sequence[str]) -> tuple[int, dict]:
    """Return exit code and record of a command."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        code = command([*words, "--json"])
    return code, json.loads(out.getvalue())


def tried(layout: Layout, log: Log, prediction: Any, place: Path) -> Outcome:
    """Return what becomes of a log that a person gives to `diagnose`, then to what it asks for."""
    file = place / f"log{layout.ending}"
    file.write_bytes(layout.write(log))
    outcome, beside = Outcome(commands=1), str(place.parent / "p")
    code, record = typed(["diagnose", beside, str(file)])
    if code == 0:
        run = run_or_log(file, prediction)
    else:
        issue = record["issues"][0]
        outcome.words = f"{issue['message']} -> {issue['remedy']}"
        if issue["code"] != "run-layout":
            return outcome
        answers = [
            word
            for option, said in layout.knows.items()
            for each in said.split()
            for word in (f"--{option}", each)
        ]
        outcome.commands, folder = 2, str(place / "run")
        code, record = typed(["runs", "import", str(file), "-o", folder, *answers, "--prediction", beside])
        outcome.words += f" | {' '.join(answers)}"
        if code != 0:
            outcome.words += f": {record['issues'][0]['message']}"
            return outcome
        run = load_run(folder, partial=True)
        code, record = typed(["diagnose", beside, folder])
    outcome.right, outcome.wrong = judged(run, layout, log)
    causes = [cause for cause in record.get("causes", ()) if cause["probability"] > 0.5]
    outcome.diagnosed = code == 0 and any(cause["target"] == "A3" for cause in causes)
    named = ", ".join(f"{cause['effect']} {cause['target'] or ''}".strip() for cause in causes)
    outcome.words = f"{record.get('verdict')}: {named}" + (f"; {outcome.words}" if outcome.words else "")
    return outcome


def judged(run: Run, layout: Layout, log: Log) -> tuple[bool, str]:
    """Tell whether a run holds what the log does, and name a signal that is read wrong."""
    truth = {
        "cmd": log.cmd,
        "act": log.act,
        "tip": log.tip,
        "force": log.force,
        "own": log.tip,
        "abc": log.abc,
    }
    c = run.controller
    found = {
        "cmd": None if c is None or c.q_cmd_rad is None else np.degrees(c.q_cmd_rad),
        "act": None if c is None or c.q_act_rad is None else np.degrees(c.q_act_rad),
        "own": None if c is None else c.position_act_mm,
        "abc": None if c is None or c.abc_act_rad is None else np.degrees(c.abc_act_rad),
        "tip": None if run.tracker is None else run.tracker.position_mm,
        "force": None if run.force is None else run.force.force_N,
    }
    times = [each.time_s for each in (run.controller, run.tracker, run.force) if each is not None]
    wrong = [name for name, seen in found.items() if seen is not None and not alike(seen, truth[name])]
    wrong += ["time" for t in times if abs(np.ptp(t) - np.ptp(log.t)) > 0.02 * np.ptp(log.t)]
    right = not wrong and all(found[name] is not None for name in layout.holds.split())
    return right, " ".join(wrong)


def alike(seen: np.ndarray, truth: np.ndarray) -> bool:
    rows = min(len(seen), len(truth))
    return bool(np.max(np.abs(seen[:rows] - truth[:rows])) < 2e-2)


def main(arguments: Sequence[str] | None = None, write: Callable[[str], object] = print) -> int:
    """Print a line for each layout, and whether the aims are met."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", default="")
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as scratch:
        place = given.keep or Path(scratch)
        place.mkdir(exist_ok=True)
        (place / "short.nc").write_text(PROGRAM, encoding="utf-8")
        prediction = predict(place / "short.nc", forces=False)
        prediction.save(place / "p")
        log = recorded(prediction)
        outcomes = []
        for number, layout in enumerate(LAYOUTS):
            if given.only not in layout.name:
                continue
            folder = place / f"layout-{number}"
            folder.mkdir(exist_ok=True)
            begun = time.perf_counter()
            outcome = tried(layout, log, prediction, folder)
            outcomes.append(outcome)
            read = f"WRONG: {outcome.wrong}" if outcome.wrong else "right" if outcome.right else "not read"
            found = "diagnosed" if outcome.diagnosed else "-"
            seconds = time.perf_counter() - begun
            figures = f"{read:<10} {found:<10} {outcome.commands} {seconds:4.1f} s"
            write(f"{layout.name:<48} {figures}  {outcome.words}")
    right, diagnosed = sum(o.right for o in outcomes), sum(o.diagnosed for o in outcomes)
    wrong = sum(bool(o.wrong) for o in outcomes)
    write(f"of {len(outcomes)}: {right} read right, {diagnosed} diagnosed, {wrong} silently wrong")
    if not given.only:
        met = right >= AIMS["right"] and diagnosed >= AIMS["diagnosed"] and wrong <= AIMS["wrong"]
        write("every aim met" if met else f"not every aim met: {AIMS}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
