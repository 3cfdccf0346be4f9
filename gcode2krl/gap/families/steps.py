"""Steps: from an unknown moment on, in the rest of that run and in all later ones."""

from collections.abc import Sequence

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.families.evidence import Evidence, evidence_of, log_evidence, log_mean
from gcode2krl.gap.families.grid import Place
from gcode2krl.gap.families.rows import Rows
from gcode2krl.gap.families.view import View
from gcode2krl.gap.thresholds import THRESHOLDS

_STEP_S = THRESHOLDS.families.step_s
_MOST = 40
"""Moments that are tried in one run."""
_FROM_END_S = 1.0
"""A step nearer to an end of a run is a difference between runs."""
_FINER = 10
"""So many times closer are those around the best."""

Moment = tuple[int, float]
"""Number of a trace and the time in it."""


class Steps:
    """Columns of steps at a place, at every moment that is tried."""

    def __init__(self, rows: Rows, place: Place) -> None:
        self.rows, self.place, self.traces = rows, place, rows.traces
        self.order: Ints = np.argsort([trace.inputs.hours for trace in self.traces], kind="stable")
        """Numbers of the traces in the order of the runs."""
        self.every_s = [max(_STEP_S, (t.time_s[-1] - t.time_s[0]) / _MOST) for t in self.traces]

    def _times(self, number: int) -> Floats:
        """Return the moments in a trace; at its ends a step is a difference between runs."""
        trace, every_s = self.traces[number], self.every_s[number]
        times: Floats = np.arange(trace.time_s[0] + _FROM_END_S, trace.time_s[-1] - _FROM_END_S, every_s)
        return times

    def coarse(self) -> list[Moment]:
        """Return the moments of the first search."""
        return [(number, float(time)) for number in range(len(self.traces)) for time in self._times(number)]

    def finer(self, moment: Moment) -> list[Moment]:
        """Return the moments around one."""
        number, time_s = moment
        trace, reach = self.traces[number], self.every_s[number]
        times = time_s + reach * np.arange(-_FINER + 1, _FINER) / _FINER
        low, high = trace.time_s[0] + _FROM_END_S, trace.time_s[-1] - _FROM_END_S
        return [(number, float(t)) for t in times if low <= t <= high]

    def blocks(self, moments: Sequence[Moment]) -> Floats:
        """Return the columns of moments whitened and in blocks, (v, moments·d)."""
        return self.rows.of(self.columns(moments), self.place.component)

    def columns(self, moments: Sequence[Moment]) -> list[Floats]:
        """Return the columns (k, n, moments·d) of each trace."""
        place_of = np.argsort(self.order)
        found = []
        for number, (trace, unit) in enumerate(zip(self.traces, self.place.units, strict=True)):
            after = np.stack(
                [
                    trace.time_s >= time
                    if run == number
                    else np.full(len(trace.time_s), place_of[number] > place_of[run])
                    for run, time in moments
                ],
                axis=1,
            )
            columns = after[None, :, :, None] * unit[:, :, None, :]
            found.append(columns.reshape(*unit.shape[:2], -1))
        return found


def scan(view: View, steps: Steps, columns: Floats, signs: Floats) -> tuple[Floats, Floats]:
    """Return the log evidence (moments,) of steps, and its mean over moments (flips,) for random signs.

    ``columns`` (v, moments·d).
    """
    d = steps.place.units[0].shape[2]
    projected = view.without_fixed(columns)
    shape = (len(columns), -1, d)
    gram = np.einsum("vmi,vmj->mij", columns.reshape(shape), projected.reshape(shape))
    values, vectors = np.linalg.eigh((gram + gram.swapaxes(1, 2)) / 2.0)
    values = np.maximum(values, 0.0)
    score = (columns.T @ view.projected).reshape(-1, d)
    flipped = (signs @ view.scores(projected)).reshape(len(signs), len(gram), d)
    own = _each(values, np.einsum("mij,mi->mj", vectors, score))
    random = _each(values, np.einsum("mij,fmi->fmj", vectors, flipped))
    return own, log_mean(random)


def _each(values: Floats, scores: Floats) -> Floats:
    """Return the log evidence (…, m) of each moment from its eigenvalues (m, d) and scores (…, m, d)."""
    moments = [log_mean(log_evidence(own, scores[..., m, :])) for m, own in enumerate(values)]
    return np.stack(moments, axis=-1)


def step_evidence(view: View, steps: Steps, coarse: Floats, signs: Floats) -> Evidence | None:
    """Return the evidence of a step at the best moment; ``coarse`` (v, moments·d) are the columns of all."""
    if coarse.shape[1] == 0:
        return None
    moments = steps.coarse()
    own, flipped = scan(view, steps, coarse, signs)
    finer = steps.finer(moments[int(np.argmax(own))])
    fine = steps.blocks(finer)
    near, _ = scan(view, steps, fine, signs[:0])
    best = int(np.argmax(near))
    d = steps.place.units[0].shape[2]
    cost = float(np.max(own) - log_mean(own))
    found = evidence_of(
        view,
        steps.place,
        Dependence.RUN_TIME_STEP,
        steps.columns(finer[best : best + 1]),
        fine[:, best * d : (best + 1) * d],
        (np.eye(d),),
        signs,
        at=finer[best],
        cost=cost,
    )
    return None if found is None else found.flipped_as(flipped)
