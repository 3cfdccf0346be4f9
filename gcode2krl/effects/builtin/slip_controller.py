"""Set-up slips of the controller: RSI correction on, wrong load data, its own accurate model on."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np

from gcode2krl.arrays import Floats
from gcode2krl.compliance import project_normal
from gcode2krl.effects import arm
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import Parameter, size_from_zero
from gcode2krl.effects.weight import with_weight
from gcode2krl.units import RAD_PER_DEG


class RsiOn(Effect):
    """An RSI correction was on: the drives take back ``gain``·the nominal deflection normal to the feed.

    The commanded columns stay those of the program, the actual ones move (Haehn & Weigold 2020, eq. 10), as
    the force of ``delay_s`` ago says. The tool is not turned.
    """

    name = "rsi_on"
    family = "set-up slips"
    links = frozenset({"servo"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.FORCE_BY_PLACE})
    kind = "slip"
    searched_in = frozenset({"servo"})
    parameters = (
        size_from_zero("gain", "", high=1.5, start=1.0, source="1 takes all of the modelled deflection back"),
        Parameter(
            name="delay_s",
            unit="s",
            low=0.0,
            high=0.5,
            nominal=None,
            start=0.1,
            grid=(0.0, 0.05, 0.1, 0.15),
            source="force chain and robot's reaction 100-150 ms; pilot forces take it off",
        ),
    )

    def servo(self, q_act_rad: Floats, inputs: Inputs, applied: Applied) -> Floats:
        """Return the motor side."""
        if applied["gain"] == 0.0 or not inputs.deflection_mm.any():
            return q_act_rad
        wanted_mm = -applied["gain"] * project_normal(inputs.deflection_mm, inputs.velocity_mm_s)
        seen_s = inputs.time_s - applied["delay_s"]
        shift = np.zeros((len(inputs), 6, 1))
        for axis in range(3):
            shift[:, axis, 0] = np.interp(seen_s, inputs.time_s, wanted_mm[:, axis])
        return q_act_rad + np.linalg.solve(inputs.jacobian, shift)[:, :, 0]


_FURTHER = ("dx_mm", "dy_mm", "dz_mm")


class WrongLoad(Effect):
    """The controller's load data are off by ``mass_kg`` (true less stated): the arm sags by that weight.

    Its centre lies at the stated one and ``dx_mm dy_mm dz_mm`` further, along the axes of the flange: load
    data of another tool differ in both. By the model's own compliance, static.
    """

    name = "load"
    family = "set-up slips"
    links = frozenset({"mechanics"})
    where = frozenset({Where.TIP})
    depends_on = frozenset({Dependence.PLACE})
    kind = "slip"
    searched_in = frozenset({"mechanics"})
    vectors = MappingProxyType({"further_mm": _FURTHER})
    parameters = (
        Parameter(
            name="mass_kg",
            unit="kg",
            low=-300.0,
            high=300.0,
            nominal=0.0,
            start=30.0,
            linear=True,
            source="load data of another tool, or none: up to the rated payload",
        ),
        *(
            Parameter(
                name=name,
                unit="mm",
                low=-500.0,
                high=500.0,
                nominal=None,
                start=0.0,
                source="centres of the tools of one cell: some hundred millimetres apart",
            )
            for name in _FURTHER
        ),
    )

    def load(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load with the weight that is not accounted for."""
        if applied["mass_kg"] == 0.0:
            return load
        lever_mm = np.empty((len(inputs), 3))
        for number, rows in arm.tool_rows(inputs.tool):
            stated = inputs.cell.load_of(int(number))
            centre_mm = np.array([stated.x_mm, stated.y_mm, stated.z_mm]) + applied.vector(_FURTHER)
            from_tip_mm = centre_mm - inputs.cell.tool_matrix(number)[:3, 3]
            lever_mm[rows] = inputs.sensor_rotation[rows] @ from_tip_mm
        return with_weight(load, inputs, applied["mass_kg"], lever_mm)


_OFFSETS = tuple(f"a{number}_deg" for number in range(1, 7))


class AbsoluteAccuracy(Effect):
    """The controller's own accurate model is on: its joints are not those of the nominal kinematics.

    The tip is where it was commanded, the joints differ. Here by a constant a joint, the first term of that
    model; what changes with the pose is not in it.
    """

    name = "absolute_accuracy"
    family = "set-up slips"
    links = frozenset({"path", "mechanics"})
    where = frozenset({Where.JOINT})
    depends_on = frozenset({Dependence.CONSTANT})
    kind = "slip"
    searched_in = frozenset({"path"})
    own_model = True
    vectors = MappingProxyType({"offsets_deg": _OFFSETS})
    parameters = tuple(
        Parameter(
            name=name,
            unit="deg",
            low=-1.0,
            high=1.0,
            nominal=0.0,
            start=0.02,
            linear=True,
            source="uncalibrated accuracy of 1-3 mm is 0.02-0.1 deg",
        )
        for name in _OFFSETS
    )

    def replan(self, inputs: Inputs, applied: Applied) -> Inputs:
        """Return the inputs with these joints."""
        offsets_rad = applied.vector(_OFFSETS) * RAD_PER_DEG
        return replace(inputs, q_cmd_rad=inputs.q_cmd_rad + offsets_rad) if offsets_rad.any() else inputs


EFFECT = (RsiOn(), WrongLoad(), AbsoluteAccuracy())
