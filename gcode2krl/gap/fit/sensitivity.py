"""How much one effect of a fit says about the data, beside the others."""

import math
from dataclasses import dataclass

import numpy as np

from gcode2krl.arrays import Bools, Floats, Ints
from gcode2krl.gap.fit.clusters import cluster_scores, gain_inflation
from gcode2krl.gap.fit.fitted import Fitted
from gcode2krl.gap.fit.likelihood import Likelihood

_RANK = 1e-9
"""Directions with less than this share of the largest information are treated as unobserved."""


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """The residual (v,) of a fit and its derivative (v, p) by the numbers of one effect.

    Derivatives are in typical sizes; what the other effects explain of them is taken out.
    """

    residual: Floats
    jacobian: Floats
    information: Floats
    """(p, p) the prior's share included."""
    clusters: Ints
    """(v,) the stretch of time of each value."""

    def inflation(self) -> float:
        """Return by how much the gain of the effect varies more than white noise lets it, at least 1."""
        inverse = np.asarray(np.linalg.pinv(self.information, rcond=_RANK, hermitian=True), dtype=np.float64)
        scores = cluster_scores(self.jacobian, self.residual, self.clusters)
        return gain_inflation(inverse, scores, fitted=self.jacobian.shape[1])

    def left_out_gain(self, before: Floats, groups: int) -> float:
        """Return the fall of chi2 from the residual ``before`` on data that the numbers were not fitted to.

        Stretches in their order make groups in which the effect does as much: a run in air tells nothing of a
        force. Each is left out in turn; the numbers then are a step away from those of the fit. Infinite
        where there are fewer stretches than groups.
        """
        before = before[: len(self.residual)]
        names, at = np.unique(self.clusters, return_inverse=True)
        power = np.cumsum(np.bincount(at, weights=(before - self.residual) ** 2))
        if len(names) < groups or power[-1] <= 0.0:
            return math.inf
        group = np.minimum((groups * (power - power[0] / 2.0) / power[-1]).astype(int), groups - 1)[at]
        return self.gain_of_left_out(before, group)

    def gain_of_left_out(self, before: Floats, group: Ints) -> float:
        """Return the fall of chi2 from the residual ``before``, groups (v,) of values left out in turn."""
        before = before[: len(self.residual)]
        return sum(self._held_out_gain(before, group == number) for number in np.unique(group))

    def _held_out_gain(self, before: Floats, held: Bools) -> float:
        """Return the fall of chi2 on held rows, with the numbers fitted to the others."""
        step = np.linalg.lstsq(self.jacobian[~held], -self.residual[~held], rcond=_RANK)[0]
        left = self.residual[held] + self.jacobian[held] @ step
        return float(before[held] @ before[held] - left @ left)


def sensitivity_of(likelihood: Likelihood, fitted: Fitted, effect: int) -> Sensitivity:
    """Return the sensitivity to one effect of a fit."""
    residual = likelihood.residual(fitted.applied)
    jacobian = likelihood.jacobian(fitted.numbers, fitted.x)
    own = jacobian[:, fitted.numbers.slices[effect]]
    others = jacobian[:, fitted.numbers.without(effect)]
    if others.shape[1]:
        own = own - others @ np.linalg.lstsq(others, own, rcond=_RANK)[0]
    rows = len(likelihood.clusters)
    return Sensitivity(residual[:rows], own[:rows], own.T @ own, likelihood.clusters)
