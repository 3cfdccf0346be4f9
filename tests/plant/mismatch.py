"""Normal mismatch, which is never a cause: its bounds, and the laws by which a case draws it.

The usual law is even between the bounds. A foreign law has another shape, bounds half as wide again or twice
as wide, and joints that err together (one batch of gears, one wrong datum): a Gaussian copula with one common
factor.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import betaincinv, ndtr, ndtri

from tests.plant.robot import Mismatch

BOUNDS = {  # between plus and minus (or zero and) the bound
    "stiffness": 0.08,
    "coefficients": 0.03,
    "gain": 0.02,
    "lag_s": 0.0005,
    "play_deg": 0.0005,
    "transmission_deg": 0.0005,
    "shift_mm": 0.04,
    "turn_rad": 3e-5,
    "clock_s": 0.002,
    "force_zero_N": 3.0,
}
CLOCKS = ("tracker", "force", "controller", "q_load")
SHAPES = ("clipped_normal", "bimodal", "beta")
SCALES = (1.5, 2.0)


@dataclass(frozen=True)
class Law:
    """How shares of a bound are drawn; `correlation` is that between the joints of one draw."""

    shape: str = "uniform"
    scale: float = 1.0
    correlation: float = 0.0

    def shares(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """Shares of the bound in -1 ... 1, times the scale."""
        if self.shape == "uniform":
            return self.scale * rng.uniform(-1.0, 1.0, n)
        common, own = rng.normal(), rng.normal(size=n)
        u = ndtr(np.sqrt(self.correlation) * common + np.sqrt(1.0 - self.correlation) * own)
        return self.scale * QUANTILES[self.shape](u)


def _clipped_normal(u: np.ndarray) -> np.ndarray:
    """Two standard deviations reach the bound."""
    return np.clip(ndtri(u) / 2.0, -1.0, 1.0)


def _bimodal(u: np.ndarray) -> np.ndarray:
    """Within the outer fifth on either side."""
    side = np.where(u < 0.5, -1.0, 1.0)
    return side * (0.8 + 0.2 * np.abs(2.0 * u - 1.0))


def _beta(u: np.ndarray) -> np.ndarray:
    """Beta(2, 5) over the range: leans to one side."""
    return 2.0 * betaincinv(2.0, 5.0, u) - 1.0


QUANTILES = {"clipped_normal": _clipped_normal, "bimodal": _bimodal, "beta": _beta}
USUAL = Law()


def foreign(rng: np.random.Generator) -> Law:
    """Another distribution, wider bounds, with joints that err together."""
    return Law(str(rng.choice(SHAPES)), float(rng.choice(SCALES)), float(rng.uniform(0.3, 0.9)))


def _even(rng: np.random.Generator, law: Law, low: float, high: float, n: int) -> np.ndarray:
    """Values from `low` to `high` under a law; where `low` is 0 the size of the share counts."""
    if law.shape == "uniform":
        return law.scale * rng.uniform(low, high, n)
    shares = law.shares(rng, n)
    return high * (np.abs(shares) if low == 0.0 else shares)


def _ball(rng: np.random.Generator, law: Law, radius: float) -> np.ndarray:
    v = rng.normal(size=3)
    if law.shape == "uniform":
        length = law.scale * rng.random() ** (1 / 3)
    else:
        length = float(np.abs(law.shares(rng, 1))[0])
    return radius * length * v / np.linalg.norm(v)


def of_robot(rng: np.random.Generator, law: Law = USUAL) -> Mismatch:
    """What stays the same in all runs of a case."""
    b = BOUNDS
    return Mismatch(
        stiffness=1.0 + _even(rng, law, -b["stiffness"], b["stiffness"], 10),
        coefficients=1.0 + _even(rng, law, -b["coefficients"], b["coefficients"], 6),
        gain=1.0 + _even(rng, law, -b["gain"], b["gain"], 3),
        lag_s=_even(rng, law, 0.0, b["lag_s"], 6),
        play_deg=_even(rng, law, 0.0, b["play_deg"], 6),
        play_start=rng.uniform(-1.0, 1.0, 6),
        transmission_deg=_even(rng, law, 0.0, b["transmission_deg"], 6),
        phase=rng.uniform(0.0, 2.0 * np.pi, 6),
    )


def of_day(robot: Mismatch, rng: np.random.Generator, law: Law = USUAL) -> Mismatch:
    """The robot's mismatch with that of one run: frame, clocks, zero of the force."""
    b = BOUNDS
    return replace(
        robot,
        shift_mm=_ball(rng, law, b["shift_mm"]),
        turn_rad=_ball(rng, law, b["turn_rad"]),
        clocks_s={name: float(_even(rng, law, -b["clock_s"], b["clock_s"], 1)[0]) for name in CLOCKS},
        force_zero_N=_even(rng, law, -b["force_zero_N"], b["force_zero_N"], 3),
    )
