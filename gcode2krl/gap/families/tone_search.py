"""Tones: one frequency of time, or of a joint's angle, that the data must find."""

from collections.abc import Iterator, Sequence

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.families.columns import Columns
from gcode2krl.gap.families.evidence import Evidence, evidence_of
from gcode2krl.gap.families.grid import Place
from gcode2krl.gap.families.rows import Rows
from gcode2krl.gap.families.view import View
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.families
_FINER = 4
"""Frequencies that are tried for each that the length of a run can tell."""
_BINS = 4096
"""Of an angle's range: a quarter as many waves of it can be told; lines of encoders and teeth are within."""
_PEAKS = 2


def tones(rows: Rows, view: View, place: Place, signs: Floats) -> Iterator[Evidence]:
    """Yield the evidence of the strongest tones at a place, each run with a phase of its own."""
    if place.where is Where.JOINT and rows.traces[0].link.of_tip:
        return  # what turns a joint to and fro moves the tip
    hz, power, count = _spectrum(rows, view)
    for peak in _peaks(power):
        raw = list(_tone_columns(place, rows.traces, float(hz[peak])))
        columns = Columns(rows.of(raw, place.component))
        found = evidence_of(
            view,
            place,
            Dependence.TONE,
            raw,
            columns,
            (np.eye(len(columns)),),
            signs,
            at=(-1, float(hz[peak])),
            cost=float(np.log(count)),
        )
        if found is not None:
            yield found


def _spectrum(rows: Rows, view: View) -> tuple[Floats, Floats, int]:
    """Return frequencies, the power at them over all runs, and how many of them are independent."""
    length = _FINER * max(len(starts) for starts in rows.starts)
    hz: Floats = np.asarray(np.fft.rfftfreq(length, rows.step_s), dtype=np.float64)
    power = np.zeros(len(hz))
    for own in _of_runs(rows, view):
        power += np.sum(np.abs(np.fft.rfft(own, length, axis=1)) ** 2, axis=0)
    inside = (hz >= _LIMITS.tone_least_hz) & (hz <= 0.45 / rows.step_s)
    return hz[inside], power[inside], max(1, int(inside.sum()) // _FINER)


def _of_runs(rows: Rows, view: View) -> Iterator[Floats]:
    """Yield the projected residual (k, blocks) of each run."""
    k = len(np.unique(view.components))
    ends = np.cumsum([k * len(starts) for starts in rows.starts])[:-1]
    for own in np.split(view.projected, ends):
        yield own.reshape(k, -1)


def _peaks(power: Floats) -> list[int]:
    """Return the places of the highest peaks, none within a resolved frequency of a higher one."""
    found: list[int] = []
    for i in np.argsort(-power):
        if all(abs(int(i) - other) > 2 * _FINER for other in found):
            found.append(int(i))
        if len(found) == _PEAKS:
            break
    return found


def _tone_columns(place: Place, traces: Sequence[Trace], hz: float) -> Iterator[Floats]:
    for number, (trace, unit) in enumerate(zip(traces, place.units, strict=True)):
        turn = 2.0 * np.pi * hz * trace.time_s
        wave = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        k, n, d = unit.shape
        columns = np.zeros((k, n, len(traces), 2, d))
        columns[:, :, number] = wave[None, :, :, None] * unit[:, :, None, :]
        yield columns.reshape(k, n, -1)


def angle_tones(rows: Rows, view: View, place: Place, signs: Floats) -> Iterator[Evidence]:
    """Yield the evidence of the strongest frequency of a joint's own angle, the same in all runs."""
    if place.joint is None or place.component is None:
        return
    angles = [_angle(trace, place.joint) for trace in rows.traces]
    orders, power = _orders(
        np.concatenate([angle[starts] for angle, starts in zip(angles, rows.starts, strict=True)]),
        view.projected,
    )
    order = float(orders[int(np.argmax(power))])
    raw = [
        unit * np.stack([np.cos(order * angle), np.sin(order * angle)], axis=1)[None]
        for angle, unit in zip(angles, place.units, strict=True)
    ]
    found = evidence_of(
        view,
        place,
        Dependence.MOTOR_ANGLE,
        raw,
        Columns(rows.of(raw, place.component)),
        (np.eye(2),),
        signs,
        at=(-1, order),
        cost=float(np.log(len(orders) / _FINER)),
    )
    if found is not None:
        yield found


def _angle(trace: Trace, joint: int) -> Floats:
    """Return the commanded angle (n,) of a joint."""
    angle: Floats = np.interp(trace.time_s, trace.inputs.time_s, trace.inputs.q_cmd_rad[:, joint])
    return angle


def _orders(angle: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return orders, in waves by rad times 2·pi, and the power of values (n,) at them, by bins."""
    reach = max(float(np.ptp(angle)), 1e-9)
    bins = np.minimum((_BINS * (angle - angle.min()) / reach).astype(int), _BINS - 1)
    spectrum = np.fft.rfft(np.bincount(bins, values, minlength=_BINS), _FINER * _BINS)
    orders = 2.0 * np.pi * np.arange(len(spectrum)) / (_FINER * reach)
    used = slice(2 * _FINER, _FINER * _BINS // 4)
    power: Floats = np.abs(spectrum[used]) ** 2
    return np.asarray(orders[used], dtype=np.float64), power
