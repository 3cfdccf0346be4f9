"""Files: written together or not at all, and foreign ones read within bounds."""

from gcode2krl.files.output import (
    SURELY_LEFT_S,
    Content,
    Staging,
    leftovers,
    make_folder,
    refuse_inputs,
    unwritable,
    watched,
    write_together,
)

__all__ = [
    "SURELY_LEFT_S",
    "Content",
    "Staging",
    "leftovers",
    "make_folder",
    "refuse_inputs",
    "unwritable",
    "watched",
    "write_together",
]
