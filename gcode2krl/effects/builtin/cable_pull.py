"""A cable pulls at the end effector."""

from types import MappingProxyType

from gcode2krl.arrays import Floats
from gcode2krl.effects.arm import Load
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect, every_joint
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.parameter import DIRECTION, direction_parameters, size_from_zero
from gcode2krl.units import DEG_PER_RAD


class CablePull(Effect):
    """The sensor shows N_per_deg·(angle - angle at the run's start) more, along its own axes.

    A cable that is slack at the start and is stretched, or pushed, with the travel of one joint. Its pull is
    a load and bends the arm too, by some hundredths of a millimetre. `hose_pack` goes with the turn of the
    tool instead.
    """

    name = "cable_pull"
    family = "sensor"
    links = frozenset({"force"})
    where = frozenset({Where.FORCE_AXIS})
    depends_on = frozenset({Dependence.OWN_ANGLE, Dependence.PLACE})
    targets = staticmethod(every_joint)
    vectors = MappingProxyType({"direction": DIRECTION})
    direction = DIRECTION
    parameters = (
        size_from_zero(
            "N_per_deg",
            "N/deg",
            high=20.0,
            start=0.5,
            source="a cable pulls with up to some 50 N; over 30 deg of travel 0.1-2",
        ),
        *direction_parameters("any"),
    )

    def learned(self, applied: Applied, link: str) -> Applied:
        """Return the effect as it is: what pulls at the end effector bends the arm."""
        return applied

    def load(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return the load that bends the arm."""
        return _with_pull(load, inputs, applied)

    def sensor(self, load: Load, inputs: Inputs, applied: Applied) -> Load:
        """Return what the sensor states."""
        return _with_pull(load, inputs, applied)


def _with_pull(load: Load, inputs: Inputs, applied: Applied) -> Load:
    """Return a load with the pull at the tool."""
    if applied["N_per_deg"] == 0.0:
        return load
    pull_N = applied["N_per_deg"] * travelled_deg(inputs, applied.joint)[:, None] * applied.unit_vector()
    return load[0] + (inputs.sensor_rotation @ pull_N[:, :, None])[:, :, 0], load[1]


def travelled_deg(inputs: Inputs, joint: int) -> Floats:
    """Return how far (m,) a joint is from where it began."""
    q_rad = inputs.q_cmd_rad[:, joint]
    return (q_rad - q_rad[:1]) * DEG_PER_RAD


EFFECT = CablePull()
