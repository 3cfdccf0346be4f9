"""Which simple effects of the library could stand in for an effect on the data of a case.

The change that an effect makes is fitted by the columns of a frame, of an offset, of a warming; what is left
over, in units of the noise, says whether data could ever part the two. Mismatch is not counted, so the truth
is parted at most this well.
"""

import numpy as np

from tests.plant import truth
from tests.plant.instruments import Instruments
from tests.plant.plans import Day

TIMES_h = (0.05, 0.2, 0.6, 2.0, 8.0)  # of a warming, whatever it really was
TIMES_s = (1.0, 3.0, 10.0)  # of a growth since the start of the run
CLOSE = 1.0  # times the noise; what is left over of a stand-in is at most this


def stand_ins(
    changes: list[dict], bare: list[dict], days: tuple[Day, ...], main: str, how: Instruments
) -> list[dict]:
    """Stand-ins with what they leave over, the best first, where tracker, force sensor or motor see it."""
    if main == "joint_actual":
        return _close({"servo_lag": _lagging(changes, bare)}, main, how)
    if main not in ("tcp", "force"):
        return []
    table = "tracker" if main == "tcp" else "force"
    change = np.concatenate([run[main][1] for run in changes])
    rows = [run[main][0] for run in changes]
    hours = np.concatenate([(day.age_s + t) / 3600.0 for day, t in zip(days, rows, strict=True)])
    since = np.concatenate(rows)
    if main == "tcp":
        n = [len(t) for t in rows]
        place = [
            np.stack([run[table][f"{a}_mm"][:k] for a in "xyz"], axis=1)
            for run, k in zip(bare, n, strict=True)
        ]
        fits = _of_places(change, np.concatenate(place), hours, since)
    else:
        fits = {
            "force_offset": _left(change, _along(np.ones(len(change)))),
            "force_drift": _left(change, _along(hours)),
        }
    return _close(fits, main, how)


def _lagging(changes: list[dict], bare: list[dict]) -> float:
    """RMS that a lag of one joint leaves, at the joint that changes most."""
    change = np.concatenate([run["joint_actual"][1] for run in changes])
    change = change - change.mean(axis=0)
    j = int(np.argmax(np.mean(change**2, axis=0)))
    rates = []
    for run, change_of_run in zip(bare, changes, strict=True):
        t, n = run["controller"]["t_s"], len(change_of_run["joint_actual"][0])
        rates.append(np.gradient(run["controller"][f"q{j + 1}_cmd_deg"], t)[:n])
    rate = np.concatenate(rates)
    return _left(change[:, j], np.stack([rate, np.ones(len(rate))], axis=1))


def _close(fits: dict[str, float], main: str, how: Instruments) -> list[dict]:
    """Those that leave no more than the noise."""
    noise = truth.noise_of(main, how)
    out = [{"effect": name, "left_over": float(rms / noise)} for name, rms in fits.items()]
    return sorted((s for s in out if s["left_over"] <= CLOSE), key=lambda s: s["left_over"])


def _of_places(change, place, hours, since) -> dict[str, float]:
    return {
        "base_frame": _left(change, _frame(place)),
        "tool_frame": _left(change, _along(np.ones(len(change)))),
        "tracker_drift": _left(change, _along(hours)),
        "thermal": min(_left(change, _along(-np.expm1(-hours / t))) for t in TIMES_h),
        "tool_frame and thermal": min(
            _left(
                change, np.concatenate([_along(np.ones(len(change))), _along(-np.expm1(-hours / t))], axis=2)
            )
            for t in TIMES_h
        ),
        "spindle_growth": min(_left(change, _along(-np.expm1(-since / t))[:, :, 2:]) for t in TIMES_s),
    }


def _along(course: np.ndarray) -> np.ndarray:
    """One course in time along x, y and z, (n, 3, 3)."""
    return course[:, None, None] * np.eye(3)


def _frame(place: np.ndarray) -> np.ndarray:
    """A small shift and turn of all places, (n, 3, 6)."""
    about = place - place.mean(axis=0)
    turns = np.stack([np.cross(e, about) for e in np.eye(3)], axis=2) / 100.0
    return np.concatenate([_along(np.ones(len(place))), turns], axis=2)


def _left(change: np.ndarray, columns: np.ndarray) -> float:
    """RMS of a column that the best combination of columns leaves."""
    a, b = columns.reshape(change.size, -1), change.ravel()
    rest = b - a @ np.linalg.lstsq(a, b, rcond=None)[0]
    return float(np.sqrt(np.mean(rest**2)))
