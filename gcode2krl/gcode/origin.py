"""Who wrote a file: the control that it is for, the CAM system, or what it is instead of a milling program.

A control is named by its own marks alone: a program head, codes and statements that no other control of those
read here has, or the post's name in the comments at the top. That all letters of a block can be read says
nothing. Facts: the programming manuals of Fanuc (Series 0i), Haas, Siemens (840D sl), Heidenhain (iTNC 530,
DIN/ISO), Okuma (OSP), Heidenhain MillPlus, and the file formats' own definitions.
"""

import re
from typing import Final, NamedTuple

from gcode2krl.errors import input_error
from gcode2krl.gcode.dialects import OTHER_POST

FANUC_DIALECTS: Final = ("fanuc", "fanuc-calculator", "fanuc-increments")
_HEAD_BYTES, _HEAD_LINES = 4000, 30
# Comments are blanks where marks are looked for: blanks may be passed in one way only, or the time grows with
# the square of a comment's length.
_FLAGS = re.IGNORECASE | re.MULTILINE
_COMMENT = re.compile(rb"\([^()\n]*\)|;[^\n]*")


class Control(NamedTuple):
    """A control that is read."""

    title: str
    dialects: tuple[str, ...]
    """The dialects in which its programs are read."""


class Mark(NamedTuple):
    """What tells whose a file is."""

    control: Control
    text: str
    """The mark as it stands in the file."""
    line: int
    """1-based."""


class _Foreign(NamedTuple):
    code: str
    what: str
    remedy: str
    pattern: re.Pattern[bytes]
    """What is looked for in the text."""
    in_comments: bool = False
    unless: re.Pattern[bytes] | None = None
    """What speaks against it."""


_SINUMERIK = Control("a Sinumerik (840D sl, 828D)", ("sinumerik",))
_FANUC = Control("a Fanuc or Haas", FANUC_DIALECTS)
_GRBL = Control("Grbl", ("grbl",))
_LINUXCNC = Control("LinuxCNC", ("linuxcnc",))
_HEIDENHAIN = Control("a Heidenhain (conversational)", ("heidenhain",))
CONTROLS: Final = (_HEIDENHAIN, _SINUMERIK, _FANUC, _GRBL, _LINUXCNC)


def _pattern(*alternatives: str) -> re.Pattern[bytes]:
    return re.compile("|".join(f"(?:{each})" for each in alternatives).encode(), _FLAGS)


_MARKS: Final = (
    (
        _HEIDENHAIN,
        _pattern(
            r"^[ \t]*(?:\d+[ \t]*)?BEGIN +PGM\b[^\n]*",
            r"^[ \t]*(?:\d+[ \t]*)?(?:L|C|CR) +[XY][+-][\d.]+[^\n]*\bR[0LR]\b",
        ),
    ),
    (
        _SINUMERIK,
        _pattern(
            r"^%_N_\w+",
            r"\b(?:MCALL\b[^\n;]*|(?:CYCLE\d{2,4}|POCKET\d|SLOT\d|HOLES\d|LONGHOLE|WORKPIECE)\b)",
            r"\b(?:G500|G700|G710|G64[1-5]|G60[12]|TRAORI|TRAFOOF|SUPA|COMPCAD|COMPOF|FFWON|STOPRE)\b",
            r"\bMSG(?= *\()|\bGOTO[FB]\b|\bA?(?:TRANS|ROT|MIRROR|SCALE) +[XYZ]\b",
            r"\bDEF +(?:REAL|INT|BOOL|STRING|CHAR|AXIS)\b",
            r"\b(?:RND|RNDM|CHF|CHR|CR|TURN) *=|\bT *= *\"|\b[XYZIJK] *=|\bR\d{1,3} *=|\b[XYZ] *= *[AI]C\b",
        ),
    ),
    (
        _LINUXCNC,
        _pattern(
            r"\bO *(?:<[^<>\n]*>|\d+) *(?:sub|endsub|call|if|elseif|else|endif|while|endwhile|do|repeat)\b",
            r"#<\w+>|\bG33\.1\b|\bG38\.[2-5]\b|\bG10 *L20\b",
        ),
    ),
    (_GRBL, _pattern(r"^ *\$(?:H|X|\$|J=|\d+=)[^\n]*")),
    (
        _FANUC,
        _pattern(
            r"\b(?:G0?5\.1 *Q|G187|G103 *P|G154 *P|G54\.1 *P|G68\.[2-4]|G5[01]\.1|G40\.1|G41\.2|G13\.1)\d*",
            r"\b(?:GOTO *[#\d]|WHILE *\[[^\n]*\] *DO *\d|IF *\[[^\n]*\] *(?:GOTO|THEN))\d*",
            r"\b(?:G6[56]|M97) *P\d*",
            r", *[RC] *-?[\d.]+",
        ),
    ),
)
"""What only one of the controls has, the surest first."""
_HEAD_NUMBER = re.compile(rb"\A[\s%]*(?:\w+[^\S\n]*\n\s*)?([O:] *\d{1,8})[^\S\n]*$", _FLAGS)
"""A program number that stands alone, before anything else: O0001."""
_POSTS: Final = (
    (_SINUMERIK, re.compile(rb"\b(?:sinumerik|siemens|840 ?D|828 ?D)\w*", _FLAGS)),
    (_FANUC, re.compile(rb"\b(?:fanuc|haas)\w*", _FLAGS)),
    (_GRBL, re.compile(rb"\bgrbl\w*", _FLAGS)),
    (_LINUXCNC, re.compile(rb"\b(?:linuxcnc|emc2)\w*", _FLAGS)),
)
"""Controls as the comments of posts name them."""

_MILLING = "this translates for milling; use a post for a milling machine"
_CAM_FIRST = "make a program of it in a CAM system, and translate that"
_FOREIGN: Final = (
    _Foreign(
        "dialect-unknown",
        "this is a conversational program for a Heidenhain (BEGIN PGM, L X+10 R0 FMAX), not G-code",
        "read it with --dialect heidenhain",
        re.compile(
            rb"\A[\s%]*(?:\d+\s*)?BEGIN\s+PGM\b"
            rb"|^[ \t]*(?:\d+[ \t]*)?(?:L|CC|C|CR)[ \t]+[XY][+-]\d.*\bR[0LR]\b",
            re.M,
        ),
        in_comments=True,
    ),
    _Foreign(
        "dialect-unknown",
        "this is DIN/ISO of a Heidenhain (each block ends with *), whose codes mean other things: G30 and "
        "G31 are the raw part, G99 is a tool",
        OTHER_POST,
        re.compile(rb"\A\s*%[^\s*]+\s+G7[01]\s*\*|(?:^[^\n*]*[^\s*\d][^\n*]*\*[ \t\r]*\n){3}", _FLAGS),
        unless=re.compile(rb"\*\d", _FLAGS),
    ),
    _Foreign(
        "dialect-unknown",
        "this is a program for an Okuma (OSP), where G15 H selects the zero, G56 H the length of the tool "
        "and G71 or VC set what they do nowhere else",
        OTHER_POST,
        _pattern(r"\A\s*\$[^\n%]*%", r"\bG15 *H *\d", r"\bG56 *H[A-Z]\b", r"\bVC\d+ *=", r"\bCALL +O[A-Z]"),
    ),
    _Foreign(
        "dialect-unknown",
        "this is a program for a Philips or Heidenhain MillPlus (%PM), where G77, G83 and G98 mean "
        "other things",
        OTHER_POST,
        _pattern(r"\A\s*%(?:PM|MM)\d*\b"),
    ),
    _Foreign(
        "not-a-part",
        "a slicer made this for a 3D printer: E drives an extruder, M104 and M109 heat it",
        _MILLING,
        _pattern(
            r"^ *M(?:104|109|140|190) +S\d",
            r"^ *G92 +E0",
            r"^ *M8[23] *$",
            r"(?:^ *G1\b[^\n]*\bE *-?\.?\d[^\n]*\n(?:[^\n]*\n)?){2}",
        ),
    ),
    _Foreign(
        "not-a-part",
        "this is a program for a plasma cutter: the torch's height follows its voltage",
        _MILLING,
        _pattern(r"\bplasmac\b", r"#<_hal\[plasmac"),
        in_comments=True,
    ),
    _Foreign(
        "not-a-part",
        "this is a program for a laser: M4 with a power S in the cutting moves, and no move along the tool",
        _MILLING,
        re.compile(rb"^ *(?:N\d+ *)?M0?4\b(?:.|\n)*^[^\n]*G0?1(?!\d)[^\n]*S *\d", _FLAGS),
        unless=re.compile(rb"Z *-?\.?\d|\bM0?[36]\b|\bT\d", _FLAGS),
    ),
    _Foreign(
        "not-a-part",
        "this is a program for a lathe: T0101 is a tool with its offset, X is a diameter, U and W are X "
        "and Z in increments",
        _MILLING,
        re.compile(
            rb"^ *(?:N\d+ *)?(?:G\d+ *)*T\d{4}\b"
            rb"(?:.|\n)*(?:\b[UW] *-?\d*\.?\d|\bG96\b|\bG50 *S|\bG99\b|\bG7[0-6] *[PUR])"
            rb"|^ *DIAMON\b|\bLIMS *=|\bCYCLE95\b",
            _FLAGS,
        ),
        unless=re.compile(rb"\bM0?6\b", _FLAGS),
    ),
    _Foreign(
        "not-a-part",
        "this is a file of drill holes of a circuit board (Excellon), not a program",
        "let pcb2gcode or FlatCAM make a program of it",
        re.compile(rb"\A(?:;[^\n]*\n|\s)*M48\s[^%]*^T\d+[^\n]*C\d*\.\d", _FLAGS),
    ),
    _Foreign(
        "not-a-part",
        "this is a drawing or a solid of a CAD system (STEP, IGES, DXF, STL or SVG), not a program",
        _CAM_FIRST,
        re.compile(
            rb"\A\s*(?:ISO-10303-21;|0\s+SECTION\b|999\s[^\n]*\n|solid\b[^\n]*\n\s*facet\b|<\?xml\b|<svg\b)"
            rb"|\A[^\n]{72}S {0,6}0*1\s",
            _FLAGS,
        ),
        in_comments=True,
    ),
    _Foreign(
        "not-a-part",
        "this is cutter location data (APT: GOTO/, FEDRAT/), which a post has still to make a program of",
        "run the CAM system's post for LinuxCNC, Fanuc or Sinumerik",
        _pattern(r"^ *(?:GOTO|FEDRAT|LOADTL|SPINDL) */ *[\w-][^\n]*\n(?:[^\n]*\n)*? *(?:GOTO|FEDRAT) */"),
    ),
    _Foreign(
        "not-a-part",
        "these are pen plotter commands (HPGL), not G-code",
        OTHER_POST,
        re.compile(rb"\A\s*(?:\x1b[^\n]*)?(?:IN|DF|PU|PD|SP\d?)[-\d, ]*;\s*(?:[A-Z]{2}[-\d, ]*;)", _FLAGS),
        in_comments=True,
    ),
    _Foreign(
        "not-a-part",
        "this is a KRL program, not G-code",
        "what is translated is the G-code; `gcode2krl verify PART.src PART.nc` compares both",
        re.compile(rb"\A(?:\s*&[A-Z][^\n]*\n)*\s*(?:DEF\s+\w+\s*\(|DEFDAT\s+\w+|DEFFCT\s+\w+)", _FLAGS),
        in_comments=True,
    ),
    _Foreign(
        "not-a-part",
        "this is a subprogram of a Sinumerik: PROC takes its numbers from the program that calls it",
        "translate the program that calls it; the subprogram is read from beside that",
        _pattern(r"\A(?:[ \t\r]*(?:[%;][^\n]*)?\n)*[ \t]*(?:N\d+[ \t]*)?PROC[ \t]+\w+[ \t]*\([ \t]*[A-Z]"),
        in_comments=True,
    ),
    _Foreign(
        "not-a-part",
        "this is a cell file, not G-code",
        "give the program first and the cell by --cell: `gcode2krl part.nc --cell cell.toml`",
        re.compile(
            rb"^[ \t]*(?:based_on|mounted_tool|verified)[ \t]*="
            rb"|^[ \t]*\[(?:robot|controller|frames|cell|tool\.\d+|home)\]\s*$",
            _FLAGS,
        ),
        in_comments=True,
    ),
)
"""What is no milling program of a control that is read: one sentence each."""
_CAM: Final = re.compile(
    rb"\b(Fusion(?: 360)?|HSMWorks|Mastercam|MCAM|FreeCAD|Vectric|VCarve|Aspire|SolidCAM|CamBam|Estlcam"
    rb"|FlatCAM|pcb2gcode|PyCAM|gcodetools|dxf2gcode|BlenderCAM|Fabex CNC|Kiri:Moto|SheetCam|bCNC"
    rb"|Carbide Create|Easel|LightBurn|PowerMill|hyperMILL|Siemens NX|NX|CATIA|Edgecam|BobCAD|SprutCAM|ESPRIT"
    rb"|GibbsCAM|Alphacam)\b",
    _FLAGS,
)
_CAM_PHRASES: Final = {b"using high feed g1": "Fusion 360", b"using g0 which travels": "Fusion 360"}


def refuse_foreign(text: bytes, name: str) -> None:
    """Raise `NotUnderstoodError` with one sentence where a text is no milling program that is read.

    ``text`` is its beginning, whole lines; ``name`` is that of the file.
    """
    head = text[:_HEAD_BYTES]
    code = _COMMENT.sub(_blanks, head)
    for foreign in _FOREIGN:
        searched = head if foreign.in_comments else code
        match = foreign.pattern.search(searched)
        against = foreign.unless is not None and foreign.unless.search(code)
        if match is not None and not against:
            place = match.start() + len(match[0]) - len(match[0].lstrip())
            line = 1 + head.count(b"\n", 0, place)
            raise input_error(foreign.code, foreign.what, foreign.remedy, line=line, source=name)


def control_of(text: bytes) -> Mark | None:
    """Return whose control's program a text is, by its surest mark; None where nothing tells."""
    code = _COMMENT.sub(_blanks, text)
    for control, pattern in _MARKS:
        match = pattern.search(code)
        if match is not None:
            return Mark(control, _shown(match[0]), 1 + code.count(b"\n", 0, match.start()))
    number = _HEAD_NUMBER.search(code[:_HEAD_BYTES])
    if number is not None:
        return Mark(_FANUC, _shown(number[1]), 1 + code.count(b"\n", 0, number.start(1)))
    return _named_in_comments(text)


def cam_of(text: bytes) -> str:
    """Return the CAM system that the comments at the top name, empty where none is."""
    said = b"\n".join(_COMMENT.findall(_head(text)))
    match = _CAM.search(said)
    if match is not None:
        return match[1].decode()
    return next((name for phrase, name in _CAM_PHRASES.items() if phrase in said.lower()), "")


def _named_in_comments(text: bytes) -> Mark | None:
    head = _head(text)
    for comment in _COMMENT.finditer(head):
        for control, pattern in _POSTS:
            match = pattern.search(comment[0])
            if match is not None:
                return Mark(control, _shown(comment[0]), 1 + head.count(b"\n", 0, comment.start()))
    return None


def _head(text: bytes) -> bytes:
    return b"\n".join(text[:_HEAD_BYTES].split(b"\n")[:_HEAD_LINES])


def _blanks(comment: re.Match[bytes]) -> bytes:
    return b" " * len(comment[0])


def _shown(mark: bytes) -> str:
    return " ".join(mark.decode("latin-1").split())[:40]
