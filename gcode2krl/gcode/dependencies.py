"""Which files a program may take in as subprograms, from its text alone.

A call that is written out names its file; where a number is computed, any file nearby may be meant.
"""

import gzip
import re
import zlib
from collections.abc import Sequence
from pathlib import Path

from gcode2krl.files.program_names import PACKED_ENDING
from gcode2krl.gcode.dialect_marks import PROGRAMS_FANUC, PROGRAMS_LINUXCNC
from gcode2krl.gcode.o_words import Label
from gcode2krl.gcode.subprograms import found_file

_CALL = re.compile(rb"M\s*0*98(?!\d)|G\s*65(?!\d)|c\s*a\s*l\s*l", re.IGNORECASE)
"""What may call a subprogram; a comment may say it too."""
_WRITTEN_OUT = re.compile(
    rb"(?:M[ \t]*0*98|G[ \t]*65)[ \t]*P[ \t]*(?P<number>\d+)(?![\d.])"
    rb"|O[ \t]*(?:<(?P<name>[^>\n]*)>|(?P<label>\d+))[ \t]*call",
    re.IGNORECASE,
)
_OF_A_NUMBER = 10_000
"""P31234 is 3 times O1234."""
_PIECE_BYTES = 1_000_000


def possible_files(part: Path, folders: Sequence[Path]) -> tuple[Path, ...]:
    """Return the files whose content may belong to a program: none where it calls no subprogram."""
    places = tuple(dict.fromkeys((part.parent, *folders)))
    files: set[Path] = set()
    waiting = [part]
    while waiting:
        calling = waiting.pop()
        of_sinumerik = _named_in(calling, places) - files - {part}
        files |= of_sinumerik
        waiting += of_sinumerik
        labels = _labels_called(calling)
        if labels is None:
            return tuple(sorted(files | _all_files(places, part)))
        for label in sorted(labels):
            for programs in (PROGRAMS_LINUXCNC, PROGRAMS_FANUC):
                file = found_file(label, places, part.suffix, programs)
                if file is not None and file != part and file not in files:
                    files.add(file)
                    waiting.append(file)
    return tuple(sorted(files))


def _all_files(places: Sequence[Path], part: Path) -> set[Path]:
    endings = {".ngc", ".nc", "", part.suffix.lower()}
    files = (file for place in places for file in place.glob("*") if file.suffix.lower() in endings)
    return {file for file in files if file.is_file() and file != part}


def _named_in(file: Path, places: Sequence[Path]) -> set[Path]:
    """Return the subprograms of a Sinumerik whose names stand in a file: a name alone is a call."""
    files = (near for place in places for near in place.glob("*.[sSmM][pP][fF]") if near != file)
    near = {each.stem.upper().encode(): each for each in files if each.is_file()}
    if not near:
        return set()
    try:
        words = set(re.findall(rb"\w+", file.read_bytes().upper()))
    except OSError:  # reading it reports it
        return set()
    return {each for name, each in near.items() if name in words}


def _labels_called(file: Path) -> set[Label] | None:
    """Return the labels of all calls in a file, None where one is computed."""
    labels: set[Label] = set()
    try:
        with (gzip.open if file.suffix.lower() == PACKED_ENDING else open)(file, "rb") as stream:
            while piece := stream.read(_PIECE_BYTES):
                piece += stream.readline()
                calls = _WRITTEN_OUT.findall(piece)
                if len(calls) < len(_CALL.findall(piece)):
                    return None
                labels |= {label for call in calls for label in _labels_of(*call)}
    except (OSError, EOFError, zlib.error):  # reading it reports it
        return set()
    return labels


def _labels_of(number: bytes, name: bytes, label: bytes) -> set[Label]:
    if name:
        return {re.sub(rb"\s", b"", name).lower().decode("latin-1")}
    digits = int((number or label)[-18:])
    return {str(digits), str(digits % _OF_A_NUMBER)}
