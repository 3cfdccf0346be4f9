"""How far the gap shrinks if the effect, its target and its parameters are known.

The effect is put into the model by the library's own implementation and with the true parameters. Where the
plant's effect has another form than the library's, the oracle takes the size that fits best instead, normal
mismatch of the signal fitted beside it: per run a shift, a clock, for forces a gain.
"""

import importlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

LINK = {
    "timing": "path",
    "joint_commanded": "path",
    "joint_actual": "servo",
    "joint_load": "gear",
    "force": "force",
    "tcp": "mechanics",
}
RENAMED = {"kg": "mass_kg", "frame_off_mm": ("x_mm", "y_mm", "z_mm"), "h0_N": ("h0_x_N", "h0_y_N", "h0_z_N")}
RENAMED |= {"direction": ("direction_x", "direction_y", "direction_z")}
RENAMED |= {"H_N_rad": tuple(f"H_{row}{column}_N_rad" for row in "xyz" for column in "xyz")}
TRIALS = (0.25, 0.4, 0.6, 0.8, 1.0, 1.2, 1.5, 2.0, 3.0)


def flat(parameters: dict[str, Any]) -> dict[str, float]:
    """Return the numbers of a label under the library's names; words are left out."""
    out: dict[str, float] = {}
    for key, value in parameters.items():
        names = RENAMED.get(key, key)
        if isinstance(value, list):
            if isinstance(names, tuple):
                out |= dict(zip(names, np.ravel(value).tolist(), strict=True))
        elif isinstance(value, int | float):
            out[names if isinstance(names, str) else names[0]] = float(value)
    return out


def oracle(label: dict, result: dict, place: Path, names: Sequence[str]) -> dict[str, Any] | None:
    """Return the power that the truth takes from the signal that the diagnosis reports; None if it cannot.

    In the squared unit of the report, a mean over the rows of all runs; none of them chose anything here, so
    all are held out. ``removed`` is counted after normal mismatch, as it is with the truth in the model.
    """
    signal = (result.get("gap") or {}).get("signal")
    if signal not in LINK:
        return None
    parts = _parts(LINK[signal], place, names)
    entry = label["effects"][0]
    truth = _applied(entry, parts[0].inputs) if parts else None
    if truth is None:
        return None
    nominal = truth.effect.nominal(parts[0].inputs, truth.target)
    tried = [truth] if entry["form"] == "same" else [_times(truth, nominal, size) for size in TRIALS]
    best = min(tried, key=lambda one: _left(parts, one))
    usual = [_mismatch(part, best) for part in parts]
    before = _mean_square([part.residual for part in parts])
    gap = _mean_square([part.residual - own for part, own in zip(parts, usual, strict=True)])
    left = _mean_square(
        [part.measured - part.sample([best]) - own for part, own in zip(parts, usual, strict=True)]
    )
    unit = parts[0].factor ** 2
    return {"signal": signal, "before": before * unit, "removed": (gap - left) * unit}


def _parts(link: str, place: Path, names: Sequence[str]) -> list[Any]:
    """Return the measured signal of a link beside its model, run by run."""
    from gap_blind_cases import loaded

    module = importlib.import_module("gcode2krl.gap.diagnosis")
    links = importlib.import_module("gcode2krl.gap.beside.links")
    runs, predictions = loaded(place, names)
    sides = list(module._sides(predictions[0], runs))
    return links.parts_of(link, sides)


def _applied(entry: dict, inputs: Any) -> Any:
    from gcode2krl.effects import Applied, library

    effect = library().get(entry["effect"])
    if effect is None:
        return None
    target = entry["target"] if entry["target"] in effect.targets(inputs.cell) else None
    if target not in effect.targets(inputs.cell):
        return None
    known = flat(entry["parameters"])
    values = effect.nominal(inputs, target) | {name: known[name] for name in effect.names if name in known}
    return Applied(effect, target, values)


def _times(one: Any, nominal: dict[str, float], size: float) -> Any:
    """Return an effect with its deviations from nominal multiplied by a factor; shapes unchanged."""
    values = {
        name: value if one.effect.parameter(name).is_shape else nominal[name] + size * (value - nominal[name])
        for name, value in one.values.items()
    }
    return replace(one, values=values)


def _nuisance(part: Any) -> np.ndarray:
    """Return (n·k, c): a shift of each column, the clock, and for forces a gain of each column."""
    n, k = part.shape
    late = replace(part, minus=None).rate
    columns = [np.kron(np.eye(k), np.ones((n, 1))), late.T.reshape(-1, 1)]
    if part.signal == "force":
        columns.append(np.kron(np.eye(k), np.ones((n, 1))) * part.nominal.T.reshape(-1, 1))
    return np.concatenate(columns, axis=1)


def _left(parts: Sequence[Any], one: Any) -> float:
    """Return the sum of squares that an effect and the nuisance leave."""
    return sum(
        float(np.sum((part.measured - part.sample([one]) - _mismatch(part, one)) ** 2)) for part in parts
    )


def _mismatch(part: Any, one: Any) -> np.ndarray:
    """Return the part of the residual (n, k) with an effect in the model that the nuisance explains."""
    residual = (part.measured - part.sample([one])).T.ravel()
    wide = _nuisance(part)
    return (wide @ np.linalg.lstsq(wide, residual, rcond=None)[0]).reshape(part.shape[1], -1).T


def _mean_square(residuals: Sequence[np.ndarray]) -> float:
    return float(np.mean(np.concatenate([np.sum(each**2, axis=1) for each in residuals])))
