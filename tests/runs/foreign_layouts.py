"""Logs of one small motion as exporters write them: after public descriptions of their formats, made here."""

import io
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import polars as pl
import scipy.io
from scipy.spatial.transform import Rotation

from tests.runs import maker

TIME_S = np.arange(0.0, 10.0, 0.012)
PLANNED_S = np.arange(0.0, 10.0, 0.004)
ABC_DEG = np.stack([30.0 + 3.0 * np.sin(TIME_S), 20.0 + 2.0 * np.cos(TIME_S), -50.0 + TIME_S], axis=1)
AXIS_DEG = np.array([0.0, -10.0, 100.0, 0.0, 50.0, 0.0])
"""Levels that tell the axes apart, and that are beyond 10 where they are degrees."""


def joints_deg(time_s):
    position = maker.path(time_s)
    return maker.joints_deg(position) + AXIS_DEG


def position_mm(time_s):
    return maker.path(time_s) + np.array([900.0, -150.0, 800.0])


def force_N(time_s):
    return np.stack([40.0 * np.sin(3.0 * time_s), 25.0 * np.cos(2.0 * time_s), 60.0 + 5.0 * time_s], axis=1)


PREDICTION: Any = SimpleNamespace(
    motion=SimpleNamespace(time_s=PLANNED_S, position_mm=position_mm(PLANNED_S)),
    joints=SimpleNamespace(q_rad=np.radians(joints_deg(PLANNED_S))),
)
Q, P, F = joints_deg(TIME_S), position_mm(TIME_S), force_N(TIME_S)
QUATERNION = Rotation.from_euler("ZYX", ABC_DEG, degrees=True).as_quat()  # x, y, z, w
EPOCH_S = 1_715_000_000.0


def text(names, columns, separator=",", decimal=".", above="", units="", form="{:.9g}"):
    """Return a table as text; columns are (n,) numbers or lists of words."""
    rows = zip(*columns, strict=True)
    cells = ([v if isinstance(v, str) else form.format(v).replace(".", decimal) for v in row] for row in rows)
    lines = [separator.join(names), *([units] if units else []), *(separator.join(row) for row in cells)]
    return (above + "\n".join(lines) + "\n").encode()


def numbered(pattern, first=1):
    return [pattern.format(number) for number in range(first, first + 6)]


def stamps(form="iso"):
    made = np.datetime64("2024-05-06T07:08:09.000000") + (TIME_S * 1e6).astype("timedelta64[us]")
    words = [str(stamp)[:23] for stamp in made]
    if form == "iso":
        return words
    return [f"{w[8:10]}.{w[5:7]}.{w[:4]} {w[11:19]},{w[20:23]}" for w in words]  # as German Windows writes it


def parquet(columns):
    stream = io.BytesIO()
    pl.DataFrame(columns).write_parquet(stream)
    return stream.getvalue()


def matlab(**variables):
    stream = io.BytesIO()
    scipy.io.savemat(stream, variables, format="5")
    return stream.getvalue()


@dataclass(frozen=True)
class Layout:
    """A log, and what a person must say of it."""

    name: str
    make: Callable[[], bytes]
    holds: tuple[str, ...]
    """Signals that must be read back."""
    ending: str = ".csv"
    answers: dict[str, Any] = field(default_factory=dict)
    """What names and values leave open without a prediction; empty where the guess is certain."""
    open_beside_prediction: bool = False
    orientation: str = ""


R = np.radians
LAYOUTS = (
    Layout("Time, Axis1 … Axis6", lambda: text(["Time", *numbered("Axis{}")], [TIME_S, *Q.T]), ("q_act",)),
    Layout(
        "KUKA trace as CSV, German Excel",
        lambda: text(
            ["Zeit [ms]", *numbered("AxisPos_CmdIpo{} [°]"), *numbered("AxisPos_Act{} [°]")],
            [TIME_S * 1e3, *Q.T, *Q.T],
            ";",
            ",",
        ),
        ("q_cmd", "q_act"),
    ),
    Layout(
        "KUKA drives in cp1252",
        lambda: (
            text(
                [
                    "Zeit",
                    *numbered("Sollposition A{}"),
                    *numbered("Istposition A{}"),
                    *numbered("Iststrom A{}"),
                ],
                [TIME_S, *Q.T, *Q.T, *(0.1 * Q.T)],
                ";",
                ",",
                units=";".join(["s", *["°"] * 12, *["A"] * 6]),
            )
            .decode()
            .encode("cp1252")
        ),
        ("q_cmd", "q_act"),
    ),
    Layout(
        "RSI logger, one line a telegram",
        lambda: text(
            [
                "IPOC",
                *(f"RIst.{x}" for x in "XYZ"),
                *(f"AIPos.A{n}" for n in range(1, 7)),
                *(f"ASPos.A{n}" for n in range(1, 7)),
            ],
            [np.round(TIME_S * 1e3 + 4_208_100_000.0), *P.T, *Q.T, *Q.T],
            form="{:.12g}",
        ),
        ("q_cmd", "q_act", "xyz_act"),
    ),
    Layout(
        "RSI logger of ours with ; and tabs in names",
        lambda: text(
            ["Receive.IPOC", *(f"Receive.AIPos.A{n}" for n in range(1, 7))],
            [np.round(TIME_S * 1e3 + 4_208_100_000.0), *Q.T],
            ";",
            form="{:.12g}",
        ),
        ("q_act",),
    ),
    Layout(
        "rostopic echo -p of joint_states",
        lambda: text(
            ["%time", "field.header.seq", "field.header.stamp", *numbered("field.position{}", 0)],
            [
                [f"{(t + EPOCH_S) * 1e9:.0f}" for t in TIME_S],
                [str(k) for k in range(len(TIME_S))],
                [f"{(t + EPOCH_S) * 1e9:.0f}" for t in TIME_S],
                *R(Q).T,
            ],
        ),
        ("q_act",),
        answers={"joints": "123456"},
    ),
    Layout(
        "bagpy, UR driver's order of joints",
        lambda: text(
            ["Time", "header.stamp.secs", "header.stamp.nsecs", *numbered("position_{}", 0)],
            [
                [f"{t + EPOCH_S:.6f}" for t in TIME_S],
                [f"{int(t + EPOCH_S)}" for t in TIME_S],
                [f"{(t % 1) * 1e9:.0f}" for t in TIME_S],
                *R(Q)[:, [2, 1, 0, 3, 4, 5]].T,
            ],
        ),
        ("q_act",),
        answers={"joints": "321456"},
        open_beside_prediction=True,
    ),
    Layout(
        "PlotJuggler, wrench and joints by name",
        lambda: text(
            [
                "__time",
                *(f"/joint_states/joint_a{n}/position" for n in range(1, 7)),
                *(f"/ft/wrench/force/{x}" for x in "xyz"),
                "/joint_states/joint_a1/velocity",
            ],
            [[f"{t + EPOCH_S:.6f}" for t in TIME_S], *R(Q).T, *F.T, TIME_S],
        ),
        ("q_act", "force"),
    ),
    Layout(
        "UR RTDE client, blanks",
        lambda: text(
            [
                "timestamp",
                *numbered("target_q_{}", 0),
                *numbered("actual_q_{}", 0),
                *numbered("actual_TCP_pose_{}", 0),
                *numbered("actual_TCP_force_{}", 0),
            ],
            [
                TIME_S + 5123.0,
                *R(Q).T,
                *R(Q).T,
                *(P.T / 1e3),
                *Rotation.from_euler("ZYX", ABC_DEG, degrees=True).as_rotvec().T,
                *F.T,
                *(0.1 * F.T),
            ],
            " ",
        ),
        ("q_cmd", "q_act", "xyz_act", "force"),
        orientation="abc_act",
    ),
    Layout(
        "UR joints by name, radians unstated",
        lambda: text(
            [
                "timestamp",
                "shoulder_pan_joint",
                "shoulder_lift_joint",
                "elbow_joint",
                "wrist_1_joint",
                "wrist_2_joint",
                "wrist_3_joint",
            ],
            [TIME_S, *R(Q).T],
        ),
        ("q_act",),
        answers={"units": {"angle": "rad"}},
    ),
    Layout(
        "ABB, jointtarget and robtarget with a quaternion",
        lambda: text(
            [
                "t_ms",
                *numbered("robax.rax_{}"),
                "trans.x",
                "trans.y",
                "trans.z",
                "rot.q1",
                "rot.q2",
                "rot.q3",
                "rot.q4",
            ],
            [TIME_S * 1e3, *Q.T, *P.T, *QUATERNION[:, [3, 0, 1, 2]].T],
            "\t",
        ),
        ("q_act", "xyz_act"),
        orientation="abc_act",
    ),
    Layout(
        "ABB signal analyser, stamps",
        lambda: text(
            ["Time", *(f"ROB_1.Axis{n} (deg)" for n in range(1, 7))],
            [stamps(), *Q.T],
            ",",
            above="TestSignal Export\nController;IRC5\n\n",
        ),
        ("q_act",),
    ),
    Layout(
        "Stäubli recorder, commanded and measured",
        lambda: text(
            ["time (s)", *numbered("jntCmd.j{}"), *numbered("jntFbk.j{}")], [TIME_S, *Q.T, *Q.T], ";"
        ),
        ("q_cmd", "q_act"),
    ),
    Layout(
        "Leica, SpatialAnalyzer with stamps and decimal comma",
        lambda: text(["Timestamp", "X [mm]", "Y [mm]", "Z [mm]"], [stamps("german"), *P.T], ";", ","),
        ("xyz",),
    ),
    Layout(
        "FARO, metres unstated",
        lambda: text(["Time", "X", "Y", "Z"], [TIME_S, *(P.T / 1e3)], "\t"),
        ("xyz",),
        answers={"units": {"length": "m"}},
    ),
    Layout(
        "dynamometer in kN",
        lambda: text(["Time", "Fx", "Fy", "Fz"], [TIME_S, *(F.T / 1e3)], ";", ",", units="s;kN;kN;kN"),
        ("force",),
    ),
    Layout(
        "logger with commanded and actual, microseconds",
        lambda: text(
            ["timestamp", *numbered("J{}_target"), *numbered("J{}_actual"), *numbered("J{}_speed")],
            [np.round(TIME_S * 1e6), *Q.T, *Q.T, *Q.T],
        ),
        ("q_cmd", "q_act"),
    ),
    Layout(
        "Parquet of a data lake",
        lambda: parquet(
            {"stamp": np.datetime64("2024-05-06T07:08:09") + (TIME_S * 1e6).astype("timedelta64[us]")}
            | dict(zip(numbered("joint_{}_rad"), R(Q).T, strict=True))
        ),
        ("q_act",),
        ".parquet",
    ),
    Layout(
        "MATLAB v5, a matrix",
        lambda: matlab(time=TIME_S, q_actual=Q, tau=0.1 * Q),
        ("q_act",),
        ".mat",
    ),
    Layout(
        "MATLAB v5, a struct in radians",
        lambda: matlab(log={"t": TIME_S, "q": R(Q)}),
        ("q_act",),
        ".mat",
        answers={"units": {"angle": "rad"}},
    ),
    Layout(
        "pose with roll, pitch, yaw beside joints, UTF-16",
        lambda: (
            text(
                ["Time(ms)", *numbered("A{} (deg)"), "X(mm)", "Y(mm)", "Z(mm)", "roll", "pitch", "yaw"],
                [TIME_S * 1e3, *Q.T, *P.T, *ABC_DEG[:, ::-1].T],
                "\t",
            )
            .decode()
            .encode("utf-16")
        ),
        ("q_act", "xyz_act"),
        ".txt",
    ),
    Layout(
        "Leica, stamps with an apostrophe",
        lambda: text(
            ["X  [mm]", "Y  [mm]", "Z  [mm]", *(f"Q{k} " for k in range(4)), "Time Stamp", "Delete"],
            [
                *P.T,
                *QUATERNION[:, [3, 0, 1, 2]].T,
                [f"'{stamp.replace(',', '.')}" for stamp in stamps("german")],
                [""] * len(TIME_S),
            ],
        ),
        ("xyz",),
    ),
    Layout(
        "EGM messages, flattened",
        lambda: text(
            [
                "header.seqno",
                "header.tm",
                *numbered("feedBack.joints.joints[{}]", 0),
                *numbered("planned.joints.joints[{}]", 0),
            ],
            [[str(k) for k in range(len(TIME_S))], np.round(1e3 * TIME_S + 1e6), *Q.T, *Q.T],
        ),
        ("q_act", "q_cmd"),
    ),
    Layout(
        "LabVIEW measurement file",
        lambda: text(
            ["X_Value", *numbered("A{}"), "Fx", "Fy", "Fz", "Comment"],
            [TIME_S, *Q.T, *F.T, [""] * len(TIME_S)],
            "\t",
            ",",
            above="LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\n***End_of_Header***\t\n"
            "\t\nChannels\t9\n***End_of_Header***\n",
        ),
        ("q_act", "force"),
        ".lvm",
    ),
    Layout(
        "motion capture, a head of four lines",
        lambda: text(
            ["Frame", "Time (Seconds)", "X", "Y", "Z"],
            [[str(k) for k in range(len(TIME_S))], TIME_S, *P.T],
            above="Format Version,1.23,Take Name,run 1,Length Units,Millimeters\n\n"
            ",Type,Marker,Marker,Marker\n,Name,tcp,tcp,tcp\n,,Position,Position,Position\n",
        ),
        ("xyz",),
    ),
    Layout(
        "2 kHz or 2 Hz",
        lambda: text(["clock", *numbered("Axis{}")], [0.5 * np.arange(len(TIME_S)), *Q.T]),
        ("q_act",),
        answers={"units": {"time": "ms"}},
        open_beside_prediction=True,
    ),
)
