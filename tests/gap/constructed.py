"""Small cases with known answers: a motion made of sines, traces of it, effects that are known forms of time.

What several tests build of fit/ and choose/ is built here, so that a renamed function is renamed once.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from gcode2krl import load_cell, robot
from gcode2krl.effects import Applied, Effect, Inputs, Parameter
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.errors import input_error
from gcode2krl.gap.compare.links import LINKS
from gcode2krl.gap.compare.pair import Pair, Simulator
from gcode2krl.gap.compare.trace import Trace
from gcode2krl.gap.components import blocks_of
from gcode2krl.gap.noise.nuisance import Nuisance, Question
from gcode2krl.gap.noise.short import white
from gcode2krl.gap.posterior.examination import Examination
from gcode2krl.gap.posterior.gram import Gram, SplitColumns, UsedColumns
from gcode2krl.gap.posterior.likelihood import Likelihood, refit
from gcode2krl.gap.posterior.selection import examine
from gcode2krl.runs import Controller, Run, RunHead

STEP_S = 0.02
SECONDS = 10.0
Q0_RAD = np.radians([5.0, -85.0, 95.0, 10.0, 25.0, 15.0])
AMPLITUDE_RAD = np.radians([6.0, 4.0, 5.0, 8.0, 7.0, 9.0])
HZ = np.array([0.31, 0.23, 0.37, 0.29, 0.41, 0.19])
LINK = {link.name: link for link in LINKS}
PLANNED = {
    "path": ("q_cmd_rad", None),
    "servo": ("q_act_rad", "q_cmd_rad"),
    "gear": ("q_load_rad", "q_act_rad"),
    "force": ("force_meas_base_N", None),
    "mechanics": ("tcp_base_mm", None),
}
"""Which signals of the model a link compares."""


def joints(time_s: np.ndarray) -> np.ndarray:
    """Return the commanded joints (n, 6) of the motion at any time."""
    return Q0_RAD + AMPLITUDE_RAD * np.sin(2.0 * np.pi * HZ * time_s[:, None])


def joint_rates(time_s: np.ndarray) -> np.ndarray:
    """Return their derivatives (n, 6)."""
    w = 2.0 * np.pi * HZ
    return AMPLITUDE_RAD * w * np.cos(w * time_s[:, None])


@functools.cache
def cell():
    return load_cell()


@functools.cache
def motion(seconds: float = SECONDS, step_s: float = STEP_S) -> Inputs:
    """Return the inputs of a motion in air whose joints are sines of time."""
    time_s = np.arange(0.0, seconds, step_s)
    count = len(time_s)
    q_rad = joints(time_s)
    position, rotation = robot.forward(q_rad, cell(), 1)
    nothing = np.zeros((count, 3))
    return Inputs(
        cell=cell(),
        time_s=time_s,
        move=np.zeros(count, dtype=np.int32),
        source_line=np.arange(1, count + 1, dtype=np.int32),
        path_mm=np.zeros(count),
        tool=np.ones(count, dtype=np.int32),
        spindle_rad_s=np.zeros(count),
        q_cmd_rad=q_rad,
        position_mm=position,
        rotation=rotation,
        force_base_N=nothing,
        moment_base_Nmm=nothing,
    )


class Added(Effect):
    """``size`` times a known form of time, added to the motor side of a joint; range ±10, typically 1."""

    family = "joint"
    links = frozenset({"servo"})

    def __init__(self, name: str, form: Callable[[np.ndarray], np.ndarray], low=-10.0, high=10.0) -> None:
        self.name, self.form = name, form
        self.parameters = (
            Parameter("size_rad", "rad", low, high, nominal=0.0, start=1.0, source="a test", linear=True),
        )

    def targets(self, cell):
        return ("A1",)

    def servo(self, q_act_rad, inputs, applied):
        q = np.array(q_act_rad)
        q[:, 0] += applied["size_rad"] * self.form(inputs.time_s)
        return q


class Impossible(Added):
    """An effect that no run can have: simulating it is an error."""

    def servo(self, q_act_rad, inputs, applied):
        raise input_error("effect-impossible", "this cannot be", "do without it")


def wave(hz: float, name: str = "", low=-10.0, high=10.0) -> Added:
    """Return an effect that is a sine of time; those of whole turns in the run are orthogonal."""
    return Added(name or f"wave_{hz:g}", lambda t: np.sin(2.0 * np.pi * hz * t), low, high)


def applied(effect: Effect, size: float, target: str | None = "A1") -> Applied:
    return Applied(effect, target, {effect.names[0]: size})


def trace(residual: np.ndarray, link: str = "servo", number: int = 0, inputs: Inputs | None = None, **more):
    """Return a trace of a link (n, k) whose measured values differ from the nominal model by a residual."""
    inputs = motion(STEP_S * len(residual)) if inputs is None else inputs
    plus, minus = PLANNED[link]
    columns = tuple(range(residual.shape[1]))
    made = Trace(
        link=LINK[link],
        run=f"run-{number + 1}",
        run_number=number,
        simulator=Simulator(),
        factor=1.0,
        components=tuple(f"A{i + 1}" if LINK[link].of_joints else "xyz"[i] for i in columns),
        columns=columns,
        plus=plus,
        minus=minus,
        inputs=inputs,
        time_s=inputs.time_s,
        measured=residual,
        segments=np.array([[0, len(residual)]], dtype=np.int64),
    )
    made = replace(made, **more)
    return replace(made, measured=residual + made.nominal)


def columns_nuisance(name: str, *columns: np.ndarray, shared: bool = True) -> Nuisance:
    """Return nuisance of one component with some columns (n,)."""
    return Nuisance(name, shared, np.stack(columns, axis=1)[None])


def likelihood(traces: Sequence[Trace], nuisance: Sequence[Sequence[Nuisance]] = (), sigma=1.0) -> Likelihood:
    """Return the likelihood of traces beside white noise."""
    own = list(nuisance) or [[] for _ in traces]
    return Likelihood(list(traces), own, [white(sigma)] * traces[0].shape[1])


def gram(one: Trace, signatures: np.ndarray, nuisance: Sequence[Nuisance] = (), sigma=1.0) -> Gram:
    """Return the Gram matrices of a trace (n, 1) with signatures (n, s), its residual taken as the data."""
    made = likelihood([one], [nuisance], sigma)
    nothing = [np.zeros((1, len(one.time_s), 0))]
    return made.gram([signatures[None]]).beside(made.data((), nothing))


def question(effects: Sequence[Effect], target: str | None = "A1", **more) -> Question:
    """Return the question whether some effects are at work, without normal mismatch of the library."""
    blocks = [block for effect in effects for block in blocks_of(effect, target)]
    return Question({}, blocks, Mismatch(), frozenset(), **more)


def examined(
    traces: Sequence[Trace], asked: Question | Sequence[Effect], sigma: float | None = None
) -> Examination:
    """Return what a link's data say of some effects of A1; with ``sigma`` the noise is known."""
    asked = asked if isinstance(asked, Question) else question(asked)
    known = None if sigma is None else [white(sigma)] * traces[0].shape[1]
    return examine(traces[0].link, list(traces), asked, None, known)


def refitted(made: Examination, data: Trace, sigma: float) -> Examination:
    """Return an examination with its effects fitted to other data; nothing is chosen again."""
    other = likelihood([data], sigma=sigma)
    return replace(
        made,
        data=replace(made.data, traces=(data,), likelihood=other),
        fitted=refit(other, made.applied),
    )


def noise(count: int, seed: int, sigma: float = 1.0, width: int = 1) -> np.ndarray:
    """Return white noise (count, width)."""
    return sigma * np.random.default_rng(seed).standard_normal((count, width))


def table(kind: type, time_s: np.ndarray, **columns: np.ndarray):
    """Return a table of a run without gaps."""
    count = len(time_s)
    rows = {"time_s": time_s, "row": np.arange(count) + 2, "segments": np.array([[0, count]])}
    return kind(**rows, source=f"{kind.__name__.lower()}.csv", **columns)


def controller(time_s: np.ndarray, **columns: np.ndarray) -> Controller:
    """Return a controller's table without gaps."""
    return table(Controller, time_s, **columns)


def pair(inputs: Inputs | None = None, head: RunHead | None = None, number: int = 0, **tables) -> Pair:
    """Return a run with some tables beside the motion."""
    name = f"run-{number + 1}"
    run = Run(name, Path(name), head or RunHead(), **tables)
    return Pair(run=run, number=number, inputs=inputs or motion(), simulator=Simulator())


def stub(**values) -> SimpleNamespace:
    """Return as much of an object as a function looks at."""
    return SimpleNamespace(**values)


def split(columns, components) -> SplitColumns:
    """Return columns (v, m) by stretches of rows that are of one component (v,)."""
    edges = [0, *(np.flatnonzero(np.diff(components)) + 1).tolist(), len(columns)]
    parts = [columns[first:last] for first, last in pairwise(edges)]
    used = [np.flatnonzero(part.any(axis=0)) for part in parts]
    return SplitColumns.of_parts(
        [UsedColumns(part[:, at], at) for part, at in zip(parts, used, strict=True)], columns.shape[1]
    )
