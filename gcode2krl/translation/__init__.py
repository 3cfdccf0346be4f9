"""A translation as a function: an `Order` goes in, `carry_out` returns an `Attempt` with its record.

Commands, worker processes and Python programs translate alike; only the commands print.
"""

from gcode2krl.translation.attempt import Attempt
from gcode2krl.translation.carry_out import carry_out
from gcode2krl.translation.order import Order

__all__ = ["Attempt", "Order", "carry_out"]
