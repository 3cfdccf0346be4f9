"""All families of a link beside several views of its rest, and the null of the largest.

**Steps and tones.** Their moment or frequency is a number that the data must find: the mean of the evidences
over all positions pays for the search. A step lasts from an unknown moment on, in the rest of that run and in
all later ones, or is gone in the next.

**Directions.** Functions of an input may all move the tip, or the force, along one line.

**Families that contain others.** A smooth function can be a constant, what each run does over time anything.
The larger one is ahead where the least rest follows it. It is told before the smaller one only where its
evidence is larger by a share worth naming; what each run does over time is the last resort.

**Null.** Scores u_g = Σ_{i in g} B_i·r_i over stretches of time g (one second). If nothing admissible
explains the rest, their signs are arbitrary; the largest evidence over all families with signs drawn at
random is what the largest one has to exceed; for a gap by the Gumbel distribution of the flips. Few strong
stretches have few signs: there the evidence alone must be beyond what models of sound machines are off by.
What happens once, in a few rows, has a null of its own (`gcode2krl.gap.compare.events`), and so has what
moves a signal for tenths of a second (`gcode2krl.gap.posterior.excursions`).
"""

import functools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from gcode2krl.arrays import Floats, Ints
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.gap.compare.trace import Trace
from gcode2krl.gap.components import Family, Grid, Place
from gcode2krl.gap.posterior.families import (
    AMPLITUDES,
    Beside,
    Columns,
    Evidence,
    Rows,
    View,
    evidence_of,
    log_mean,
    moved_evidence,
)
from gcode2krl.gap.thresholds import THRESHOLDS


def along_one(
    view: View, every: Evidence | None, family: Family, columns: Columns, signs: Floats
) -> Evidence | None:
    """Return the evidence of a family along the one direction in which it says most; None where it has one.

    ``every``: what the family says along all of its axes. The direction is one that the data must find:
    of the mean over all of them (Laplace), the share of the hemisphere that is near the best one is
    1/gain. By chance it says no more than the family along all axes, whose null it has.
    """
    d = family.directions
    if every is None or d == 1 or len(columns) <= d:
        return None
    along = _main_axis(every, family)
    evidence = evidence_of(
        view,
        family.place,
        family.on,
        [_turned(each, along) for each in family.columns],
        Columns(_turned(columns.values, along)),
        [root[::d, ::d] for root in family.roots],  # the same for each axis: a Kronecker product
        signs,
        cost=float(np.log(max(every.gain, 1.0))),
    )
    return None if evidence is None else replace(evidence, flipped=every.flipped, unbounded=every.unbounded)


def _main_axis(every: Evidence, family: Family) -> Floats:
    """Return the direction (d,), in units of the place, along which a family has most of its signal."""
    units = [unit[:, 0] for unit in family.place.units]
    rows = np.concatenate([np.linalg.solve(u, own.T).T for u, own in zip(units, every.signal, strict=True)])
    return np.linalg.eigh(rows.T @ rows)[1][:, -1]


def _turned(columns: Floats, along: Floats) -> Floats:
    """Return columns (…, f·d) along a direction (d,), (…, f)."""
    return columns.reshape(*columns.shape[:-1], -1, len(along)) @ along


_CONSTANT = frozenset({Dependence.CONSTANT})
CONTAINS: Mapping[Dependence, frozenset[Dependence]] = MappingProxyType(
    {
        Dependence.FORCE_BY_PLACE: frozenset({Dependence.FORCE}),
        Dependence.RUN_TIME: frozenset(Dependence) - {Dependence.RUN_TIME, Dependence.TONE},
    }
    | dict.fromkeys(
        (
            Dependence.RUN_TO_RUN,
            Dependence.RUN_START,
            Dependence.TEMPERATURE,
            Dependence.TRAVEL,
            Dependence.OWN_ANGLE,
            Dependence.PLACE,
            Dependence.VELOCITY,
            Dependence.ACCELERATION,
        ),
        _CONSTANT,
    )
)
"""Family -> the smaller ones within it, at the same place. Time in each run has a function for each run."""


def simplest_first(evidences: Iterable[Evidence]) -> tuple[Evidence, ...]:
    """Return families, the most probable first; a smaller one changes evidence with one that contains it.

    Unless that one is ahead by more than `ahead_share` of its own evidence.
    """
    ranked = sorted(evidences, key=lambda evidence: -evidence.nats)
    moved = True
    while moved:  # a smaller one only ever rises
        moved = False
        for i, larger in enumerate(ranked):
            contained = (
                j
                for j, smaller in enumerate(ranked[i + 1 :], i + 1)
                if smaller.place.name == larger.place.name and smaller.on in CONTAINS.get(larger.on, ())
            )
            j = next(contained, None)
            if j is None or larger.nats - ranked[j].nats >= _ahead_share(larger) * larger.nats:
                continue
            ranked[i], ranked[j] = replace(ranked[j], nats=larger.nats), replace(larger, nats=ranked[j].nats)
            moved = True
    return tuple(ranked)


def _ahead_share(larger: Evidence) -> float:
    """Return the share of its evidence from which on a larger family is ahead of one within it."""
    is_time = larger.on is Dependence.RUN_TIME
    return THRESHOLDS.posterior.time_ahead_share if is_time else THRESHOLDS.posterior.ahead_share


_STEP_S = THRESHOLDS.posterior.step_s
_MOST = 40
"""Moments that are tried in one run."""
_FROM_END_S = 1.0
"""A step nearer to an end of a run is a difference between runs."""
_AT_ONCE = 40
"""Moments whose columns are made together."""
_STEPS_FINER = 10
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
        return np.arange(trace.time_s[0] + _FROM_END_S, trace.time_s[-1] - _FROM_END_S, every_s)

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
        times = time_s + reach * np.arange(-_STEPS_FINER + 1, _STEPS_FINER) / _STEPS_FINER
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
            of_run = [i for i, (run, *_) in enumerate(moments) if run == number]
            for column, i in enumerate(of_run):
                after[:, column] = trace.time_s >= moments[i][1]
            at = np.array([width + 1 - self._is_in(number, each) for each in moments], dtype=int)
            at[of_run] = np.arange(len(of_run))
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
        columns = []
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
            columns.append(_lifted(after, unit))
        return columns


def _lifted(after: Floats, unit: Floats) -> Floats:
    """Return columns (k, n, moments·d) of what is after each moment (n, moments) at a place (k, n, d)."""
    columns: Floats = after[None, :, :, None] * unit[:, :, None, :]
    return columns.reshape(*unit.shape[:2], -1)


def scan(view: View, steps: Steps, columns: Columns, signs: Floats) -> tuple[Floats, Floats]:
    """Return the log evidence (moments,) of steps, and that (flips, moments) for random signs.

    ``columns`` of these moments, d a moment.
    """
    d = steps.place.width
    projected = Beside(view, columns)
    by_moment = columns.values.reshape(len(columns.values), -1, d)
    fixed, taken = (
        projected.fixed.reshape(by_moment.shape[1], d, -1),
        projected.taken.T.reshape(by_moment.shape[1], d, -1),
    )
    gram = np.einsum("vmi,vmj->mij", by_moment, by_moment) - fixed @ taken.swapaxes(1, 2)
    values, vectors = np.linalg.eigh((gram + gram.swapaxes(1, 2)) / 2.0)
    values = np.maximum(values, 0.0)
    score = projected.score.reshape(-1, d)
    evidence = _each(values, np.einsum("mij,mi->mj", vectors, score))
    if not len(signs):
        return evidence, np.zeros((0, len(evidence)))
    flipped = (signs @ projected.scores).reshape(len(signs), len(gram), d)
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
    return np.moveaxis(evidence.reshape(falls.shape[:-1]), 0, -1)


def step_evidence(view: View, steps: Steps, signs: Floats) -> Evidence | None:
    """Return the evidence of a step at the best moment."""
    moments = steps.coarse()
    if not moments:
        return None
    # some moments at a time: the columns of all are many times the data
    some = [moments[first : first + _AT_ONCE] for first in range(0, len(moments), _AT_ONCE)]
    scans = [scan(view, steps, Columns(steps.blocks(each)), signs) for each in some]
    log_evidences, flipped = (np.concatenate(each, axis=-1) for each in zip(*scans, strict=True))
    finer = steps.finer(moments[int(np.argmax(log_evidences))])
    fine = steps.blocks(finer)
    near, _ = scan(view, steps, Columns(fine), signs[:0])
    best = int(np.argmax(near))
    d = steps.place.width
    cost = float(np.max(log_evidences) - log_mean(log_evidences))
    evidence = evidence_of(
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
    return None if evidence is None else replace(evidence, flipped=log_mean(flipped), stays=finer[best][2])


_LIMITS = THRESHOLDS.posterior
_TONES_FINER = 4
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
        evidence = evidence_of(
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
        if evidence is not None:
            yield evidence


def _spectrum(rows: Rows, view: View) -> tuple[Floats, Floats, int]:
    """Return frequencies, the power at them over all runs, and how many of them are independent."""
    length = _TONES_FINER * max(len(starts) for starts in rows.starts)
    hz: Floats = np.asarray(np.fft.rfftfreq(length, rows.step_s), dtype=np.float64)
    power = np.zeros(len(hz))
    for of_run in _of_runs(rows, view):
        power += np.sum(np.abs(np.fft.rfft(of_run, length, axis=1)) ** 2, axis=0)
    inside = (hz >= _LIMITS.tone_least_hz) & (hz <= 0.45 / rows.step_s)
    return hz[inside], power[inside], max(1, int(inside.sum()) // _TONES_FINER)


def _of_runs(rows: Rows, view: View) -> Iterator[Floats]:
    """Yield the projected residual (k, blocks) of each run."""
    k = len(np.unique(view.components))
    ends = np.cumsum([k * len(starts) for starts in rows.starts])[:-1]
    for of_run in np.split(view.projected, ends):
        yield of_run.reshape(k, -1)


def _peaks(power: Floats) -> list[int]:
    """Return the places of the highest peaks, none within a resolved frequency of a higher one."""
    peaks: list[int] = []
    for i in np.argsort(-power):
        if all(abs(int(i) - other) > 2 * _TONES_FINER for other in peaks):
            peaks.append(int(i))
        if len(peaks) == _PEAKS:
            break
    return peaks


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
    evidence = evidence_of(
        view,
        place,
        Dependence.MOTOR_ANGLE,
        raw,
        Columns(rows.of(raw, place.component)),
        (np.eye(2),),
        signs,
        at=(-1, order),
        cost=float(np.log(len(orders) / _TONES_FINER)),
    )
    if evidence is not None:
        yield evidence


def _angle(trace: Trace, joint: int) -> Floats:
    """Return the commanded angle (n,) of a joint."""
    return np.interp(trace.time_s, trace.inputs.time_s, trace.inputs.q_cmd_rad[:, joint])


def _orders(angle: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return orders, in waves by rad times 2·pi, and the power of values (n,) at them, by bins."""
    reach = max(float(np.ptp(angle)), 1e-9)
    bins = np.minimum((_BINS * (angle - angle.min()) / reach).astype(int), _BINS - 1)
    spectrum = np.fft.rfft(np.bincount(bins, values, minlength=_BINS), _TONES_FINER * _BINS)
    orders = 2.0 * np.pi * np.arange(len(spectrum)) / (_TONES_FINER * reach)
    used = slice(2 * _TONES_FINER, _TONES_FINER * _BINS // 4)
    power: Floats = np.abs(spectrum[used]) ** 2
    return np.asarray(orders[used], dtype=np.float64), power


_COMMANDED = (
    Dependence.OWN_ANGLE,
    Dependence.MOTOR_ANGLE,
    Dependence.REVERSALS,
    Dependence.OWN_TORQUE,
    Dependence.PLACE,
    Dependence.VELOCITY,
    Dependence.ACCELERATION,
    Dependence.JERK,
    Dependence.FORCE,
    Dependence.FORCE_BY_PLACE,
)
"""Where the robot is and what it does; what grows with time a drift of the instrument imitates."""


@dataclass(frozen=True, eq=False)
class Study:
    """What every family says of one view, the most probable first."""

    chi2: float
    """Of the view, with nothing explained."""
    evidences: tuple[Evidence, ...]
    p: float
    """Of an evidence as large as the largest, if nothing admissible explains what is left."""
    tail_p: float = 1.0
    """The same by the distribution of the largest (Gumbel 1935) that has the mean and deviation of the flips.

    That goes on where so many flips end.
    """

    moved: Callable[[], Floats] = field(default=lambda: np.zeros(0), repr=False)
    """(moves,) the largest evidence of what the command gives, where each run's rest is moved in time."""

    @cached_property
    def command_p(self) -> float:
        """Return p of the largest evidence of what the command gives, where runs are moved in time.

        Few strong stretches have few signs to flip, yet do not stand where the robot turns back by chance.
        Of its root, which is as an amplitude: the evidence itself has a longer tail than Gumbel's.
        """
        nats = max((each.unbounded for each in self.evidences if each.on in _COMMANDED), default=0.0)
        # of less a sound robot may have as much where its force is
        moved = self.moved() if nats >= _LIMITS.certain_evidence else np.zeros(0)
        return _tail_p(np.sqrt(np.maximum(moved, 0.0)), nats**0.5) if len(moved) else 1.0

    def p_of(self, evidence: Evidence) -> float:
        """Return p of one of its evidences; of what the command gives most, where runs are moved, too."""
        flipped = np.max(np.stack([each.flipped for each in self.evidences]), axis=0)
        p = _p(flipped, evidence.unbounded)
        if p <= _LIMITS.significant_p or evidence.on not in _COMMANDED:
            return p
        is_most = all(
            each.unbounded <= evidence.unbounded for each in self.evidences if each.on in _COMMANDED
        )
        return min(p, self.command_p) if is_most else p


@dataclass
class _Asked:
    """What families say of a view, one after the other: of each place and input the best is kept."""

    best: dict[object, Evidence] = field(default_factory=dict)
    unbounded: float = -np.inf
    flipped: Floats = field(default_factory=lambda: np.full(_LIMITS.flips, -np.inf))
    """(flips,) the largest of any for random signs of stretches."""

    def add(self, evidences: Iterable[Evidence | None]) -> None:
        """Take evidences; a None said nothing."""
        for evidence in evidences:
            if evidence is not None:
                self.unbounded = max(self.unbounded, evidence.unbounded)
                self.flipped = np.maximum(self.flipped, evidence.flipped)
                known = self.best.get(evidence.key)
                if known is None or evidence.nats > known.nats:
                    self.best[evidence.key] = evidence


def studies(rows: Rows, views: Sequence[View], grid: Grid, seed: int = 0) -> list[Study]:
    """Return what every family says of some views of the same rows."""
    asked = [_Asked() for _ in views]
    signs = [_signs(view, seed) for view in views]
    for family in grid.families():
        place = family.place
        columns = Columns(rows.of(family.columns, place.component))
        for view, of_view, sign in zip(views, asked, signs, strict=True):
            at = view.at(place.component)
            every = evidence_of(at, place, family.on, family.columns, columns, family.roots, sign)
            of_view.add([every, along_one(at, every, family, columns, sign)])
    for place in grid.places:
        for of_view, evidences in zip(asked, _searched(rows, views, place, signs), strict=True):
            of_view.add(evidences)
    return [
        _study(view, of_view, functools.partial(_moved, rows, view, grid))
        for view, of_view in zip(views, asked, strict=True)
    ]


def _searched(
    rows: Rows, views: Sequence[View], place: Place, signs: Sequence[Floats]
) -> Iterator[list[Evidence | None]]:
    """Yield for each view the families at a place whose moment or frequency the data must find."""
    steps = Steps(rows, place)
    for view, sign in zip(views, signs, strict=True):
        at = view.at(place.component)
        yield [
            step_evidence(at, steps, sign),
            *tones(rows, at, place, sign),
            *angle_tones(rows, at, place, sign),
        ]


def _signs(view: View, seed: int) -> Floats:
    """Return random signs (flips, g) of the stretches of time."""
    generator = np.random.default_rng(seed)
    shape = (_LIMITS.flips, view.members.shape[0])
    return np.where(generator.random(shape) < 0.5, -1.0, 1.0)


def _study(view: View, asked: _Asked, moved: Callable[[], Floats]) -> Study:
    """Return the study: one evidence for each place and input, and p of the largest."""
    if not asked.best:
        return Study(view.chi2, (), 1.0)
    p, tail_p = _p(asked.flipped, asked.unbounded), _tail_p(asked.flipped, asked.unbounded)
    return Study(view.chi2, simplest_first(asked.best.values()), p, tail_p, moved)


def _p(random: Floats, nats: float) -> float:
    """Return p of an evidence, from the largest over all families (flips,) for random signs of stretches."""
    return (1.0 + float(np.sum(random >= nats))) / (1.0 + len(random))


def _moved(rows: Rows, view: View, grid: Grid) -> Floats:
    """Return the largest evidence (moves,) of what the command gives, where runs are moved in time.

    None of joints beside a plan, whose corners are off by more than noise.
    """
    if rows.traces[0].link.of_joints and not rows.traces[0].of_six_encoders:
        return np.zeros(0)
    largest = np.full(_LIMITS.moves, -np.inf)
    for family in grid.families():
        if family.on in _COMMANDED:
            columns = Columns(rows.of(family.columns, family.place.component))
            at = view.at(family.place.component)
            largest = np.maximum(largest, moved_evidence(at, columns, family.roots))
    return largest


def _tail_p(random: Floats, nats: float) -> float:
    """Return the probability of at least so much of a Gumbel distribution with the moments of values (n,)."""
    scale = float(np.std(random)) * np.sqrt(6.0) / np.pi
    middle = float(np.mean(random)) - np.euler_gamma * scale
    return float(-np.expm1(-np.exp(-(nats - middle) / max(scale, 1e-12))))
