"""What an effect can depend on: where it shows and the inputs of its link, which together are its family.

A gap without a name is described by them too, so that it can be compared with effects.

An effect that states several places or inputs is a function of any of them or of all together: its family has
a member for each pair of a place and an input, and the effect's own form, which may join them, is one more.
An effect at a joint has the families of that joint only.
"""

from enum import Enum


class Where(Enum):
    """Of what the signal of a link is a deviation."""

    TIP = "tip"
    JOINT = "joint"
    """Also where no encoder sees it and only the tip shows it, through the Jacobian."""
    FORCE_AXIS = "force axis"


class Dependence(Enum):
    """An input that a deviation can be a function of."""

    CONSTANT = "constant"
    """None of the others: a zero, an offset."""
    RUN_TIME = "time in the run"
    """Smoothly, each run in its own way."""
    RUN_TIME_STEP = "step in time"
    """From one moment on, in all later runs too."""
    EVENT = "event"
    """Once, for some hundredths of a second: an impact."""
    RUN_START = "time since the run's start"
    """The same in every run: what settles."""
    RUN_TO_RUN = "run to run"
    WALL_CLOCK = "wall clock"
    OWN_ANGLE = "own angle"
    """Of the joint where it shows, or of the one that is its target."""
    MOTOR_ANGLE = "motor angle"
    REVERSALS = "reversals"
    """Direction of the joint's motion, with memory."""
    OWN_TORQUE = "own torque"
    """Odd in it, also with memory of it."""
    VELOCITY = "velocity"
    """How fast the signal itself changes: a joint, the tip, or a force."""
    ACCELERATION = "acceleration"
    """Also what rings with it: the mode of a spring."""
    JERK = "jerk"
    """Commanded: what a servo is behind or ahead where the acceleration changes."""
    FORCE = "force"
    """Also with memory of it."""
    FORCE_BY_PLACE = "force by place"
    METRES_CUT = "metres cut"
    TRAVEL = "travel"
    """Length of the path so far."""
    CORNERS = "corners"
    """How corners are rounded: beside them, and how late each makes the run."""
    STOPS = "stops"
    """Later from a corner on: something stops the robot there."""
    PLACE = "place"
    """Pose of the tool."""
    SPINDLE_SPEED = "spindle speed"
    """Also what follows it with a delay."""
    TEMPERATURE = "temperature"
    TONE = "tone"
    """One frequency, whatever the motion."""
