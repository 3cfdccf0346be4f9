"""A controller that moves by a model of the robot of its own: what it adds to the planned joints."""

from dataclasses import replace

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.beside.interpolation import cubic
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.thresholds import THRESHOLDS

LIMITS = THRESHOLDS.beside


def with_own_model(pair: Pair) -> Pair:
    """Return the pair with what a controller's own model of the robot adds to the planned joints.

    The addition is taken to be a polynomial of second degree in the six angles (an assumption), fitted by
    least squares together with the offset of the table's clock.
    """
    table, inputs = pair.run.controller, pair.inputs
    if table is None or table.q_cmd_rad is None or pair.from_log:
        return pair
    offset_s, values = 0.0, np.zeros((1, 6))
    for _ in range(LIMITS.own_model_steps):
        stamps = pair.stamps(table) - offset_s
        wanted, before, after = (
            cubic(stamps + s, inputs.time_s, inputs.q_cmd_rad)
            for s in (0.0, -LIMITS.rate_step_s, LIMITS.rate_step_s)
        )
        rate = (after - before) / (2.0 * LIMITS.rate_step_s)
        terms = _of_second_degree(wanted, inputs.q_cmd_rad)
        difference = np.nan_to_num(table.q_cmd_rad - wanted)
        fitted = np.linalg.lstsq(terms, np.concatenate([difference, rate], axis=1), rcond=1e-8)[0]
        late = difference - terms @ fitted[:, :6]
        moves = rate - terms @ fitted[:, 6:]
        step_s = -float(np.sum(late * moves)) / max(float(np.sum(moves**2)), 1e-30)
        offset_s, values = offset_s + step_s, fitted[:, :6] + step_s * fitted[:, 6:]
    added = _of_second_degree(inputs.q_cmd_rad, inputs.q_cmd_rad) @ values
    inputs = replace(inputs, q_cmd_rad=inputs.q_cmd_rad + added)
    return replace(pair.later("controller", offset_s), inputs=inputs)


def with_nominal_joints(pair: Pair) -> Pair:
    """Return the pair with the planned joints in its controller's table; the drives' errors stay in it.

    For a controller whose own model of the robot makes its joints differ from the plan while its tip is where
    it was commanded. Clocks must have been set before.
    """
    table = pair.run.controller
    if table is None or table.q_cmd_rad is None or pair.from_log:
        return pair
    wanted = cubic(pair.stamps(table), pair.inputs.time_s, pair.inputs.q_cmd_rad)
    difference = np.nan_to_num(table.q_cmd_rad - wanted)
    nominal = replace(
        table,
        q_cmd_rad=table.q_cmd_rad - difference,
        q_act_rad=None if table.q_act_rad is None else table.q_act_rad - difference,
        q_load_rad=None if table.q_load_rad is None else table.q_load_rad - difference,
    )
    return replace(pair, run=replace(pair.run, controller=nominal))


def _of_second_degree(q_rad: Floats, among_rad: Floats) -> Floats:
    """Return 1, angles and their products (n, 28) of poses (n, 6), in units of the spread among others."""
    spread = np.maximum(among_rad.std(axis=0), 1e-9)
    q = (q_rad - among_rad.mean(axis=0)) / spread
    first, second = np.triu_indices(q.shape[1])
    terms: Floats = np.concatenate([np.ones((len(q), 1)), q, q[:, first] * q[:, second]], axis=1)
    return terms
