"""A case as a folder: cell, programs, runs with their tables, and beside it the label."""

from pathlib import Path

import numpy as np

from tests.plant import instruments, surface, writing
from tests.plant.instruments import Instruments
from tests.plant.plans import Day, Plan
from tests.plant.robot import Run
from tests.plant.scene import CELL_TOML
from tests.plant.waypoints import PROGRAMS


def write(folder: Path, plan: Plan, driven: list[Run], predictions: str) -> None:
    """All runs of a case."""
    writing.write_text(folder / "cell.toml", CELL_TOML)
    for day, run in zip(plan.days, driven, strict=True):
        writing.write_text(folder / "programs" / f"{day.program}.nc", PROGRAMS[day.program]().text())
        keys = {
            "cell": "../cell.toml",
            "program": f"../programs/{day.program}.nc",
            "prediction": f"{predictions}/{day.program}",
        }
        write_run(folder / f"run-{day.number + 1}", day, run, plan.how, keys)


def write_run(place: Path, day: Day, run: Run, how: Instruments, keys: dict) -> None:
    """The tables of a run and its `run.toml`, which opens with these keys."""
    rng = np.random.default_rng(day.seed)
    place.mkdir(parents=True, exist_ok=True)
    tables = instruments.noisy(instruments.clean(run, how), how, run.units, rng)
    for name, table in tables.items():
        writing.write_table(place / name, table, parquet=bool(rng.random() < 0.3))
    if how.scan:
        cloud = surface.scanned(run, rng, how.scan_mm)
        if len(cloud):
            scan = {f"{a}_mm": np.round(cloud[:, i], 4) for i, a in enumerate("xyz")}
            writing.write_table(place / "scan", scan, parquet=False)
    keys = {**keys, "started": day.started.isoformat(), "angles": "absolute"}
    sections = {"frames": {"tracker": "base", "force": how.force_frame}}
    if rng.random() < 0.5 or how.foreign:  # of a foreign noise the data sheet's short part
        sections["noise"] = {
            "tcp_mm": how.tracker_mm,
            "force_N": how.force_N,
            "q_act_deg": how.q_act_deg,
            "q_load_deg": how.q_load_deg,
        }
    writing.write_text(place / "run.toml", writing.run_toml(keys, sections))
