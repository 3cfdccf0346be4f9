"""Where the file of a subprogram is: beside the program, or in a folder that was named, and nowhere else."""

import gzip
import re
import zlib
from collections.abc import Sequence
from pathlib import Path

from gcode2krl.files.program_names import PACKED_ENDING
from gcode2krl.gcode.o_words import Label

_FILE_NAME = re.compile(r"[a-z0-9_][a-z0-9_.+-]*")
"""What a label has to look like to be the name of a file: no way out of the folder."""
_ENDING = ".ngc"
_NUMBER_IN_NAME = re.compile(r"[Oo]?(\d{1,9})")
_CALL = re.compile(rb"M\s*0*98(?!\d)|G\s*65(?!\d)|c\s*a\s*l\s*l|\bL\d", re.IGNORECASE)
"""What a program says that may call a subprogram; a comment may say it too."""
_MOST_CALL_BYTES = 32
_PIECE_BYTES = 1_000_000


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


def possible_files(part: Path, folders: Sequence[Path]) -> tuple[Path, ...]:
    """Return the files whose content may belong to a program: none where it calls no subprogram."""
    try:
        if not _may_call(part):
            return ()
    except (OSError, EOFError, zlib.error):  # reading it reports it
        return ()
    endings = {_ENDING, ".nc", "", part.suffix.lower()}
    files = {
        file
        for folder in dict.fromkeys((part.parent, *folders))
        for file in folder.glob("*")
        if file.suffix.lower() in endings and file.is_file() and file != part
    }
    return tuple(sorted(files))


def _may_call(part: Path) -> bool:
    rest = b""
    with (gzip.open if part.suffix.lower() == PACKED_ENDING else open)(part, "rb") as stream:
        while piece := stream.read(_PIECE_BYTES):
            if _CALL.search(rest + piece):
                return True
            rest = piece[-_MOST_CALL_BYTES:]
    return False
