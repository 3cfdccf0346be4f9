"""A view of a link's rest: the residual beside some effects, and what tangents and nuisance may do to it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from gcode2krl.arrays import Floats, Ints
from gcode2krl.gap.families.rows import Rows
from gcode2krl.gap.fit.box import MOST, boxed
from gcode2krl.gap.thresholds import THRESHOLDS

_PRIOR = THRESHOLDS.fit.prior_sizes**-2


@dataclass(frozen=True, eq=False)
class View:
    """Blocks of r (v,) with some effects in the model, of their tangents T (v, t) and of N (v, m)."""

    residual: Floats
    tangents: Floats
    nuisance: Floats
    members: csr_array
    """(g, v) 1 where a block belongs to a stretch of time."""
    components: Ints
    """(v,) the component of each block."""

    @classmethod
    def of(cls, rows: Rows, residuals: Sequence[Floats], tangents: Sequence[Floats]) -> "View":
        """Return the view of residuals (n, k) with tangents (k, n, t) of the effects in the model."""
        left = rows.of([each.T[:, :, None] for each in residuals])[:, 0]
        return cls(left, rows.of(tangents), rows.nuisance, rows.members, rows.components)

    def beside(self, residual: Floats, tangents: Floats) -> "View":
        """Return the view of the same rows with another residual (v,) and other tangents (v, t)."""
        return replace(self, residual=residual, tangents=tangents)

    @cached_property
    def _of_component(self) -> dict[int | None, "View"]:
        return {None: self}

    def at(self, component: int | None) -> "View":
        """Return the view of one component alone: nothing couples joints but clocks."""
        if component not in self._of_component:
            rows = self.components == component
            tangents, nuisance = self.tangents[rows], self.nuisance[rows]
            self._of_component[component] = View(
                self.residual[rows],
                tangents[:, np.any(tangents, axis=0)],
                nuisance[:, np.any(nuisance, axis=0)],
                self.members[:, np.flatnonzero(rows)],
                self.components[rows],
            )
        return self._of_component[component]

    @cached_property
    def _fixed(self) -> Floats:
        """(v, t + m) T and N."""
        return np.concatenate([self.tangents, self.nuisance], axis=1)

    @cached_property
    def _precision(self) -> Floats:
        """(t + m,) of the priors of δ and b."""
        precision: Floats = np.r_[np.full(self.tangents.shape[1], _PRIOR), np.ones(self.nuisance.shape[1])]
        return precision

    @cached_property
    def _normal(self) -> Floats:
        """(t + m) squared: [T, N]ᵀ·[T, N] with the priors."""
        normal: Floats = self._fixed.T @ self._fixed + np.diag(self._precision)
        return normal

    @cached_property
    def _cross(self) -> Floats:
        cross: Floats = self._fixed.T @ self.residual
        return cross

    @cached_property
    def projected(self) -> Floats:
        """(v,) r without what unbounded tangents and nuisance explain."""
        return self.without_fixed(self.residual[:, None])[:, 0]

    def without_fixed(self, columns: Floats) -> Floats:
        """Return columns (v, c) without what tangents and nuisance explain of them."""
        left: Floats = columns - self._fixed @ np.linalg.solve(self._normal, self._fixed.T @ columns)
        return left

    def scores(self, projected: Floats, explained: Floats | None = None) -> Floats:
        """Return White's scores (g, c) of projected columns by stretches of time.

        ``explained`` (v,) of the projected residual is taken off it first.
        """
        left = self.projected if explained is None else self.projected - explained
        scores: Floats = self.members @ (projected * left[:, None])
        return scores

    @cached_property
    def is_within(self) -> bool:
        """Tell whether no nuisance would leave its bounds, so that they need not be watched."""
        b = np.linalg.solve(self._normal, self._cross)[self.tangents.shape[1] :]
        return bool(np.all(np.abs(b) < MOST))

    @cached_property
    def chi2(self) -> float:
        """Chi2 of the blocks, nuisance within its bounds."""
        return self.bounded(np.zeros((len(self.residual), 0)))[0]

    def bounded(self, columns: Floats) -> tuple[float, Floats]:
        """Return chi2 with the weights of columns (v, c) of unit variance at their best, and these (c,).

        Nuisance stays within its bounds.
        """
        return self.bounded_by(columns.T @ columns, columns.T @ self._fixed, columns.T @ self.residual)

    def bounded_by(self, gram: Floats, fixed: Floats, scores: Floats) -> tuple[float, Floats]:
        """Do as `bounded` from Bᵀ·B (c, c), Bᵀ·[T, N] (c, t + m) and Bᵀ·r (c,)."""
        t, c = self.tangents.shape[1], len(gram)
        free = np.zeros((t + c, t + c))
        free[:t, :t], free[:t, t:] = self._normal[:t, :t], fixed[:, :t].T
        free[t:, :t], free[t:, t:] = fixed[:, :t], gram + np.eye(c)
        right = np.zeros((t + c, 1 + len(self._normal) - t))
        right[:t, 0], right[:t, 1:] = self._cross[:t], self._normal[:t, t:]
        right[t:, 0], right[t:, 1:] = scores, fixed[:, t:]
        half = np.linalg.solve(free, right) if t + c else right
        cost = self._normal[t:, t:] - right[:, 1:].T @ half[:, 1:]
        pull = self._cross[t:] - right[:, 1:].T @ half[:, 0]
        b = boxed(cost, pull)
        left = float(self.residual @ self.residual - right[:, 0] @ half[:, 0])
        chi2 = left - 2.0 * float(b @ pull) + float(b @ cost @ b)
        return chi2, (half[:, 0] - half[:, 1:] @ b)[t:]

    def fixed_products(self, columns: Floats) -> Floats:
        """Return Bᵀ·[T, N] (c, t + m) of columns (v, c)."""
        products: Floats = columns.T @ self._fixed
        return products
