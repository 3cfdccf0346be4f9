"""What a cell can hold of an arm's errors: zeros, lengths and tilted axes as ``[[effects]]``.

A cell knows no lateral offset, no axes that miss the wrist's centre, no weight: those that it knows are
fitted again without the others, so that they do not wait for what is not there, and the figures say what that
costs.
"""

from dataclasses import replace
from typing import Any

from gcode2krl.identify.kinematics.arms import Arm
from gcode2krl.identify.kinematics.identification import Geometry, Options, identify_kinematics
from gcode2krl.identify.kinematics.readings import Readings

_OF_TILT = {"A2 tilt": 1.0, "A3 tilt": 1.0, "A4 tilt": 1.0, "A5 tilt": -1.0, "A6 tilt": 1.0}
"""The chain's turn about the line of ``axis_parallelism``, which follows KUKA's signs of the axes."""
_EFFECTS = {
    **{f"A{n} zero": ("mastering", f"A{n}", "offset_deg", 1.0) for n in range(1, 7)},
    **{name: ("link_length", name, "mm", 1.0) for name in ("a1", "a2", "c1", "c2", "c3", "c4")},
    **{name: ("axis_parallelism", name[:2], "mrad", sign) for name, sign in _OF_TILT.items()},
}


def section_of(readings: Readings, arm: Arm, options: Options) -> tuple[list[dict[str, Any]], Geometry]:
    """Return the entries of ``[[effects]]`` that a KUKA's cell can hold, and the fit of these alone.

    Raises as `identify_kinematics` does.
    """
    groups = ("zeros", "lengths", "axes", *(g for g in ("drift", "air") if g in options.groups))
    fit = identify_kinematics(readings, arm, replace(options, groups=groups, only=_EFFECTS, curves=False))
    entries = []
    for part in fit.parts:
        if part.name in _EFFECTS and part.is_told and not part.estimate.contains(0.0):
            effect, target, parameter, sign = _EFFECTS[part.name]
            value = float(f"{sign * part.estimate.value:.6g}")
            entries.append(
                {
                    "name": effect,
                    "target": target,
                    "parameters": {parameter: value},
                    "source": f"identify kinematics, {readings.source}: {len(readings)} poses",
                }
            )
    return entries, fit
