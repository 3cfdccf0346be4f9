"""One measured signal of one run beside the model of it: what a link of the measuring chain is judged by.

The measured signal before a link is the input of its model, so that an error upstream is not blamed twice.

**Splits.** No row of a run is used both to choose or fit an effect and to report on it. Rows of one stretch
of time share the errors of a model and stay together in every split.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import Protocol

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.effects import Applied, Effect, Inputs, Signals, simulate
from gcode2krl.effects.effect import JOINTS
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.gap.compare.interpolation import (
    LastPath,
    cubic,
    follows_path,
    interpolate,
    linear,
    nearest_rows,
    usual_step_s,
    values_of,
)
from gcode2krl.gap.compare.pair import Pair, Simulator, from_base
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.compare
Span = tuple[float, float]
"""Start and end in s of the table's stamps."""


class Whose(Enum):
    """What an event is."""

    COMMAND = "in step with the command"
    SLIP = "a change that stays"
    IMPULSE = "an impulse"
    INSTRUMENT = "a burst of the instrument"


@dataclass(frozen=True, eq=False)
class Event:
    """One event of one run in one link's signal, in the link's inner unit."""

    link: str
    run: str
    whose: Whose
    span_s: Span
    at_s: float
    """Where it is largest; of a slip where the level has changed by half."""
    line: int
    """Of the G-code that the robot is on; 0 where it is on none."""
    peak: Floats
    """(k,) the largest deviation from the level around it."""
    change: Floats
    """(k,) by how much the level is another one behind it."""
    power: float
    """Sum of the squares of its deviations over its rows."""
    is_shared: bool = False
    """Another table is rough at that moment, too."""


class Link:
    """One link: names, units and clocks of its signal, its trace and its model, what later links learn."""

    name: str
    signal: str
    """Name of its signal in the report."""
    unit: str
    """Unit of the report."""
    needs: str
    """What a run must hold for the link to be examined."""
    table: str = "controller"
    """The table of a run whose clock stamps it."""
    of_joints: bool = False
    """Its components are joints."""
    of_tip: bool = False
    """Its components are those of the tip."""
    tells_time: bool = False
    """It shows when the robot is where: timing is the part of it along the motion."""
    model_rms: float = 0.0
    """Accuracy of its model in the inner unit where that, not noise, is the limit."""
    least_off: float = 0.0
    """RMS in the inner unit below which the run keeps to the planned times."""
    least_step: float = 0.0
    """Shorter ways along the signal, in the inner unit, are noise of the instrument, not motion."""
    own_clock: str = ""
    """The clock that the signal has of its own besides that of its table."""
    sets_clocks: bool = False
    """Clocks are set run by run first, since the signal changes fast all the time."""
    instrument: tuple[str, ...] = ()
    """Names of the nuisance that belongs to the instrument alone: the joints do nothing of it."""

    def __repr__(self) -> str:
        return f"<link {self.name}>"

    def simulated(self, trace: "Trace", applied: Sequence[Applied]) -> Signals:
        """Return the signals of its model with some effects at work."""
        return simulate(trace.inputs, applied)

    def planned(self, inputs: Inputs) -> Floats:
        """Return the planned signal (m, k) that shows how far a run has come."""
        raise NotImplementedError(f"{self.name} does not show how far a run has come")

    @property
    def clock(self) -> str:
        """Return the name of the clock by which it may be late."""
        return self.own_clock or self.table

    @property
    def has_instrument(self) -> bool:
        """Tell whether an instrument measures it; what is commanded has no noise."""
        return self.model_rms == 0.0

    def mismatch(self, trace: "Trace", mismatch: Mismatch) -> Iterator[tuple[str, Floats]]:
        """Yield what its instrument may be off by: names, and columns (k, n, c) for one deviation."""
        return iter(())

    def has_time_law(self, unmeasured: frozenset[str]) -> bool:
        """Tell whether the time law may be slightly off in it, given the links without data."""
        return self.tells_time

    def trace(self, pair: Pair, base: Sequence[Applied] = ()) -> "Trace | None":
        """Return the measured signal of a run, None where it has none; ``base`` belongs to its model."""
        return None

    def traces(self, pairs: Iterable[Pair], base: Sequence[Applied] = ()) -> "list[Trace]":
        """Return the measured signals, one a run that has it and is long enough to be judged."""
        traces = (self.trace(pair, base) for pair in pairs)
        return [trace for trace in traces if trace and len(trace.time_s) >= _LIMITS.trace_least_rows]

    def base(self, context: "Context") -> tuple[Applied, ...]:
        """Return the effects that are part of its model from the start."""
        return context.slips

    def clocks(self, context: "Context") -> int:
        """Return how many clocks of their own the compared signals have.

        Where the run's own timing replaced the plan's, an instrument's clock is known four times worse.
        """
        path = context.timing
        if is_lost(path):
            return _LIMITS.clocks_lost
        return 1 if path is None or path.verdict == "no_gap" else 2

    def clock_share(self, context: "Context") -> float:
        """Return the share of its clocks' normal mismatch that is left after they were set."""
        return 1.0

    def learn(self, context: "Context", judged: "FittedVerdict") -> "Context":
        """Return what is known to later links after this one was judged."""
        return context


_KINK_ROWS = 5
"""Samples of a jump of the rate and one on either side."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trace:
    """A measured signal (n, k), the inputs of its model, and which signals of the model it is."""

    link: Link
    run: str
    run_number: int
    simulator: Simulator
    factor: float
    """From the inner unit to that of the report."""
    components: tuple[str, ...]
    columns: tuple[int, ...]
    """Columns of the model's signals that were measured."""
    plus: str
    minus: str | None = None
    """The measured signal is ``plus`` - ``minus`` of the model."""
    inputs: Inputs
    base: tuple[Applied, ...] = ()
    """Effects that were found before: they are part of the model."""
    time_s: Floats
    """(n,) stamps of the table."""
    measured: Floats
    segments: Ints
    """(s, 2) stretches without a gap."""
    plus_late_s: float = 0.0
    """By how much the samples of ``plus`` are older than their stamps, beyond the table's clock."""
    clock_set_s: float = 0.0
    """What was taken off the stamps for the run's own clock."""
    declared_sigma: float | None = None
    frame: str = "base"
    """Along the axes of which a vector is: base, tcp or sensor, whose axes are those of the flange."""
    still: bool = False
    """Each row is a pose in which the robot stands."""
    left_out: tuple[str, ...] = ()
    """What was taken out of the measured values because it is the instrument's, in a person's words."""
    is_shown_at_tip: bool = False
    """What it has beyond its model the tip has too, so that no slow part of it is its instrument's noise."""
    events: tuple[Event, ...] = ()
    """What was rough or far off for a moment and is not in step with the command (`events`)."""

    @property
    def signal(self) -> str:
        """Return the name in the report: tcp, force, joint_load …"""
        return self.link.signal

    @property
    def of_six_encoders(self) -> bool:
        """Tell whether it is of two columns of all joints, whose encoders are alike."""
        return self.link.of_joints and self.minus is not None and self.measured.shape[1] == len(JOINTS)

    @property
    def shape(self) -> tuple[int, int]:
        """Return rows and components."""
        return self.measured.shape[0], self.measured.shape[1]

    @cached_property
    def nominal(self) -> Floats:
        """(n, k) what the model says."""
        return self.sample(())

    @cached_property
    def residual(self) -> Floats:
        """(n, k) measured less model."""
        return self.measured - self.nominal

    @cached_property
    def rate(self) -> Floats:
        """(n, k) time derivative of the model, from the model's own samples."""
        if self.still:
            return np.zeros(self.shape)
        step = 1e-3
        return (self.at(self._plain, self.time_s + step) - self.at(self._plain, self.time_s - step)) / (
            2.0 * step
        )

    @cached_property
    def clock_rate(self) -> Floats:
        """(n, k) how fast the signal changes with its own clock: that of ``plus`` where both have one."""
        if not self.link.own_clock:
            return self.rate
        step, signals = _LIMITS.clock_difference_s, self._plain
        times = self.time_s - self.plus_late_s
        apart = [interpolate(signals, self.plus, times + s) for s in (step, -step)]
        return (apart[0] - apart[1])[:, list(self.columns)] / (2.0 * step)

    @cached_property
    def kinks(self) -> Floats:
        """(n, k) the largest jump of the model's rate within two of its samples, 0 where it bends evenly.

        Where a clock is off by less than a sample, the row may be on either side of the jump.
        """
        signals = self._plain
        values, own_s = values_of(signals, self.plus), signals.time_s
        if self.still or not follows_path(self.plus) or len(own_s) < _KINK_ROWS:
            return np.zeros(self.shape)
        # less what its neighbours have: an even acceleration is no kink
        jumps = np.diff(np.diff(values, axis=0) / np.diff(own_s)[:, None], axis=0)
        kinks = np.zeros_like(values)
        kinks[2:-2] = np.abs(jumps[1:-1] - 0.5 * (jumps[:-2] + jumps[2:]))
        near = np.maximum(kinks, np.maximum(np.roll(kinks, 1, axis=0), np.roll(kinks, -1, axis=0)))
        if self.frame != "base":  # whichever way they are turned
            near = np.repeat(np.linalg.norm(near, axis=1, keepdims=True), near.shape[1], axis=1)
        return near[nearest_rows(own_s, self.time_s - self.plus_late_s)][:, list(self.columns)]

    @cached_property
    def _plain(self) -> Signals:
        return self.signals(())

    @cached_property
    def _last_paths(self) -> tuple[LastPath, LastPath]:
        """Of ``plus`` and of ``minus``, whose clocks may differ."""
        return LastPath(), LastPath()

    def late(self, by_s: float) -> Floats:
        """Return what the model says (n, k) of an instrument that states what was true some time before."""
        return self.at(self._plain, self.time_s - by_s)

    def sample(self, applied: Sequence[Applied]) -> Floats:
        """Return what the instrument would show (n, k) with these effects at work besides the base."""
        return self.at(self.signals(applied) if applied else self._plain, self.time_s)

    def model_error(self, applied: Sequence[Applied]) -> Floats:
        """Return by how much the model may be off (n, k) where it, not noise, is the limit.

        To its accuracy come what its samples miss of a sharp corner: by how much every other one misses more,
        and at a kink half a sample at the jump of the rate.
        """
        signals = self.signals(applied)
        times = signals.true_time(self.plus, self.time_s)
        values = values_of(signals, self.plus)[:, list(self.columns)]
        fine, coarse = cubic(times, signals.time_s, values), cubic(times, signals.time_s[::2], values[::2])
        kink = self.kinks * usual_step_s(signals.time_s) / 4.0
        return self.link.model_rms + np.abs(fine - coarse) + kink

    def signals(self, applied: Sequence[Applied]) -> Signals:
        """Return all signals of the model with these effects at work besides the base."""
        return self.link.simulated(self, (*self.base, *applied))

    def at(self, signals: Signals, stamps: Floats) -> Floats:
        """Return what the instrument would show (n, k) of simulated signals at its stamps (n,)."""
        times = signals.true_time(self.plus, stamps - self.plus_late_s)
        if self.minus is None:
            values = interpolate(signals, self.plus, times, self._last_paths[0])
        else:
            # the inputs are this signal as it was stamped: a clock of its own shows in the other one
            times = times - signals.own_late_s(self.minus, stamps)
            other = signals.table_time(self.minus, stamps)
            if np.array_equal(times, other):
                apart = values_of(signals, self.plus) - values_of(signals, self.minus)
                values = linear(times, signals.time_s, apart)
            else:
                plus, minus = self._last_paths
                values = interpolate(signals, self.plus, times, plus)
                values = values - interpolate(signals, self.minus, other, minus)
        values = from_base(values, self.frame, signals.inputs, times)
        return values[:, list(self.columns)]


STRETCH_S = THRESHOLDS.compare.stretch_s


def stretches_of(trace: Trace) -> Ints:
    """Return the number (n,) of the stretch of time each row of a trace belongs to.

    Of a long run they are longer, so that what is kept of each does not grow with it.
    """
    since_s = trace.time_s - trace.inputs.time_s[0]
    longest_s = (float(since_s[-1]) + 1e-6) / THRESHOLDS.compare.stretches_most
    lasts_s = max(STRETCH_S, longest_s)
    number: Ints = (since_s / lasts_s).astype(np.int64)
    return number


def stretches_of_all(traces: Sequence[Trace]) -> Ints:
    """Return the number of the stretch of each value of all traces, component after component.

    No two runs have a number in common, however long they are.
    """
    numbers, first = [], 0
    for trace in traces:
        number = stretches_of(trace)
        number -= number.min(initial=0)  # a table may begin before its model
        numbers.append(np.tile(first + number, trace.shape[1]))
        first += int(number.max(initial=-1)) + 1
    return np.concatenate(numbers)


def evenly_spread(traces: Sequence[Trace]) -> list[Trace]:
    """Return the traces of a link, of long runs with the rows of evenly spread windows of time alone.

    What the columns of all effects take in memory and time goes with the rows; what they tell of a cause goes
    with the root of their number. Events are sought in all rows before; of each run the windows over which
    its level changes most are kept too, since the moment of a step is in one of them.
    """
    share = _LIMITS.judged_values / max(1, sum(trace.measured.size for trace in traces))
    if share >= 1.0 or any(trace.still for trace in traces):
        return list(traces)
    kept = []
    for trace in traces:
        window = ((trace.time_s - trace.time_s[0]) / _LIMITS.judged_window_s).astype(np.int64)
        is_even = np.floor((window + 1) * share) > np.floor(window * share)
        kept.append(with_rows(trace, is_even | np.isin(window, _stepped(trace, window))))
    return kept


def _stepped(trace: Trace, window: Ints) -> Ints:
    """Return the windows over which the median of the rest changes most, if far more than it usually does."""
    first = np.flatnonzero(np.diff(window, prepend=-1))
    medians = np.stack([np.median(rows, axis=0) for rows in np.split(trace.residual, first[1:])])
    change = np.abs(medians[2:] - medians[:-2])
    if len(change) == 0:
        return window[:0]
    times = np.max(change / np.maximum(np.median(change, axis=0), 1e-300), axis=1)
    most = np.argsort(times)[-_LIMITS.stepped_windows :]
    stepped: Ints = window[first[1 + most[times[most] > _LIMITS.stepped_times]]]
    return stepped


def split(traces: Sequence[Trace], explaining: int) -> tuple[list[Trace], list[Trace]]:
    """Return the traces of the runs that explain, and the held-out ones; all explain if none would."""
    explain = [trace for trace in traces if trace.run_number < explaining]
    held = [trace for trace in traces if trace.run_number >= explaining]
    return (explain, held) if explain else (held, [])


def folds_of(traces: Sequence[Trace], power: Sequence[Floats] = ()) -> list[tuple[list[Trace], list[Trace]]]:
    """Return (traces that explain, held-out traces): each run held out in turn, of a single run each quarter.

    ``power`` is the power (n,) of the gap in each row of each trace. Where one run has nearly all of it, the
    others cannot test an explanation; then each quarter of the power is held out in turn.
    """
    sums = [float(each.sum()) for each in power]
    if len(traces) > 1 and not (sums and max(sums) > _LIMITS.holdout_nearly_all * sum(sums)):
        return [([trace for trace in traces if trace is not held], [held]) for held in traces]
    weights = list(power) if sum(sums) > 0.0 else [np.ones(len(trace.time_s)) for trace in traces]
    quarters = _quarters(weights)
    folds = (_fold(traces, weights, quarters, held) for held in range(_LIMITS.holdout_quarters))
    return [fold for fold in folds if fold is not None]


def _quarters(weights: Sequence[Floats]) -> list[Ints]:
    """Return the quarter (n,) of the power that each row belongs to, in the order of the traces."""
    total = sum(float(weight.sum()) for weight in weights)
    rows = sum(len(weight) for weight in weights)
    # a little for every row, so that rows without power belong to a quarter too
    evenly, before, quarters = _LIMITS.holdout_evenly, 0.0, []
    for weight in weights:
        share = before + np.cumsum(weight / total + evenly / rows) / (1.0 + evenly)
        before = float(share[-1]) if len(share) else before
        last = _LIMITS.holdout_quarters - 1
        quarters.append(np.minimum((_LIMITS.holdout_quarters * share).astype(np.int64), last))
    return quarters


def _fold(
    traces: Sequence[Trace], weights: Sequence[Floats], quarters: Sequence[Ints], quarter: int
) -> tuple[list[Trace], list[Trace]] | None:
    """Return the traces without a quarter and its guards, and that quarter; None where too little is left."""
    kept, held, power_kept = [], [], 0.0
    for trace, weight, of_row in zip(traces, weights, quarters, strict=True):
        inside = of_row == quarter
        guarded = _with_guards(trace.time_s, inside)
        held.append(with_rows(trace, inside))
        kept.append(with_rows(trace, ~guarded))
        power_kept += float(weight[~guarded].sum())
    if power_kept < _LIMITS.holdout_least_seen * sum(float(weight.sum()) for weight in weights):
        return None
    kept = [trace for trace in kept if len(trace.time_s) >= _LIMITS.holdout_least_kept]
    held = [trace for trace in held if len(trace.time_s) >= _LIMITS.holdout_least_held]
    return (kept, held) if kept and held else None


def _with_guards(time_s: Floats, inside: Bools) -> Bools:
    """Return the rows (n,) within the guard of the chosen ones, which are one stretch."""
    if not inside.any():
        return inside
    first, last = time_s[inside][[0, -1]]
    guarded: Bools = (time_s >= first - STRETCH_S) & (time_s <= last + STRETCH_S)
    return guarded


_SAME_MM = 1e-3
_SAME_RAD = 1e-3
"""Repeats of a program have the same path; their logs differ by a servo and a start, not by a degree."""


def is_repeat(trace: Trace, other: Trace) -> bool:
    """Tell whether two traces are of one program, so that they can be compared row by row."""
    a, b = trace.inputs, other.inputs
    if len(a) != len(b) or trace.shape[1] != other.shape[1]:
        return False
    # with relative angles every tip is zero, and the joints tell the programs apart
    tips = np.allclose(a.position_mm, b.position_mm, atol=_SAME_MM)
    return tips and np.allclose(a.q_cmd_rad, b.q_cmd_rad, atol=_SAME_RAD)


def with_rows(trace: Trace, chosen: Bools) -> Trace:
    """Return a trace with some of its rows; a segment ends where rows are left out."""
    rows = np.flatnonzero(chosen)
    owner = np.zeros(len(chosen), dtype=np.int64)
    for number, (first, last) in enumerate(trace.segments):
        owner[first:last] = number
    breaks = np.flatnonzero((np.diff(rows) > 1) | (np.diff(owner[rows]) > 0)) + 1
    edges = np.concatenate([[0], breaks, [len(rows)]]).astype(np.int64)
    segments = np.stack([edges[:-1], edges[1:]], axis=1)
    return replace(trace, time_s=trace.time_s[rows], measured=trace.measured[rows], segments=segments)


class Verdict(Protocol):
    """What the judgement of a link says to all that comes later."""

    @property
    def link(self) -> Link:
        """Return the judged link."""

    @property
    def verdict(self) -> str:
        """Return no_gap, explained, partly_explained or unexplained."""

    @property
    def nearly_all(self) -> bool:
        """Tell whether what is left is more than noise, but a small share of the gap."""

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Return the named causes."""

    def without(self, applied: Applied) -> "Verdict":
        """Return the judgement without a cause."""


class FittedVerdict(Verdict, Protocol):
    """What later links may learn from the judgement of a signal."""

    @property
    def every(self) -> tuple[Trace, ...]:
        """Return all traces of the link, held-out ones included."""

    def fitted(self, trace: Trace, stamps_s: Floats) -> Floats:
        """Return what the fitted model says of a trace's run at some stamps (n,), as (n, k)."""


def is_lost(judged: Verdict | None) -> bool:
    """Tell whether the model of a link does not hold, not even with the causes that were named."""
    if judged is None or judged.nearly_all:
        return False
    return judged.verdict in ("unexplained", "partly_explained")


@dataclass(frozen=True, eq=False)
class Context:
    """Pairs as far as they are understood, and the judgements so far; each step returns a new one."""

    pairs: tuple[Pair, ...]
    explaining: int
    """So many of the pairs explain; the others are held out."""
    known: Mapping[str, Effect]
    """The library with the user's effects; those that are excluded still count as normal mismatch."""
    mismatch: Mismatch
    exclude: frozenset[str] = frozenset()
    """Names of effects that are no candidates."""
    seed: int = 0
    examined: frozenset[str] = frozenset()
    """Names of the links that have data."""
    joints: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Link of joints -> those that it has data of."""
    slips: tuple[Applied, ...] = ()
    """Set-up slips that every link's model has."""
    learned: tuple[Applied, ...] = ()
    """Causes that bend the arm, so that the mechanics' model has them."""
    judgements: tuple[Verdict, ...] = ()
    clocks_set: bool = False
    """The controllers' clocks were set by the commanded joints."""
    stopped: bool = False
    """Stops that nobody planned are in the plan."""

    @property
    def timing(self) -> Verdict | None:
        """Return the judgement of the link that tells when the robot is where."""
        return next((each for each in self.judgements if each.link.tells_time), None)

    @property
    def offered(self) -> Mapping[str, Effect]:
        """Return the effects that are candidates."""
        return {name: effect for name, effect in self.known.items() if name not in self.exclude}

    def has_data(self, link: str) -> bool:
        """Tell whether a link can be judged."""
        return link in self.examined

    def examined_at(self, effect: Effect, target: str | None) -> frozenset[str]:
        """Return the links with data of what an effect moves: load encoders may be on some joints only."""
        return self.examined - unmeasured_at(effect, target, self.joints)

    def candidates(self) -> "list[Effect]":
        """Return the effects that links try: no slip beside one that was found, nor a second kind of stop."""
        return [
            effect
            for effect in self.offered.values()
            if not (effect.kind == "slip" and self.slips) and not (effect.plans_anew and self.stopped)
        ]

    def with_pairs(self, pairs: Iterable[Pair]) -> "Context":
        """Return the context with other pairs."""
        return replace(self, pairs=tuple(pairs))

    def replanned(self, applied: Applied) -> "Context":
        """Return the context whose pairs have an effect in their plan."""
        return self.with_pairs(
            replace(pair, inputs=applied.effect.replan(pair.inputs, applied)) for pair in self.pairs
        )

    def with_slip(self, applied: Applied) -> "Context":
        """Return the context with a set-up slip in the plan, and the rest of what it does in every model."""
        context = self.replanned(applied)
        if applied.effect.plans_anew:  # all that it does is in the plan
            return context
        return replace(context, slips=(*self.slips, replace(applied, planned=True)))

    def with_learned(self, learned: Iterable[Applied]) -> "Context":
        """Return the context with more causes that bend the arm."""
        return replace(self, learned=(*self.learned, *learned))

    def with_judgement(self, judged: Verdict) -> "Context":
        """Return the context with one more judgement."""
        return replace(self, judgements=(*self.judgements, judged))

    def without_cause(self, judged: Verdict, applied: Applied) -> "Context":
        """Return the context whose judgement of a link lacks a cause."""
        judgements = tuple(each.without(applied) if each is judged else each for each in self.judgements)
        return replace(self, judgements=judgements)


def unmeasured_at(effect: Effect, target: str | None, joints: Mapping[str, frozenset[str]]) -> frozenset[str]:
    """Return the links of joints, among those with data, that lack a joint which an effect moves."""
    moved = effect.joints_at(target)
    return frozenset(link for link, measured in joints.items() if not moved <= measured)
