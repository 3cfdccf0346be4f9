"""White's estimator by clusters: how much more a fit varies than independent noise lets it.

With H the information, J_i the derivative of residual r_i and clusters g of rows that share what the model is
off by, the covariance of the fitted numbers is H⁻¹·B·H⁻¹ with B = Σ_g u_g·u_gᵀ and the scores
u_g = Σ_{i in g} J_i·r_i (White 1980; by clusters: Liang & Zeger 1986). Valid for many clusters, each with a
small part of the information.
"""

import numpy as np

from gcode2krl.arrays import Floats, Ints


def cluster_scores(jacobian: Floats, residual: Floats, clusters: Ints) -> Floats:
    """Return the scores u (g, p) of jacobian (n, p) and residual (n,), one row a cluster (n,), 0 or more."""
    used = np.bincount(clusters) > 0
    at = (np.cumsum(used) - 1)[clusters]
    sums = [np.bincount(at, column * residual, int(used.sum())) for column in jacobian.T]
    scores: Floats = np.stack(sums, axis=1) if sums else np.zeros((int(used.sum()), 0))
    return scores


def clustered_covariance(inverse: Floats, scores: Floats, small_sample: bool = False) -> Floats:
    """Return the inverse information (p, p), each deviation widened to that of H⁻¹·B·H⁻¹, never narrowed.

    ``small_sample`` multiplies B by g/(g - 1).
    """
    meat = scores.T @ scores
    if small_sample:
        meat = meat * len(scores) / (len(scores) - 1.0)
    robust = np.diag(inverse @ meat @ inverse)
    wider = np.sqrt(np.maximum(robust / np.maximum(np.diag(inverse), 1e-300), 1.0))
    widened: Floats = inverse * np.outer(wider, wider)
    return widened


def gain_inflation(inverse: Floats, scores: Floats, fitted: int) -> float:
    """Return by how much the likelihood ratio of p numbers varies more than white noise lets it, at least 1.

    trace(H⁻¹·B)/p, times g/(g - ``fitted``) for the numbers fitted to the g clusters. A model that is off
    here and there, by either sign, makes the noise of a gain larger than the noise of a sample says.
    """
    clusters, width = scores.shape
    grown = float(np.trace(inverse @ (scores.T @ scores))) / width
    return float(max(1.0, grown * clusters / max(clusters - fitted, 1)))
