"""Remedies of what `identify` says of readings."""

from dataclasses import replace

from gcode2krl.compliance.sensor import read_calibration
from tests.conftest import ROOT
from tests.identify.test_controller import HEAD as HEADED
from tests.identify.test_controller import Controller, trace_of
from tests.identify.test_kinematics import arm_named, identify_kinematics, pose_arms, read_readings
from tests.remedies.bench import BASE, GONE, PREDICT, SPACE, call, case
from tests.remedies.cutting import STATE as CUT
from tests.remedies.runs import FORCE, csv

FOLDER = ROOT / "examples" / "identify"
HOLDER, ORIENTATIONS, POSES, HEAD = (
    (FOLDER / name).read_text(encoding="utf-8")
    for name in ("holder.csv", "orientations.csv", "poses.csv", "holder.toml")
)
POSES = "".join(POSES.splitlines(keepends=True)[:101])
STIFFNESS = "identify stiffness holder.toml"
SENSOR = "identify sensor orientations.csv -o calibration.toml"
KINEMATICS = "identify kinematics poses.csv -o geometry.toml"
ROBOT = {
    "robot.toml": (FOLDER / "robot.toml").read_text(encoding="utf-8"),
    "robot.csv": (FOLDER / "robot.csv").read_text(encoding="utf-8"),
}
DRIVEN = PREDICT
METAL = CUT["cell.toml"]
STATE = BASE | {
    "words": SENSOR,
    "holder.csv": HOLDER,
    "holder.toml": HEAD,
    "orientations.csv": ORIENTATIONS,
    "poses.csv": POSES,
    "cell.toml": METAL,
}


def scaled(text, columns, factor, rows=None):
    """Return a table with some columns multiplied, of all rows or some."""
    head, *lines = text.splitlines()
    names = head.split(",")
    out = []
    for number, line in enumerate(lines):
        values = line.split(",")
        for k, name in enumerate(names):
            if columns(name) and (rows is None or number in rows):
                values[k] = f"{float(values[k]) * factor:.6g}"
        out.append(",".join(values))
    return "\n".join([head, *out, ""])


def column(text, *names):
    """Return a table without the columns of some beginnings."""
    rows = [line.split(",") for line in text.splitlines()]
    keep = [k for k, name in enumerate(rows[0]) if not name.startswith(names)]
    return "\n".join(",".join(row[k] for k in keep) for row in rows) + "\n"


def sensor(text):
    return case({"orientations.csv": text}, {"orientations.csv": ORIENTATIONS})


def holder(*edits):
    wrong, right = {"words": STIFFNESS}, {"words": STIFFNESS}
    for name, old, new in edits:
        wrong[name], right[name] = (old, new), (new, old)
    return case(wrong, right)


@call
def calibration():
    read_calibration("calibration.toml")


@call
def poses(noise_mm):
    """Identify poses with the noise of an instrument, or the controller's own, which have none."""
    arm = replace(pose_arms.KR300, noise_mm=float(noise_mm))
    readings = read_readings(pose_arms.measured(arm, 60, 3).columns())
    return identify_kinematics(readings, arm_named(arm.name)).issues


TURN = "G64 P0.5\nG1 X{x} Y0 F3000\nG61\nG1 X{x} Y{y}\nG4 P0.3\nG1 X100 Y0\nG4 P0.3\n"
TURNS = HEADED + "".join(TURN.format(x=100 + size, y=size) for size in (20, 40, 80)) + "M5\nM30\n"
STOPPED = TURNS.replace("G1 X140 Y0 F3000\n", "G61\nG1 X120 Y0 F3000\nG4 P0.3\nG64 P0.5\nG1 X140 Y0\n")


def trace(text):
    made = trace_of(text, Controller())
    return csv({"t_s": made.time_s} | {f"{a}_cmd_mm": made.position_mm[:, k] for k, a in enumerate("xyz")})


FORCES = lambda name: name[:2] in ("fx", "fy", "fz", "mx", "my", "mz")  # noqa: E731
MOMENTS = lambda name: name[0] == "m"  # noqa: E731
CASES = {
    "table-column": sensor(ORIENTATIONS.replace(",", ";")),
    "table-empty": sensor(""),
    "table-number": sensor(ORIENTATIONS.replace("-60,35,-70,", "-60,3a5,-70,", 1)),
    "table-unreadable": case(
        {"orientations.csv": b"a_deg,b_deg\n1,2,3,4\n"}, {"orientations.csv": ORIENTATIONS}
    ),
    "weight-sign": case(
        {"orientations.csv": scaled(ORIENTATIONS, FORCES, -1.0)}, {"orientations.csv": ORIENTATIONS}
    ),
    "moment-unit": sensor(scaled(ORIENTATIONS, MOMENTS, 1e-3)),
    "not-determined": sensor("\n".join(ORIENTATIONS.splitlines()[:3]) + "\n"),
    "remaining-offset": case(
        {"orientations.csv": "\n".join(ORIENTATIONS.splitlines()[:9]) + "\n"},
        {"orientations.csv": ORIENTATIONS},
        says="no remaining offset",
    ),
    "calibration-key": case(
        {
            "words": f"{SENSOR}; change; call calibration",
            "change": {"calibration.toml": ("weight_N = ", 'weight_N = "heavy" # ')},
        },
        {"words": f"{SENSOR}; change; {SENSOR}; call calibration"},
    ),
    "table-pair": holder(("holder.toml", "[pair.holder]", "[pair.holdr]")),
    "measurement-key": holder(("holder.toml", "point_flange_mm", "point_mm")),
    "table-change": case(
        {"words": STIFFNESS, "holder.csv": scaled(HOLDER, lambda n: "_loaded_" in n, 1e-3)},
        {"holder.csv": HOLDER},
    ),
    "stray-reading": case(
        {
            "words": "identify stiffness robot.toml",
            **ROBOT,
            "robot.csv": scaled(ROBOT["robot.csv"], lambda n: "upper_loaded_3" in n, 1.002, {4}),
        },
        ROBOT,
    ),
    "pair-joints": case(
        {
            "words": "identify stiffness robot.toml",
            **ROBOT,
            "robot.toml": ROBOT["robot.toml"]
            .replace('upper = "link_low"', 'upper = "arm_rear"', 1)
            .replace('body = "sensor"', 'body = "sensor"'),
        },
        ROBOT,
    ),
    "kinematics-order": case(
        {"words": KINEMATICS, "poses.csv": column(POSES, "approach")},
        {"words": KINEMATICS + " --no-order"},
        {"poses.csv": POSES},
    ),
    "kinematics-outlier": case(
        {"words": KINEMATICS},
        {"poses.csv": "".join(line for k, line in enumerate(POSES.splitlines(keepends=True), 1) if k != 35)},
    ),
    "kinematics-rows": case(
        {"words": KINEMATICS, "poses.csv": scaled(POSES, lambda n: n in ("x_mm", "y_mm", "z_mm"), 0.0, {7})},
        {"poses.csv": POSES},
    ),
    "kinematics-strange": case(
        {"words": KINEMATICS + " --robot KR" + SPACE + "3" + SPACE + "R540"}, {"words": KINEMATICS}
    ),
    "run-prediction": case(
        {"words": f"{DRIVEN}; identify force run", "run/run.toml": "", "run/force.csv": csv(FORCE)},
        {"words": f"{DRIVEN}; identify force run --prediction prediction"},
        {"run/run.toml": 'prediction = "../prediction"\n'},
        then="not-determined",
    ),
    "run-force": case(
        {"words": f"{DRIVEN}; identify force run", "run/run.toml": 'prediction = "../prediction"\n'},
        {"run/force.csv": csv(FORCE)},
        then="not-determined",
    ),
    "model-misfit": case(
        {
            "words": "identify stiffness robot.toml",
            **ROBOT,
            "robot.csv": scaled(ROBOT["robot.csv"], lambda n: "upper_loaded_3" in n, 1.002, {4}),
        },
        ROBOT,
    ),
    "prediction-motion": case(
        {
            "words": f"{DRIVEN}; change; identify force run",
            "run/run.toml": 'prediction = "../prediction"\n',
            "run/force.csv": csv(FORCE),
            "change": {"prediction/motion.parquet": GONE},
        },
        {"words": f"{DRIVEN}; change; {DRIVEN}; identify force run"},
        then="not-determined",
    ),
    "kinematics-exact": case({"words": "call poses 0.0"}, {"words": "call poses 0.05"}),
    "trace-sections": case(
        {"words": "identify controller trace.csv --part p.nc", "p.nc": TURNS, "trace.csv": trace(STOPPED)},
        {"trace.csv": trace(TURNS)},
        then="not-determined",
    ),
    "law-misfit": case(
        {
            "words": "identify controller trace.csv --part p.nc",
            "p.nc": TURNS,
            "trace.csv": trace(TURNS.replace("F3000", "F1500")),
        },
        {"trace.csv": trace(TURNS)},
        then="not-determined",
    ),
}
