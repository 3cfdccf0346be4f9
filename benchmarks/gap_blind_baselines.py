"""Simple methods on the same cases, for comparison.

All see the whole signals, scaled by the noise of each column and without a split of the chain, at 20 samples
a second, and the signatures of all effects by finite differences at the nominal prediction. The
clocks of the tables are fitted to each run first.
"""

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

STEP_s = 0.05
LEAST_GAIN = 0.02
"""Fraction of the power that a method must remove to name a cause."""
LASSO_STEPS, LASSO_SWEEPS, LASSO_NAMED = 12, 40, 0.25


def baselines(runs: Sequence[Any], predictions: dict[str, str]) -> dict[str, list]:
    """Return the effect and target that each method names, or an empty list."""
    started = [run.head.started for run in runs]
    first = min(started)
    data, columns = [], []
    for run in runs:
        program = (run.path("prediction") or Path()).name
        hours = (run.head.started - first).total_seconds() / 3600.0
        blocks, base = signatures(predictions[program], round(hours, 1))
        y, use, sigma = _residual(run, base)
        late = _clocks(base, use, sigma)
        wide = np.concatenate([(block[:, use] / sigma).T.reshape(-1, 1) for _, block in blocks], axis=1)
        data.append(y - late @ (late.T @ y))
        columns.append(wide - late @ (late.T @ wide))
        keys = [key for key, _ in blocks]
    y = np.concatenate(data)
    wide = np.concatenate(columns)
    length = np.sqrt(np.sum(wide**2, axis=0))
    wide = wide / np.where(length > 1e-9, length, 1.0)
    groups = list(dict.fromkeys(keys))
    member = np.array([groups.index(key) for key in keys])
    return {
        "best correlation": _best_correlation(y, wide, member, groups),
        "lasso": _lasso(y, wide, member, groups),
        "always geometry": [["base_frame", None]],
    }


def _best_correlation(y: np.ndarray, wide: np.ndarray, member: np.ndarray, groups: list) -> list:
    found = np.abs(wide.T @ y)
    best = int(np.argmax(found))
    return [list(groups[member[best]])] if found[best] ** 2 > LEAST_GAIN * float(y @ y) else []


def _lasso(y: np.ndarray, wide: np.ndarray, member: np.ndarray, groups: list) -> list:
    """Coordinate descent along a falling penalty (Friedman et al. 2010), chosen by Schwarz' criterion."""
    gram, right, power = wide.T @ wide, wide.T @ y, float(y @ y)
    best, chosen = np.inf, np.zeros(wide.shape[1])
    weights = np.zeros(wide.shape[1])
    top = float(np.abs(right).max())
    for penalty in top * np.geomspace(0.9, 0.02, LASSO_STEPS):
        weights = _descend(gram, right, weights, penalty)
        rest = power - 2.0 * float(weights @ right) + float(weights @ gram @ weights)
        score = len(y) * np.log(max(rest, 1e-12)) + np.count_nonzero(weights) * np.log(len(y))
        if score < best:
            best, chosen = score, weights.copy()
    gain = np.array(
        [np.linalg.norm(wide[:, member == g] @ chosen[member == g]) ** 2 for g in range(len(groups))]
    )
    if gain.max() <= LEAST_GAIN * power:
        return []
    return [list(groups[g]) for g in np.argsort(-gain) if gain[g] > LASSO_NAMED * gain.max()][:3]


def _descend(gram: np.ndarray, right: np.ndarray, start: np.ndarray, penalty: float) -> np.ndarray:
    weights = start.copy()
    for sweep in range(LASSO_SWEEPS):
        active = np.flatnonzero(weights) if sweep % 5 else np.arange(len(weights))
        before = weights.copy()
        for j in active:
            pull = right[j] - gram[j] @ weights + gram[j, j] * weights[j]
            weights[j] = np.sign(pull) * max(abs(pull) - penalty, 0.0) / max(gram[j, j], 1e-12)
        if sweep % 5 == 0 and np.abs(weights - before).max() < 1e-4 * max(np.abs(weights).max(), 1e-12):
            break
    return weights


# signals ----------------------------------------------------------------------------------------------------


@functools.lru_cache(maxsize=64)
def signatures(folder: str, hours: float) -> tuple[list[tuple[tuple, np.ndarray]], dict[str, np.ndarray]]:
    """Return (effect, target) and change of all signals (m, 24) for each setting; and the nominal signals."""
    from dataclasses import replace

    inputs, base, blocks = _nominal(folder)
    moved = replace(inputs, hours=hours)
    dated = [
        ((effect.name, target), _change(moved, base, effect, target, values))
        for effect, target, values in _settings(inputs, dated=True)
    ]
    return [*blocks, *[(key, change) for key, change in dated if change is not None]], base


@functools.lru_cache(maxsize=8)
def _nominal(folder: str) -> tuple[Any, dict[str, np.ndarray], list]:
    from gcode2krl import Prediction
    from gcode2krl.effects import inputs_of, simulate

    inputs = inputs_of(Prediction.load(folder))
    signals = simulate(inputs, [])
    grid = np.arange(0.0, inputs.time_s[-1], STEP_s)
    base = {"t_s": grid, "all": _columns(signals, grid), "turn": inputs.sensor_rotation[0]}
    base["tool"] = inputs.tool_rotation[0]
    blocks = [
        ((effect.name, target), _change(inputs, base, effect, target, values))
        for effect, target, values in _settings(inputs, dated=False)
    ]
    return inputs, base, [(key, change) for key, change in blocks if change is not None]


def _settings(inputs: Any, dated: bool) -> list:
    from gcode2krl.effects import library

    found = []
    for effect in library().values():
        if effect.kind == "slip" or (effect.name in ("thermal", "force_drift")) != dated:
            continue
        for target in effect.targets(inputs.cell):
            own = effect.at(target)
            for shape in own.shapes():
                found += [(own, target, values) for values in own.settings(inputs, target, shape)]
    return found


def _change(inputs: Any, base: dict, effect: Any, target: str | None, values: dict) -> np.ndarray | None:
    from gcode2krl.effects import Applied, simulate
    from gcode2krl.errors import Gcode2KrlError

    try:
        signals = simulate(inputs, [Applied(effect, target, values)])
    except Gcode2KrlError:
        return None
    return _columns(signals, base["t_s"]) - base["all"]


def _columns(signals: Any, grid: np.ndarray) -> np.ndarray:
    """Return (m, 24): tip, force, q_cmd, q_act - q_cmd, q_load - q_act at the stamps of a grid."""
    cmd, act, load = (signals.seen(name, grid) for name in ("q_cmd_rad", "q_act_rad", "q_load_rad"))
    tip, force = signals.seen("tcp_base_mm", grid), signals.seen("force_meas_base_N", grid)
    return np.concatenate([tip, force, cmd, act - cmd, load - act], axis=1)


def _clocks(base: dict, use: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return (k·m, c) orthonormal: the effect of a clock of tracker, force, controller or load encoders."""
    rate = np.gradient(base["all"], STEP_s, axis=0)
    rate[:, 18:] = rate[:, 6:12]
    tables = [range(3), range(3, 6), range(6, 12), range(18, 24)]
    columns = [np.where(np.isin(use, table), rate[:, use] / sigma, 0.0).T.ravel() for table in tables]
    late, sizes, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
    return late[:, sizes > 1e-9 * sizes[0]]


def _residual(run: Any, base: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the residual over its noise (k·m,), the columns that were measured (k,), their noise (k,)."""
    grid, nominal = base["t_s"], base["all"]
    measured = np.full(nominal.shape, np.nan)
    if run.tracker is not None:
        measured[:, :3] = _at(grid, run.tracker.time_s, run.tracker.position_mm)
    if run.force is not None:
        turn = {"sensor": base["turn"], "tcp": base["tool"]}.get(run.head.frames.force, np.eye(3))
        measured[:, 3:6] = _at(grid, run.force.time_s, run.force.force_N @ turn.T)
    table = run.controller
    if table is not None and table.q_cmd_rad is not None and table.q_act_rad is not None:
        measured[:, 6:12] = _at(grid, table.time_s, table.q_cmd_rad)
        measured[:, 12:18] = _at(grid, table.time_s, table.q_act_rad - table.q_cmd_rad)
        if table.q_load_rad is not None:
            measured[:, 18:] = _at(grid, table.time_s, table.q_load_rad - table.q_act_rad)
    use = np.flatnonzero(np.isfinite(measured).all(axis=0))
    apart = measured[:, use] - nominal[:, use]
    jumps = np.abs(np.diff(apart, n=2, axis=0))
    sigma = np.maximum(np.median(jumps, axis=0) / 0.6745 / np.sqrt(6.0), 1e-6)
    sigma[use < 6] = np.maximum(sigma[use < 6], 1e-3)
    return (apart / sigma).T.ravel(), use, sigma


def _at(grid: np.ndarray, own_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(grid, own_s, column) for column in values.T], axis=1)
