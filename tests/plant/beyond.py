"""What of an effect normal mismatch could not do: its change less columns of mismatch within their bounds.

Of places a shift and a turn of each run and its tracker's clock; of forces the zero and the clock of each
run, and one gain of sensor and cut; of joints the clock of the encoders in each run and the lag of each
motor. That stiffness may be a few percent off is left out, so that the figure is rather too large.
"""

import numpy as np
from scipy.optimize import lsq_linear

from tests.plant import truth
from tests.plant.instruments import Instruments
from tests.plant.mismatch import BOUNDS

ROWS = 250  # of each run: bounded fits need no more
AXES = np.eye(3)


def left_by_mismatch(changes: list[dict], bare: list[dict], signal: str, how: Instruments) -> float | None:
    """RMS of a column that mismatch leaves of a change, over the noise; None where no law is known."""
    if signal not in LAWS:
        return None
    shared, own, changed = [], [], []
    for run, tables in zip(changes, bare, strict=True):
        time_s, change = run[signal]
        values = truth.signals(tables)[signal][1][: len(time_s)]
        rows = np.unique(np.linspace(0, len(time_s) - 1, ROWS).astype(int))
        alike, of_run = LAWS[signal](tables, time_s, values)
        shared.append(alike[rows])
        own.append(of_run[rows])
        changed.append(change[rows])
    if signal.startswith("joint"):
        mean = np.concatenate(changed).mean(axis=0)
        changed = [each - mean for each in changed]
    rest = _left(np.concatenate(changed), shared, own)
    square = np.mean(rest**2, axis=0)
    rms = np.sqrt(square.max() if signal.startswith("joint") else square.mean())
    return float(rms / truth.noise_of(signal, how))


def _left(change: np.ndarray, shared: list[np.ndarray], own: list[np.ndarray]) -> np.ndarray:
    """What columns (n, k, c), each within plus and minus one, leave of a change (n, k)."""
    n = [len(each) for each in own]
    blocks = np.zeros((sum(n), change.shape[1], sum(each.shape[2] for each in own)))
    first, at = 0, 0
    for rows, each in zip(n, own, strict=True):
        blocks[first : first + rows, :, at : at + each.shape[2]] = each
        first, at = first + rows, at + each.shape[2]
    columns = np.concatenate([np.concatenate(shared), blocks], axis=2).reshape(change.size, -1)
    columns = columns[:, np.any(columns != 0.0, axis=0)]
    if not columns.shape[1]:
        return change
    found = lsq_linear(columns, change.ravel(), bounds=(-1.0, 1.0))
    return change - (columns @ found.x).reshape(change.shape)


def _rate(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.gradient(values, time_s, axis=0)[:, :, None]


def _none(values: np.ndarray) -> np.ndarray:
    return np.zeros((*values.shape, 0))


def _of_places(tables: dict, time_s: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    shifts = np.broadcast_to(BOUNDS["shift_mm"] * AXES, (len(place), 3, 3))
    turns = BOUNDS["turn_rad"] * np.stack([np.cross(axis, place) for axis in AXES], axis=2)
    late = BOUNDS["clock_s"] * _rate(time_s, place)
    return _none(place), np.concatenate([shifts, turns, late], axis=2)


def _of_forces(tables: dict, time_s: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    zeros = np.broadcast_to(BOUNDS["force_zero_N"] * AXES, (len(force), 3, 3))
    late = BOUNDS["clock_s"] * _rate(time_s, force)
    return (BOUNDS["gain"] + BOUNDS["coefficients"]) * force[:, :, None], np.concatenate(
        [zeros, late], axis=2
    )


def _of_joints(tables: dict, time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    table = tables["controller"]
    turned = np.stack([table[f"q{j}_cmd_deg"] for j in range(1, 7)], axis=1)[: len(values)]
    rate = _rate(time_s, turned)
    lags = BOUNDS["lag_s"] * rate * np.eye(6)
    return lags, BOUNDS["clock_s"] * rate


LAWS = {"tcp": _of_places, "force": _of_forces, "joint_actual": _of_joints, "joint_load": _of_joints}
