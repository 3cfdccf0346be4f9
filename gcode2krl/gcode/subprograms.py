"""Where the file of a subprogram is: beside the program, or in a folder that was named, and nowhere else."""

import re
from collections.abc import Sequence
from pathlib import Path

from gcode2krl.gcode.dialect_marks import PROGRAMS_FANUC, PROGRAMS_LINUXCNC, PROGRAMS_SINUMERIK
from gcode2krl.gcode.o_words import Label

_FILE_NAME = re.compile(r"[a-z0-9_][a-z0-9_.+-]*")
"""What a label has to look like to be the name of a file: no way out of the folder."""
_ENDING = ".ngc"
SINUMERIK_ENDINGS = (".spf", ".mpf")
"""Endings of a Sinumerik's subprograms, in the order in which it looks for them."""
_NUMBER_IN_NAME = re.compile(r"[Oo]?(\d{1,9})")


def found_file(
    label: Label, folders: Sequence[Path], ending: str, programs: int = PROGRAMS_LINUXCNC
) -> Path | None:
    """Return the file ``label.ngc``, or with the ending of the program, in the first folder that has it.

    That of a Fanuc's program 12 is ``O0012.nc``, ``O12.nc``, ``0012.nc`` or ``12.nc``, with the ending of the
    program that calls it, with ``.nc`` or with none; that of a Sinumerik's HOLES is ``HOLES.SPF``, else
    ``HOLES.MPF``, in small letters or capitals. ``programs`` is how the control writes them.
    """
    if not _FILE_NAME.fullmatch(label):
        return None
    if programs == PROGRAMS_SINUMERIK:
        return next((file for folder in folders if (file := _of_sinumerik(label, folder)) is not None), None)
    of_fanuc = programs == PROGRAMS_FANUC
    names = _names_of_number(label, ending) if of_fanuc else [label + _ENDING, label + ending]
    for folder in folders:
        for name in dict.fromkeys(names):
            path = folder / name
            if path.is_file() and path.resolve().parent == folder.resolve():
                return path
    return None


def _of_sinumerik(label: Label, folder: Path) -> Path | None:
    names = (label + ending for ending in SINUMERIK_ENDINGS)
    files = {file.name.lower(): file for file in folder.glob("*.[sSmM][pP][fF]") if file.is_file()}
    return next((files[name] for name in names if name in files), None)


def _names_of_number(label: Label, ending: str) -> list[str]:
    stems = [f"{letter}{number}" for letter in ("O", "o", "") for number in (label.zfill(4), label)]
    return [stem + each for stem in stems for each in (ending, ".nc", "")]


def own_number(name: str) -> Label:
    """Return the number that the file of a Fanuc's program has in its name, empty where it has none."""
    digits = _NUMBER_IN_NAME.fullmatch(Path(name).stem)
    return str(int(digits[1])) if digits else ""
