"""Names of KRL programs: at most 24 characters A-Z, 0-9, _, not starting with a digit, no keyword."""

import re
import zlib

LONGEST = 24
_KEYWORDS = frozenset(
    [
        "AND",
        "ANIN",
        "ANOUT",
        "B_AND",
        "B_EXOR",
        "B_NOT",
        "B_OR",
        "BRAKE",
        "C_DIS",
        "C_ORI",
        "C_PTP",
        "C_SPL",
        "C_VEL",
        "CASE",
        "CAST_FROM",
        "CAST_TO",
        "CCLOSE",
        "CHANNEL",
        "CIRC",
        "CIRC_REL",
        "CONFIRM",
        "CONST",
        "CONTINUE",
        "COPEN",
        "CREAD",
        "CWRITE",
        "DECL",
        "DEF",
        "DEFAULT",
        "DEFDAT",
        "DEFFCT",
        "DELAY",
        "DIGIN",
        "DISTANCE",
        "DO",
        "ELSE",
        "END",
        "ENDDAT",
        "ENDFCT",
        "ENDFOR",
        "ENDIF",
        "ENDLOOP",
        "ENDSPLINE",
        "ENDSWITCH",
        "ENDWHILE",
        "ENUM",
        "EXIT",
        "EXOR",
        "EXT",
        "EXTFCT",
        "FALSE",
        "FOR",
        "GLOBAL",
        "GOTO",
        "HALT",
        "IF",
        "IMPORT",
        "INTERRUPT",
        "IS",
        "LIN",
        "LIN_REL",
        "LOOP",
        "MAXIMUM",
        "MINIMUM",
        "NOT",
        "OFF",
        "ON",
        "OR",
        "PRIO",
        "PTP",
        "PTP_REL",
        "PUBLIC",
        "PULSE",
        "REPEAT",
        "RESUME",
        "RETURN",
        "SCIRC",
        "SIGNAL",
        "SLIN",
        "SPL",
        "SPLINE",
        "SPTP",
        "SREAD",
        "STRUC",
        "SWITCH",
        "SWRITE",
        "SYNC",
        "THEN",
        "TO",
        "TRIGGER",
        "TRUE",
        "UNTIL",
        "WAIT",
        "WHEN",
        "WHILE",
        "INT",
        "REAL",
        "BOOL",
        "CHAR",
        "FRAME",
        "POS",
        "E6POS",
        "AXIS",
        "E6AXIS",
        "BAS",
    ]
)


def name_problem(name: str) -> str:
    """Return what is wrong with a program name, empty where it is good."""
    if not re.fullmatch(r"[A-Za-z0-9_]+", name):
        return "only A-Z, 0-9 and _ are allowed"
    if name[0].isdigit():
        return "must not begin with a digit"
    if len(name.upper()) > LONGEST:
        return f"longer than {LONGEST} characters"
    if name.upper() in _KEYWORDS:
        return "is a KRL keyword"
    return ""


def part_name(name: str, number: int) -> str:
    """Return the name of a part: ``NAME_001``; a long name is cut and told apart by its checksum."""
    suffix = f"_{number:03d}"
    if len(name) + len(suffix) <= LONGEST:
        return name + suffix
    checksum = f"{zlib.crc32(name.upper().encode()) & 0xFFFF:04X}"
    return name[: LONGEST - len(suffix) - len(checksum)] + checksum + suffix


def suggested_name(stem: str) -> str:
    """Return a good program name made from a file's stem."""
    name = re.sub(r"[^A-Z0-9]+", "_", stem.upper()).strip("_")[:LONGEST] or "PART"
    if name[0].isdigit():
        name = f"P_{name}"[:LONGEST]
    return f"{name}_1" if name in _KEYWORDS else name
