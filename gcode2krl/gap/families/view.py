"""A view of a link's rest: the residual beside some effects, and what tangents and nuisance may do to it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse import csr_array

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.gap.families.rows import Rows
from gcode2krl.gap.fit.box import MOST, boxed
from gcode2krl.gap.fit.split_columns import SplitColumns
from gcode2krl.gap.thresholds import THRESHOLDS

_PRIOR = THRESHOLDS.fit.prior_sizes**-2
_LEAST_SAYING = 3
"""Components: fewer cannot outvote one that has an effect."""
_MEDIAN_VARIANCE = float(np.pi / 2.0)
"""Of a median of normal values, over that of their mean (Kenney & Keeping 1962)."""
_MOVED_BY = (0.05, 0.95)
"""Shares of a run by which its residual is moved."""
_KNOWN = 0.1
"""Of the variance before any data, the most that is left of what a component knows."""


@dataclass(frozen=True, eq=False)
class View:
    """Blocks of r (v,) with some effects in the model, of their tangents T (v, t) and of N (v, m)."""

    residual: Floats
    tangents: Floats
    nuisance: SplitColumns
    members: csr_array
    """(g, v) 1 where a block belongs to a stretch of time."""
    components: Ints
    """(v,) the component of each block."""
    runs: Ints
    """(v,) the number of the run of each block."""
    kept: tuple[int, ...] | None = None
    """Which of the link's nuisance are in N; None: all."""

    @classmethod
    def of(cls, rows: Rows, residuals: Sequence[Floats], tangents: Sequence[Floats]) -> "View":
        """Return the view of residuals (n, k) with tangents (k, n, t) of the effects in the model."""
        left = rows.of([each.T[:, :, None] for each in residuals])[:, 0]
        return cls(left, rows.of(tangents), rows.nuisance, rows.members, rows.components, rows.runs)

    def beside(self, residual: Floats, tangents: Floats) -> "View":
        """Return the view of the same rows with another residual (v,) and other tangents (v, t)."""
        return replace(self, residual=residual, tangents=tangents)

    @cached_property
    def _of_component(self) -> dict[int | None, "View"]:
        return {None: self}

    def at(self, component: int | None) -> "View":
        """Return the view of one component alone; clocks, which couple joints, are what the others say.

        One joint alone would take an effect of its own, a lag, for the clock of all.
        """
        if component is not None and component not in self._of_component:
            said, deviation = self._said_beside(component)
            known = self._used(component) & ~np.isnan(said)
            alone = self._of_rows(component, self._used(component) & ~known)
            columns = self._of_rows(component, known).fixed.dense
            unsure = columns * (deviation[known] * _PRIOR**0.5)  # tangents have that wide prior
            self._of_component[component] = replace(
                alone,
                residual=alone.residual - columns @ said[known],
                tangents=np.concatenate([alone.tangents, unsure], axis=1),
            )
        return self._of_component[component]

    def _used(self, component: int) -> Bools:
        """Return which of T and N (t + m,) are not zero in a component."""
        return self.fixed.used(self.components == component)

    def _of_rows(self, component: int, columns: Bools) -> "View":
        """Return the view of a component's rows with some of T and N (t + m,)."""
        rows, t = self.components == component, self.tangents.shape[1]
        return View(
            self.residual[rows],
            self.tangents[np.ix_(rows, columns[:t])],
            self.nuisance.of(rows, columns[t:]),
            self.members[:, np.flatnonzero(rows)],
            self.components[rows],
            self.runs[rows],
            tuple(np.flatnonzero(columns[t:]).tolist()),
        )

    @cached_property
    def _said(self) -> tuple[Floats, Floats]:
        """(k, t + m) what each component alone says of δ and b, and how sure; nan of what it hardly knows."""
        said = np.full((int(self.components.max()) + 1, self.fixed.shape[1]), np.nan)
        deviation = said.copy()
        for component in range(len(said)):
            used = self._used(component)
            alone = self._of_rows(component, used)
            variance = np.diag(alone.solved(np.eye(int(used.sum()))))
            is_known = variance * alone._precision < _KNOWN  # of the variance before any data
            said[component, used] = np.where(is_known, alone.solved(alone.cross), np.nan)
            deviation[component, used] = np.where(is_known, variance**0.5, np.nan)
        return said, deviation

    def _said_beside(self, component: int) -> tuple[Floats, Floats]:
        """Return the middle one (t + m,) of what the others say, and its deviation; nan where few do.

        One with an effect of its own is outvoted. A lag of each joint's own, within its bounds, lets each say
        another clock: the middle one is as unsure as they are.
        """
        said, deviation = (np.delete(each, component, axis=0) for each in self._said)
        count = np.sum(~np.isnan(said), axis=0)
        many = count >= _LEAST_SAYING
        middle, unsure = np.full(said.shape[1], np.nan), np.full(said.shape[1], np.nan)
        middle[many] = np.nanmedian(said[:, many], axis=0)
        unsure[many] = np.nanmedian(deviation[:, many], axis=0) * (_MEDIAN_VARIANCE / count[many]) ** 0.5
        return middle, unsure

    @cached_property
    def fixed(self) -> SplitColumns:
        """(v, t + m) F: T and N."""
        return replace(self.nuisance, whole=self.tangents)

    @cached_property
    def _precision(self) -> Floats:
        """(t + m,) of the priors of δ and b."""
        precision: Floats = np.r_[np.full(self.tangents.shape[1], _PRIOR), np.ones(self.nuisance.shape[1])]
        return precision

    @cached_property
    def _normal(self) -> Floats:
        """(t + m) squared: H = Fᵀ·F with the priors."""
        return self.fixed.gram + np.diag(self._precision)

    @cached_property
    def _factors(self) -> tuple[Floats, Ints]:
        factors: tuple[Floats, Ints] = lu_factor(self._normal)
        return factors

    def solved(self, right: Floats) -> Floats:
        """Return H⁻¹ times right sides (t + m, …)."""
        return np.asarray(lu_solve(self._factors, right), dtype=np.float64) if len(right) else right

    @cached_property
    def cross(self) -> Floats:
        """(t + m,) Fᵀ·r."""
        return self.residual @ self.fixed

    @cached_property
    def projected(self) -> Floats:
        """(v,) r without what unbounded tangents and nuisance explain."""
        left: Floats = self.residual - self.fixed @ self.solved(self.cross)
        return left

    def without_fixed(self, columns: Floats) -> Floats:
        """Return columns (v, c) without what tangents and nuisance explain of them."""
        left: Floats = columns - self.fixed @ self.solved((columns.T @ self.fixed).T)
        return left

    def by_stretch(self, values: Floats) -> csr_array:
        """Return what sums columns, times values (v,), over each stretch of time, (g, v)."""
        at = self.members.indices
        return csr_array((self.members.data * values[at], at, self.members.indptr), shape=self.members.shape)

    @cached_property
    def fixed_scores(self) -> Floats:
        """(g, t + m) sums over stretches of F times the projected residual."""
        sums: Floats = self.by_stretch(self.projected) @ self.fixed
        return sums

    @cached_property
    def moved(self) -> Floats:
        """(moves, v) the projected residual, each run's moved in time, around its end, and of either sign.

        The noise of a tracker or a force sensor knows no moment of the command: so moved it is as probable.
        """
        generator = np.random.default_rng(0)
        runs = int(self.runs.max(initial=0)) + 1
        moves = THRESHOLDS.families.moves
        shares = generator.uniform(*_MOVED_BY, (moves, runs))
        signs = np.where(generator.random((moves, runs)) < 0.5, -1.0, 1.0)
        moved = np.empty((moves, len(self.projected)))
        begins = np.flatnonzero(np.diff(self.runs, prepend=-1) | np.diff(self.components, prepend=-1))
        for first, last in zip(begins, [*begins[1:], len(self.runs)], strict=True):
            rest, run = self.projected[first:last], self.runs[first]
            by = np.round(shares[:, run] * len(rest)).astype(np.int64)
            # all components of a run together: what moves them at once does so then, too
            moved[:, first:last] = signs[:, [run]] * rest[(np.arange(len(rest)) - by[:, None]) % len(rest)]
        return moved

    @cached_property
    def moved_cross(self) -> Floats:
        """(moves, t + m) Fᵀ times each."""
        return self.moved @ self.fixed

    @cached_property
    def is_within(self) -> bool:
        """Tell whether no nuisance would leave its bounds, so that they need not be watched."""
        b = self.solved(self.cross)[self.tangents.shape[1] :]
        return bool(np.all(np.abs(b) < MOST))

    @cached_property
    def chi2(self) -> float:
        """Chi2 of the blocks, nuisance within its bounds."""
        width = self.fixed.shape[1]
        return self.bounded(np.zeros((0, 0)), np.zeros((0, width)), np.zeros(0))[0]

    def bounded(self, gram: Floats, fixed: Floats, scores: Floats) -> tuple[float, Floats]:
        """Return chi2 with the weights of columns B of unit variance at their best, and these (c,).

        Of the columns Bᵀ·B (c, c), Bᵀ·F (c, t + m) and Bᵀ·r (c,). Nuisance stays within its bounds.
        """
        t, c = self.tangents.shape[1], len(gram)
        free = np.zeros((t + c, t + c))
        free[:t, :t], free[:t, t:] = self._normal[:t, :t], fixed[:, :t].T
        free[t:, :t], free[t:, t:] = fixed[:, :t], gram + np.eye(c)
        right = np.zeros((t + c, 1 + len(self._normal) - t))
        right[:t, 0], right[:t, 1:] = self.cross[:t], self._normal[:t, t:]
        right[t:, 0], right[t:, 1:] = scores, fixed[:, t:]
        half = np.linalg.solve(free, right) if t + c else right
        cost = self._normal[t:, t:] - right[:, 1:].T @ half[:, 1:]
        pull = self.cross[t:] - right[:, 1:].T @ half[:, 0]
        b = boxed(cost, pull)
        left = float(self.residual @ self.residual - right[:, 0] @ half[:, 0])
        chi2 = left - 2.0 * float(b @ pull) + float(b @ cost @ b)
        return chi2, (half[:, 0] - half[:, 1:] @ b)[t:]
