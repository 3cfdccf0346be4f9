"""How far apart the true cause of a case is from everything else that could explain its data, in nats.

D is half the least chi² of the true change (signals with the effect less signals without, all measured links
of all runs jointly, whitened by the case's noise) beside

* `mismatch`: normal mismatch within its bounds alone: whether a gap is there at all;
* `one`, `two`: mismatch and any one or two effects of the library other than the truth, their parameters free
  within their ranges.

An observer who knows every effect of the library and the course of the noise tells the truth from its best
imitator at odds of exp(D) to one. Assumptions, each of which makes D a little too large or too small:

* Truth and imitators act on the nominal robot; mismatch enters to first order, in a box of its bounds. The
  zero between two encoders of a joint is free.
* The noise of a column is of first order with the case's memory; the last digit's share is added to its
  power. Foreign noise and drop-outs are not counted. The commanded log is met by the prediction to 0.01 mm.
* Effects enter by their signatures at a grid of starts (`signatures.py`); of two, the second extends one of
  the `BEAM` best singles. Of the best few the effect itself is run and, where it is not linear, refitted.
* The truth's own model errs by a share of its change (`MODEL_ERROR`): the distance is reduced by so much.
* What the part alone shows is no link here; its D is not known.
"""

import copy
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from tests.plant.effects import LIBRARY
from tests.plant.faults import Fault
from tests.plant.instruments import Instruments
from tests.plant.plans import Day, Plan
from tests.plant.scenes import Signals
from tests.plant.signatures import (
    EVENTS,
    MOST_SHARE,
    SQUARED,
    TONES,
    Column,
    Library,
    Start,
    columns,
    nuisances,
    sparse,
    starts,
)

DECIDABLE, OPEN = 10.0, 3.0
BEAM = 5
CHECKED = 3
"""So many of the best candidates are run and, where they are not linear, refitted."""
BOUNDED = 10
"""So many of the best by an unbounded estimate are fitted within their bounds."""
CURVED = 0.05
"""Share of its change from which on an effect that differs from its signatures is refitted."""
EVALUATIONS = 8
MODEL_ERROR = {"plan": 0.10, "force": 0.03}
"""Share of a true effect's change that its model does not get right: of one that plans the motion anew, and
of one of the cut's forces, whose edges are met to so much. Of frames and joints nothing."""
PLANS = ("velocity_rule", "corner", "advance_stop")
PLAN_deg, PLAN_MEMORY = 3.2e-4, 0.99
"""The predicted plan is met to 0.01 mm at 1.8 m, and errs slowly."""
ZERO_deg = 0.2
"""Bound of the zero between two encoders of a joint."""
GRID_s = 0.004
RELATIVE = 1e-9
"""Ridge on a column's own product, so that columns that are alike do no harm."""


@dataclass(frozen=True)
class Decidability:
    """D in nats beside mismatch, one effect and two, and who imitates best."""

    mismatch: float
    one: float
    two: float
    best_one: str
    best_two: tuple[str, str]

    @property
    def name(self) -> str:
        """Class by the best imitators: decidable, open or undecidable."""
        return class_of(self.two)

    def as_dict(self) -> dict:
        """Plain numbers and names."""
        return {**asdict(self), "best_two": list(self.best_two), "class": self.name}


def class_of(nats: float) -> str:
    """Class of a distance."""
    return "decidable" if nats >= DECIDABLE else "open" if nats >= OPEN else "undecidable"


# linear algebra: everything by products of whitened columns -------------------------------------------------


@dataclass(frozen=True)
class Block:
    """Columns of one candidate in the products, with their bounds."""

    label: str
    at: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    start: Start | None = None


@dataclass(frozen=True)
class Fit:
    """Least chi² of some blocks beside mismatch, and the blocks' coefficients."""

    chi2: float
    blocks: tuple[Block, ...]
    values: tuple[np.ndarray, ...] = ()


class Products:
    """Products of the change (row 0), the mismatch and all candidates; distances within bounds."""

    def __init__(self, products: np.ndarray, mismatch: Block, candidates: Sequence[Block]):
        self.products, self.mismatch, self.candidates = products, mismatch, list(candidates)
        m = mismatch.at
        inner = products[np.ix_(m, m)] + np.eye(len(m))  # as if each bound were one standard deviation
        across = products[m]
        self.beside = products - across.T @ np.linalg.solve(inner, across)

    def least(self, *blocks: Block) -> Fit:
        """The least chi² of the change beside mismatch and blocks, all within their bounds."""
        every = (self.mismatch, *blocks)
        at = np.concatenate([b.at for b in every]).astype(int)
        lower, upper = (np.concatenate([getattr(b, side) for b in every]) for side in ("lower", "upper"))
        chi2, x = bounded(self.products, at, lower, upper)
        ends = np.cumsum([len(b.at) for b in every])
        return Fit(chi2, blocks, tuple(np.split(x, ends[:-1])[1:]))

    def estimate(self, *blocks: Block) -> float:
        """The same by a ridge in place of bounds; a guide to the best ones alone."""
        at = np.concatenate([b.at for b in blocks]).astype(int)
        wide = np.concatenate([np.maximum(np.abs(b.lower), np.abs(b.upper)) for b in blocks])
        p, q = self.beside[np.ix_(at, at)], self.beside[at, 0]
        p = p + np.diag(1.0 / wide**2 + RELATIVE * np.diag(p))
        return float(self.beside[0, 0] - q @ np.linalg.solve(p, q))

    def singles(self) -> list[Fit]:
        """The best single candidates, one start a label, the best first."""
        ranked = sorted(self.candidates, key=self.estimate)
        return sorted((self.least(b) for b in _distinct(ranked, BOUNDED)), key=lambda fit: fit.chi2)

    def pairs(self, singles: Sequence[Fit]) -> list[Fit]:
        """The best extensions of the `BEAM` best singles by another label."""
        tried: dict[tuple, tuple[float, Block, Block]] = {}
        for fit in singles[:BEAM]:
            first = fit.blocks[0]
            for second in self.candidates:
                if second.label == first.label:
                    continue
                key = tuple(sorted((first.label, second.label)))
                chi2 = self.estimate(first, second)
                if key not in tried or chi2 < tried[key][0]:
                    tried[key] = (chi2, first, second)
        best = sorted(tried.values(), key=lambda entry: entry[0])[:BOUNDED]
        return sorted((self.least(one, two) for _, one, two in best), key=lambda fit: fit.chi2)


def bounded(
    products: np.ndarray, at: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[float, np.ndarray]:
    """Least chi² of row 0 by the columns `at` within bounds, and their values."""
    p, q = products[np.ix_(at, at)], products[at, 0]
    scale = np.sqrt(np.maximum(np.diag(p), 1e-30))
    root = np.linalg.cholesky(p / np.outer(scale, scale) + RELATIVE * np.eye(len(at)))
    target = np.linalg.solve(root, q / scale)
    bounds = (lower * scale, upper * scale + 1e-300)
    found = lsq_linear(root.T, target, bounds=bounds, method="bvls", max_iter=5 * len(at))
    x = found.x / scale
    return float(max(products[0, 0] - 2.0 * q @ x + x @ p @ x, 0.0)), x


def _distinct(ranked: Sequence[Block], count: int) -> list[Block]:
    out: dict[str, Block] = {}
    for block in ranked:
        out.setdefault(block.label, block)
        if len(out) == count:
            break
    return list(out.values())


def distance_nats(chi2: float, change2: float, error: float) -> float:
    """D of a least chi², with a model error as a share of the whole change's distance taken off."""
    return 0.5 * max(np.sqrt(chi2) - error * np.sqrt(change2), 0.0) ** 2


# whitened signals of a case ---------------------------------------------------------------------------------


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

    def _whitened(self, r: int, channel: Channel, axis: int, first: int) -> tuple[np.ndarray, np.ndarray] | None:
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


# effects themselves, beyond their signatures ----------------------------------------------------------------


def settings(start: Start, cols: Sequence[Column], values: np.ndarray) -> tuple[float, dict[int, object]]:
    """Size and answers of an effect whose columns have these values."""
    given: dict[int, object] = dict(start.given)
    signs = [i for i, kind in enumerate(start.asked) if kind == ("sign",)]
    n = len(start.directions)
    if start.name in TONES and n:  # two phases of a line
        left, sizes, right = np.linalg.svd(values.reshape(2, 3))
        given[start.directions[0]] = tuple(sizes[0] * right[0])
        given[start.shares[1]] = float(np.arctan2(left[1, 0], left[0, 0]) / (2.0 * np.pi) % 1.0)
        return start.size, given
    if start.name in SQUARED:
        xx, yy, zz, xy, xz, yz = values
        xy, xz, yz = (0.5 * v for v in (xy, xz, yz))
        diagonal = np.array([xx + xy + xz, yy + xy + yz, zz + xz + yz])
        tensor = np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]]) + np.diag(diagonal)
        sizes, ways = np.linalg.eigh(tensor)
        given[start.directions[0]] = tuple(np.sqrt(max(sizes[-1], 1e-6)) * ways[:, -1])
        return start.size, given
    if n:
        for k, i in enumerate(start.directions):
            given[i] = tuple(values[3 * k : 3 * k + 3])
        size, level, tail = start.size, max(np.abs(values[: 3 * n]).max(), 1e-6), values[3 * n :]
    else:
        size, level, tail = start.size * max(abs(values[0]), 1e-6), values[0], values[1:]
        for i in signs[:1]:
            given[i] = float(np.sign(values[0]) or 1.0)
    level = level if abs(level) > 1e-6 else 1e-6
    free = [i for i in start.shares if i not in dict(start.given)]
    for i, value in zip(free, tail, strict=False):
        given[i] = float(np.clip(0.5 + value / level, 0.5 - MOST_SHARE, 0.5 + MOST_SHARE))
    return float(size), given


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


class Truth:
    """One true effect of a case, and its distances."""

    def __init__(self, case: Case, fault: Fault, size: float, without: Sequence[str] = ()):
        self.case, self.error = case, error_of(fault)
        self.change = case.white(case.changes(fault.hooks(size)))
        own = fault.kind.name if fault.target is None else f"{fault.kind.name}@{fault.target}"
        is_named = LIBRARY.get(fault.kind.name) is fault.kind
        self.left_out = {own} if is_named else set()
        self.without = set(without)
        self.candidates = [b for b in case.blocks if self._allowed(b)]
        self.size2 = sum(float(v @ v) for v in self.change.values())

    def _allowed(self, block: Block) -> bool:
        return block.label not in self.left_out and block.start.name not in self.without

    def nats(self, chi2: float) -> float:
        """D of a least chi²."""
        return distance_nats(chi2, self.size2, self.error)

    def decided(self) -> Decidability:
        """All three distances."""
        alone = self.case.against(self.change, ())
        gap = alone.least().chi2
        if self.nats(gap) < OPEN:  # mismatch alone imitates it
            d = self.nats(gap)
            return Decidability(d, d, d, "mismatch", ("mismatch", "mismatch"))
        products = self._with_events(alone)
        singles = products.singles()
        one, name = self._best(singles, gap)
        pairs = products.pairs(singles)
        two, names = self._best(pairs, one)
        if two >= one:
            names = (*name, "mismatch")[:2]
        return Decidability(
            self.nats(gap), self.nats(one), self.nats(min(one, two)), " + ".join(name), tuple(names)
        )

    def _with_events(self, alone: Products) -> Products:
        """Products with all candidates, those that begin where this change does included."""
        rest = self._beside_mismatch(alone)
        more: list[tuple[Start, list[dict]]] = []
        for name in self.case.library.by_case:
            for start in _found(name, rest, self.case.channels):
                label = Block(start.label, np.zeros(0), np.zeros(0), np.zeros(0), start)
                if self._allowed(label):
                    more.append((start, self.case.columns_of(start)))
        if not more:
            return self.case.against(self.change, self.candidates)
        wide = self.case.and_also(more)
        return wide.against(self.change, [b for b in wide.blocks if self._allowed(b)])

    def _beside_mismatch(self, alone: Products) -> dict[tuple, np.ndarray]:
        m = alone.mismatch.at
        inner = alone.products[np.ix_(m, m)] + np.eye(len(m))
        return self.case.less(self.change, m, np.linalg.solve(inner, alone.products[m, 0]))

    def _best(self, fits: Sequence[Fit], most: float) -> tuple[float, tuple[str, ...]]:
        """Least chi² of the best candidates when the effects themselves are run, and their names."""
        best, names = most, ("mismatch",)
        for fit in fits[:CHECKED]:
            if fit.chi2 >= best:
                break
            chi2 = self._run(fit)
            if chi2 < best:
                best, names = chi2, tuple(b.label for b in fit.blocks)
        return best, names

    def _run(self, fit: Fit) -> float:
        """Least chi² when the effects of a fit are run; refitted where they are not linear."""
        guess = Guess(self, fit)
        acted = guess.white(guess.start)
        straight = self.case.line(fit)
        off = sum(float((acted[k] - straight.get(k, 0.0)) @ (acted[k] - straight.get(k, 0.0))) for k in acted)
        size2 = sum(float(v @ v) for v in acted.values())
        if off <= CURVED**2 * size2:
            return fit.chi2
        chi2 = guess.chi2(acted)
        if self.nats(chi2) < OPEN:
            return chi2
        return min(chi2, guess.refitted())


class Guess:
    """Effects with free sizes, directions and shares against the change of a truth."""

    def __init__(self, truth: Truth, fit: Fit):
        self.truth, self.case = truth, truth.case
        self.parts, start, lower, upper = [], [], [], []
        for block, values in zip(fit.blocks, fit.values, strict=True):
            s = block.start
            size, given = settings(s, columns(s), values)
            most = LIBRARY[s.name].sizes[1]
            free: list[tuple[int, int]] = []  # question and axis; (-1, 0) is the size
            if not s.directions:
                free.append((-1, 0))
                start.append(size / s.size)
                lower.append(0.0)
                upper.append(most / s.size)
            reach = np.sqrt(most / s.size) if s.name in SQUARED else most / s.size
            for i in s.directions:
                free += [(i, axis) for axis in range(3)]
                start += list(given[i])
                lower += [-reach] * 3
                upper += [reach] * 3
            for i in s.shares:
                free.append((i, 0))
                start.append(float(given.get(i, 0.5)))
                lower.append(0.0)
                upper.append(1.0)
            self.parts.append((s, size, given, free))
        self.lower, self.upper = np.array(lower), np.array(upper)
        room = 1e-6 * (self.upper - self.lower)
        self.start = np.clip(np.array(start), self.lower + room, self.upper - room)

    def white(self, values: np.ndarray) -> dict[tuple, np.ndarray]:
        """The effects' whitened change."""
        out: dict[tuple, np.ndarray] = {}
        at = 0
        for s, size, given, free in self.parts:
            answers, size = dict(given), s.size if s.directions else size
            for i, axis in free:
                if i < 0:
                    size = s.size * values[at]
                elif i in s.directions:
                    way = list(answers[i])
                    way[axis] = float(values[at])
                    answers[i] = tuple(way)
                else:
                    answers[i] = float(values[at])
                at += 1
            white = self.case.white(self.case.changes(s.hooks(max(size, 1e-12), answers)))
            out = {k: v + out.get(k, 0.0) for k, v in white.items()}
        return out

    def chi2(self, acted: dict[tuple, np.ndarray]) -> float:
        """Least chi² of the truth less this, beside bounded mismatch."""
        left = {k: v - acted[k] for k, v in self.truth.change.items()}
        return self.case.against(left, ()).least().chi2

    def refitted(self) -> float:
        """Least chi² from the start on."""

        def rest(values: np.ndarray) -> np.ndarray:
            acted = self.white(values)
            left = {k: v - acted[k] for k, v in self.truth.change.items()}
            m = self.case.mismatch.at
            inner = self.case.own[np.ix_(m, m)] + np.eye(len(m))
            onto = self.case.against(left, ()).products[m, 0]
            return np.concatenate(list(self.case.less(left, m, np.linalg.solve(inner, onto)).values()))

        found = least_squares(
            rest,
            self.start,
            bounds=(self.lower, self.upper),
            x_scale=np.maximum(np.abs(self.start), 0.05 * (self.upper - self.lower)),
            diff_step=0.01,
            max_nfev=EVALUATIONS,
        )
        return self.chi2(self.white(found.x))


def _found(name: str, rest: dict[tuple, np.ndarray], channels_: Sequence[Channel]) -> list[Start]:
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


def error_of(fault: Fault) -> float:
    """Share of its change that the truth's own model does not get right."""
    if fault.kind.name in PLANS:
        return MODEL_ERROR["plan"]
    return MODEL_ERROR["force"] if fault.kind.family == "force" else 0.0


def of_plan(
    plan: Plan, sizes: Sequence[float], library: Library, without: Sequence[str] = ()
) -> list[Decidability | None]:
    """D of each fault of a plan at its size; None of what the part alone shows, and of slips.

    `without`: effects that are taken out of the library.
    """
    shown = [
        (f.kind.signal != "scan" and f.kind.family != "set-up") or f.kind.name in EVENTS for f in plan.faults
    ]
    if not any(shown):
        return [None] * len(shown)
    case = Case(library, plan.how, plan.days)
    return [
        Truth(case, fault, size, without).decided() if seen else None
        for fault, size, seen in zip(plan.faults, sizes, shown, strict=True)
    ]
