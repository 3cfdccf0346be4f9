"""Measured slots beside the force law: as fitted by their author and by us, and predicted from the others.

Revolution means of the raw signals at github.com/leekunhwee/ForceCalculation, 15 slots with mills of two
teeth: five with a flat mill of 25 mm (45° helix, 6000/min, 3 mm deep, 0.025 to 0.125 mm a tooth); five with a
bull-nose mill of 16 mm with a corner radius of 3 mm, and five with a ball mill (800/min, 160 mm/min, 1 to
5 mm deep). The ball's diameter is not stated; 16 mm is assumed, that of the bull-nose mill of the same day,
whose sensor had z towards the holder. Their author fitted the coefficients of `slot D25 z2` to the flat
mill's slots, and takes those of `Al 7075-T6` for the others.
"""

from typing import NamedTuple

import numpy as np

from gcode2krl.cutting import mean_force
from gcode2krl.identify.force import fit_force

TEETH = 2
STEP_S = 0.012


class Cut(NamedTuple):
    """A slot: its depth, feed per tooth, and the mean force on the tool along feed, normal and axis."""

    a_p_mm: float
    f_z_mm: float
    measured_N: tuple[float, float, float]


class Mill(NamedTuple):
    """A mill and its slots."""

    diameter_mm: float
    corner_radius_mm: float
    stated: str
    """The set of coefficients that the author used."""
    cuts: tuple[Cut, ...]

    def force_N(self, cut, coefficients):
        """Return the mean force (3,) of a full slot."""
        size = (TEETH, self.diameter_mm, self.corner_radius_mm)
        return mean_force([[0.0, np.pi]], cut.a_p_mm, cut.f_z_mm, *size, coefficients)[0]


MILLS = {
    "flat": Mill(
        25.0,
        0.0,
        "slot D25 z2",
        (
            Cut(3.0, 0.025, (-39.8, 63.0, 55.7)),
            Cut(3.0, 0.050, (-60.1, 107.1, 70.9)),
            Cut(3.0, 0.075, (-71.6, 137.7, 82.6)),
            Cut(3.0, 0.100, (-76.8, 171.3, 85.2)),
            Cut(3.0, 0.125, (-78.5, 210.7, 83.5)),
        ),
    ),
    "bull-nose": Mill(
        16.0,
        3.0,
        "Al 7075-T6",
        (
            Cut(1.0, 0.100, (-26.9, 72.2, -46.1)),
            Cut(2.0, 0.100, (-60.8, 137.9, -57.5)),
            Cut(3.0, 0.100, (-93.4, 199.8, -47.5)),
            Cut(4.0, 0.100, (-107.3, 253.4, -28.4)),
            Cut(5.0, 0.100, (-123.4, 310.3, -11.1)),
        ),
    ),
    "ball": Mill(
        16.0,
        8.0,
        "Al 7075-T6",
        (
            Cut(1.0, 0.100, (-24.9, 93.5, -90.3)),
            Cut(2.0, 0.100, (-57.7, 169.0, -136.9)),
            Cut(3.0, 0.100, (-94.0, 243.7, -183.0)),
            Cut(4.0, 0.100, (-142.0, 318.6, -215.9)),
            Cut(5.0, 0.100, (-194.6, 382.1, -235.5)),
        ),
    ),
}


def fit_of(mill, cuts, *, zeroed=True, in_air=0):
    """Return what `identify force` finds from slots, each a second long."""
    basis, force = [], []
    for cut in cuts:
        basis += in_air * [np.zeros((3, 6))]
        basis += 80 * [np.stack([mill.force_N(cut, unit) for unit in np.eye(6)], axis=1)]
        force += in_air * [np.zeros(3)] + 80 * [np.array(cut.measured_N)]
    time_s = STEP_S * np.arange(len(basis))
    return fit_force(time_s, np.array(basis), time_s, np.array(force), zeroed=zeroed)


def held_out(mill):
    """Yield for each slot of a mill the error of its prediction from the others, their band, if it is within.

    It is within where its depth and its feed are between those of the others.
    """
    for cut in mill.cuts:
        others = [other for other in mill.cuts if other is not cut]
        fit = fit_of(mill, others)
        error = error_of(mill.force_N(cut, fit.value), cut)
        sizes = np.array([other[:2] for other in others])
        inside = bool(np.all((sizes.min(axis=0) <= cut[:2]) & (cut[:2] <= sizes.max(axis=0))))
        yield cut, error, fit.relative_band, inside


def error_of(predicted_N, cut):
    """Return the error in size and direction of a predicted force, relative to it."""
    return float(np.linalg.norm(predicted_N - cut.measured_N) / np.linalg.norm(predicted_N))
