"""Names of KRL programs: at most 24 characters A-Z, 0-9, _, not starting with a digit, not taken.

A controller starts the ``DEF`` that is named as its file, so both are alike; KRL and the controller's Windows
do not tell letters by their case.
"""

import itertools
import re
import zlib
from collections.abc import Iterable

from gcode2krl import krl_words as w


def name_problem(name: str, taken: Iterable[str] = ()) -> str:
    """Return what is wrong with a program name, empty where it is good; ``taken`` are other programs."""
    upper = name.upper()
    if not re.fullmatch(r"[A-Za-z0-9_]+", name):
        return "only A-Z, 0-9 and _ are allowed"
    if name[0].isdigit():
        return "must not begin with a digit"
    if len(name) > w.LONGEST_NAME:
        return f"longer than {w.LONGEST_NAME} characters"
    if upper in w.KEYWORDS:
        return "is a KRL keyword"
    if upper in w.FUNCTIONS:
        return "is a function of the controller"
    if upper in w.MODULES:
        return "is a module of the controller itself"
    if upper in w.DEVICES:
        return "is a device of the controller's Windows"
    if upper.startswith(w.OWN_PREFIX):
        return f"{w.OWN_PREFIX} begins the names inside a program"
    if upper in {other.split("(")[0].strip().upper() for other in taken}:
        return "is a subprogram that the cell calls"
    return ""


def part_name(name: str, number: int) -> str:
    """Return the name of a part: ``NAME_001``; a long name is cut and told apart by its checksum."""
    suffix = f"_{number:03d}"
    if len(name) + len(suffix) <= w.LONGEST_NAME:
        return name + suffix
    checksum = f"{zlib.crc32(name.upper().encode()) & 0xFFFF:04X}"
    return name[: w.LONGEST_NAME - len(suffix) - len(checksum)] + checksum + suffix


def suggested_name(stem: str, taken: Iterable[str] = ()) -> str:
    """Return a good program name made from a file's stem."""
    name = re.sub(r"[^A-Z0-9]+", "_", stem.upper()).strip("_") or "PART"
    if name[0].isdigit() or name.startswith(w.OWN_PREFIX):
        name = f"P_{name}"
    name = name[: w.LONGEST_NAME]
    numbered = (f"{name[: w.LONGEST_NAME - len(str(k)) - 1]}_{k}" for k in itertools.count(1))
    return name if not name_problem(name, taken) else next(n for n in numbered if not name_problem(n, taken))
