"""Where the file of a subprogram is: beside the program, or in a folder that was named, and nowhere else."""

import re
from collections.abc import Sequence
from pathlib import Path

from gcode2krl.gcode.o_words import Label

_FILE_NAME = re.compile(r"[a-z0-9_][a-z0-9_.+-]*")
"""What a label has to look like to be the name of a file: no way out of the folder."""
_ENDING = ".ngc"


def found_file(label: Label, folders: Sequence[Path], ending: str) -> Path | None:
    """Return the file ``label.ngc``, or with the ending of the program, in the first folder that has it."""
    if not _FILE_NAME.fullmatch(label):
        return None
    for folder in folders:
        for name in dict.fromkeys((label + _ENDING, label + ending)):
            path = folder / name
            if path.is_file() and path.resolve().parent == folder.resolve():
                return path
    return None
