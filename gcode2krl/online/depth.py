"""How much of the depth error a compensation takes away, by where it turns an axis.

Haehn & Weigold 2020, section 3.3: the depth of grooves is compensated worse where an axis-specific correction
is opposed to the motion of the axis. They assume that the controller takes play out of what it computes, but
not out of what is sent to the axes. A correction is *against* the program where an axis that carries the
depth moves, with its correction, the other way than the program moves it: there the play is on the side that
the controller does not know of. An opposed correction that is slower than the program only slows the axis.
"""

from typing import Any, NamedTuple

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects.operators import since_reversal
from gcode2krl.online.judge import Judged
from gcode2krl.online.plant import reaction, tip_shift_mm
from gcode2krl.online.twin import Case, Twin, TwinRun, axis_shift

_CARRIES = 0.1
"""An axis with a smaller share of the depth of the correction is left out."""
_SMALL_RAD = 1e-5


class Depth(NamedTuple):
    """The depth of the floors that stay, over samples of one kind."""

    share: float
    """Of the judged samples."""
    uncompensated_mm: float
    """Root mean square of the depth error without compensation."""
    removed_percent: dict[Case, float]
    """How much less that is with each compensation."""
    achieved: dict[Case, float]
    """Depth that the robot has moved by over the depth that was sent, once lag is taken out: 1 is exact."""


def depth_by_side(twin: Twin, runs: "dict[Case, TwinRun]", judged: Judged) -> dict[str, Any] | None:
    """Return `Depth` as plain values for corrections ``with`` and ``against`` the program's axes.

    A kind that no sample has is None; all is None without an axis-specific case.
    """
    run = runs.get("axis")
    if run is None or run.device is None or not judged.counts.any():
        return None
    against = _against(twin, run)
    kinds = {"with": judged.counts & ~against, "against": judged.counts & against}
    whole = int(np.count_nonzero(judged.counts))
    return {
        kind: _depth(twin, runs, where, whole)._asdict() if where.any() else None
        for kind, where in kinds.items()
    }


def tool_axis(twin: Twin) -> Floats:
    """Return the tool's axis (n, 3) along ``$BASE``."""
    x, y, z, w = twin.motion.rotation.T
    return np.stack([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)], axis=1)


def _against(twin: Twin, run: TwinRun) -> Bools:
    """Return (n,) True where an axis that carries the depth goes the other way than its program."""
    q, time_s = twin.joints.q_rad, run.time_s
    sent = axis_shift(twin, run)
    axis = tool_axis(twin)
    deep = np.zeros_like(q)
    for joint in range(q.shape[1]):
        turned = q.copy()
        turned[:, joint] += _SMALL_RAD
        per_rad = tip_shift_mm(turned, q, twin.cell, twin.tool) / _SMALL_RAD
        deep[:, joint] = np.abs(np.einsum("ij,ij->i", per_rad, axis) * sent[:, joint])
    carries = deep > _CARRIES * np.maximum(deep.sum(axis=1, keepdims=True), 1e-12)
    against = np.zeros(len(q), dtype=np.bool_)
    for joint in range(q.shape[1]):
        programmed, _ = since_reversal(q[:, joint], time_s)
        corrected, _ = since_reversal(q[:, joint] + sent[:, joint], time_s)
        against |= carries[:, joint] & (programmed * corrected < 0.0)
    return against


def _depth(twin: Twin, runs: "dict[Case, TwinRun]", where: Bools, whole: int) -> Depth:
    axis = tool_axis(twin)[where]

    def along(vector: Floats) -> Floats:
        return np.asarray(np.einsum("ij,ij->i", vector[where], axis))

    def rms(vector: Floats) -> float:
        return float(np.sqrt(np.mean(along(vector) ** 2)))

    before = rms(runs["uncompensated"].error_mm)
    cases = [case for case in runs if case != "uncompensated"]
    achieved: dict[Case, float] = {}
    for case in cases:
        moved, meant = along(runs[case].shift_mm), along(_meant(twin, runs[case]))
        achieved[case] = float(moved @ meant / max(float(meant @ meant), 1e-12))
    removed: dict[Case, float] = {
        case: 100.0 * (1.0 - rms(runs[case].error_mm) / max(before, 1e-12)) for case in cases
    }
    return Depth(float(np.count_nonzero(where) / whole), before, removed, achieved)


def _meant(twin: Twin, run: TwinRun) -> Floats:
    """Return the shift (n, 3) of the tip that drives without play make of what was sent."""
    if run.device is None:
        return np.zeros_like(run.shift_mm)
    if run.device.correction.shape[1] == 3:
        return reaction(run.device.correction, run.time_s, twin.world.dead_s, twin.world.lag_s)
    q = twin.joints.q_rad
    return tip_shift_mm(q + axis_shift(twin, run), q, twin.cell, twin.tool)
