"""A made-up run: a polyline at constant speeds with stops, linear joints, as columns and as files."""

import numpy as np
import polars as pl

WAYPOINTS = np.array(
    [
        [0, 0, 20],
        [0, 0, 0],
        [120, 0, 0],
        [120, 60, 0],
        [70, 60, -3],
        [70, 95, -3],
        [10, 80, -3],
        [0, 30, 0],
        [0, 0, 20],
    ],
    dtype=float,
)
JOINTS = np.array([-8.0, -70.0, 95.0, 12.0, -40.0, 30.0])
PER_MM = np.array(
    [
        [0.02, -0.05, 0.003],
        [-0.041, 0.011, -0.03],
        [0.07, 0.006, 0.021],
        [-0.004, 0.03, 0.055],
        [0.013, -0.022, 0.06],
        [0.035, 0.041, -0.02],
    ],
)


def path(t, waypoints=WAYPOINTS, speed=50.0, stop=0.1, percent=100.0, top=np.inf):
    """Return positions (n, 3) at times (n,): straight lines, a stop at each waypoint, 0 at the start."""
    length = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    fast = np.where(np.arange(len(length)) % 3 == 1, 1.0, 0.6) * speed
    duration = length / np.minimum(fast * percent / 100.0, top)
    start = np.concatenate([[0.0], np.cumsum(duration + stop)])[:-1]
    times = np.stack([start, start + duration], axis=1).ravel()
    places = np.stack([waypoints[:-1], waypoints[1:]], axis=1).reshape(-1, 3)
    return np.stack([np.interp(t, times, places[:, axis]) for axis in range(3)], axis=1)


def joints_deg(position):
    return JOINTS + position @ PER_MM.T + 2e-4 * (position @ PER_MM.T) ** 2


def duration(**how):
    t = np.arange(0.0, 200.0, 0.1)
    moving = np.flatnonzero(np.abs(np.diff(path(t, **how), axis=0)).max(axis=1) > 0)
    return float(t[moving[-1] + 1])


def controller(dt=0.012, lag=0.02, seed=1, t=None, **how):
    """Return the columns of controller.csv."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration(**how), dt) if t is None else t
    position, late = path(t, **how), path(t - lag, **how)
    columns = {"t_s": t}
    columns |= {f"{axis}_cmd_mm": position[:, i] for i, axis in enumerate("xyz")}
    columns |= {f"{angle}_cmd_deg": np.full(len(t), 10.0 * i) for i, angle in enumerate("abc")}
    columns |= {f"q{i + 1}_cmd_deg": joints_deg(position)[:, i] for i in range(6)}
    act = joints_deg(late) + rng.normal(0.0, 2e-4, (len(t), 6))
    columns |= {f"q{i + 1}_act_deg": act[:, i] for i in range(6)}
    return columns


def tracker(dt=0.01, seed=2, offset=0.0, t=None, **how):
    """Return the columns of tracker.csv: the path with noise, ``offset`` seconds late on its clock."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration(**how), dt) if t is None else t
    position = path(t, **how) + rng.normal(0.0, 0.03, (len(t), 3))
    return {"t_s": t + offset} | {f"{axis}_mm": position[:, i] for i, axis in enumerate("xyz")}


def force(dt=0.004, seed=3):
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration(), dt)
    values = rng.normal([40.0, 120.0, -30.0], 3.0, (len(t), 3))
    return {"t_s": t} | {f"f{axis}_N": values[:, i] for i, axis in enumerate("xyz")}


def write(folder, name, columns):
    """Write a table as CSV or Parquet by its ending."""
    frame = pl.DataFrame(columns)
    file = folder / name
    frame.write_parquet(file) if file.suffix == ".parquet" else frame.write_csv(file)
    return file


def run_folder(folder, head="", **tables):
    """Write a run; tables as ``controller=columns``."""
    folder.mkdir(exist_ok=True)
    (folder / "run.toml").write_text(head, encoding="utf-8")
    for name, columns in tables.items():
        if columns is not None:
            write(folder, f"{name}.csv", columns)
    return folder
