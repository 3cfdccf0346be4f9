"""Measured slots beside the force law: as fitted by their author and by us, and predicted from the others.

The five slots: flat mill of 25 mm, two teeth, 6000/min, 3 mm deep, revolution means of the raw signals at
github.com/leekunhwee/ForceCalculation. Their author fitted the coefficients of `slot D25 z2` to these slots.

    python benchmarks/measured_slots.py
"""

import numpy as np

from gcode2krl.cell.library import read_model
from gcode2krl.cell.sections import Material
from gcode2krl.cutting import mean_force
from gcode2krl.identify.force import fit_force

A_P_MM, TEETH, DIAMETER_MM = 3.0, 2, 25.0
MEASURED_N = {
    0.025: (-39.8, 63.0, 55.7),
    0.050: (-60.1, 107.1, 70.9),
    0.075: (-71.6, 137.7, 82.6),
    0.100: (-76.8, 171.3, 85.2),
    0.125: (-78.5, 210.7, 83.5),
}
"""Feed per tooth in mm → mean force on the tool along feed, normal and axis."""
STEP_S = 0.012


def slot_N(f_z_mm, coefficients):
    """Return the mean force (3,) of a full slot."""
    return mean_force([[0.0, np.pi]], A_P_MM, f_z_mm, TEETH, DIAMETER_MM, 0.0, coefficients)[0]


def fit_of(feeds, *, zeroed=True, in_air=0):
    """Return what `identify force` finds from slots, each a second long."""
    basis, force = [], []
    for f_z_mm in feeds:
        basis += in_air * [np.zeros((3, 6))]
        basis += 80 * [np.stack([slot_N(f_z_mm, unit) for unit in np.eye(6)], axis=1)]
        force += in_air * [np.zeros(3)] + 80 * [np.array(MEASURED_N[f_z_mm])]
    time_s = STEP_S * np.arange(len(basis))
    return fit_force(time_s, np.array(basis), time_s, np.array(force), zeroed=zeroed)


def held_out():
    """Yield for each slot its feed, the error of its prediction from the others, their band, if it is within.

    It is within where its feed is between those of the others.
    """
    for f_z_mm, measured in MEASURED_N.items():
        others = [feed for feed in MEASURED_N if feed != f_z_mm]
        fit = fit_of(others)
        predicted = slot_N(f_z_mm, fit.value)
        error = np.linalg.norm(predicted - measured) / np.linalg.norm(predicted)
        yield f_z_mm, error, fit.relative_band, min(others) <= f_z_mm <= max(others)


def percent(predicted, measured):
    return f"{100.0 * (predicted / measured - 1.0):+8.1f} %"


def main():
    author = Material.model_validate(read_model("materials", "slot D25 z2")).linear_edge.array()
    print("fitted to these slots: the author's coefficients")
    print("  f_z mm    in the plane   along the axis")
    for f_z_mm, measured in MEASURED_N.items():
        force = slot_N(f_z_mm, author)
        plane = percent(np.hypot(*force[:2]), np.hypot(*measured[:2]))
        print(f"  {f_z_mm:.3f}   {plane}       {percent(force[2], measured[2])}")
    for words, options in (
        ("as recorded", {"zeroed": False}),
        ("zeroed", {}),
        ("with air", {"zeroed": False, "in_air": 40}),
    ):
        fit = fit_of(MEASURED_N, **options)
        told = [
            f"{each:.2f}" if known else "-" for each, known in zip(fit.value, fit.determined, strict=True)
        ]
        print(f"all five, {words}: {', '.join(told)}; band {fit.relative_band:.1%}")
    print("held out: predicted from the other four")
    print("  f_z mm   error    90 % band of the others")
    within = []
    for f_z_mm, error, band, is_inside in held_out():
        verdict = "inside" if error <= band else "MISSED"
        if is_inside:
            within.append(error <= band)
        else:
            verdict += ", outside their range: a program there gets force-unmeasured"
        print(f"  {f_z_mm:.3f}   {error:6.1%}  {band:6.1%}  {verdict}")
    print(f"  within the range {sum(within)} of {len(within)} inside their band")


if __name__ == "__main__":
    main()
