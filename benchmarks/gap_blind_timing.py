"""Time and memory of a diagnosis of three runs, 56 s by default: 12 ms, load encoders, tracker at 100 Hz."""

import resource
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
ROW_S = 3.3
"""That a row along y takes."""
EFFECT, SIZE = "backlash@A2", 0.02


def long_program(rows: int = ROWS) -> Writer:
    """Rows along y, to and fro over the whole block until there are so many; back between those of before."""
    w = Writer("LONG", -4, -92, 30)
    w.rapid(z=2).feed(FEED_mm_s, z=-3)
    for i in range(rows):
        column = i % (2 * ROWS)
        x = -4 + 9 * (column if column < ROWS else 2 * ROWS - 1.5 - column)
        w.feed(FEED_mm_s, x=x).feed(FEED_mm_s, y=92 if i % 2 == 0 else -92)
    return w.rapid(z=30)


def timing(seconds: float = ROWS * ROW_S, effect: str = EFFECT, size: float = SIZE, times: int = 2) -> str:
    """Return how long predictions, plant and diagnosis took, and the peak memory of the whole process.

    The first diagnosis loads compiled code. One of long runs takes minutes and gigabytes.
    """
    from gcode2krl.gap import diagnose

    program = long_program(max(1, round(seconds / ROW_S)))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        writing.write_text(folder / "cell.toml", CELL_TOML)
        writing.write_text(folder / "long.nc", program.text())
        marks = [time.perf_counter()]
        predict(folder / "long.nc", load_cell(folder / "cell.toml")).save(folder / "prediction")
        marks.append(time.perf_counter())
        length_s = _runs(folder, program, effect, size)
        marks.append(time.perf_counter())
        answers = []
        for _ in range(times):
            runs = [load_run(folder / f"run-{i + 1}") for i in range(3)]
            gap = diagnose(Prediction.load(folder / "prediction"), runs).as_dict()
            answers.append(
                ", ".join(f"{c['effect']} {c['target']} {c['probability']:.2f}" for c in gap["causes"])
            )
            marks.append(time.perf_counter())
    parts = np.diff(marks)
    peak_MB = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    diagnoses = ", ".join(f"{part:.1f} s" for part in parts[2:])
    return (
        f"three runs of {length_s:.0f} s with {effect}: prediction {parts[0]:.1f} s, plant {parts[1]:.1f} s, "
        f"diagnosis {diagnoses}, peak {peak_MB:.0f} MB ({gap['verdict']}: {answers[-1] or 'no cause'})"
    )


def _runs(folder: Path, program: Writer, effect: str, size: float) -> float:
    rng = np.random.default_rng(1)
    how = replace(
        instruments.drawn(rng, frozenset({"controller", "tracker", "force", "q_load"})),
        tracker_hz=100.0,
        controller_s=0.012,
        scan=False,
    )
    fault = faults.build(effect, "same", 1)
    robot = mismatch.of_robot(rng)
    for number in range(3):
        run = simulate(
            program.waypoints(),
            World(),
            [fault.hooks(size)],
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
