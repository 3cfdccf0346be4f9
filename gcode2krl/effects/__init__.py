"""What the nominal model leaves out, an effect a file: one implementation predicts it and finds it."""

from gcode2krl.effects.apply import inputs_of, with_effects
from gcode2krl.effects.chain import commanded, drives, forces, simulate
from gcode2krl.effects.dependence import Dependence, Where
from gcode2krl.effects.effect import Applied, Effect
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.mismatch import Mismatch
from gcode2krl.effects.parameter import Parameter, Role
from gcode2krl.effects.registry import effects_in, from_cell, library, parse, resolve
from gcode2krl.effects.signals import Clock, Signals

__all__ = [
    "Applied",
    "Clock",
    "Dependence",
    "Effect",
    "Inputs",
    "Mismatch",
    "Parameter",
    "Role",
    "Signals",
    "Where",
    "commanded",
    "drives",
    "effects_in",
    "forces",
    "from_cell",
    "inputs_of",
    "library",
    "parse",
    "resolve",
    "simulate",
    "with_effects",
]
