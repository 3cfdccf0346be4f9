"""Steps: from an unknown moment on, in the rest of that run and in all later ones, or gone in the next."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects.dependence import Dependence
from gcode2krl.gap.families.columns import Beside, Columns
from gcode2krl.gap.families.evidence import AMPLITUDES, Evidence, evidence_of, log_mean
from gcode2krl.gap.families.grid import Place
from gcode2krl.gap.families.rows import Rows
from gcode2krl.gap.families.view import View
from gcode2krl.gap.thresholds import THRESHOLDS

_STEP_S = THRESHOLDS.families.step_s
_MOST = 40
"""Moments that are tried in one run."""
_FROM_END_S = 1.0
"""A step nearer to an end of a run is a difference between runs."""
_AT_ONCE = 40
"""Moments whose columns are made together."""
_FINER = 10
"""So many times closer are those around the best."""

Moment = tuple[int, float, bool]
"""Number of a trace, the time in it, and whether later runs have the step, too: it may be mended."""


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
        return [
            (number, float(time), stays)
            for number in range(len(self.traces))
            for stays in ((True,) if number == self.order[-1] else (True, False))
            for time in self._times(number)
        ]

    def finer(self, moment: Moment) -> list[Moment]:
        """Return the moments around one."""
        number, time_s, stays = moment
        trace, reach = self.traces[number], self.every_s[number]
        times = time_s + reach * np.arange(-_FINER + 1, _FINER) / _FINER
        low, high = trace.time_s[0] + _FROM_END_S, trace.time_s[-1] - _FROM_END_S
        return [(number, float(t), stays) for t in times if low <= t <= high]

    def blocks(self, moments: Sequence[Moment]) -> Floats:
        """Return the columns of moments whitened and in blocks, (v, moments·d).

        In a run whose moment it is not a step is nothing or all: these two are whitened once.
        """
        width = max(sum(run == n for run, *_ in moments) for n in range(len(self.traces)))
        raw, chosen = [], []
        for number, (trace, unit) in enumerate(zip(self.traces, self.place.units, strict=True)):
            after = np.zeros((len(trace.time_s), width + 2))
            after[:, width] = 1.0
            own = [i for i, (run, *_) in enumerate(moments) if run == number]
            for column, i in enumerate(own):
                after[:, column] = trace.time_s >= moments[i][1]
            at = np.array([width + 1 - self._is_in(number, each) for each in moments], dtype=int)
            at[own] = np.arange(len(own))
            raw.append(_lifted(after, unit))
            chosen.append(at)
        white, d = self.rows.of(raw, self.place.component), self.place.width
        counts = zip(self.place.units, self.rows.starts, strict=True)
        ends = np.cumsum([len(unit) * len(starts) for unit, starts in counts])
        columns = np.empty((len(white), len(moments), d))
        parts = zip(np.split(white, ends[:-1]), np.split(columns, ends[:-1]), chosen, strict=True)
        for part, into, at in parts:
            into[:] = part.reshape(len(part), -1, d)[:, at]
        return columns.reshape(len(white), -1)

    def _is_in(self, number: int, moment: Moment) -> bool:
        """Tell whether all of another trace is behind a moment's step."""
        run, _, stays = moment
        place_of = np.argsort(self.order)
        return stays and bool(place_of[number] > place_of[run])

    def columns(self, moments: Sequence[Moment]) -> list[Floats]:
        """Return the columns (k, n, moments·d) of each trace."""
        found = []
        for number, (trace, unit) in enumerate(zip(self.traces, self.place.units, strict=True)):
            after = np.stack(
                [
                    trace.time_s >= moment[1]
                    if moment[0] == number
                    else np.full(len(trace.time_s), self._is_in(number, moment))
                    for moment in moments
                ],
                axis=1,
            )
            found.append(_lifted(after, unit))
        return found


def _lifted(after: Floats, unit: Floats) -> Floats:
    """Return columns (k, n, moments·d) of what is after each moment (n, moments) at a place (k, n, d)."""
    columns: Floats = after[None, :, :, None] * unit[:, :, None, :]
    return columns.reshape(*unit.shape[:2], -1)


def scan(view: View, steps: Steps, columns: Columns, signs: Floats) -> tuple[Floats, Floats]:
    """Return the log evidence (moments,) of steps, and that (flips, moments) for random signs.

    ``columns`` of these moments, d a moment.
    """
    d = steps.place.width
    beside = Beside(view, columns)
    own = columns.values.reshape(len(columns.values), -1, d)
    fixed, taken = beside.fixed.reshape(own.shape[1], d, -1), beside.taken.T.reshape(own.shape[1], d, -1)
    gram = np.einsum("vmi,vmj->mij", own, own) - fixed @ taken.swapaxes(1, 2)
    values, vectors = np.linalg.eigh((gram + gram.swapaxes(1, 2)) / 2.0)
    values = np.maximum(values, 0.0)
    score = beside.score.reshape(-1, d)
    evidence = _each(values, np.einsum("mij,mi->mj", vectors, score))
    if not len(signs):
        return evidence, np.zeros((0, len(evidence)))
    flipped = (signs @ beside.scores).reshape(len(signs), len(gram), d)
    return evidence, _each(values, np.einsum("mij,fmi->fmj", vectors, flipped))


def _each(values: Floats, scores: Floats) -> Floats:
    """Return the log evidence (…, m) of each moment from its eigenvalues (m, d) and scores (…, m, d).

    `log_evidence` and its mean over the amplitudes, of all moments at once.
    """
    squares = AMPLITUDES[:, None] ** 2
    grown = squares * values[:, None]
    falls = np.moveaxis(scores**2, -2, 0)  # (m, …, d)
    shrunk = (squares / (1.0 + grown)).swapaxes(1, 2)
    fall = falls.reshape(len(values), -1, values.shape[1]) @ shrunk
    evidence = log_mean(0.5 * fall - 0.5 * np.log1p(grown).sum(axis=-1)[:, None])
    each: Floats = np.moveaxis(evidence.reshape(falls.shape[:-1]), 0, -1)
    return each


def step_evidence(view: View, steps: Steps, signs: Floats) -> Evidence | None:
    """Return the evidence of a step at the best moment."""
    moments = steps.coarse()
    if not moments:
        return None
    # some moments at a time: the columns of all are many times the data
    some = [moments[first : first + _AT_ONCE] for first in range(0, len(moments), _AT_ONCE)]
    scans = [scan(view, steps, Columns(steps.blocks(each)), signs) for each in some]
    own, flipped = (np.concatenate(each, axis=-1) for each in zip(*scans, strict=True))
    finer = steps.finer(moments[int(np.argmax(own))])
    fine = steps.blocks(finer)
    near, _ = scan(view, steps, Columns(fine), signs[:0])
    best = int(np.argmax(near))
    d = steps.place.width
    cost = float(np.max(own) - log_mean(own))
    found = evidence_of(
        view,
        steps.place,
        Dependence.RUN_TIME_STEP,
        steps.columns(finer[best : best + 1]),
        Columns(fine[:, best * d : (best + 1) * d]),
        (np.eye(d),),
        signs,
        at=finer[best][:2],
        cost=cost,
    )
    return None if found is None else replace(found, flipped=log_mean(flipped), stays=finer[best][2])
