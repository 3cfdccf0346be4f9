"""Distances by the products of whitened columns: least chi² within bounds, the best candidates and pairs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

BEAM = 5
"""So many of the best singles are extended to pairs."""
BOUNDED = 10
"""So many of the best by an unbounded estimate are fitted within their bounds."""
RELATIVE = 1e-9
"""Ridge on a column's own product, so that columns that are alike do no harm."""


@dataclass(frozen=True)
class Block:
    """Columns of one candidate in the products, with their bounds."""

    label: str
    at: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    start: object = None
    """Where the effect of the columns starts; nothing here reads it."""


@dataclass(frozen=True)
class Fit:
    """Least chi² of some blocks beside mismatch, and the blocks' coefficients."""

    chi2: float
    blocks: tuple[Block, ...]
    values: tuple[np.ndarray, ...] = ()


class Products:
    """Products of the change (row 0), the mismatch and all candidates; distances within bounds."""

    def __init__(self, products: np.ndarray, mismatch: Block, candidates: Sequence[Block]):
        self.products, self.mismatch, self.candidates = products, mismatch, list(candidates)
        m = mismatch.at
        inner = products[np.ix_(m, m)] + np.eye(len(m))  # as if each bound were one standard deviation
        across = products[m]
        self.beside = products - across.T @ np.linalg.solve(inner, across)

    def least(self, *blocks: Block) -> Fit:
        """The least chi² of the change beside mismatch and blocks, all within their bounds."""
        every = (self.mismatch, *blocks)
        at = np.concatenate([b.at for b in every]).astype(int)
        lower, upper = (np.concatenate([getattr(b, side) for b in every]) for side in ("lower", "upper"))
        chi2, x = bounded(self.products, at, lower, upper)
        ends = np.cumsum([len(b.at) for b in every])
        return Fit(chi2, blocks, tuple(np.split(x, ends[:-1])[1:]))

    def estimate(self, *blocks: Block) -> float:
        """The same by a ridge in place of bounds; a guide to the best ones alone."""
        at = np.concatenate([b.at for b in blocks]).astype(int)
        wide = np.concatenate([np.maximum(np.abs(b.lower), np.abs(b.upper)) for b in blocks])
        p, q = self.beside[np.ix_(at, at)], self.beside[at, 0]
        p = p + np.diag(1.0 / wide**2 + RELATIVE * np.diag(p))
        return float(self.beside[0, 0] - q @ np.linalg.solve(p, q))

    def singles(self) -> list[Fit]:
        """The best single candidates, one start a label, the best first."""
        ranked = sorted(self.candidates, key=self.estimate)
        return sorted((self.least(b) for b in _distinct(ranked, BOUNDED)), key=lambda fit: fit.chi2)

    def pairs(self, singles: Sequence[Fit]) -> list[Fit]:
        """The best extensions of the `BEAM` best singles by another label."""
        tried: dict[tuple, tuple[float, Block, Block]] = {}
        for fit in singles[:BEAM]:
            first = fit.blocks[0]
            for second in self.candidates:
                if second.label == first.label:
                    continue
                key = tuple(sorted((first.label, second.label)))
                chi2 = self.estimate(first, second)
                if key not in tried or chi2 < tried[key][0]:
                    tried[key] = (chi2, first, second)
        best = sorted(tried.values(), key=lambda entry: entry[0])[:BOUNDED]
        return sorted((self.least(one, two) for _, one, two in best), key=lambda fit: fit.chi2)


def bounded(
    products: np.ndarray, at: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> tuple[float, np.ndarray]:
    """Least chi² of row 0 by the columns `at` within bounds, and their values."""
    p, q = products[np.ix_(at, at)], products[at, 0]
    scale = np.sqrt(np.maximum(np.diag(p), 1e-30))
    root = np.linalg.cholesky(p / np.outer(scale, scale) + RELATIVE * np.eye(len(at)))
    target = np.linalg.solve(root, q / scale)
    bounds = (lower * scale, upper * scale + 1e-300)
    found = lsq_linear(root.T, target, bounds=bounds, method="bvls", max_iter=5 * len(at))
    x = found.x / scale
    return float(max(products[0, 0] - 2.0 * q @ x + x @ p @ x, 0.0)), x


def _distinct(ranked: Sequence[Block], count: int) -> list[Block]:
    out: dict[str, Block] = {}
    for block in ranked:
        out.setdefault(block.label, block)
        if len(out) == count:
            break
    return list(out.values())
