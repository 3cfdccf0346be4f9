"""What may explain a slow movement of a signal: the admissible inputs as columns, for each component.

The inputs are those that families are made of (`beside.admissible`). Noise is cleaned of them column by
column, so each is given in few simple forms: itself, half waves over its range, its reversals and plays.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.admissible import Admissible
from gcode2krl.gap.beside.trace import Trace

_PLACE_WAVES, _ANGLE_WAVES = 4, 3
"""Half waves over the range of a coordinate or of a joint."""
_BENDS = (3.0, 10.0)
"""How soon an odd function of a torque is full, as shares of its range."""
_SETTLES_S = (1.0, 3.0, 10.0)
_STILL = 1e-9
"""A coordinate of less range does not move."""


def explaining_columns(traces: Sequence[Trace]) -> Iterator[list[Floats]]:
    """Yield for each component columns (n, c) of each trace, alike in all traces."""
    inputs = [Admissible(trace) for trace in traces]
    parts = [
        [np.column_stack([*_of_motion(each)]) for each in inputs],
        _waves([each.position_mm for each in inputs], _PLACE_WAVES),
        _waves([each.q_rad for each in inputs], _ANGLE_WAVES),
    ]
    if any(each.presses for each in inputs):
        parts.append([np.column_stack([*_of_force(each)]) for each in inputs])
    if len({each.temperature_C.shape[1] for each in inputs}) == 1:
        parts.append([each.temperature_C for each in inputs])
    shared = [np.column_stack(own) for own in zip(*parts, strict=True)]
    for j in range(traces[0].shape[1]):
        yield [
            np.column_stack([common, *_of_component(each, j)])
            for each, common in zip(inputs, shared, strict=True)
        ]


def _of_motion(inputs: Admissible) -> Iterator[Floats]:
    """Yield what any component may follow: place, angles, their rates and reversals, spindle, the start."""
    rates, velocity = inputs.rate_rad_s, inputs.velocity_mm_s
    yield from (inputs.position_mm, inputs.q_rad, rates, np.abs(rates), inputs.acceleration_rad_s2)
    yield from (inputs.directions, velocity, inputs.acceleration_mm_s2)
    yield from (np.linalg.norm(velocity, axis=1), inputs.travel_mm, inputs.spindle)
    # what settles after each start, alike in all runs
    yield np.exp(-inputs.since_start_s[:, None] / np.array(_SETTLES_S))


def _of_force(inputs: Admissible) -> Iterator[Floats]:
    """Yield the force, the same by place, and what grows with the metres cut."""
    force, position = inputs.force_N, inputs.position_mm
    yield from (force, np.linalg.norm(force, axis=1))
    yield (force[:, :, None] * position[:, None, :]).reshape(len(force), -1)
    yield from (force * inputs.cut_m[:, None], inputs.cut_m)


def _of_component(inputs: Admissible, component: int) -> Iterator[Floats]:
    """Yield what this component may follow in a way of its own: a joint its load, a tip its tool and arm."""
    trace = inputs.trace
    column = trace.columns[component]
    if trace.link.of_joints:
        torque = inputs.torque_Nm[:, column]
        yield _odd(torque)
        yield inputs.torque_with_memory(column)
        yield inputs.reversals(column)
        return
    # a constant vector that turns with the tool, as seen along this axis
    yield inputs.tool_axes[:, column % 3]
    if trace.link.of_tip:
        yield inputs.jacobian[:, column]
        yield inputs.jacobian[:, column] * inputs.torque_Nm
        yield inputs.jacobian[:, column] * inputs.directions
    else:
        yield trace.rate[:, component]
        yield inputs.with_memory[component]


def _odd(values: Floats) -> Floats:
    """Return odd functions (n, 3) of values (n,), straight and bent."""
    most = max(float(np.abs(values).max(initial=0.0)), _STILL)
    return np.stack([values, *(np.tanh(bend * values / most) for bend in _BENDS)], axis=1)


def _waves(tables: Sequence[Floats], count: int) -> list[Floats]:
    """Return half waves (n, w) of the columns of tables (n, c) over their range in all traces."""
    low = np.min([each.min(axis=0) for each in tables], axis=0)
    reach = np.max([each.max(axis=0) for each in tables], axis=0) - low
    moving = reach > _STILL
    orders = np.pi * np.arange(1, count + 1)
    scaled = [(each[:, moving] - low[moving]) / reach[moving] for each in tables]
    return [np.cos(each[:, :, None] * orders).reshape(len(each), -1) for each in scaled]
