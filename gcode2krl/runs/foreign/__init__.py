"""Logs as other programs write them: which column is what, in which unit, and the run that they make."""

from gcode2krl.runs.foreign.guess import ORDERS, ColumnQuestion, Entry, Guess, guessed
from gcode2krl.runs.foreign.names import FACTORS
from gcode2krl.runs.foreign.run import (
    absences,
    earlier_layout,
    guess_of,
    is_native,
    run_from,
    run_of,
    run_or_log,
    sheets_of,
    told,
    write_native,
    write_run,
)
from gcode2krl.runs.foreign.table import LogTable, read_table, table_of

__all__ = [
    "FACTORS",
    "ORDERS",
    "ColumnQuestion",
    "Entry",
    "Guess",
    "LogTable",
    "absences",
    "earlier_layout",
    "guess_of",
    "guessed",
    "is_native",
    "read_table",
    "run_from",
    "run_of",
    "run_or_log",
    "sheets_of",
    "table_of",
    "told",
    "write_native",
    "write_run",
]
