"""How far the gap shrinks if the effect, its target and its parameters are known.

The effect is put into the model by the library's own implementation and with the true parameters. Where the
plant's effect has another form than the library's, the oracle takes the size that fits best instead, normal
mismatch of the signal fitted beside it: per run a shift, a clock, for forces a gain.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gap_blind_words import flat, truth_of

LINK = {"timing": "PATH", "joint_commanded": "PATH", "joint_actual": "SERVO", "joint_load": "GEAR"}
LINK |= {"force": "FORCE", "tcp": "MECHANICS"}
"""Signal of the answer -> its link's name in ``gcode2krl.gap.compare.links``."""
TRIALS = (0.25, 0.4, 0.6, 0.8, 1.0, 1.2, 1.5, 2.0, 3.0)


def oracle(label: dict, result: dict, runs: Sequence[Any], prediction: Any) -> dict[str, Any] | None:
    """Return the power that the truth takes from the signal that the diagnosis reports; None if it cannot.

    In the squared unit of the report, a mean over the rows of all runs; none of them chose anything here, so
    all are held out. ``removed`` is counted after normal mismatch, as it is with the truth in the model.
    """
    signal = (result.get("gap") or {}).get("signal")
    if signal not in LINK:
        return None
    traces = _traces(LINK[signal], runs, prediction)
    entry = label["effects"][0]
    truth = _applied(entry, traces[0].inputs) if traces else None
    if truth is None:
        return None
    nominal = truth.effect.nominal(traces[0].inputs, truth.target)
    tried = [truth] if entry["form"] == "same" else [_times(truth, nominal, size) for size in TRIALS]
    best = min(tried, key=lambda one: _left(traces, one))
    usual = [_mismatch(trace, best) for trace in traces]
    before = _mean_square([trace.residual for trace in traces])
    gap = _mean_square([trace.residual - own for trace, own in zip(traces, usual, strict=True)])
    left = _mean_square(
        [trace.measured - trace.sample([best]) - own for trace, own in zip(traces, usual, strict=True)]
    )
    unit = traces[0].factor ** 2
    return {"signal": signal, "before": before * unit, "removed": (gap - left) * unit}


def _traces(link: str, runs: Sequence[Any], prediction: Any) -> list[Any]:
    """Return the measured signal of a link beside its model, run by run."""
    from gcode2krl.gap.compare import links
    from gcode2krl.gap.compare.pair import pairs_of

    found: list[Any] = getattr(links, link).traces(list(pairs_of(prediction, runs)))
    return found


def _applied(entry: dict, inputs: Any) -> Any:
    from gcode2krl.effects import Applied, library

    effect = library().get(entry["effect"])
    if effect is None:
        return None
    target = truth_of(entry)[1]
    if target not in effect.targets(inputs.cell):
        return None
    effect = effect.at(target)
    known = flat(entry)
    if not set(known) & set(effect.names):
        return None
    values = effect.nominal(inputs, target) | {name: known[name] for name in effect.names if name in known}
    return Applied(effect, target, values)


def _times(one: Any, nominal: dict[str, float], size: float) -> Any:
    """Return an effect with its deviations from nominal multiplied by a factor; shapes unchanged."""
    values = {
        name: value if one.effect.parameter(name).is_shape else nominal[name] + size * (value - nominal[name])
        for name, value in one.values.items()
    }
    return replace(one, values=values)


def _nuisance(trace: Any) -> np.ndarray:
    """Return (n·k, c): a shift of each column, the clock, and for forces a gain of each column."""
    n, k = trace.shape
    late = replace(trace, minus=None).rate
    columns = [np.kron(np.eye(k), np.ones((n, 1))), late.T.reshape(-1, 1)]
    if trace.signal == "force":
        columns.append(np.kron(np.eye(k), np.ones((n, 1))) * trace.nominal.T.reshape(-1, 1))
    return np.concatenate(columns, axis=1)


def _left(traces: Sequence[Any], one: Any) -> float:
    """Return the sum of squares that an effect and the nuisance leave."""
    return sum(
        float(np.sum((trace.measured - trace.sample([one]) - _mismatch(trace, one)) ** 2)) for trace in traces
    )


def _mismatch(trace: Any, one: Any) -> np.ndarray:
    """Return the part of the residual (n, k) with an effect in the model that the nuisance explains."""
    residual = (trace.measured - trace.sample([one])).T.ravel()
    wide = _nuisance(trace)
    return (wide @ np.linalg.lstsq(wide, residual, rcond=None)[0]).reshape(trace.shape[1], -1).T


def _mean_square(residuals: Sequence[np.ndarray]) -> float:
    return float(np.mean(np.concatenate([np.sum(each**2, axis=1) for each in residuals])))
