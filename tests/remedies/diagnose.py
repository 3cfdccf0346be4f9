"""Remedies of what `diagnose` and `online replay` say of runs beside a prediction."""

from pathlib import Path

import numpy as np
import trimesh

from gcode2krl import Prediction, load_cell
from gcode2krl.gap.answer.causes import issues_of
from gcode2krl.gap.compare.slips import without_cuts
from gcode2krl.runs.scan import read_scan
from tests.gap.test_dependences import SIGMA_N, of_force, rough
from tests.gap.test_slips import in_air
from tests.online.test_replay import HEAD as REPLAYED
from tests.online.test_replay import write_run
from tests.remedies.bench import PREDICT, call, case, laid
from tests.remedies.cutting import STATE as CUT
from tests.runs import maker

STATE = laid(CUT, {"words": "", "cut": "G1 Z-1 F900\nX16 F900\nY14"})


@call
def drive(*left_out):
    """Write the run of a prediction, its drives 20 ms late, without the columns that have these words."""
    made = Prediction.load("prediction")
    time_s, q = made.motion.time_s, np.degrees(made.joints.q_rad)
    rng = np.random.default_rng(5)
    late = np.stack([np.interp(time_s - 0.02, time_s, column) for column in q.T], axis=1)
    act = late + rng.normal(0.0, 3e-4, q.shape)
    columns = {"t_s": time_s + (1.7e9 if "clock" in left_out else 0.0)}
    columns |= {f"q{k + 1}_cmd_deg": q[:, k] for k in range(6)} | {
        f"q{k + 1}_act_deg": act[:, k] for k in range(6)
    }
    columns |= {f"i{k + 1}_A": 1.0 + rng.normal(0.0, 0.1, len(q)) for k in range(6)}
    kept = {name: values for name, values in columns.items() if not any(word in name for word in left_out)}
    maker.run_folder(Path("run"), 'program = "part.nc"\n', controller=kept)


@call
def instruments(what):
    """Judge a signal whose noise, steps or bursts were made up."""
    loud = rough(5, 2000)
    loud[900:912] *= 12.0
    found = {
        "loud": lambda: of_force(8.0 * rough(1), 8.0 * rough(2), declared_sigma=1.0),
        "stated": lambda: of_force(rough(1), rough(2), declared_sigma=SIGMA_N),
        "steps": lambda: of_force(10.0 * np.round(rough(1) / 10.0), 10.0 * np.round(rough(2) / 10.0)),
        "fine": lambda: of_force(rough(1), rough(2)),
        "rough": lambda: of_force(rough(6, 2000), loud),
        "even": lambda: of_force(rough(6, 2000), rough(5, 2000)),
    }[what]()
    return issues_of([found])


@call
def recorded(*how):
    """Write the run that is replayed."""
    write_run(
        Path("run"),
        load_cell(),
        head=REPLAYED + ("[channels]\nrsi = true\n" if "rsi" in how else ""),
        gap="gap" in how,
    )


@call
def air(*stated):
    """Judge a run in air beside a prediction with forces."""
    return without_cuts([in_air(False, {"yes": True, "no": False}[stated[0]] if stated else None)])[1]


@call
def scan(how):
    """Read the scan of a part, or half of its file."""
    content = trimesh.creation.icosphere(subdivisions=3, radius=20.0).export(file_type="ply")
    Path("scan.ply").write_bytes(content[: len(content) // 5] if how == "half" else content)
    read_scan("scan.ply")


def words(text):
    return {"words": text}


CASES = {
    "no-runs": case(
        words(f"{PREDICT} --no-forces; diagnose prediction"),
        words(f"{PREDICT} --no-forces; call drive; diagnose prediction run"),
    ),
    "nothing-compared": case(
        words(f"{PREDICT} --no-forces; call drive q; diagnose prediction run"),
        words(f"{PREDICT} --no-forces; call drive; diagnose prediction run"),
    ),
    "joints-actual-alone": case(
        words(f"{PREDICT} --no-forces; call drive _cmd; diagnose prediction run"),
        words(f"{PREDICT} --no-forces; call drive; diagnose prediction run"),
    ),
    "noise-above-stated": case(words("call instruments loud"), words("call instruments stated")),
    "readings-in-steps": case(words("call instruments steps"), words("call instruments fine")),
    "replay-corrected": case(
        words("call recorded rsi; online replay run"), words("call recorded; online replay run")
    ),
    "replay-sensor": case(
        words("call recorded gap; online replay run"), words("call recorded; online replay run")
    ),
    "instrument-bursts": case(words("call instruments rough"), words("call instruments even")),
    "run-in-air": case(words("call air"), words("call air yes"), words("call air no")),
    "scan-ply": case(words("call scan half"), words("call scan whole")),
}
