"""Measured runs: a folder with what the controller, the tracker, the force sensor and the scan recorded."""

from gcode2krl.runs.against import check_against, check_program
from gcode2krl.runs.controller_trace import (
    POSITION,
    ControllerTrace,
    check_scale,
    noise_mm,
    program_rests,
    read_controller_trace,
    resolution_mm,
    standstills,
)
from gcode2krl.runs.folder import Run, load_run
from gcode2krl.runs.head import RunHead
from gcode2krl.runs.krc_trace import read_krc_trace
from gcode2krl.runs.measured import LEAST_ROWS, TIME, Controller, Force, Measured, Poses, Tracker
from gcode2krl.runs.rsi_log import read_rsi_log
from gcode2krl.runs.scan import Scan

__all__ = [
    "LEAST_ROWS",
    "POSITION",
    "TIME",
    "Controller",
    "ControllerTrace",
    "Force",
    "Measured",
    "Poses",
    "Run",
    "RunHead",
    "Scan",
    "Tracker",
    "check_against",
    "check_program",
    "check_scale",
    "load_run",
    "noise_mm",
    "program_rests",
    "read_controller_trace",
    "read_krc_trace",
    "read_rsi_log",
    "resolution_mm",
    "standstills",
]
