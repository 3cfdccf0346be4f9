"""The tables of a prediction as one bundle, saved, loaded and checked."""

from gcode2krl.prediction.bundle import RECORD, Prediction, column_names, refuse_foreign

__all__ = ["RECORD", "Prediction", "column_names", "refuse_foreign"]
