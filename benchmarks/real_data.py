"""Real data that a person has fetched, diagnosed: docs/real_data.md says what is expected of them.

``python benchmarks/real_data.py FOLDER`` with FOLDER a copy of JonasWeigand/Robot_Identification on GitHub
(MIT): three logs of a KUKA KR 300 R2500 ultra. Its files become run folders, which are diagnosed from the log
alone; what is measured is printed beside what was expected. ``--runs DIR`` keeps the run folders. Without
FOLDER the same is done with made-up logs, to try the program; they are not judged.

``--abb FOLDER``: a copy of icelinker/Robot-Calibration-LaserTracker (it states no licence: read, never
passed on), whose poses are fitted. ``--ur10 FOLDER``: a copy of christianlandgraf/ipa-robot-accuracy (MIT),
likewise. ``--cobot FILE``: tests/test.parquet of vorausrobotik/voraus-ad-dataset or a
copy of it (MIT). ``--rtde FILE``: analysis/Dataset_PowerAnalysis/CSV-Files/fig9.xlsx of
ubc-systopia/dsn-2022-rad-artifact (MIT), a Universal Robots log as Excel keeps it.
"""

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from scipy.interpolate import CubicSpline
from scipy.io import loadmat

from gcode2krl.arrays import Floats
from gcode2krl.effects.operators import play
from gcode2krl.gap import diagnose_log
from gcode2krl.gap.answer.result import Gap
from gcode2krl.identify.kinematics import arm_named, identify_kinematics, read_readings
from gcode2krl.runs import load_run
from gcode2krl.runs.foreign import read_table, run_from

LOAD_ENCODERS = 3
"""A1 to A3 have one."""
PLAY_DEG = 0.06
EXPECTED_LATE_MS = (2.3, 3.6)
EXPECTED_INTERVAL_MS = 0.5
CARRIED_SLACK = 0.05
CONSTANT_P = 0.01
TORQUE_UNIT_NM = 10.0
PLAYS = (0.1, 0.3, 0.6)
"""Half-widths of the memory in torque, in units of it: a tenth to more than half of its amplitude."""


@dataclass(frozen=True)
class Log:
    """One recorded movement: times (n,), angles (n, 6) in degrees, motor torques (n, 6)."""

    name: str
    time_s: Floats
    q_act_deg: Floats
    q_load_deg: Floats
    torque_Nm: Floats


def read_logs(folder: Path) -> list[Log]:
    """Return the recorded movements of a copy of the repository, in the order of their names."""
    files = sorted(folder.glob("data/recorded_trajectories/*/data.mat"))
    if not files:
        raise SystemExit(f"{folder}: no data/recorded_trajectories/*/data.mat")
    return [_log(file, f"run-{number}") for number, file in enumerate(files, start=1)]


def _log(file: Path, name: str) -> Log:
    record = loadmat(file, squeeze_me=True, struct_as_record=False)["rec"]
    angles = (record.act_pos_mot_deg, record.act_pos_se_deg, record.act_torque_abs_nm)
    actual, load, torque = (np.ascontiguousarray(np.asarray(each, dtype=float).T) for each in angles)
    return Log(name, np.asarray(record.time_cont, dtype=float), actual, load, torque)


def write_run(log: Log, parent: Path) -> Path:
    """Write the run folder of a log; angles begin at zero, so they are relative."""
    folder = parent / log.name
    folder.mkdir(parents=True, exist_ok=True)
    joints = range(1, 7)
    names = ["t_s", *(f"q{j}_act_deg" for j in joints)]
    names += [f"q{j}_load_deg" for j in joints[:LOAD_ENCODERS]] + [f"tau{j}_Nm" for j in joints]
    table = np.column_stack([log.time_s, log.q_act_deg, log.q_load_deg[:, :LOAD_ENCODERS], log.torque_Nm])
    np.savetxt(
        folder / "controller.csv", table, delimiter=",", header=",".join(names), comments="", fmt="%.7f"
    )
    (folder / "run.toml").write_text('angles = "relative"\n', encoding="utf-8")
    return folder


def diagnosed(logs: Sequence[Log], parent: Path) -> Gap:
    """Return what the logs alone tell."""
    return diagnose_log([load_run(write_run(log, parent), partial=True) for log in logs])


# Made-up logs


def made_up_logs() -> list[Log]:
    """Return two logs of 10 s: all joints swing, load encoders are 3 ms late and see 0.02 deg a kN·m.

    They try this program where nobody has fetched the recorded ones.
    """
    time_s = np.arange(0.0, 10.0, 0.004)
    logs = []
    for number in range(1, 3):
        generator = np.random.default_rng(number)
        hz, deg = generator.uniform(0.1, 0.5, 6), generator.uniform(10.0, 40.0, 6)
        phase = generator.uniform(0.0, 2.0 * np.pi, 6)

        def swing(t: Floats) -> Floats:
            return deg * np.sin(2.0 * np.pi * hz * t[:, None] + phase)  # noqa: B023

        actual = swing(time_s)
        torque_Nm = -3.0 * actual + 400.0 * np.cos(np.radians(actual))
        load = swing(time_s - 3e-3) + 2e-5 * torque_Nm
        noise = generator.normal(0.0, 2e-4, (2, *actual.shape))
        logs.append(Log(f"run-{number}", time_s, actual + noise[0], load + noise[1], torque_Nm))
    return logs


def with_play(log: Log, joint: int, gap_deg: float) -> Log:
    """Return the log as if a joint (0 to 5) had a play: its load encoder follows the motor within ± gap/2."""
    load = log.q_load_deg.copy()
    load[:, joint] += play(log.q_act_deg[:, joint], gap_deg / 2.0) - log.q_act_deg[:, joint]
    return Log(log.name, log.time_s, log.q_act_deg, load, log.torque_Nm)


def without_gap(log: Log, seed: int) -> Log:
    """Return the log with load encoders that show the motor's angle, with noise as rough as the log's own."""
    difference = (log.q_load_deg - log.q_act_deg)[:, :LOAD_ENCODERS]
    sigma = np.std(np.diff(difference, n=2, axis=0), axis=0) / np.sqrt(6.0)  # 1, -2, 1: sum of squares 6
    load = log.q_act_deg.copy()
    load[:, :LOAD_ENCODERS] += np.random.default_rng(seed).normal(0.0, sigma, difference.shape)
    return Log(log.name, log.time_s, log.q_act_deg, load, log.torque_Nm)


# The rest against a joint's own torque


def rest_deg(log: Log, joint: int, late_s: float) -> Floats:
    """Return q_load - q_act (n,) without its mean and with the clock taken off."""
    model = CubicSpline(log.time_s, log.q_act_deg[:, joint])(log.time_s - late_s)
    rest = log.q_load_deg[:, joint] - model
    return rest - rest.mean()


def torque_columns(log: Log, joint: int) -> Floats:
    """Return odd functions (n, c) of a joint's own torque with memory: itself and its plays."""
    torque = np.ascontiguousarray(log.torque_Nm[:, joint] / TORQUE_UNIT_NM)
    columns = np.column_stack([torque, *(play(torque, width) for width in PLAYS)])
    return columns - columns.mean(axis=0)


def carried_over(logs: Sequence[Log], joint: int, late_s: float) -> list[float]:
    """Return R² of the rest on own torque in each log, by the coefficients of the others."""
    rests = [rest_deg(log, joint, late_s) for log in logs]
    columns = [torque_columns(log, joint) for log in logs]
    found = []
    for held in range(len(logs)):
        others = [number for number in range(len(logs)) if number != held]
        design = np.vstack([columns[number] for number in others])
        values = np.concatenate([rests[number] for number in others])
        coefficients = np.linalg.lstsq(design, values, rcond=None)[0]
        left = rests[held] - columns[held] @ coefficients
        found.append(float(1.0 - left @ left / (rests[held] @ rests[held])))
    return found


# Poses of an arm


ABB_BEFORE_MM, ABB_AFTER_MM = (0.82, 0.92), 0.50


UR10_BEFORE_MM, UR10_AFTER_MM = (0.5, 5.0), 0.30
UR10_SERIES = ("Series_B/measurements_joint_configurations.csv", "Series_C/measurements_random_poses.csv")
UR_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


def ur10_rows(folder: Path) -> Iterator["Row"]:
    """Yield the lines of the table for the poses of a UR10: points of a tracker in mm, joints in rad."""
    low, high = UR10_BEFORE_MM
    for name in UR10_SERIES:
        table = read_table(folder / name)
        columns = {f"q{n}_rad": table.columns[f"{joint}_joint"] for n, joint in enumerate(UR_JOINTS, 1)}
        columns |= {f"{axis}_mm": table.columns[f"measurement_{axis}"] for axis in "xyz"}
        found = identify_kinematics(read_readings(columns), arm_named("UR10"))
        before, alone = found.rms_before_mm, found.rms_after_mm
        curved = found.rms_with_curves_mm
        after = alone if curved is None else curved
        poses = f"UR10, {name.partition('/')[0]}, {len(found.before_mm)} poses"
        out = f"{before:.3f} mm; {int(found.is_outlier.sum())} points left out as outliers"
        yield Row(f"{poses}, frame and tool", f"{low} to {high} mm", out, low <= before <= high)
        agrees = after <= UR10_AFTER_MM
        yield Row(
            f"{poses}, places left out",
            f"{UR10_AFTER_MM} mm or less",
            f"{after:.3f} mm, numbers alone {alone:.3f}",
            agrees,
        )


def read_abb(folder: Path) -> dict[str, Floats]:
    """Return joints in deg and the first reflector in mm of a copy of the repository, by column."""
    place = folder / "4-DataProcess" / "Output"
    q, seen = (np.loadtxt(place / f"processed_{name}.txt") for name in ("joints", "SMR_1"))
    return {f"q{j + 1}_deg": q[:, j] for j in range(6)} | {f"{a}_mm": seen[:, i] for i, a in enumerate("xyz")}


def abb_rows(columns: Mapping[str, Floats]) -> Iterator["Row"]:
    """Yield the lines of the table for the poses; all points are counted."""
    found = identify_kinematics(read_readings(columns), arm_named("ABB IRB 120-3/0.6"))
    before, after = (float(np.sqrt(np.mean(values**2))) for values in (found.before_mm, found.after_mm))
    low, high = ABB_BEFORE_MM
    yield Row("IRB 120, frame and tool", f"{low} to {high} mm", f"{before:.3f} mm", low <= before <= high)
    agrees = after <= ABB_AFTER_MM
    yield Row("IRB 120, places left out", f"{ABB_AFTER_MM} mm or less", f"{after:.3f} mm", agrees)


# Logs of cobots


COBOT_LATE_MS = (9.2, 10.2)


def cobot_rows(file: Path) -> Iterator["Row"]:
    """Yield the lines of the table for a table of several movements of a second, in radians."""
    movements = pl.read_parquet(file).partition_by("sample", maintain_order=True)
    read = [run_from(one, units={"angle": "rad"}, name=f"run-{n}") for n, one in enumerate(movements, 1)]
    gap = diagnose_log(read)
    low, high = COBOT_LATE_MS
    late = next((c for c in gap.named_causes if (c.effect, c.target) == ("dead_time", "all")), None)
    expected = f"dead time of all axes, {low} to {high} ms"
    if late is None:
        yield Row(f"cobot, {len(read)} movements", expected, f"{gap.verdict}: {_names(gap)}", False)
        return
    value, least, most = (1e3 * each for each in late.parameters["delay_s"])
    words = f"{value:.2f} ms [{least:.2f}, {most:.2f}], p {late.probability:.2f}; {_shrunk(gap)}"
    yield Row(f"cobot, {len(read)} movements", expected, words, low <= value <= high)


def rtde_rows(file: Path) -> Iterator["Row"]:
    """Yield the line of the table for one log of a Universal Robots arm."""
    gap = diagnose_log([run_from(file, name="run-1")])
    late = [c for c in gap.named_causes if c.target == "all"]
    words = f"{gap.verdict}: {_names(gap)}; {_shrunk(gap)}"
    yield Row("RTDE log", "read without a question; no delay of all axes (as first seen)", words, not late)


def _shrunk(gap: Gap) -> str:
    size = gap.gap
    return f"{size.rms_before:.3g} -> {size.rms_after:.3g} {size.unit}"


# What is printed


@dataclass(frozen=True)
class Row:
    """One line of the table: what was measured beside what was expected, and whether they agree."""

    what: str
    expected: str
    measured: str
    agrees: bool


def rows(logs: Sequence[Log], parent: Path, *, small: bool) -> Iterator[Row]:
    """Yield the lines of the table; each diagnosis takes some seconds, and ``small`` makes one."""
    sets = [*([log] for log in logs if not small), list(logs)]
    late_s = float("nan")
    for some in sets:
        gap = diagnosed(some, parent / "as-logged")
        name = some[0].name if len(some) == 1 else "all together"
        yield _clock_row(name, gap)
        late_s = next((c.parameters["offset_s"].value for c in gap.named_causes if _is_clock(c)), late_s)
    yield _one_number_row(logs, gap)
    yield from _torque_rows(logs, late_s)
    for each in gap.unexplained.depends_on:
        words = f"{each.at} on {each.on}, {each.form}, share {each.share:.2f}, p {each.probability:.2f}"
        yield Row("the rest, by the diagnosis", "own torque at A3 and A2", words, each.on == "own torque")
    if small:
        return
    gap = diagnosed([with_play(log, 1, PLAY_DEG) for log in logs], parent / "play")
    yield _play_row(gap)
    yield _null_row(diagnosed([without_gap(log, seed) for seed, log in enumerate(logs)], parent / "null"))


def _is_clock(cause) -> bool:
    return (cause.effect, cause.target) == ("clock", "q_load")


def _clock_row(name: str, gap: Gap) -> Row:
    low, high = EXPECTED_LATE_MS
    expected = f"clock q_load {low} to {high} ms, within ± {EXPECTED_INTERVAL_MS} ms"
    clock = next((cause for cause in gap.named_causes if _is_clock(cause)), None)
    if clock is None:
        return Row(f"clock, {name}", expected, f"{gap.verdict}: {_names(gap)}", False)
    value, least, most = (1e3 * each for each in clock.parameters["offset_s"])
    width = max(value - least, most - value)
    words = f"{value:.2f} ms [{least:.2f}, {most:.2f}], p {clock.probability:.2f}"
    if clock.constant is not None:
        words += f", inconstancy {clock.constant.inconstancy:.3f} (p {clock.constant.p:.2f})"
    words += f"; {gap.verdict}: {_names(gap)}"
    return Row(f"clock, {name}", expected, words, low <= value <= high and width <= EXPECTED_INTERVAL_MS)


def least_squares_late_ms(log: Log, joint: int) -> float:
    """Return by how much a load encoder is late by plain least squares on the motor's rate."""
    rate = CubicSpline(log.time_s, log.q_act_deg[:, joint])(log.time_s, 1)
    difference = log.q_load_deg[:, joint] - log.q_act_deg[:, joint]
    rate, difference = rate - rate.mean(), difference - difference.mean()
    return float(-1e3 * (rate @ difference) / (rate @ rate))


def _one_number_row(logs: Sequence[Log], gap: Gap) -> Row:
    expected = "one number for A1 to A3 in all runs"
    found = next((cause.constant for cause in gap.named_causes if _is_clock(cause)), None)
    each = [[least_squares_late_ms(log, joint) for joint in range(LOAD_ENCODERS)] for log in logs]
    words = "; ".join(" ".join(f"{late:.2f}" for late in joints) for joints in each)
    if found is None:
        return Row("clock, joint by joint", expected, f"no clock was found; least squares {words} ms", False)
    measured = f"inconstancy {found.inconstancy:.3f}, p {found.p:.2f}; least squares {words} ms"
    return Row("clock, joint by joint", expected, measured, found.p > CONSTANT_P)


def _names(gap: Gap) -> str:
    return ", ".join(f"{c.effect} {c.target or ''}".strip() for c in gap.named_causes) or "nothing named"


def _torque_rows(logs: Sequence[Log], late_s: float) -> Iterator[Row]:
    if not np.isfinite(late_s):
        yield Row("rest against own torque", "R² about 0.58 (A3), 0.33 (A2)", "no clock was found", False)
        return
    for joint, expected in ((0, None), (1, 0.33), (2, 0.58)):
        r2 = carried_over(logs, joint, late_s)
        words = ", ".join(f"{each:.2f}" for each in r2)
        middle = float(np.median(r2))
        agrees = expected is None or middle >= expected - CARRIED_SLACK
        yield Row(
            f"rest against own torque, A{joint + 1}",
            "none stated" if expected is None else f"R² of {expected} or more",
            f"R² {words} in the run left out; median {middle:.2f}",
            agrees,
        )


def _play_row(gap: Gap) -> Row:
    found = next((c for c in gap.named_causes if (c.effect, c.target) == ("backlash", "A2")), None)
    expected = f"backlash A2, {PLAY_DEG} deg"
    if found is None:
        return Row("made-up play", expected, f"{gap.verdict}: {_names(gap)}", False)
    value, low, high = found.parameters["gap_deg"]
    words = f"{value:.4f} deg [{low:.4f}, {high:.4f}], p {found.probability:.2f}; {_names(gap)}"
    return Row("made-up play", expected, words, low <= PLAY_DEG <= high)


def _null_row(gap: Gap) -> Row:
    return Row("made-up null", "no_gap", f"{gap.verdict}: {_names(gap)}", gap.verdict == "no_gap")


def main(arguments: Sequence[str] | None = None, write: Callable[[str], object] = print) -> int:
    """Print the table; 0 where all agrees with what was expected, and for made-up logs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "folder", type=Path, nargs="?", help="a copy of the repository; without it made-up logs"
    )
    parser.add_argument(
        "--runs", type=Path, help="folder for the runs that are written; by default they are removed"
    )
    parser.add_argument("--abb", type=Path, metavar="FOLDER", help="a copy of the poses of an ABB IRB 120")
    parser.add_argument("--ur10", type=Path, metavar="FOLDER", help="a copy of the poses of a UR10")
    parser.add_argument("--cobot", type=Path, metavar="FILE", help="a Parquet table of voraus-AD")
    parser.add_argument("--rtde", type=Path, metavar="FILE", help="an RTDE log of a Universal Robots arm")
    parser.add_argument("--small", action="store_true", help="all logs together alone, without play and null")
    given = parser.parse_args(arguments)
    tables = [
        *(abb_rows(read_abb(given.abb)) if given.abb else ()),
        *(ur10_rows(given.ur10) if given.ur10 else ()),
        *(cobot_rows(given.cobot) if given.cobot else ()),
        *(rtde_rows(given.rtde) if given.rtde else ()),
    ]
    if tables:
        return 0 if all(_printed(tables, write)) else 1
    logs = read_logs(given.folder) if given.folder else made_up_logs()
    with tempfile.TemporaryDirectory() as scratch:
        found = _printed(rows(logs, given.runs or Path(scratch), small=given.small), write)
    return 0 if all(found) or given.folder is None else 1


def _printed(table: Iterable[Row], write: Callable[[str], object]) -> list[bool]:
    """Print the lines of a table; return which agree."""
    found = []
    for row in table:
        found.append(row.agrees)
        write(f"{'as expected' if row.agrees else 'NOT AS EXPECTED':16}{row.what}")
        write(f"{'':16}expected: {row.expected}")
        write(f"{'':16}measured: {row.measured}")
    return found


if __name__ == "__main__":
    sys.exit(main())
