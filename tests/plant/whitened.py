"""The links that a case measures, in units of white noise: mismatch and library, and their products."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tests.plant.distance import Block, Fit, Products
from tests.plant.instruments import Instruments
from tests.plant.plans import Day
from tests.plant.scenes import Signals
from tests.plant.signatures import EVENTS, Library, Start, columns, nuisances, sparse, starts

PLAN_deg, PLAN_MEMORY = 3.2e-4, 0.99
"""The predicted plan is met to 0.01 mm at 1.8 m, and errs slowly."""
ZERO_deg = 0.2
"""Bound of the zero between two encoders of a joint."""
GRID_s = 0.004


@dataclass(frozen=True)
class Channel:
    """How one channel is read in a case."""

    name: str
    step_s: float
    sigma: float
    memory: float
    axes: tuple[int, ...]

    def whitened(self, columns_: np.ndarray) -> np.ndarray:
        """Columns (n, k) on the grid of 4 ms as rows of this channel, of unit white noise."""
        times = np.arange(0.0, (len(columns_) - 1) * GRID_s, self.step_s) / GRID_s
        low = np.minimum(times.astype(int), len(columns_) - 2)
        share = (times - low)[:, None]
        rows = columns_[low] * (1.0 - share) + columns_[low + 1] * share
        fresh = np.sqrt(1.0 - self.memory**2)
        out = rows / self.sigma
        out[1:] = (rows[1:] - self.memory * rows[:-1]) / (self.sigma * fresh)
        return out


def channels(how: Instruments) -> list[Channel]:
    """The links that a case measures, with the noise of one of their columns."""

    def digit(decimals: int) -> float:
        return 10.0**-decimals / np.sqrt(12.0)

    out, last = [], digit(how.q_decimals)
    if "tracker" in how.tables:
        sigma = float(np.hypot(how.tracker_mm, digit(how.tracker_decimals)))
        out.append(Channel("tcp", 1.0 / how.tracker_hz, sigma, how.tracker_memory, (0, 1, 2)))
    if "force" in how.tables:
        sigma = float(np.hypot(how.force_N, digit(how.force_decimals)))
        out.append(Channel("force", 1.0 / how.force_hz, sigma, how.force_memory, (0, 1, 2)))
    if "controller" in how.tables:
        step, every = how.controller_s, tuple(range(6))
        out.append(Channel("cmd", step, float(np.hypot(PLAN_deg, last)), PLAN_MEMORY, every))
        out.append(Channel("act", step, float(np.hypot(how.q_act_deg, last * 2.0**0.5)), 0.0, every))
        seen = tuple(j for j in every if f"q{j + 1}_load_deg" not in how.blank) if how.q_load else ()
        if seen:
            out.append(Channel("load", step, float(np.hypot(how.q_load_deg, last * 2.0**0.5)), 0.0, seen))
    return out


Sparse = dict[tuple[str, int], np.ndarray]


class Case:
    """The whitened world of a case: its runs, its links, its library without the truth."""

    def __init__(self, library: Library, how: Instruments, days: Sequence[Day]):
        self.library, self.days, self.channels = library, tuple(days), channels(how)
        self.names: list[tuple[str, Start | None]] = []
        per_run: list[list[tuple[int, Sparse]]] = [[] for _ in self.days]  # columns of each run
        lower, upper, width = [], [], 1
        for i, nuisance in enumerate(nuisances()):
            for r, day in enumerate(self.days):
                per_run[r].append((width, library.mismatch(day.program)[i]))
                if nuisance.own or r == len(self.days) - 1:
                    width += 1
                    lower.append(nuisance.lower)
                    upper.append(1.0)
        for channel in self.channels:
            for j in channel.axes if channel.name in ("act", "load") else ():
                for r, day in enumerate(self.days):
                    one = np.full(library.scene(day.program).rows, ZERO_deg, np.float32)
                    per_run[r].append((width, {(channel.name, j): one}))
                width += 1
                lower.append(-1.0)
                upper.append(1.0)
        self.mismatch = Block("mismatch", np.arange(1, width), np.array(lower), np.array(upper))
        self.blocks: list[Block] = []
        for name in library.names:
            of_runs = [library.of(name, day.program, day.age_s, day.number) for day in self.days]
            for start in of_runs[0]:
                cols = columns(start)
                at = np.arange(width, width + len(cols))
                for r, signatures in enumerate(of_runs):
                    per_run[r] += [(int(k), s) for k, s in zip(at, signatures[start], strict=True)]
                width += len(cols)
                bounds = np.array([(c.lower, c.upper) for c in cols])
                self.blocks.append(Block(start.label, at, bounds[:, 0], bounds[:, 1], start))
        self.width, self.per_run = width, per_run
        self.own = np.zeros((width, width))
        self.rows: dict[tuple, tuple[np.ndarray, np.ndarray]] = {}  # by run, channel, axis
        self._multiply(0)

    def _whitened(
        self, r: int, channel: Channel, axis: int, first: int
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Columns from `first` on that are not zero on an axis of a run, whitened; None without any."""
        key = (channel.name, axis)
        there = [(k, s[key]) for k, s in self.per_run[r] if k >= first and key in s]
        if not there:
            return None
        return np.array([k for k, _ in there]), channel.whitened(np.stack([x for _, x in there], axis=1))

    def _multiply(self, first: int) -> None:
        """Products of all columns from `first` on with each other and with those before."""
        for r in range(len(self.days)):
            for channel in self.channels:
                for axis in channel.axes:
                    fresh = self._whitened(r, channel, axis, first)
                    if fresh is None:
                        continue
                    at, white = fresh
                    self.own[np.ix_(at, at)] += white.T @ white
                    key = (r, channel.name, axis)
                    if key in self.rows:
                        old_at, old = self.rows[key]
                        across = old.T @ white
                        self.own[np.ix_(old_at, at)] += across
                        self.own[np.ix_(at, old_at)] += across.T
                        at, white = np.concatenate([old_at, at]), np.concatenate([old, white], axis=1)
                    self.rows[key] = (at, white)

    def less(self, change: dict, at: np.ndarray, values: np.ndarray) -> dict:
        """A whitened change less columns of the products."""
        place = np.zeros(self.width)
        place[at] = values
        return {
            k: v - self.rows[k][1] @ place[self.rows[k][0]] if k in self.rows else v
            for k, v in change.items()
        }

    def line(self, fit: Fit) -> dict[tuple, np.ndarray]:
        """The straight change of a fit's blocks."""
        place = np.zeros(self.width)
        for block, values in zip(fit.blocks, fit.values, strict=True):
            place[block.at] = values
        return {k: white @ place[at] for k, (at, white) in self.rows.items()}

    def columns_of(self, start: Start) -> list[list[Sparse]]:
        """Sparse signals of a start's columns on each run."""
        scenes = [self.library.scene(day.program) for day in self.days]
        return [
            [sparse(c.change(s, d.age_s, d.number)) for c in columns(start)]
            for s, d in zip(scenes, self.days, strict=True)
        ]

    def and_also(self, more: Sequence[tuple[Start, list[list[Sparse]]]]) -> "Case":
        """This case with more candidates."""
        out = copy.copy(self)
        out.blocks, out.per_run = list(self.blocks), [list(each) for each in self.per_run]
        for start, of_runs in more:
            bounds = np.array([(c.lower, c.upper) for c in columns(start)])
            at = np.arange(out.width, out.width + len(bounds))
            for r, signatures in enumerate(of_runs):
                out.per_run[r] += [(int(k), s) for k, s in zip(at, signatures, strict=True)]
            out.width += len(bounds)
            out.blocks.append(Block(start.label, at, bounds[:, 0], bounds[:, 1], start))
        out.own, out.rows = np.zeros((out.width, out.width)), dict(self.rows)
        out.own[: self.width, : self.width] = self.own
        out._multiply(self.width)
        return out

    def white(self, changes: Sequence[Signals]) -> dict[tuple, np.ndarray]:
        """A change of each run, whitened, by run, channel and axis."""
        out = {}
        for r, change in enumerate(changes):
            for channel in self.channels:
                white = channel.whitened(change[channel.name][:, list(channel.axes)])
                for i, axis in enumerate(channel.axes):
                    out[(r, channel.name, axis)] = white[:, i]
        return out

    def changes(self, hooks) -> list[Signals]:
        """What hooks change on each run of the nominal robot."""
        scenes = [self.library.scene(day.program) for day in self.days]
        return [s.change(hooks, d.age_s, d.number) for s, d in zip(scenes, self.days, strict=True)]

    def against(self, change: dict[tuple, np.ndarray], candidates: Sequence[Block]) -> Products:
        """Products with a change in row 0."""
        out = self.own.copy()
        for key, values in change.items():
            out[0, 0] += values @ values
            if key in self.rows:
                at, white = self.rows[key]
                with_it = white.T @ values
                out[at, 0] += with_it
                out[0, at] += with_it
        return Products(out, self.mismatch, candidates)


def moment_of(rest: dict[tuple, np.ndarray], channels_: Sequence[Channel], sort: str) -> tuple[int, float]:
    """Run and time of the strongest step or impulse in whitened columns."""
    steps = {c.name: c for c in channels_ if c.name != "cmd"}
    best = (-1.0, 0, 0.0)
    grid = np.arange(0.0, 30.0, 0.01)
    for r in sorted({key[0] for key in rest}):
        score = np.zeros(len(grid))
        for (run, name, _), values in rest.items():
            if run != r or name not in steps:
                continue
            step_s, n = steps[name].step_s, len(values)
            sums = np.concatenate([[0.0], np.cumsum(values)])
            at = np.minimum((grid / step_s).astype(int), n)
            if sort == "step":
                after = sums[-1] - sums[at]
                left, gone = np.maximum(n - at, 1), np.maximum(at, 1)
                jump = after / left - sums[at] / gone
                score += np.where((at > 5) & (at < n - 5), jump**2 / (1.0 / left + 1.0 / gone), 0.0)
            else:
                wide = np.minimum(at + max(int(0.02 / step_s), 1), n)
                score += (sums[wide] - sums[at]) ** 2 / np.maximum(wide - at, 1)
        k = int(np.argmax(score))
        if score[k] > best[0]:
            best = (float(score[k]), r, float(grid[k]))
    return best[1], best[2]


def tone_of(rest: dict[tuple, np.ndarray], channels_: Sequence[Channel], low: float, high: float) -> float:
    """Frequency with the most power at the tip, Hz, within a range."""
    step_s = next((c.step_s for c in channels_ if c.name == "tcp"), None)
    if step_s is None:
        return 0.5 * (low + high)
    hz = np.arange(low, high, 0.01)
    power = np.zeros(len(hz))
    for (_, name, _), values in rest.items():
        if name == "tcp":
            n = int(1.0 / (0.01 * step_s))
            seen = (
                np.abs(np.fft.rfft(values, n)) ** 2 if len(values) <= n else np.abs(np.fft.rfft(values)) ** 2
            )
            power += np.interp(hz, np.fft.rfftfreq(max(n, len(values)), step_s), seen)
    return float(hz[int(np.argmax(power))])


def starts_found(name: str, rest: dict[tuple, np.ndarray], channels_: Sequence[Channel]) -> list[Start]:
    """Starts of an effect where an event or a tone is found in what is left."""
    out = []
    for start in starts(name):
        given, (low, high) = dict(start.given), start.first_range
        if name in EVENTS:
            run, at_s = moment_of(rest, channels_, EVENTS[name])
            given |= {i: run for i, kind in enumerate(start.asked) if kind[0] == "pick" and i in given}
            if run >= 2 or dict(start.given) != {**dict(start.given), **dict.fromkeys(given, run)}:
                continue
            share = (at_s - low) / (high - low)
        else:
            share = (tone_of(rest, channels_, low, high) - low) / (high - low)
        if 0.0 <= share <= 1.0:
            given[start.shares[0]] = share
            out.append(replace(start, given=tuple(given.items())))
    return out
