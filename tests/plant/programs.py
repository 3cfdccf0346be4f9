"""Test programs as plain data: rows to drive, or joints over time, with dwells, spindle and hung weights.

Nothing here knows where a program comes from; it is numbers in a dictionary.
"""

from dataclasses import dataclass

import numpy as np

from tests.plant.scene import RAPID_mm_s
from tests.plant.waypoints import PROGRAMS, Waypoints

LONG_s = 20.0  # of a longer dwell only the ends are logged
SHOWN_s = 5.0  # at either end


@dataclass(frozen=True)
class Track:
    """Commanded joints over time, which no law of the plant changes: (n,) and (n, 6)."""

    t_s: np.ndarray
    q_rad: np.ndarray


@dataclass(frozen=True)
class Weight:
    """A known mass that hangs on the tool for a while, its centre in the tool frame, or a known pull."""

    from_s: float
    to_s: float
    kg: float = 0.0
    pull_N: tuple[float, float, float] = (0.0, 0.0, 0.0)  # along `$BASE`, as by a rope over a pulley
    at_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Program:
    """One test program. `pauses`: time of the simulation and seconds that are not simulated there."""

    name: str
    way: Waypoints | Track
    spindle: tuple[tuple[float, float], ...] = ((0.0, 13000.0),)  # from second, rpm
    weights: tuple[Weight, ...] = ()
    pauses: tuple[tuple[float, float], ...] = ()


def program_of(data: dict) -> Program:
    """A program from plain data.

    `name`; `rows`, `track` or `repeats` (one of the plant's own programs); optional `spindle`
    [[from_s, rpm] …] and `weights` [{from_s, to_s, kg, pull_N, at_mm} …]. A row: `x_mm y_mm z_mm`, optional
    `a_deg b_deg c_deg` (0), `speed_mm_s` (rapid), `cdis_mm` (0, an exact stop), `hold_s` (0), `cutting`
    (false); row 0 is where the robot waits.
    `track`: `t_s` (n) from 0 and `q_deg` (n, 6). Raises ValueError for what is neither.
    """
    if sum(key in data for key in ("rows", "track", "repeats")) != 1:
        raise ValueError(f"program {data.get('name')!r} needs one of 'rows', 'track', 'repeats'")
    spindle = tuple((float(t), float(rpm)) for t, rpm in data.get("spindle", [(0.0, 13000.0)]))
    weights = tuple(Weight(**entry) for entry in data.get("weights", []))
    way: Waypoints | Track
    pauses: tuple = ()
    if "rows" in data:
        way = _rows(data["rows"])
    elif "repeats" in data:
        way = PROGRAMS[data["repeats"]]().waypoints()
    else:
        way, pauses = _track(np.array(data["track"]["t_s"], float), np.array(data["track"]["q_deg"], float))
    return Program(str(data["name"]), way, spindle, weights, pauses)


def _rows(rows: list[dict]) -> Waypoints:
    """Rows as arrays. A row in place with another orientation turns during its hold."""

    def column(name: str, default: float) -> np.ndarray:
        return np.array([float(row.get(name, default)) for row in rows])

    place = np.array([[float(row[f"{a}_mm"]) for a in "xyz"] for row in rows])
    turns = np.stack([column(f"{a}_deg", 0.0) for a in "abc"], axis=1)
    cdis = column("cdis_mm", 0.0)
    cdis[[0, -1]] = 0.0
    turned = np.any(np.diff(turns, axis=0) != 0.0, axis=1)
    if np.any((cdis[1:] > 0.0) & turned) or np.any((cdis[:-1] > 0.0) & turned):
        raise ValueError("a move that turns the tool must begin and end with an exact stop")
    hold = column("hold_s", 0.0)
    turning = np.append(False, turned)  # a turn in place takes its hold and is simulated
    left_out = np.where((hold > LONG_s) & ~turning, hold - 2.0 * SHOWN_s, 0.0)
    cutting = np.array([bool(row.get("cutting", False)) for row in rows])
    speed = column("speed_mm_s", RAPID_mm_s)
    return Waypoints(place, speed, cdis, hold - left_out, cutting, turns, left_out)


def _track(t_s: np.ndarray, q_deg: np.ndarray) -> tuple[Track, tuple]:
    """Joints over time without the middle of long stands, and where these were."""
    if q_deg.shape != (len(t_s), 6) or len(t_s) < 2 or np.any(np.diff(t_s) <= 0.0):
        raise ValueError("a track needs rising times (n) and six joints (n, 6)")
    still = np.concatenate([np.abs(np.diff(q_deg, axis=0)).max(axis=1) < 1e-9, [False]])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    keep, pauses, gone = np.ones(len(t_s), bool), [], 0.0
    out_s = t_s - t_s[0]
    moved = out_s.copy()
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        length = out_s[last] - out_s[first]
        if length <= LONG_s:
            continue
        left_out = length - 2.0 * SHOWN_s
        middle = out_s[first] + SHOWN_s
        keep &= ~((out_s > middle) & (out_s < middle + left_out))
        pauses.append((middle - gone, left_out))
        moved[out_s >= middle + left_out] -= left_out
        gone += left_out
    return Track(moved[keep], np.radians(q_deg[keep])), tuple(pauses)
