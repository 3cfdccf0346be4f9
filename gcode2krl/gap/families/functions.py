"""Functions of an admissible input as columns, with the covariances that their weights may have."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.thresholds import THRESHOLDS

_LIMITS = THRESHOLDS.families
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
    columns = tuple(
        np.concatenate(each, axis=1) for each in zip(*(part.columns for part in used), strict=True)
    )
    return Functions(columns, tuple(in_each(root, len(used)) for root in used[0].roots))


def _smooth(inputs: Sequence[Floats], groups: Sequence[Floats], count: int) -> Functions:
    low, high = min(map(np.min, inputs)), max(map(np.max, inputs))
    if not high - low > _VARIES * max(abs(low), abs(high)):
        return Functions(tuple(np.zeros((len(each), 0)) for each in inputs), (np.eye(0),))
    knots = np.linspace(low, high, _LIMITS.knots)
    hats = [np.maximum(0.0, 1.0 - np.abs(each[:, None] - knots) / (knots[1] - knots[0])) for each in inputs]
    columns: list[Floats] = []
    for own, group in zip(hats, groups, strict=True):
        wide = np.zeros((len(own), count, len(knots)))
        wide[np.arange(len(own)), group] = own
        columns.append(wide.reshape(len(own), -1))
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
        (one[:, :, None] * other[:, None, :]).reshape(len(one), -1)
        for one, other in zip(first, second, strict=True)
    ]
