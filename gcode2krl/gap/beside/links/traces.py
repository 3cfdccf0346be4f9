"""How the trace of a link is made: joints of the controller's table, or a vector of another instrument."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gcode2krl.arrays import Bools, Floats
from gcode2krl.effects import Applied, Inputs
from gcode2krl.gap.beside.holdout import with_rows
from gcode2krl.gap.beside.pair import Pair, usable_rows
from gcode2krl.gap.beside.trace import Trace
from gcode2krl.gap.thresholds import THRESHOLDS
from gcode2krl.runs import Controller, Measured
from gcode2krl.units import DEG_PER_RAD

if TYPE_CHECKING:
    from gcode2krl.gap.beside.links.base import Link

LIMITS = THRESHOLDS.beside

JOINTS = ("A1", "A2", "A3", "A4", "A5", "A6")


def joint_trace(
    link: "Link",
    pair: Pair,
    table: Controller,
    values: Floats,
    plus: str,
    minus: str | None,
    *,
    base: Sequence[Applied] = (),
    sigma_rad: float | None = None,
) -> Trace | None:
    """Return the values (n, 6) of the joints that were recorded and move; None where there is none.

    ``plus`` less ``minus`` are the signals of the model; ``sigma_rad`` is the stated noise.
    """
    recorded = np.isfinite(values).all(axis=0) & _moves(table)
    stamps = pair.stamps(table)
    rows, segments = usable_rows(table, stamps, pair.inputs, _ends_s(pair))
    if not recorded.any() or len(rows) == 0:
        return None
    columns = tuple(np.flatnonzero(recorded).tolist())
    return Trace(
        link=link,
        run=pair.name,
        run_number=pair.number,
        factor=DEG_PER_RAD,
        components=tuple(JOINTS[column] for column in columns),
        columns=columns,
        plus=plus,
        minus=minus,
        inputs=pair.inputs,
        simulator=pair.simulator,
        base=tuple(base),
        time_s=stamps[rows],
        measured=values[np.ix_(rows, np.array(columns))],
        segments=segments,
        declared_sigma=sigma_rad,
    )


def _moves(table: Controller) -> Bools:
    """Return which joints (6,) ever move, by whatever of them is recorded; a joint at rest tells nothing."""
    moving = np.zeros(6, dtype=np.bool_)
    for values in (table.q_cmd_rad, table.q_act_rad):
        if values is not None:
            moving |= np.nan_to_num(np.ptp(values, axis=0)) > LIMITS.joint_moves_rad
    return moving


def vector_trace(
    link: "Link",
    pair: Pair,
    table: Measured,
    values: Floats,
    plus: str,
    *,
    base: Sequence[Applied] = (),
    frame: str = "base",
    sigma: float | None = None,
) -> Trace:
    """Return the values (n, 3) along the axes of ``frame`` (base, tcp, sensor), jumps of the force left out.

    ``plus`` is the signal of the model; ``sigma`` is the stated noise.
    """
    stamps = pair.stamps(table)
    rows, segments = usable_rows(table, stamps, pair.inputs, _ends_s(pair))
    trace = Trace(
        link=link,
        run=pair.name,
        run_number=pair.number,
        factor=1.0,
        components=("x", "y", "z"),
        columns=(0, 1, 2),
        plus=plus,
        inputs=pair.inputs,
        simulator=pair.simulator,
        base=tuple(base),
        time_s=stamps[rows],
        measured=values[rows],
        segments=segments,
        declared_sigma=sigma,
        in_sensor_frame=frame == "sensor",
        in_tool_frame=frame == "tcp",
        still=pair.still,
    )
    return with_rows(trace, ~at_edges(pair.inputs, trace.time_s))


def at_edges(inputs: Inputs, time_s: Floats) -> Bools:
    """Return where (n,) the predicted force jumps, some hundredths of a second around it.

    Removal finds an edge of the cut to a sample; within it the force is right or wrong by all of itself.
    """
    force = inputs.force_base_N
    largest = float(np.linalg.norm(force, axis=1).max(initial=0.0))
    if largest == 0.0:
        return np.zeros(len(time_s), dtype=np.bool_)
    own_s = inputs.time_s
    later = np.stack([np.interp(own_s + LIMITS.jump_s, own_s, column) for column in force.T], axis=1)
    jumps = own_s[np.linalg.norm(later - force, axis=1) > LIMITS.jump_share * largest] + LIMITS.jump_s / 2.0
    if len(jumps) == 0:
        return np.zeros(len(time_s), dtype=np.bool_)
    after = np.clip(np.searchsorted(jumps, time_s), 1, len(jumps) - 1) if len(jumps) > 1 else 0
    before = np.maximum(after - 1, 0)
    nearest = np.minimum(np.abs(time_s - jumps[after]), np.abs(time_s - jumps[before]))
    near: Bools = nearest < LIMITS.jump_left_out_s
    return near


def _ends_s(pair: Pair) -> float:
    """Return how near to the ends of its model a row is left out: a log alone may begin in motion."""
    return LIMITS.log_ends_s if pair.from_log and not pair.still else 0.0
