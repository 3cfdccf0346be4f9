"""Remedies of what `identify` says of readings."""

from gcode2krl.compliance.sensor import read_calibration
from tests.conftest import ROOT
from tests.remedies.bench import BASE, PREDICT, SPACE, call, case
from tests.remedies.cutting import STATE as CUT
from tests.remedies.runs import FORCE, csv

FOLDER = ROOT / "examples" / "identify"
HOLDER, ORIENTATIONS, POSES, HEAD = (
    (FOLDER / name).read_text(encoding="utf-8")
    for name in ("holder.csv", "orientations.csv", "poses.csv", "holder.toml")
)
STIFFNESS = "identify stiffness holder.toml"
SENSOR = "identify sensor orientations.csv -o calibration.toml"
KINEMATICS = "identify kinematics poses.csv -o geometry.toml"
ROBOT = {"robot.toml": (FOLDER / "robot.toml").read_text(encoding="utf-8"), "robot.csv": (FOLDER / "robot.csv").read_text(encoding="utf-8")}
DRIVEN = PREDICT
METAL = CUT["cell.toml"]
STATE = BASE | {"words": SENSOR, "holder.csv": HOLDER, "holder.toml": HEAD, "orientations.csv": ORIENTATIONS, "poses.csv": POSES, "cell.toml": METAL}


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


FORCES = lambda name: name[:2] in ("fx", "fy", "fz", "mx", "my", "mz")  # noqa: E731
MOMENTS = lambda name: name[0] == "m"  # noqa: E731
CASES = {
    "table-column": sensor(ORIENTATIONS.replace(",", ";")),
    "table-empty": sensor(""),
    "table-number": sensor(ORIENTATIONS.replace("-60,35,-70,", "-60,3a5,-70,", 1)),
    "table-unreadable": case({"orientations.csv": b"a_deg,b_deg\n1,2,3,4\n"}, {"orientations.csv": ORIENTATIONS}),
    "weight-sign": case({"orientations.csv": scaled(ORIENTATIONS, FORCES, -1.0)}, {"orientations.csv": ORIENTATIONS}),
    "moment-unit": sensor(scaled(ORIENTATIONS, MOMENTS, 1e-3)),
    "not-determined": sensor("\n".join(ORIENTATIONS.splitlines()[:3]) + "\n"),
    "remaining-offset": case({"orientations.csv": "\n".join(ORIENTATIONS.splitlines()[:9]) + "\n"}, {"orientations.csv": ORIENTATIONS}, says="no remaining offset"),
    "calibration-key": case(
        {
            "words": f"{SENSOR}; change; call calibration",
            "change": {"calibration.toml": ("weight_N = ", 'weight_N = "heavy" # ')},
        },
        {"words": f"{SENSOR}; change; {SENSOR}; call calibration"},
    ),
    "table-pair": holder(("holder.toml", "[pair.holder]", "[pair.holdr]")),
    "measurement-key": holder(("holder.toml", "point_flange_mm", "point_mm")),
    "table-change": case({"words": STIFFNESS, "holder.csv": scaled(HOLDER, lambda n: "_loaded_" in n, 1e-3)}, {"holder.csv": HOLDER}),
    "stray-reading": case({"words": "identify stiffness robot.toml", **ROBOT, "robot.csv": scaled(ROBOT["robot.csv"], lambda n: "upper_loaded_3" in n, 1.002, {4})}, ROBOT),
    "pair-joints": case({"words": "identify stiffness robot.toml", **ROBOT, "robot.toml": ROBOT["robot.toml"].replace('upper = "link_low"', 'upper = "arm_rear"', 1).replace('body = "sensor"', 'body = "sensor"')}, ROBOT),
    "kinematics-order": case({"words": KINEMATICS, "poses.csv": column(POSES, "approach")}, {"words": KINEMATICS + " --no-order"}, {"poses.csv": POSES}),
    "kinematics-outlier": case({"words": KINEMATICS}, {"poses.csv": "".join(line for k, line in enumerate(POSES.splitlines(keepends=True), 1) if k not in (35, 137))}),
    "kinematics-rows": case({"words": KINEMATICS, "poses.csv": scaled(POSES, lambda n: n in ("x_mm", "y_mm", "z_mm"), 0.0, {7})}, {"poses.csv": POSES}),
    "kinematics-strange": case({"words": KINEMATICS + " --robot KR" + SPACE + "3" + SPACE + "R540"}, {"words": KINEMATICS}),
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
}
