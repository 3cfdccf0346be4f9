"""Components of a gap: what an effect of the library does to a signal, and functions of an admissible input.

**Signatures.** What an effect does per unit of its size, from the effect's own implementation. A block is an
effect at a target with one set of shapes; its columns are finite differences of `simulate` around the nominal
model, one for each of the settings that span the effect.

**Functions.** Columns of one input at one place, with the covariances that their weights may have. The grid
of hypotheses of a link is where by on what.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.effects import Applied, Effect, Parameter
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.errors import Gcode2KrlError
from gcode2krl.gap.compare.inputs import RINGS_HZ, SWINGS_HZ, Admissible
from gcode2krl.gap.compare.interpolation import hats
from gcode2krl.gap.compare.pair import from_base
from gcode2krl.gap.compare.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS

_PADDED = 4
"""Finer than the lines of a spectrum, between which a tone would hide."""

_Made = TypeVar("_Made")
_Key = tuple[float, str, str | None, tuple[tuple[str, float], ...]]


@dataclass(frozen=True)
class Block:
    """An effect at a target with its shapes."""

    effect: Effect
    target: str | None
    shape: Mapping[str, float] = field(default_factory=dict)
    tried: float = 1.0
    """Out of so many independent ones it was chosen by looking at the data."""

    @property
    def key(self) -> tuple[str, str | None]:
        """Return the names of effect and target."""
        return self.effect.name, self.target

    def settings(self, trace: Trace, size: float = 1.0) -> list[Applied]:
        """Return the effects whose signals, less the nominal ones, span the block; ``size`` 1 is typical."""
        phase, shapes = self.effect.phase, [dict(self.shape)]
        if phase is not None:
            shapes = [dict(self.shape) | {phase.name: turn} for turn in (0.0, math.pi / 2.0)]
        return [
            Applied(self.effect, self.target, values)
            for shape in shapes
            for values in self.effect.settings(trace.inputs, self.target, shape, size)
        ]

    def applied(
        self, coefficients: Floats, trace: Trace, shape: Mapping[str, float] | None = None
    ) -> Applied:
        """Return the effect that a combination of the block's columns is."""
        phase, form = self.effect.phase, dict(self.shape) | dict(shape or {})
        if phase is not None:
            form[phase.name] = math.atan2(coefficients[1], coefficients[0])
            coefficients = np.array([math.hypot(coefficients[0], coefficients[1])])
        values = self.effect.combined(coefficients, trace.inputs, self.target, form)
        return Applied(self.effect, self.target, values)

    def bounds(self, trace: Trace) -> tuple[Floats, Floats]:
        """Return the plausible range (c,), (c,) of the coefficients; symmetric where they are a vector."""
        effect, sizes = self.effect, self.effect.sizes
        if effect.phase is not None or effect.direction is not None:
            width = 2 if effect.phase is not None else 3 * len(sizes)
            most = max(_share(p.high, p, effect, trace, self.target) for p in sizes)
            return np.full(width, -most), np.full(width, most)
        ends = np.array(
            [sorted(_share(end, p, effect, trace, self.target) for end in (p.low, p.high)) for p in sizes]
        )
        return ends[:, 0], ends[:, 1]


def _share(value: float, p: Parameter, effect: Effect, trace: Trace, target: str | None) -> float:
    """Return the coefficient of the block's column at which the parameter has a value."""
    name = p.name
    nominal = effect.nominal(trace.inputs, target)[name]
    start = effect.start(trace.inputs, target)[name]
    return (value - nominal) / (start - nominal) if start != nominal else 0.0


def blocks_of(effect: Effect, target: str | None) -> Iterator[Block]:
    """Yield the blocks of an effect at a target, one a combination of shapes; a phase is in the columns."""
    phase = effect.phase
    seen = []
    for shape in effect.shapes():
        form = {name: value for name, value in shape.items() if phase is None or name != phase.name}
        if form not in seen:
            seen.append(form)
            yield Block(effect, target, form)


def blocks_at(
    effect: Effect, target: str | None, values: Sequence[float], looked_at: float
) -> Iterator[Block]:
    """Yield the blocks of an effect that begins at a moment or has a frequency, at these values of it.

    They were chosen out of ``looked_at`` independent ones: of frequencies one for each 1/T of the range, T
    the duration of a run (Scargle 1982).
    """
    searched, seen = effect.moment or effect.frequency, []
    if searched is None:
        return
    for block in blocks_of(effect, target):
        others = {name: value for name, value in block.shape.items() if name != searched.name}
        if others not in seen:
            seen.append(others)
            for value in values:
                tried = max(1.0, looked_at / len(values))
                yield Block(effect, target, others | {searched.name: value}, tried)


def strongest_hz(
    residuals: list[Floats], step_s: float, low: float, high: float, most: int
) -> tuple[float, ...]:
    """Return the frequencies of the highest peaks of the mean power of residuals (n, k), most powerful first.

    Neighbours within 15 % of a higher peak are not taken. Peaks are looked for in a spectrum smoothed over
    0.3 Hz; where one is, is the centre of its cubed power, which a steady tone has within a bin.
    """
    length = min(len(residual) for residual in residuals)
    padded = _PADDED * length
    mean = sum(
        np.abs(np.fft.rfft(rows[:length] - rows[:length].mean(axis=0), padded, axis=0)) ** 2
        for rows in residuals
    )
    power, hz = np.sum(mean, axis=1), np.fft.rfftfreq(padded, step_s)
    wide = max(1, round(0.3 * padded * step_s))
    smooth = np.convolve(power, np.ones(wide) / wide, mode="same")
    peaks: list[float] = []
    for i in np.argsort(-smooth):
        if low <= hz[i] <= high and all(abs(hz[i] / peak - 1.0) > 0.15 for peak in peaks):
            around = slice(max(i - wide, 0), i + wide + 1)
            weight = power[around] ** 3
            centre = float(weight @ hz[around] / max(float(weight.sum()), 1e-300))
            peaks.append(min(max(centre, low), high))
            if len(peaks) == most:
                break
    return tuple(peaks)


class Signatures:
    """Columns of blocks on traces, each computed once and kept as long as its trace is in use."""

    def __init__(self) -> None:
        self._by_trace: WeakKeyDictionary[Trace, dict[_Key, Floats]] = WeakKeyDictionary()
        self._made: WeakKeyDictionary[Trace, tuple[object, Any]] = WeakKeyDictionary()
        self._stacks: WeakKeyDictionary[Trace, tuple[list[_Key], Floats]] = WeakKeyDictionary()

    def once(self, trace: Trace, asked: object, make: Callable[[Trace], _Made]) -> _Made:
        """Return what ``make`` makes of a trace for a question, once as long as no other one is asked."""
        if trace not in self._made or self._made[trace][0] is not asked:
            self._made[trace] = asked, make(trace)
        made: _Made = self._made[trace][1]
        return made

    def same(self, known: Trace, other: Trace) -> None:
        """Let a trace whose stamps are moved by a few ms have the columns of the other one."""
        self._by_trace[other] = self._by_trace.setdefault(known, {})

    def columns(self, block: Block, trace: Trace, size: float = 1.0) -> Floats:
        """Return the block's columns (k, n, c) on a trace, none where the effect is not possible there."""
        known = self._by_trace.setdefault(trace, {})
        key = self._key(block, size)
        if key not in known:
            known[key] = _columns(block, trace, size)
        return known[key]

    def stacked(self, blocks: Sequence[Block], trace: Trace) -> Floats:
        """Return the columns (k, n, s) of blocks side by side, where they are kept from now on.

        But for blocks chosen by looking at the data: with some of it held out others are.
        """
        keys = [self._key(block) for block in blocks]
        if trace in self._stacks and self._stacks[trace][0] == keys:
            return self._stacks[trace][1]
        parts = [self.columns(block, trace) for block in blocks]
        stack, first = unwritten((*trace.shape[::-1], sum(part.shape[2] for part in parts))), 0
        for block, key, part in zip(blocks, keys, parts, strict=True):
            place = stack[:, :, first : first + part.shape[2]]
            for j, column in np.argwhere(part.any(axis=1)).tolist():
                place[j, :, column] = part[j, :, column]
            if block.tried == 1.0:
                self._by_trace[trace][key] = place
            first += part.shape[2]
        self._stacks[trace] = keys, stack
        return stack

    def forget(self) -> None:
        """Let go of all columns, when a link is judged; what is asked for again is made again."""
        self._by_trace.clear()
        self._stacks.clear()

    @staticmethod
    def _key(block: Block, size: float = 1.0) -> _Key:
        return (size, *block.key, tuple(sorted(block.shape.items())))


def _columns(block: Block, trace: Trace, size: float) -> Floats:
    n, k = trace.shape
    try:
        settings = block.settings(trace, size)
        columns = unwritten((k, n, len(settings)))
        for number, applied in enumerate(settings):
            change = (trace.sample([applied]) - trace.nominal).T
            change[~np.isfinite(change)] = 0.0
            for j in np.flatnonzero(change.any(axis=1)):
                columns[j, :, number] = change[j]
    except Gcode2KrlError:
        return np.zeros((k, n, 0))
    return columns


def unwritten(shape: tuple[int, int, int]) -> Floats:
    """Return zeros (k, n, c), one column of one component behind the other.

    What is never written takes no memory: most effects of a joint move it alone.
    """
    k, n, c = shape
    return np.zeros((k, c, n)).transpose(0, 2, 1)


_LIMITS = THRESHOLDS.components
_VARIES = 1e-9
"""An input whose values differ by a smaller share is constant: there is no function of it but a constant."""


class Functions(NamedTuple):
    """Columns (n, f) of each trace, and roots (f, f') of the covariances that their weights may have."""

    columns: tuple[Floats, ...]
    roots: tuple[Floats, ...]

    @property
    def width(self) -> int:
        """Return the number of functions."""
        return int(self.columns[0].shape[1])


def free(columns: Sequence[Floats]) -> Functions:
    """Return columns (n, f) whose weights are independent, those that do nothing left out."""
    scale = np.sqrt(np.mean(np.concatenate(columns) ** 2, axis=0))
    used = scale > _VARIES * max(float(scale.max(initial=0.0)), 1e-300)
    made = tuple(each[:, used] / scale[used] for each in columns)
    return Functions(made, (np.eye(int(used.sum())),))


def smooth(inputs: Sequence[Floats]) -> Functions:
    """Return functions of an input (n,) over its range in all traces, of each correlation length."""
    return _smooth(inputs, [np.zeros(len(each), dtype=int) for each in inputs], 1)


def smooth_in_each(inputs: Sequence[Floats]) -> Functions:
    """Return functions of an input (n,) that each trace has of its own."""
    return _smooth(inputs, [np.full(len(each), i) for i, each in enumerate(inputs)], len(inputs))


def smooth_sum(inputs: Sequence[Floats]) -> Functions:
    """Return functions of each of several inputs (n, c), whose sum a deviation may be."""
    parts = [smooth([each[:, i] for each in inputs]) for i in range(inputs[0].shape[1])]
    used = [part for part in parts if part.width]
    if not used:
        return smooth([np.zeros(len(each)) for each in inputs])
    columns = tuple(_side_by_side(*(part.columns for part in used)))
    return Functions(columns, tuple(in_each(root, len(used)) for root in used[0].roots))


def _smooth(inputs: Sequence[Floats], groups: Sequence[Floats], count: int) -> Functions:
    low, high = min(map(np.min, inputs)), max(map(np.max, inputs))
    if not high - low > _VARIES * max(abs(low), abs(high)):
        return Functions(tuple(np.zeros((len(each), 0)) for each in inputs), (np.eye(0),))
    knots = np.linspace(low, high, _LIMITS.knots)
    columns: list[Floats] = []
    for values, group in zip(inputs, groups, strict=True):
        wide = np.zeros((len(values), count, len(knots)))
        wide[np.arange(len(values)), group] = hats(values, knots)
        columns.append(wide.reshape(len(values), -1))
    roots = [in_each(_root(length), count) for length in _LIMITS.lengths]
    return Functions(tuple(columns), tuple(roots))


def in_each(root: Floats, count: int) -> Floats:
    """Return the root (f·count, f'·count) of a covariance that holds in each of several groups by itself."""
    return np.asarray(np.kron(np.eye(count), root), dtype=np.float64)


def _root(length: float) -> Floats:
    """Return a root of the covariance exp(-d²/(2·length²)) between knots at distances d."""
    at = np.arange(_LIMITS.knots)
    values, vectors = np.linalg.eigh(np.exp(-0.5 * ((at[:, None] - at) / length) ** 2))
    used = values > 1e-6 * values[-1]
    root: Floats = vectors[:, used] * np.sqrt(values[used])
    return root


def odd(inputs: Sequence[Floats]) -> list[Floats]:
    """Return x, x·|x| and tanh at two bends (n, 4) of an input (n,) over its largest value: odd functions."""
    most = max(float(np.abs(each).max(initial=0.0)) for each in inputs)
    if most == 0.0:
        return [np.zeros((len(each), 0)) for each in inputs]
    scaled = [each / most for each in inputs]
    return [np.stack([x, x * np.abs(x), np.tanh(3.0 * x), np.tanh(10.0 * x)], axis=1) for x in scaled]


def polynomials(inputs: Sequence[Floats], order: int) -> list[Floats]:
    """Return the powers (n, p) up to an order (1 or 2) of inputs (n, c) over their ranges, 1 first."""
    everything = np.concatenate(inputs)
    middle = (everything.max(axis=0) + everything.min(axis=0)) / 2.0
    half = np.maximum(np.ptp(everything, axis=0) / 2.0, 1e-12)
    return [_powers((each - middle) / half, order) for each in inputs]


def _powers(x: Floats, order: int) -> Floats:
    columns = [np.ones(len(x)), *x.T]
    if order > 1:
        columns += [x[:, i] * x[:, j] for i in range(x.shape[1]) for j in range(i, x.shape[1])]
    return np.stack(columns, axis=1)


def products(first: Sequence[Floats], second: Sequence[Floats]) -> list[Floats]:
    """Return every product (n, a·b) of columns (n, a) and (n, b)."""
    return [
        (factor[:, :, None] * other[:, None, :]).reshape(len(factor), -1)
        for factor, other in zip(first, second, strict=True)
    ]


_WARMS_H = (0.1, 0.3, 1.0, 3.0)
"""Time constants over which a cell drifts between runs."""
_OF_THE_PLAN = (Dependence.CORNERS, Dependence.VELOCITY, Dependence.STOPS)
"""What laws of a controller for corners, speeds and stops depend on."""

TIMING = "timing"
"""The place of what is late along the path."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where a deviation is: its name, and the columns (k, n, d) of each trace that a unit of it makes.

    Along each axis by itself d is 3, along one direction 1: of one name, for which the better one speaks.
    """

    name: str
    where: Where
    units: Sequence[Floats]
    joint: int | None = None
    component: int | None = None
    """Where it is one component of the signal alone; ``units`` are then (1, n, d)."""

    @property
    def width(self) -> int:
        """Return the number of axes along which a unit of it is: d."""
        return int(self.units[0].shape[2])

    def lifted(self, functions: Functions) -> tuple[list[Floats], tuple[Floats, ...]]:
        """Return columns (k, n, f·d) of functions at this place, and the roots of their covariances."""
        columns: list[Floats] = [
            (function[None, :, :, None] * unit[:, :, None, :]).reshape(*unit.shape[:2], -1)
            for function, unit in zip(functions.columns, self.units, strict=True)
        ]
        directions = np.eye(self.width)
        roots = [np.asarray(np.kron(root, directions), dtype=np.float64) for root in functions.roots]
        return columns, tuple(roots)


@dataclass(frozen=True, eq=False)
class Family:
    """A place and an input, and the columns (k, n, c) of each trace that functions of it make there."""

    place: Place
    on: Dependence
    columns: Sequence[Floats]
    roots: tuple[Floats, ...]
    directions: int = 1
    """So many columns next to each other are one function along the axes of the place."""


class Grid:
    """All hypotheses of a link, over all of its traces."""

    def __init__(self, traces: Sequence[Trace], sigma: Sequence[float]) -> None:
        """Take the rms (k,) of each component's noise: columns are in units of it."""
        self.traces = tuple(traces)
        self.inputs = [Admissible(trace) for trace in self.traces]
        self._sigma = np.array(sigma)

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """Where a deviation of the link can be: a joint, the tip and each joint, or the force."""
        trace = self.traces[0]
        if trace.link.tells_time:
            return (self._timing, *self._own_joints())
        if trace.link.of_joints:
            return tuple(self._own_joints())
        if trace.link.of_tip:
            return (*self._in_space("tip", Where.TIP), *self._arm_joints())
        return tuple(self._in_space("force", Where.FORCE_AXIS))

    @property
    def _timing(self) -> Place:
        """How late the run is along its path."""
        rms = np.sqrt(np.mean(np.concatenate([trace.rate for trace in self.traces]) ** 2, axis=0))
        scale = float(np.max(rms / self._sigma))
        units = [trace.rate.T[:, :, None] / max(scale, 1e-300) for trace in self.traces]
        return Place(TIMING, Where.JOINT, tuple(units))

    def _in_space(self, name: str, where: Where) -> Iterator[Place]:
        """Yield a place along its axes, along the tool, and along gravity where the tool is not."""
        yield Place(name, where, tuple(self._axes(trace) for trace in self.traces))
        tool = self._along([own.tool_axes[:, :, 2] for own in self.inputs])
        down = self._along([np.tile(t.inputs.gravity, (len(t.time_s), 1)) for t in self.traces])
        yield Place(name, where, tool)
        if not _is_alike(tool, down):
            yield Place(name, where, down)

    def _axes(self, trace: Trace) -> Floats:
        n, k = trace.shape
        return np.repeat(np.diag(self._sigma)[:, None, :], n, axis=1).reshape(k, n, k)

    def _along(self, vectors: Sequence[Floats]) -> tuple[Floats, ...]:
        """Return units (k, n, 1) along vectors (n, 3) of each trace in ``$BASE``."""
        sigma = float(np.mean(self._sigma))
        return tuple(
            sigma
            * from_base(vector, trace.frame, trace.inputs, trace.time_s)[:, list(trace.columns)].T[:, :, None]
            for trace, vector in zip(self.traces, vectors, strict=True)
        )

    def _own_joints(self) -> Iterator[Place]:
        trace = self.traces[0]
        for j, (name, column) in enumerate(zip(trace.components, trace.columns, strict=True)):
            units = [np.full((1, each.shape[0], 1), self._sigma[j]) for each in self.traces]
            yield Place(name, Where.JOINT, units, column, j)

    def _arm_joints(self) -> Iterator[Place]:
        columns = list(self.traces[0].columns)
        for joint in range(6):
            lifted = [np.moveaxis(own.jacobian[:, columns, joint], 1, 0)[:, :, None] for own in self.inputs]
            power = np.mean(np.concatenate(lifted, axis=1)[:, :, 0] ** 2, axis=1)
            scale = float(np.max(np.sqrt(power) / self._sigma))
            if scale > 0.0:
                yield Place(f"A{joint + 1}", Where.JOINT, tuple(each / scale for each in lifted), joint)

    def families(self, on: Dependence | None = None, at: str | None = None) -> Iterator[Family]:
        """Yield every family that is no step and no tone; those on one input, at one place, where stated."""
        for place in (each for each in self.places if at in (None, each.name)):
            for of, functions in self._functions(place):
                if functions.width and on in (None, of):
                    yield Family(place, of, *place.lifted(functions), directions=place.width)
            if place.width > 1 and place.where is Where.TIP:
                yield from self._of_the_pose(place)
            elif place.width > 1:
                yield from self._of_the_signal(place)
            if place.width > 1 and on in (None, Dependence.ACCELERATION):
                yield self._of_swings(place, RINGS_HZ if place.where is Where.TIP else SWINGS_HZ)
        if self.traces[0].link.tells_time and on in (None, *_OF_THE_PLAN) and at in (None, TIMING):
            yield from self._of_the_plan(self._timing)

    # Functions at a place

    def _functions(self, place: Place) -> Iterator[tuple[Dependence, Functions]]:
        inputs = self.inputs
        yield from self._of_time
        yield from self._of_motion(place)
        yield self._of_travel
        if place.joint is not None:
            yield from self._of_joint(place.joint)
        if any(each.force_N.any() for each in inputs):
            yield from self._of_force
            yield Dependence.METRES_CUT, self._of_metres_cut(place)
        if place.joint is None:
            yield Dependence.PLACE, smooth_sum([each.position_mm for each in inputs])
        if place.where is Where.FORCE_AXIS:
            yield Dependence.PLACE, free(self._pose(turned=True))
            yield Dependence.REVERSALS, free([each.drags for each in inputs])
        elif place.where is Where.JOINT:
            yield Dependence.PLACE, self._of_position

    # The same at every place

    @cached_property
    def _of_travel(self) -> tuple[Dependence, Functions]:
        return Dependence.TRAVEL, smooth([each.travel_mm for each in self.inputs])

    @cached_property
    def _of_position(self) -> Functions:
        return free(self._pose(turned=False))

    @cached_property
    def _of_time(self) -> list[tuple[Dependence, Functions]]:
        inputs, count = self.inputs, len(self.inputs)
        since_s, ones = [each.since_start_s for each in inputs], np.eye(count)[:, None]
        grown = [np.stack([-np.expm1(-each.hours / tau) for tau in _WARMS_H], axis=1) for each in inputs]
        functions = [
            (Dependence.CONSTANT, free([np.ones((len(each), 1)) for each in since_s])),
            (Dependence.RUN_TIME, smooth_in_each(since_s)),
            (Dependence.WALL_CLOCK, free(grown)),
            (Dependence.RUN_START, smooth(since_s)),
        ]
        if count > 1:
            runs = [np.repeat(run, len(each), axis=0) for run, each in zip(ones, since_s, strict=True)]
            functions.insert(2, (Dependence.RUN_TO_RUN, free(runs)))
        if any(each.spindle.any() for each in inputs):
            functions.append((Dependence.SPINDLE_SPEED, free([each.spindle for each in inputs])))
        if any(each.temperature_C.any() for each in inputs):
            temperature_C = [each.temperature_C for each in inputs]
            functions.append((Dependence.TEMPERATURE, smooth_sum(temperature_C)))
        return functions

    def _of_motion(self, place: Place) -> Iterator[tuple[Dependence, Functions]]:
        inputs = self.inputs
        if place.joint is not None:
            yield Dependence.VELOCITY, smooth([each.rate_rad_s[:, place.joint] for each in inputs])
            yield (
                Dependence.ACCELERATION,
                smooth([each.acceleration_rad_s2[:, place.joint] for each in inputs]),
            )
            yield Dependence.ACCELERATION, free([each.rings(place.joint) for each in inputs])
            if self.traces[0].link.of_joints:  # behind the arm's modes a jerk is no function any more
                yield Dependence.JERK, free([each.jerk(place.joint) for each in inputs])
            return
        velocity = [each.velocity_mm_s for each in inputs]
        speed = [np.linalg.norm(each, axis=1, keepdims=True) for each in velocity]
        along = [v / np.maximum(s, 1.0) for v, s in zip(velocity, speed, strict=True)]
        yield Dependence.VELOCITY, free(_side_by_side(velocity, along, speed))
        yield Dependence.ACCELERATION, free([each.acceleration_mm_s2 for each in inputs])

    def _of_joint(self, joint: int) -> Iterator[tuple[Dependence, Functions]]:
        inputs = self.inputs
        angle = [each.q_rad[:, joint] for each in inputs]
        yield Dependence.OWN_ANGLE, smooth(angle)
        yield Dependence.REVERSALS, free([each.reversals(joint) for each in inputs])
        ratios = self.traces[0].inputs.cell.robot.drives.gear_ratio
        if ratios is not None and ratios[joint] != 0.0:
            orders = ratios[joint] * np.arange(1, _LIMITS.harmonics + 1)
            turned = [each[:, None] * orders for each in angle]
            yield (
                Dependence.MOTOR_ANGLE,
                free([np.concatenate([np.cos(each), np.sin(each)], axis=1) for each in turned]),
            )
        if any(each.torque_Nm[:, joint].any() for each in inputs):
            loops = [each.torque_with_memory(joint) for each in inputs]
            single = odd([each.torque_Nm[:, joint] for each in inputs])
            # the weight of the links is part of the first; the force alone is what bends the arm
            loads = odd([each.load_torque_Nm[:, joint] for each in inputs])
            yield Dependence.OWN_TORQUE, free(_side_by_side(single, loops, loads))

    @cached_property
    def _of_force(self) -> list[tuple[Dependence, Functions]]:
        inputs = self.inputs
        force = [each.force_N for each in inputs]
        size = [np.linalg.norm(each, axis=1, keepdims=True) for each in force]
        most = max(float(each.max()) for each in size)
        unit = [f / np.maximum(s, 1e-3 * most) for f, s in zip(force, size, strict=True)]
        bent = [f * s / most for f, s in zip(force, size, strict=True)]
        place_ = polynomials([each.position_mm for each in inputs], 1)
        return [
            (Dependence.FORCE, free(_side_by_side(force, bent, unit, size))),
            (Dependence.FORCE_BY_PLACE, free(products(force, place_))),
        ]

    def _of_metres_cut(self, place: Place) -> Functions:
        """Return what grows with the metres cut: the force and, of the tip, a wear or a slip of its own.

        An encoder or a sensor in air knows of no cut.
        """
        inputs = self.inputs
        force = [each.force_N for each in inputs]
        cut = polynomials([each.cut_m[:, None] for each in inputs], 2)
        grows = products(force, [each[:, 1:] for each in cut])
        return free(_side_by_side(grows, force, *([cut] if place.where is Where.TIP else [])))

    def _pose(self, turned: bool) -> list[Floats]:
        """Return low polynomials of the position, with the axes of the tool where they matter."""
        position = polynomials([each.position_mm for each in self.inputs], 2)
        if not turned:
            return position
        axes = [each.tool_axes.reshape(-1, 9) for each in self.inputs]
        middle = np.concatenate(axes).mean(axis=0)
        return [np.concatenate([p, a - middle], axis=1) for p, a in zip(position, axes, strict=True)]

    def _of_the_signal(self, place: Place) -> Iterator[Family]:
        """Yield what depends on how fast the signal itself changes, and on where it was before.

        It is late by one time, which the data must find; it has a loop, each axis its own.
        """
        sigma = float(np.mean(self._sigma))
        late = _scaled([each.late() for each in self.inputs], sigma)
        yield Family(place, Dependence.VELOCITY, late, tuple(np.eye(late[0].shape[2])[:, :, None]))
        loops = [each.with_memory for each in self.inputs]
        wide = [
            np.einsum("knc,kj->knjc", loop, np.eye(len(loop))).reshape(*loop.shape[:2], -1) for loop in loops
        ]
        used = np.concatenate(wide, axis=1).any(axis=(0, 1))
        if used.any():
            loops = _scaled([each[:, :, used] for each in wide], sigma)
            yield Family(place, Dependence.FORCE, loops, (np.eye(loops[0].shape[2]),))

    def _of_swings(self, place: Place, modes_hz: Sequence[float]) -> Family:
        """Return what swings behind the tip's acceleration, each axis and mode by itself."""
        swings = _scaled([each.swings(modes_hz) for each in self.inputs], float(np.mean(self._sigma)))
        return Family(place, Dependence.ACCELERATION, swings, (np.eye(swings[0].shape[2]),))

    def _of_the_plan(self, place: Place) -> Iterator[Family]:
        """Yield what a controller makes of corners, speeds and stops by laws of its own."""
        inputs, at = self.inputs, list(self.traces[0].columns)
        sigma = float(np.mean(self._sigma))
        late, _ = place.lifted(free([each.at(each.corners.late_by_rounding) for each in inputs]))
        rounded = [np.moveaxis(each.at(each.corners.roundings)[:, :, at], 2, 0) for each in inputs]
        yield Family(place, Dependence.CORNERS, *_joined([late, _scaled(rounded, sigma)]))
        ramps = free([each.at(each.corners.late_by_ramps) for each in inputs])
        yield Family(place, Dependence.VELOCITY, *place.lifted(ramps))
        yield Family(place, Dependence.STOPS, *place.lifted(free(self._passed)))

    @property
    def _passed(self) -> list[Floats]:
        """(n, c) of each trace: 1 from each blended corner on, of one program the same in all runs."""
        programs = [
            b"" if trace.inputs.targets is None else trace.inputs.targets.position_mm.tobytes()
            for trace in self.traces
        ]
        passed = [inputs.corners.passed(inputs.nearest) for inputs in self.inputs]
        widths = {program: columns.shape[1] for program, columns in zip(programs, passed, strict=True)}
        firsts = dict(zip(widths, np.cumsum([0, *widths.values()]).tolist(), strict=False))
        wide = [np.zeros((len(columns), sum(widths.values()))) for columns in passed]
        for program, columns, whole in zip(programs, passed, wide, strict=True):
            whole[:, firsts[program] : firsts[program] + widths[program]] = columns
        return wide

    def _of_the_pose(self, place: Place) -> Iterator[Family]:
        """Yield what depends on the pose, and on force by it, in a way that the arm makes."""
        columns, _ = place.lifted(self._of_position)
        tool, arm_, bends = [], [], []
        at = list(self.traces[0].columns)
        sigma = float(np.mean(self._sigma))
        for inputs in self.inputs:
            tool.append(np.moveaxis(inputs.tool_axes[:, at], 1, 0) * sigma)
            arm_.append(np.moveaxis(inputs.jacobian[:, at], 1, 0))
            bends.append(arm_[-1] * inputs.load_torque_Nm)
        with_arm = [columns, tool, _scaled(arm_, sigma)]
        yield Family(place, Dependence.PLACE, *_joined(with_arm))
        if any(each.any() for each in bends):
            force = products(
                [each.force_N for each in self.inputs],
                polynomials([each.position_mm for each in self.inputs], 1),
            )
            lifted, _ = place.lifted(free(force))
            yield Family(place, Dependence.FORCE_BY_PLACE, *_joined([lifted, _scaled(bends, sigma)]))


def _side_by_side(*parts: Sequence[Floats]) -> list[Floats]:
    """Return the columns (n, c) of several parts side by side, of each trace."""
    return [np.concatenate(each, axis=1) for each in zip(*parts, strict=True)]


def _is_alike(first: Sequence[Floats], second: Sequence[Floats]) -> bool:
    """Tell whether units (k, n, 1) of each trace are along one line, to a tenth of their length."""
    vector, other = (np.concatenate(each, axis=1)[:, :, 0] for each in (first, second))
    whole = np.sum(vector**2) * np.sum(other**2)
    return bool(np.sum(vector * other) ** 2 > 0.99 * whole)


def _scaled(columns: Sequence[Floats], size: float) -> list[Floats]:
    """Return columns (k, n, c), each with this rms over components and traces."""
    rms = np.sqrt(np.mean(np.concatenate(columns, axis=1) ** 2, axis=(0, 1)))
    return [each * (size / np.maximum(rms, 1e-300)) for each in columns]


def _joined(parts: Sequence[Sequence[Floats]]) -> tuple[list[Floats], tuple[Floats, ...]]:
    """Return the columns of several parts (k, n, c) side by side, with independent weights."""
    joined = [np.concatenate(each, axis=2) for each in zip(*parts, strict=True)]
    return joined, (np.eye(joined[0].shape[2]),)
