"""Makes the measured runs of examples/runs with the robot of the tests, which shares no code with gcode2krl.

They are dry runs: the joints that the test piece's prediction commands, in air, half an hour apart, with play
in axis 3 and the usual differences of a robot and a day; a controller's log and a tracker, no force sensor.

    python examples/make_runs.py   with ``pip install -e ".[test]"``; a minute
"""

import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from gcode2krl import predict  # noqa: E402
from tests.plant import faults, folders, mismatch  # noqa: E402
from tests.plant.instruments import Instruments, without  # noqa: E402
from tests.plant.plans import Day  # noqa: E402
from tests.plant.programs import Track  # noqa: E402
from tests.plant.robot import simulate  # noqa: E402
from tests.plant.scene import World  # noqa: E402

PROGRAM = "examples/test_piece.nc"
SEED, FAULT, GAP_DEG = 42, "backlash@A3", 0.03
SLOW_s = 0.048
"""Between two readings of the logs: they are to be small."""


def main() -> None:
    """Write run-1, run-2 and run-3."""
    # a controller commands every millisecond; 12 ms would cut its corners
    prediction = predict(ROOT / PROGRAM, dt_s=0.001, forces=False)
    track = Track(prediction.motion.time_s, prediction.joints.q_rad)
    rng = np.random.default_rng(SEED)
    far_below = np.array([[0.0, -70.0, -1030.0], [160.0, 70.0, -1000.0]])
    world = World(stock_mm=far_below)
    robot = mismatch.of_robot(rng, mismatch.USUAL)
    play = faults.build(FAULT, "same", SEED).hooks(GAP_DEG)
    how = Instruments(
        tracker_hz=1.0 / SLOW_s,
        controller_s=SLOW_s,
        q_load=False,
        q_decimals=4,
        tracker_decimals=3,
    )
    how = without(how, ("force",))
    begin = datetime(2026, 3, 2, 8, 0, tzinfo=UTC)
    for number in range(3):
        age_s = 1800.0 * number
        started = begin + timedelta(seconds=age_s)
        today = mismatch.of_day(robot, rng, mismatch.USUAL)
        day = Day(number, "test_piece", today, started, age_s, SEED + number)
        run = simulate(track, world, [play], today, age_s, number)
        place = ROOT / "examples" / "runs" / f"run-{number + 1}"
        for old in place.glob("*.*"):
            old.unlink()
        folders.write_run(place, day, run, how, {})
        head = place / "run.toml"
        text = head.read_text(encoding="utf-8").replace("\n\n", "\nin_air = true\n\n", 1)
        head.write_text(text, encoding="utf-8")
        for table in place.glob("*.parquet"):
            pl.read_parquet(table).write_csv(table.with_suffix(".csv"), null_value="NaN")
            table.unlink()


if __name__ == "__main__":
    main()
