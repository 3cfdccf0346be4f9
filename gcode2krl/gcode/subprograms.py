"""Where the file of a subprogram is: beside the program, or in a folder that was named, and nowhere else."""

import re
from collections.abc import Sequence
from pathlib import Path

from gcode2krl.gcode.o_words import Label

_FILE_NAME = re.compile(r"[a-z0-9_][a-z0-9_.+-]*")
"""What a label has to look like to be the name of a file: no way out of the folder."""
_ENDING = ".ngc"
_NUMBER_IN_NAME = re.compile(r"[Oo]?(\d{1,9})")


def found_file(label: Label, folders: Sequence[Path], ending: str, *, of_fanuc: bool = False) -> Path | None:
    """Return the file ``label.ngc``, or with the ending of the program, in the first folder that has it.

    That of a Fanuc's program 12 is ``O0012.nc``, ``O12.nc``, ``0012.nc`` or ``12.nc``, with the ending of the
    program that calls it, with ``.nc`` or with none.
    """
    if not _FILE_NAME.fullmatch(label):
        return None
    names = _names_of_number(label, ending) if of_fanuc else [label + _ENDING, label + ending]
    for folder in folders:
        for name in dict.fromkeys(names):
            path = folder / name
            if path.is_file() and path.resolve().parent == folder.resolve():
                return path
    return None


def _names_of_number(label: Label, ending: str) -> list[str]:
    stems = [f"{letter}{number}" for letter in ("O", "o", "") for number in (label.zfill(4), label)]
    return [stem + each for stem in stems for each in (ending, ".nc", "")]


def own_number(name: str) -> Label:
    """Return the number that the file of a Fanuc's program has in its name, empty where it has none."""
    digits = _NUMBER_IN_NAME.fullmatch(Path(name).stem)
    return str(int(digits[1])) if digits else ""
