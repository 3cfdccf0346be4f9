"""On what an effect truly depends: where it acts, on which inputs, in what form, and which links see it."""

from collections.abc import Callable
from dataclasses import dataclass

WHERE = ("tip", "joint", "force", "clock", "part")
ON = (
    "constant",
    "time_smooth",
    "time_step",
    "time_since_start",
    "run_to_run",
    "wall_clock",
    "own_angle",
    "motor_angle",
    "reversals",
    "own_torque",
    "own_torque_memory",
    "velocity",
    "acceleration",
    "jerk",
    "force",
    "force_memory",
    "force_by_place",
    "metres_cut",
    "travel",
    "corners",
    "stops",
    "place",
    "spindle_speed",
    "temperature",
    "tone",
    "noise",
)
FORMS = ("smooth", "step", "drift", "periodic", "loop")
LINKS = ("timing", "path", "servo", "gear", "force", "mechanics", "part")


@dataclass(frozen=True)
class Depends:
    """`on`: admissible names of the input, the truest first. `links`: where it can be seen."""

    where: str
    on: tuple[str, ...]
    form: str
    links: tuple[str, ...]

    def __post_init__(self) -> None:
        for value, allowed in ((self.where, WHERE), (self.form, FORMS)):
            if value not in allowed:
                raise ValueError(f"{value!r} is none of {', '.join(allowed)}")
        for values, allowed in ((self.on, ON), (self.links, LINKS)):
            if not values or not set(values) <= set(allowed):
                raise ValueError(f"{values} must be some of {', '.join(allowed)}")


def tip(form: str, *on: str) -> Depends:
    """Of the tool's tip, as the tracker sees it."""
    return Depends("tip", on, form, ("mechanics",))


def joint(form: str, *on: str, links: tuple[str, ...] = ("gear", "mechanics")) -> Depends:
    """Of one joint."""
    return Depends("joint", on, form, links)


def force(form: str, *on: str, links: tuple[str, ...] = ("force",)) -> Depends:
    """Of the measured force."""
    return Depends("force", on, form, links)


def timing(form: str, *on: str) -> Depends:
    """Of the motion's time law."""
    return Depends("tip", on, form, ("timing", "path"))


TORQUE = joint("smooth", "own_torque", "force", links=("mechanics",))


def by_spring(target: str | None) -> Depends:
    """A joint's spring feels the joint's torque; one that is no joint's, the force at the tip."""
    return TORQUE if target is not None and target[0] == "A" else tip("smooth", "force")


FRAME = tip("smooth", "place", "constant")

LIBRARY_DEPENDS: dict[str, Depends | Callable[[str | None], Depends]] = {
    "clock": Depends("clock", ("velocity",), "smooth", ("timing", "servo", "gear", "force", "mechanics")),
    "velocity_rule": timing("smooth", "acceleration"),
    "corner": timing("smooth", "corners", "acceleration", "place"),
    "advance_stop": timing("step", "stops", "time_step"),  # a stop is a step in lateness
    "servo_lag": joint("smooth", "velocity", links=("servo",)),
    "backlash": joint("loop", "reversals"),
    "friction": joint("loop", "reversals", links=("servo",)),
    "transmission": joint("periodic", "motor_angle"),
    "mastering": joint("smooth", "constant", links=("mechanics",)),
    "wrist_coupling": joint("smooth", "own_angle"),
    "link_length": FRAME,
    "base_frame": FRAME,
    "tool_frame": FRAME,
    "thermal": tip("drift", "wall_clock", "time_smooth"),
    "stiffness": by_spring,
    "nonlinear_stiffness": TORQUE,
    "hysteresis": joint("loop", "own_torque_memory", "force_memory", links=("mechanics",)),
    "gravity": tip("smooth", "place", "own_torque"),
    "vibration": tip("smooth", "acceleration", "force"),
    "force_scale": force("smooth", "force"),
    "tool_wear": force("drift", "metres_cut"),
    "runout": force("smooth", "force"),
    "stock_offset": force("smooth", "force_by_place", "place"),
    "edge_force": force("smooth", "force"),
    "force_offset": force("smooth", "constant"),
    "force_drift": force("drift", "wall_clock", "time_smooth"),
    "tool_weight": force("smooth", "constant", "place"),
    "hose_pack": force("smooth", "place", "constant"),
    "force_delay": force("smooth", "force_memory", "force"),
    "tool_diameter": Depends("part", ("constant",), "smooth", ("part",)),
    "tool_number": FRAME,
    "base_number": FRAME,
    "override": timing("smooth", "velocity"),
    "rsi_on": tip("smooth", "force"),
    "load": tip("smooth", "place", "own_torque"),
    "absolute_accuracy": Depends("tip", ("place",), "smooth", ("path", "mechanics")),
    "other_program": timing("smooth", "place"),
    "unit": FRAME,
    "swapped_tool": FRAME,
}
