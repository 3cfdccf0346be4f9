"""What the nominal model leaves out, an effect a file: one implementation predicts it and finds it."""

from gcode2krl.effects.apply import inputs_of, with_effects
from gcode2krl.effects.chain import commanded, simulate
from gcode2krl.effects.effect import Applied, Effect, Parameter
from gcode2krl.effects.inputs import Inputs
from gcode2krl.effects.registry import effects_in, from_cell, library, parse, resolve
from gcode2krl.effects.signals import Clock, Signals

__all__ = [
    "Applied",
    "Clock",
    "Effect",
    "Inputs",
    "Parameter",
    "Signals",
    "commanded",
    "effects_in",
    "from_cell",
    "inputs_of",
    "library",
    "parse",
    "resolve",
    "simulate",
    "with_effects",
]
