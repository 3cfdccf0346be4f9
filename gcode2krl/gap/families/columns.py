"""Columns beside what tangents and nuisance explain of them, by inner products: their rows are never made."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.gap.families.view import View


@dataclass(frozen=True, eq=False)
class Columns:
    """Whitened columns (v, c) in blocks, for views of the same rows."""

    values: Floats
    _on_nuisance: dict[tuple[int, ...] | None, Floats] = field(default_factory=dict, init=False)

    def __len__(self) -> int:
        return int(self.values.shape[1])

    @cached_property
    def gram(self) -> Floats:
        """(c, c) Bᵀ·B."""
        gram: Floats = self.values.T @ self.values
        return gram

    def on_nuisance(self, view: View) -> Floats:
        """Return Bᵀ·N (c, m); views that keep the same nuisance share it."""
        if view.kept not in self._on_nuisance:
            self._on_nuisance[view.kept] = self.values.T @ view.nuisance
        return self._on_nuisance[view.kept]


class Beside:
    """Columns beside the tangents and the nuisance F = [T, N] of a view: P = B - F·H⁻¹·Fᵀ·B."""

    def __init__(self, view: View, columns: Columns) -> None:
        self.view, self.columns = view, columns
        self.fixed: Floats = np.concatenate(
            [columns.values.T @ view.tangents, columns.on_nuisance(view)], axis=1
        )
        """(c, t + m) Bᵀ·F."""
        self.taken = view.solved(self.fixed.T)
        """(t + m, c) H⁻¹·Fᵀ·B."""
        self.on_residual: Floats = columns.values.T @ view.residual
        """(c,) Bᵀ·r."""

    @property
    def gram(self) -> Floats:
        """(c, c) Bᵀ·P."""
        gram: Floats = self.columns.gram - self.fixed @ self.taken
        return gram

    @property
    def score(self) -> Floats:
        """(c,) Pᵀ·r."""
        score: Floats = self.on_residual - self.taken.T @ self.view.cross
        return score

    @property
    def scores(self) -> Floats:
        """White's scores (g, c) of P by stretches of time."""
        view = self.view
        scores: Floats = (
            view.by_stretch(view.projected) @ self.columns.values - view.fixed_scores @ self.taken
        )
        return scores

    @property
    def moved_scores(self) -> Floats:
        """Return Pᵀ times the residuals that are moved in time (shifts, c)."""
        scores: Floats = self.view.moved @ self.columns.values - self.view.moved_cross @ self.taken
        return scores

    def explained(self, weights: Floats) -> Floats:
        """Return P times weights (c,), (v,)."""
        explained: Floats = self.columns.values @ weights - self.view.fixed @ (self.taken @ weights)
        return explained

    def scores_without(self, explained: Floats) -> Floats:
        """Return White's scores (g, c) with what is explained (v,) taken off the residual."""
        view = self.view
        by_stretch = view.by_stretch(view.projected - explained)
        scores: Floats = by_stretch @ self.columns.values - (by_stretch @ view.fixed) @ self.taken
        return scores
