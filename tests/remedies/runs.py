"""Remedies of what is said of a measured run: alone, and beside the path that was predicted."""

import io
import tempfile
from pathlib import Path

import numpy as np
import polars as pl

from gcode2krl.runs import check_against, load_run
from tests.remedies.bench import BASE, call, case
from tests.runs import maker
from tests.runs.test_krc_trace import data_set
from tests.runs.test_rsi_log import log

FAST = {"speed": 500.0}
HEAD, LEGS = "run/run.toml", ("controller", "tracker", "force")
T = np.arange(0.0, maker.duration(), 0.012)


def csv(columns):
    return pl.DataFrame(columns).write_csv()


def parquet(columns):
    written = io.BytesIO()
    pl.DataFrame(columns).write_parquet(written)
    return written.getvalue()


@call
def run(*how):
    """Read the run and hold it against its path; ``fast`` is that of another speed."""
    t = np.arange(0.0, maker.duration(**FAST if how else {}), 0.012)
    position = maker.path(t, **FAST if how else {})
    read = load_run("run")
    return [*read.issues, *check_against(read, t, position, np.radians(maker.joints_deg(position)))]


CONTROLLER, TRACKER, FORCE = maker.controller(), maker.tracker(), maker.force()
STATE = BASE | {"words": "call run", HEAD: "", "run/controller.csv": csv(CONTROLLER)}
SEEN = {"run/tracker.csv": csv(TRACKER)}


def tracked(columns):
    return {"run/tracker.csv": csv(columns)}


def logged(columns):
    return {"run/controller.csv": csv(columns)}


def moved(change):
    xyz = change(np.stack([TRACKER[f"{axis}_mm"] for axis in "xyz"], axis=1))
    return {"t_s": TRACKER["t_s"]} | {f"{axis}_mm": xyz[:, i] for i, axis in enumerate("xyz")}


def exchanged(columns, *pairs):
    for one, other in pairs:
        columns = columns | {one: columns[other], other: columns[one]}
    return columns


def without(columns, *names):
    return {name: values for name, values in columns.items() if not name.startswith(names)}


HALF = tracked(maker.tracker(percent=50.0)) | logged(maker.controller(percent=50.0))
CAPPED = tracked(maker.tracker(top=250.0, **FAST)) | logged(maker.controller(top=250.0, **FAST))
OTHER = maker.WAYPOINTS * 1.5
GAPS = np.where((np.arange(len(T)) > 99) & (np.arange(len(T)) < 140), np.nan, CONTROLLER["q3_act_deg"])
PAUSED = {k: v[(T < 3.0) | (T > 3.5)] for k, v in CONTROLLER.items()}
COARSE = {k: v if k == "t_s" else np.round(v, 1) for k, v in TRACKER.items()}
TEXT = csv(CONTROLLER)
TELEGRAMS = log()[-1]


def recorded():
    """Return the files of a controller's own trace."""
    slow = np.arange(0.0, maker.duration(), 0.012)
    axes = [maker.joints_deg(maker.path(slow - late)) for late in (0.0, 0.02)]
    channels = [
        (f"AxisPos_{kind}{n + 1}", "°", each[:, n], 1.0, 0.0)
        for kind, each in zip(("CmdIpo", "Act"), axes, strict=True)
        for n in range(6)
    ]
    with tempfile.TemporaryDirectory() as folder:
        data_set(Path(folder), "T", 0.012, channels)
        return {file.name: file.read_bytes() for file in Path(folder).iterdir()}


RECORDED = recorded()

CASES = {
    "run-axes": case(
        tracked(exchanged(without(TRACKER, "q"), ("x_mm", "y_mm")))
        | {"run/controller.csv": csv(without(CONTROLLER, "x_", "y_", "z_"))},
        tracked(TRACKER),
    ),
    "run-clock": case(
        tracked(maker.tracker(offset=2.0)), {HEAD: "[clocks]\ntracker_s = 2.0\n"}, tracked(TRACKER)
    ),
    "run-files": case(
        {"run/controller.parquet": parquet(CONTROLLER)},
        {"run/controller.parquet": None},
        {HEAD: '[files]\ncontroller = "controller.csv"\n'},
    ),
    "run-frame": case(
        tracked(moved(lambda p: p + np.array([0.0, 100.0, 0.0]))),
        tracked(TRACKER),
        {HEAD: '[frames]\ntracker = "sensor"\n'},
    ),
    "run-key": case(
        {HEAD: "override = 50\n"}, {HEAD: "override_percent = 100\n"}, {HEAD: '[notes]\noverride = "50"\n'}
    ),
    "run-override": case(HALF, {HEAD: "override_percent = 50\n"}, SEEN | logged(CONTROLLER)),
    "run-path": case(
        {HEAD: 'prediction = "../predicton"\n'},
        {"prediction/prediction.toml": "", HEAD: 'prediction = "../prediction"\n'},
    ),
    "run-program": case(
        logged(maker.controller(waypoints=OTHER)) | tracked(maker.tracker(waypoints=OTHER)),
        SEEN | logged(CONTROLLER),
    ),
    "run-t1": case(
        {"words": "call run fast"} | CAPPED,
        {HEAD: 'mode = "T1"\n'},
        tracked(maker.tracker(**FAST)) | logged(maker.controller(**FAST)),
    ),
    "run-unit": case(
        {"run/controller.csv": csv(without(CONTROLLER, "x_", "y_", "z_"))}
        | tracked(moved(lambda p: p * [1e-3, 1.0, 1.0])),
        tracked(TRACKER),
    ),
    "trace-column": case(logged(without(CONTROLLER, "q6_")), logged(CONTROLLER)),
    "trace-columns": case(logged(exchanged(CONTROLLER, ("q2_act_deg", "q3_act_deg"))), logged(CONTROLLER)),
    "trace-constant": case(
        {},
        logged(CONTROLLER | {f"{a}_cmd_deg": 10.0 * np.sin(T) for a in "abc"}),
        logged(without(CONTROLLER, "a_", "b_", "c_")),
    ),
    "trace-decimals": case(tracked(COARSE), SEEN),
    "trace-dropped": case(logged(CONTROLLER | {"q3_act_deg": GAPS}), logged(CONTROLLER)),
    "trace-empty": case({"words": "runs import log.csv -o run-9", "log.csv": ""}, {"log.csv": TEXT}),
    "trace-gap": case(logged(PAUSED), logged(CONTROLLER)),
    "trace-ignored": case(logged(CONTROLLER | {"temperature": T}), logged(CONTROLLER)),
    "trace-missing": case(logged(without(CONTROLLER, "x_", "y_", "z_")), logged(CONTROLLER)),
    "trace-number": case(
        logged(CONTROLLER | {"q3_act_deg": [f"{v:.3f}".replace(".", ";") for v in CONTROLLER["q3_act_deg"]]}),
        logged(CONTROLLER),
    ),
    "trace-overlap": case(tracked(maker.tracker(offset=60.0)), SEEN, {HEAD: "[clocks]\ntracker_s = 60.0\n"}),
    "trace-short": case(logged({k: v[:2] for k, v in CONTROLLER.items()}), logged(CONTROLLER)),
    "trace-time": case(
        logged({k: np.concatenate([v, v]) for k, v in CONTROLLER.items()}), logged(CONTROLLER)
    ),
    "trace-unit": case(tracked(TRACKER | {"t_s": TRACKER["t_s"] * 1000.0}), SEEN),
    "trace-unreadable": case(
        {
            "words": "runs import log.csv -o run-9",
            "log.csv": "Time,Axis1,Axis2,Axis3,Axis4,Axis5,Axis6\n"
            + "\n".join(f"0,0{k:02d},1,5,2,5,3,5,4,5,5,5,6,5" for k in range(30)),
        },
        {"log.csv": TEXT},
    ),
    "run-layout": case(
        {
            "words": "runs import log.csv -o run-9",
            "log.csv": csv(
                {"Time": T}
                | {f"Axis{k + 1}": np.radians(maker.joints_deg(maker.path(T)))[:, k] * 2 for k in range(6)}
            ),
        },
        {"options": "--unit angle=rad"},
        {"options": "--unit angle=deg"},
        then="trace-unit",
        says="deg or rad?",
    ),
    "rsi-log": case(
        {"words": "runs import rsi.log -o run-9", "rsi.log": "\n".join([*TELEGRAMS[300:], *TELEGRAMS[:300]])},
        {"rsi.log": "\n".join(TELEGRAMS[:300])},
        says="IPOC",
    ),
    "krc-trace": case(
        {"words": "runs import T.dat -o run-9", **RECORDED, "T.r64": RECORDED["T.r64"][:-4800]}, RECORDED
    ),
}
