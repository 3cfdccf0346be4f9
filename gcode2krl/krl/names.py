"""Names of KRL programs: at most 24 characters A-Z, 0-9, _, not starting with a digit, not taken.

A controller starts the ``DEF`` that is named as its file, so both are alike; KRL and the controller's Windows
do not tell letters by their case.
"""

import itertools
import re
import zlib
from collections.abc import Iterable


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


LONGEST = 24
DEVICES = frozenset(
    ["CON", "PRN", "AUX", "NUL", *(f"{word}{k}" for word in ("COM", "LPT") for k in range(1, 10))]
)
"""Names that Windows, on which a KRC4 runs, keeps for devices."""
OWN_PREFIX = "GK_"
"""Of the subprograms and variables inside our programs."""
_KEYWORDS = _words(
    """
    AND ANIN ANOUT AXIS BOOL BRAKE B_AND B_EXOR B_NOT B_OR CASE CAST_FROM CAST_TO CCLOSE CHANNEL
    CHAR CIRC CIRC_REL CONFIRM CONST CONTINUE COPEN CREAD CWRITE C_DIS C_ORI C_PTP C_SPL C_VEL DECL
    DEF DEFAULT DEFDAT DEFFCT DELAY DIGIN DISTANCE DO ELSE END ENDDAT ENDFCT ENDFOR ENDIF ENDLOOP
    ENDSPLINE ENDSWITCH ENDWHILE ENUM EXIT EXOR EXT EXTFCT FALSE FOR FRAME GLOBAL GOTO HALT IF
    IMPORT INT INTERRUPT IS LIN LIN_REL LOOP MAXIMUM MINIMUM NOT OFF ON OR POS PRIO PTP PTP_REL
    PUBLIC PULSE REAL REPEAT RESUME RETURN SCIRC SIGNAL SLIN SPL SPLINE SPTP SREAD STRUC SWITCH
    SWRITE SYNC THEN TO TRIGGER TRUE UNTIL WAIT WHEN WHILE
    """
)
_FUNCTIONS = _words(
    """
    ABS ACOS ATAN2 COS SIN SQRT TAN VARSTATE FORWARD INVERSE CLEAR_KRLMSG EXISTS_KRLDLG EXISTS_KRLMSG
    GET_KRLMSG SET_KRLDLG SET_KRLMSG STRADD STRCLEAR STRCOMP STRCOPY STRDECLLEN STRFIND STRLEN ERR_CLEAR
    ERR_RAISE GETVAR SETVAR RSI_CREATE RSI_DELETE RSI_MOVECORR RSI_OFF RSI_ON
    """
)
"""Functions of the interpreter."""
_MODULES = _words(
    """
    BAS IR_STOPM SPS MSGLIB COLLMONLIB MASREF_MAIN TM_BIB JOGTCP MOTIONPARAMSETS IMPEDANCEPARAMSETS
    P00 P00_SUBM CELL OPERATE OPERATE_R1 CONFIG USERTECH MASREF_USER TM_USERACTION COLLDETECT_USERACTION
    SIGNALS USER_GRP USERSPOT H50 BRAKETESTBACK BRAKETESTPARK BRAKETESTREQ BRAKETESTSELFTEST BRAKETESTSTART
    MACHINE ROBCOR CUSTOM OPTION
    """
)
"""Modules of KUKA in R1, R1/System, R1/TP and R1/Program of KRC4 controllers (KSS 8), as public backups of
such controllers show them. What an option package adds is not known here."""


def name_problem(name: str, taken: Iterable[str] = ()) -> str:
    """Return what is wrong with a program name, empty where it is good; ``taken`` are other programs."""
    upper = name.upper()
    if not re.fullmatch(r"[A-Za-z0-9_]+", name):
        return "only A-Z, 0-9 and _ are allowed"
    if name[0].isdigit():
        return "must not begin with a digit"
    if len(name) > LONGEST:
        return f"longer than {LONGEST} characters"
    if upper in _KEYWORDS:
        return "is a KRL keyword"
    if upper in _FUNCTIONS:
        return "is a function of the controller"
    if upper in _MODULES:
        return "is a module of the controller itself"
    if upper in DEVICES:
        return "is a device of the controller's Windows"
    if upper.startswith(OWN_PREFIX):
        return f"{OWN_PREFIX} begins the names inside a program"
    if upper in {other.split("(")[0].strip().upper() for other in taken}:
        return "is a subprogram that the cell calls"
    return ""


def part_name(name: str, number: int) -> str:
    """Return the name of a part: ``NAME_001``; a long name is cut and told apart by its checksum."""
    suffix = f"_{number:03d}"
    if len(name) + len(suffix) <= LONGEST:
        return name + suffix
    checksum = f"{zlib.crc32(name.upper().encode()) & 0xFFFF:04X}"
    return name[: LONGEST - len(suffix) - len(checksum)] + checksum + suffix


def suggested_name(stem: str, taken: Iterable[str] = ()) -> str:
    """Return a good program name made from a file's stem."""
    name = re.sub(r"[^A-Z0-9]+", "_", stem.upper()).strip("_") or "PART"
    if name[0].isdigit() or name.startswith(OWN_PREFIX):
        name = f"P_{name}"
    name = name[:LONGEST]
    numbered = (f"{name[: LONGEST - len(str(k)) - 1]}_{k}" for k in itertools.count(1))
    return name if not name_problem(name, taken) else next(n for n in numbered if not name_problem(n, taken))
