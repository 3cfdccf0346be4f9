"""What the compiled interpreter hands over beside rows: counts, findings and events."""

import numpy as np

EVENT = np.dtype(
    [
        ("row", "i8"),
        ("kind", "i4"),
        ("line", "i4"),
        ("a", "f8"),
        ("b", "f8"),
        ("dwell", "f8"),
        ("q", "f8"),  # words Q and E of an M-code, NaN = none
        ("e", "f8"),
    ]
)
FOUND = np.dtype([("number", "i4"), ("line", "i4"), ("a", "f8"), ("b", "f8"), ("c", "f8")])
COUNTS = np.dtype(
    [
        ("rows", "i8"),
        ("events", "i8"),
        ("findings", "i8"),
        ("marks", "i8"),  # of the scanner, in this piece, used up
        ("dropped", "i8"),  # findings that found no room
        ("consequences", "i8"),  # findings that rest on an earlier one
        ("mute", "i8"),  # not 0 while a block is followed that has been reported already
        ("rows_wanted", "i8"),  # room that the next block needs, in all
        ("events_wanted", "i8"),
        ("errors", "i8"),  # findings that are no warnings
        ("program_wanted", "i8"),  # not 0: the next block takes the whole program, as it jumps or computes
    ]
)
