"""Dry runs beside a prediction with forces: their tips show nothing of the deflection."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from gcode2krl.errors import Issue
from gcode2krl.gap.beside.links import MECHANICS
from gcode2krl.gap.beside.pair import Pair
from gcode2krl.gap.beside.simulator import Simulator
from gcode2krl.gap.slips.slip import rms
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.slips


def without_cuts(pairs: Iterable[Pair]) -> tuple[list[Pair], list[Issue]]:
    """Return the pairs, those in air without forces; a warning for each that nobody stated."""
    found, issues = [], []
    simulators: dict[Simulator, Simulator] = {}
    for pair in pairs:
        stated = pair.run.head.in_air
        if stated is False or not pair.inputs.force_base_N.any():
            found.append(pair)
            continue
        in_air = _in_air(pair, simulators.setdefault(pair.simulator, Simulator()))
        if stated or _is_nearer(pair, in_air):
            found.append(in_air)
            if not stated:
                words = (
                    f"{pair.name}: the tip shows nothing of the predicted deflection: taken as a run in air"
                )
                remedy = "in_air = true in run.toml; false where something was cut"
                issues.append(Issue("warning", "run-in-air", 0, words, remedy))
        else:
            found.append(pair)
    return found, issues


def _in_air(pair: Pair, simulator: Simulator) -> Pair:
    nothing = np.zeros_like(pair.inputs.force_base_N)
    inputs = replace(pair.inputs, force_base_N=nothing, moment_base_Nmm=nothing, forces=None, cut=None)
    return replace(pair, inputs=inputs, simulator=simulator)


def _is_nearer(pair: Pair, in_air: Pair) -> bool:
    """Tell whether the tip is nearer to the model without forces from the first cut to the last."""
    traces, bare = MECHANICS.traces([pair]), MECHANICS.traces([in_air])
    if not traces or not bare or traces[0].in_sensor_frame or traces[0].in_tool_frame:
        return False
    _, rows, bare_rows = np.intersect1d(traces[0].time_s, bare[0].time_s, return_indices=True)
    cutting, air = traces[0].residual[rows], bare[0].residual[bare_rows]
    bent_mm = np.linalg.norm(traces[0].nominal[rows] - bare[0].nominal[bare_rows], axis=1)
    is_bent = bent_mm > 0.5 * bent_mm.max(initial=0.0)
    if is_bent.sum() < THRESHOLDS.beside.trace_least_rows:
        return False
    quarters = zip(np.array_split(cutting[is_bent], 4), np.array_split(air[is_bent], 4), strict=True)
    return all(rms([own]) < _LIMITS.air_share * rms([other]) for other, own in quarters)
