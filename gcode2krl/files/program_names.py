"""Names of files with G-code: their endings, packed or not, and the name of the program in them."""

from pathlib import Path, PurePath
from typing import Final

ENDINGS: Final = frozenset(
    [".nc", ".ngc", ".ncc", ".cnc", ".tap", ".gcode", ".gc", ".mpf", ".eia", ".min", ".iso", ".h"]
)
"""Endings of programs; ``.h`` is Heidenhain's conversational text."""
DIALECT_NAMES: Final = (
    "linuxcnc",
    "fanuc",
    "fanuc-calculator",
    "fanuc-increments",
    "grbl",
    "sinumerik",
    "heidenhain",
)
"""Dialects of G-code, the default first; what they are says `gcode.dialects`."""
PACKED_ENDING: Final = ".gz"
_TIMES_PACKED = 10
"""A packed program of a CAM system is about a tenth of its text."""


def is_program_file(name: str) -> bool:
    """Tell whether a file's name ends as programs do, packed or not: ``part.nc``, ``PART.MPF.GZ``."""
    return PurePath(name.lower().removesuffix(PACKED_ENDING)).suffix in ENDINGS


def program_stem(path: str | PurePath) -> str:
    """Return the name of a program file without its endings: ``part`` of ``jobs/part.nc.gz``.

    Examples
    --------
    >>> from gcode2krl.files.program_names import program_stem
    >>> program_stem("jobs/part.nc.gz"), program_stem("part.v2.nc")
    ('part', 'part.v2')
    """
    name = PurePath(path)
    return PurePath(name.stem).stem if name.suffix.lower() == PACKED_ENDING else name.stem


def likely_text_bytes(path: Path) -> int:
    """Return about how much text is in a file, which may be packed."""
    size_bytes = path.stat().st_size
    return size_bytes * _TIMES_PACKED if path.suffix.lower() == PACKED_ENDING else size_bytes
