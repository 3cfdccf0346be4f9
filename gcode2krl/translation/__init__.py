"""A translation as a function: an `Order` goes in, `carry_out` returns an `Attempt` with its record.

Commands, worker processes and Python programs translate alike; only the commands print.
"""

from gcode2krl.translation.attempt import Attempt
from gcode2krl.translation.order import Order
from gcode2krl.translation.stages import carry_out

__all__ = ["Attempt", "Order", "carry_out"]
