"""How long a diagnosis of three runs of 60 s takes: 12 ms, load encoders, tracker at 100 Hz."""

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from gap_blind_cases import CELL_TOML

from gcode2krl import Prediction, load_cell, load_run, predict
from tests.plant import faults, instruments, mismatch, writing
from tests.plant.robot import simulate
from tests.plant.scene import World
from tests.plant.waypoints import Writer

ROWS, FEED_mm_s = 17, 60.0
EFFECT, SIZE = "backlash@A2", 0.02


def long_program() -> Writer:
    """Rows along y over the whole block, 60 s of them."""
    w = Writer("LONG", -4, -92, 30)
    w.rapid(z=2).feed(FEED_mm_s, z=-3)
    for i in range(ROWS):
        w.feed(FEED_mm_s, x=-4 + 9 * i).feed(FEED_mm_s, y=92 if i % 2 == 0 else -92)
    return w.rapid(z=30)


def timing() -> str:
    """Return how long the predictions, the plant and the diagnosis took."""
    from gcode2krl.gap import diagnose

    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        writing.write_text(folder / "cell.toml", CELL_TOML)
        writing.write_text(folder / "long.nc", long_program().text())
        marks = [time.perf_counter()]
        predict(folder / "long.nc", load_cell(folder / "cell.toml")).save(folder / "prediction")
        marks.append(time.perf_counter())
        length_s = _runs(folder)
        marks.append(time.perf_counter())
        answers = []
        for _ in range(2):
            runs = [load_run(folder / f"run-{i + 1}") for i in range(3)]
            gap = diagnose(Prediction.load(folder / "prediction"), runs).as_dict()
            answers.append(
                ", ".join(f"{c['effect']} {c['target']} {c['probability']:.2f}" for c in gap["causes"])
            )
            marks.append(time.perf_counter())
    parts = np.diff(marks)
    return (
        f"three runs of {length_s:.0f} s: prediction {parts[0]:.1f} s, plant {parts[1]:.1f} s, diagnosis "
        f"{parts[2]:.1f} s at first, {parts[3]:.1f} s again ({gap['verdict']}: {answers[-1] or 'no cause'})"
    )


def _runs(folder: Path) -> float:
    rng = np.random.default_rng(1)
    how = replace(
        instruments.drawn(rng, frozenset({"controller", "tracker", "force", "q_load"})),
        tracker_hz=100.0,
        controller_s=0.012,
        scan=False,
    )
    fault = faults.build(EFFECT, "same", 1)
    robot = mismatch.of_robot(rng)
    for number in range(3):
        run = simulate(
            long_program().waypoints(),
            World(),
            [fault.hooks(SIZE)],
            mismatch.of_day(robot, rng),
            0.0,
            number,
        )
        place = folder / f"run-{number + 1}"
        place.mkdir()
        for name, table in instruments.noisy(instruments.clean(run, how), how, run.units, rng).items():
            writing.write_table(place / name, table, parquet=False)
        keys = {"program": "../long.nc", "prediction": "../prediction", "angles": "absolute"}
        writing.write_text(
            place / "run.toml",
            writing.run_toml(keys, {"frames": {"tracker": "base", "force": how.force_frame}}),
        )
    return float(run.t_s[-1])
