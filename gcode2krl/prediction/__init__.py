"""The tables of a prediction as one bundle, saved, loaded and checked."""

from gcode2krl.exchange.disk_names import column_names
from gcode2krl.prediction.bundle import Prediction

__all__ = ["Prediction", "column_names"]
