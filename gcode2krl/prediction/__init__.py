"""The tables of a prediction as one bundle, saved, loaded and checked."""

from gcode2krl.exchange.disk_names import column_names
from gcode2krl.prediction.bundle import Prediction
from gcode2krl.prediction.folder import RECORD, refuse_foreign

__all__ = ["RECORD", "Prediction", "column_names", "refuse_foreign"]
