"""The words of KRL, once: statements, system variables, names and files that two modules must agree about.

The writer's texts, the scanner, the rules, the verification and the rules of templates take their words from
here. It holds words and no logic: how a program is read back owes nothing to how it was written.
"""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


# --- motions ---------------------------------------------------------------------------------------

LIN, PTP, C_DIS = "LIN", "PTP", "C_DIS"
CIRC = "CIRC"
CIRC_TYPE = "$CIRC_TYPE=#BASE"
"""The orientation along an arc is that of its ends in `$BASE`, not carried along by the path."""
"""The motions that are written, and the word that blends one."""
POSE_KEYS = ("X", "Y", "Z", "A", "B", "C")
STATUS_TURN = ("S", "T")
AXIS_KEYS = ("A1", "A2", "A3", "A4", "A5", "A6")
EXTERNAL_KEYS = ("E1", "E2", "E3", "E4", "E5", "E6")
SPLINE, SPL, ENDSPLINE = "SPLINE", "SPL", "ENDSPLINE"
"""A block of spline motions, its points and its end."""
MOTIONS_NOT_WRITTEN = _words("CIRC SLIN SPTP SCIRC LIN_REL PTP_REL CIRC_REL")
"""Motions that a program of this package never has."""
MOTIONS = MOTIONS_NOT_WRITTEN | _words(
    """
    LIN PTP SPLINE ENDSPLINE SPL SPTP_REL SLIN_REL SCIRC_REL ASYPTP ASYCONT ASYCANCEL ASYSTOP TIME_BLOCK
    CONST_VEL STOP
    """
)
"""All words that move the robot or belong to a motion."""
APPROXIMATIONS = (C_DIS, "C_PTP", "C_ORI", "C_VEL", "C_SPL")
JUMPS = _words("GOTO RETURN RESUME BRAKE")
"""Words that leave the order of the program."""
BRAKE = "BRAKE"

# --- statements ------------------------------------------------------------------------------------

BLOCKS = {
    "IF": "ENDIF",
    "WHILE": "ENDWHILE",
    "FOR": "ENDFOR",
    "LOOP": "ENDLOOP",
    "REPEAT": "UNTIL",
    "SWITCH": "ENDSWITCH",
}
"""What opens a block: what closes it."""
BRANCHES = ("ELSE", "CASE", "DEFAULT")
WAIT, SEC, FOR, HALT, CONTINUE = "WAIT", "SEC", "FOR", "HALT", "CONTINUE"
DEF, END, EXT, DECL, GLOBAL = "DEF", "END", "EXT", "DECL", "GLOBAL"
DECLARING = (DECL, EXT, "EXTFCT", "INT", "REAL", "BOOL", "CHAR", "FRAME", "SIGNAL")
"""Words with which a declaration begins."""
TRIGGER, WHEN, DISTANCE, DELAY, DO, PRIO = "TRIGGER", "WHEN", "DISTANCE", "DELAY", "DO", "PRIO"
PRIO_BY_CONTROLLER = -1
"""Priority of a trigger's subprogram that the controller chooses."""
INTERRUPT, PULSE, EXIT = "INTERRUPT", "PULSE", "EXIT"
RSI_INTERRUPT, STOP_INTERRUPT = 21, 3
"""Interrupts of a program: the RSI link is lost; the controller stops."""
BAS, INITMOV = "BAS", "#INITMOV"
EXT_BAS = "EXT BAS (BAS_COMMAND :IN,REAL :IN )"
RSI_CALLS = ("CREATE", "ON", "OFF", "DELETE")
"""Functions of RSI behind ``RSI_``, in the order of a program."""
RSI_FAST, RSI_SLOW = "#IPO_FAST", "#IPO"
"""Cycles of RSI: 4 ms and 12 ms."""
RSI_SLOW_CYCLE_S = 0.012

# --- variables -------------------------------------------------------------------------------------

VEL_CP, APO_CDIS = "$VEL.CP", "$APO.CDIS"
BASE, TOOL, LOAD, ACT_BASE, ACT_TOOL = "$BASE", "$TOOL", "$LOAD", "$ACT_BASE", "$ACT_TOOL"
BASE_DATA, TOOL_DATA, LOAD_DATA, ROBROOT = "BASE_DATA", "TOOL_DATA", "LOAD_DATA", "$ROBROOT"
ROBROOT_NOW, MACHINE_DEF = "$ROBROOT_C", "MACHINE_DEF"
"""The robot root as a rail has moved it, and the machines of a cell, tables among them."""
OUT = "$OUT"
OWN_PREFIX = "GK_"
"""Of the subprograms and variables inside our programs."""
PILOT_SUBPROGRAM, LOST_SUBPROGRAM = "GK_PILOT", "GK_RSI_LOST"
"""Told the next knot of the pilot force; called where the RSI link is lost."""
RSI_PREFIX, RSI_RESULT, RSI_ID = "GK_RSI_", "GK_RSI_RET", "GK_RSI_ID"

# --- comments and files ----------------------------------------------------------------------------

FOLD, ENDFOLD = ";FOLD", ";ENDFOLD"
DWELL = "dwell"
"""Comment of a wait that is a dwell of the G-code, none of a template."""
NO_GUARD = "(--no-guard)"
"""In the header of a program without a guard."""
SOURCE_SUFFIX, DATA_SUFFIX, SIDECAR_SUFFIX = ".src", ".dat", ".pilot.csv"
SIGNAL_FLOW_SUFFIXES = {"3": ".rsi.xml", "4": ".rsix", "5": ".rsix"}
"""Of the signal flow that a controller reads, by the version of RSI."""
ETHERNET_SUFFIX = "_ETH.xml"
LONGEST_LINE = 471
"""Characters in a line of KRL, as KUKA's documentation is remembered."""

# --- names -----------------------------------------------------------------------------------------

LONGEST_NAME, LONGEST_RSI_NAME = 24, 16
"""Characters of a program's name, and of the name of its RSI files."""
DEVICES = frozenset(
    ["CON", "PRN", "AUX", "NUL", *(f"{word}{k}" for word in ("COM", "LPT") for k in range(1, 10))]
)
"""Names that Windows, on which a KRC4 runs, keeps for devices."""
KEYWORDS = _words(
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
FUNCTIONS = _words(
    """
    ABS ACOS ATAN2 COS SIN SQRT TAN VARSTATE FORWARD INVERSE CLEAR_KRLMSG EXISTS_KRLDLG EXISTS_KRLMSG
    GET_KRLMSG SET_KRLDLG SET_KRLMSG STRADD STRCLEAR STRCOMP STRCOPY STRDECLLEN STRFIND STRLEN ERR_CLEAR
    ERR_RAISE GETVAR SETVAR RSI_CREATE RSI_DELETE RSI_MOVECORR RSI_OFF RSI_ON
    """
)
"""Functions of the interpreter."""
MODULES = _words(
    """
    BAS IR_STOPM SPS MSGLIB COLLMONLIB MASREF_MAIN TM_BIB JOGTCP MOTIONPARAMSETS IMPEDANCEPARAMSETS
    P00 P00_SUBM CELL OPERATE OPERATE_R1 CONFIG USERTECH MASREF_USER TM_USERACTION COLLDETECT_USERACTION
    SIGNALS USER_GRP USERSPOT H50 BRAKETESTBACK BRAKETESTPARK BRAKETESTREQ BRAKETESTSELFTEST BRAKETESTSTART
    MACHINE ROBCOR CUSTOM OPTION
    """
)
"""Modules of KUKA in R1, R1/System, R1/TP and R1/Program of KRC4 controllers (KSS 8), as public backups of
such controllers show them. What an option package adds is not known here."""

# --- kinds of statements, for the compiled scanner ---------------------------------------------------

KIND_LIN, KIND_PTP, KIND_VEL_CP, KIND_APO_CDIS = range(4)
KIND_WAIT_SEC, KIND_OTHER, KIND_PTP_AXES, KIND_TRIGGER = range(4, 8)
KIND_CIRC, KIND_SPL = 8, 9
KIND_FORGETS = 10
"""A statement behind which the speed and the approximation in force are not known."""
MALFORMED = -1
"""Stands for the blending of a statement that cannot be read."""
ASSIGNS, CALLS = 1, 2
"""What a trigger does: write one number to a variable, or call with four and ``PRIO=-1``."""

# --- columns of statements, for the compiled scanner -------------------------------------------------

STATEMENT_COLUMNS = len(POSE_KEYS) + len(STATUS_TURN)
"""X, Y, Z, A, B, C, S, T, or A1 to A6; a lone number stands in column 0."""
EXTERNAL_COLUMNS = len(EXTERNAL_KEYS)
"""E1 to E6 of a motion, which are read apart: most programs have none."""
TRIGGER_DISTANCE, TRIGGER_DELAY, TRIGGER_WRITTEN, TRIGGER_NAME = 0, 1, 2, 6
"""Of a trigger: distance, delay, the numbers it writes, first byte and length of the name."""
TRIGGER_NUMBERS = 4
"""Numbers that a trigger writes when it calls."""
