"""Real mistakes as data: each a small change to a clean program or a clean cell, and the right reaction.

What is right was written down before the translator was run on it. A change is a map from a line of the
base program to its new text (``None`` removes it, ``"@"`` keeps it, a line break inserts). ``@`` at the start
of a line says: a finding on this line is right. More than one line is marked only where a person would look
at either (the block that lacks something, and the move that suffers from it). Without a mark the finding
belongs to the whole file or cell, line 0; ``or_whole`` allows line 0 beside the marks. ``about`` is what the
finding must speak of, so that a refusal for another reason on the same line does not count.
"""

from dataclasses import dataclass, field

BASE = """\
%
(PLATE 120 X 80 X 20, ALUMINIUM)
(T7 END MILL D12, T14 BALL NOSE D10)
N10 G90 G94 G17 G21 G40 G49 G80
N20 G54
N30 T7 M6
N40 S8000 M3
N50 M8
N60 G0 X-10. Y-10.
N70 G43 Z25. H7
N80 Z2.
N90 G1 Z-4. F600.
N100 Y70. F1200.
N110 G2 X0. Y80. I10. J0.
N120 G1 X110.
N130 G2 X120. Y70. I0. J-10.
N140 G1 Y-10.
N150 G0 Z25.
N160 M9
N170 M5
N180 T14 M6
N190 S10000 M3
N200 G0 X20. Y20.
N210 G43 Z25. H14
N220 Z2.
N230 G1 Z-2. F400.
N240 X100. F900.
N250 Y60.
N260 G0 Z25.
N270 M5
N280 M30
%
"""
INCH = """\
%
(BRACKET, UNITS INCH)
(T7 END MILL .4724)
N10 G90 G94 G17 G20 G40 G49 G80
N20 G54
N30 T7 M6
N40 S8000 M3
N50 G0 X-.3937 Y-.3937
N60 G43 Z.9843 H7
N70 Z.0787
N80 G1 Z-.1575 F23.6
N90 Y2.7559 F47.2
N100 G2 X0. Y3.1496 I.3937
N110 G1 X4.3307
N120 G0 Z.9843
N130 M5
N140 M30
%
"""
NO_TOOL = """\
G21 G90 G17
G54
S8000 M3
G0 X0. Y0.
Z5.
G1 Z-1. F300.
X50. F900.
G0 Z20.
M5
M30
"""
PROGRAMS = {"base": BASE, "inch": INCH, "no tool": NO_TOOL}
HOME_END = "G28 G91 Z0.\nG28 X0. Y0.\nG90"
CELL_HEAD = 'based_on = "demonstration"\n'
CELL_TOOLS = "[tool.7]\nlength_mm = 120.0\n[tool.14]\nlength_mm = 90.0\n"
"""The clean cell: the demonstration cell with two tools of different length. A case's text goes between."""
NO_TURN = "a_deg = 0.0\nb_deg = 0.0\nc_deg = 0.0\n"
NO_PLANE = '[clearance]\nz_mm = "none"\n'
LIMITS = """\
[robot.limits]
q_deg = [[-185, 185], [-140, -5], [-120, 155], [-350, 350], [-122.5, 122.5], [-350, 350]]
"""
A5_ZERO = (
    LIMITS.replace("-122.5, 122.5", "-110, 110")
    + "[home]\nq_deg = [0, -110, 90, 0, 20, 0]\n[frames.base]\nx_mm = 1500.0\ny_mm = -30.0\nz_mm = 1496.8\n"
    + NO_TURN
)
"""Forearm level and A1 zero in the middle of line 17; A5 limited by cables, so the elbow stays up."""

KRL = b"&ACCESS RVP\n&REL 1\nDEF PART()\nPTP {X 10,Y 20,Z 30,A 0,B 0,C 0}\nEND\n"
KRL_DATA = b"DEFDAT PART\nDECL FDAT FPOINT1={TOOL_NO 1,BASE_NO 1,IPO_FRAME #BASE}\nENDDAT\n"
BINARY = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x02\x00" + bytes(range(256)) * 4


@dataclass(frozen=True)
class Mistake:
    """One mistake and the right reaction."""

    title: str
    about: str
    change: dict[int, str | None] = field(default_factory=dict)
    cell: str = ""
    program: str = "base"
    or_whole: bool = False
    data: bytes | None = None
    cut_after: str = ""
    """The file ends right after this text."""
    name: str = "part.nc"
    severity: str = "error"
    """The least severity that is right: ``warning`` where it may be intended."""
    head: str = CELL_HEAD
    tools: str = CELL_TOOLS
    options: tuple[str, ...] = ()
    output: str = "out.src"
    expected: tuple[int, ...] = ()
    """The lines that are right, where ``data`` has no marks."""


@dataclass(frozen=True)
class Clean:
    """A program without a mistake, that must be translated."""

    title: str
    program: str = "base"
    change: dict[int, str | None] = field(default_factory=dict)
    cell: str | None = ""
    """None: without ``--cell``, the demonstration cell itself."""
    form: str = ""


TOOL_MISTAKES = (
    Mistake("tool number not in the cell", r"T27|tool 27", {6: "@N30 T27 M6", 10: "N70 G43 Z25. H27"}),
    Mistake(
        "no tool in the program, none mounted in the cell",
        r"tool",
        {4: "@", 5: "@", 6: "@", 7: "@"},
        cell="mounted_tool = 0\n",
        program="no tool",
        or_whole=True,
    ),
    Mistake(
        "tool without a length",
        r"T30|tool.30",
        {6: "@N30 T30 M6", 10: "@N70 G43 Z25. H30"},
        cell="[tool.30]\ndiameter_mm = 12\nteeth = 3\n",
    ),
    Mistake(
        "tool length in metres, shorter than its flutes",
        r"length",
        {6: "@N30 T32 M6", 10: "N70 G43 Z25. H32"},
        or_whole=True,
        cell="[tool.32]\ndiameter_mm = 12\nteeth = 3\nlength_mm = 0.12\nflute_length_mm = 26\n",
    ),
    Mistake("H of another tool", r"H14", {10: "@N70 G43 Z25. H14"}),
    Mistake("second tool called without M6", r"H14|T14|M6", {21: "@N180 T14", 24: "@"}),
    Mistake("M6 without T", r"T", {6: "@N30 M6"}),
    Mistake(
        "empty spindle T0 called, then cut",
        r"[Tt]ool|T0",
        {21: "@N180 T0 M6", 24: "N210 G43 Z25. H0", 26: "@"},
    ),
    Mistake("G43 missing", r"G43", {10: "@N70 Z25.", 11: "@", 12: "@"}),
    Mistake("G43 missing after the second tool change", r"G43", {24: "@N210 Z25.", 25: "@", 26: "@"}),
    Mistake("G43 with the first tool's H after the second change", r"H7", {24: "@N210 G43 Z25. H7"}),
    Mistake("G49 left in before the cut", r"G43|G49", {11: "@N75 G49\n@N80 Z2.", 12: "@"}),
    Mistake("tool change not mapped in the cell", r"M6", {6: "@"}, cell='tool_change = ""\n'),
    Mistake("H without a number", r"H", {10: "@N70 G43 Z25. H"}),
    Mistake(
        "tool change M6 skipped in a real program",
        r"H7|T7|M6",
        {8: "@T7", 11: "@"},
        program="contour_arcs.nc",
    ),
    Mistake("wrong H in a real program", r"H10", {57: "@N470 G43 Z15. H10"}, program="cam_style.nc"),
)

SPINDLE_MISTAKES = (
    Mistake("S missing", r"[Ss]pindle|\bS\b", {7: "@N40 M3", 12: "@"}),
    Mistake("M3 missing", r"[Ss]pindle|M3", {7: "@N40 S8000", 12: "@"}),
    Mistake("M3 missing after the tool change", r"[Ss]pindle|M3", {22: "@N190 S10000", 26: "@"}),
    Mistake(
        "spindle not started again after M6 stopped it",
        r"[Ss]pindle|M3",
        {20: None, 21: "@", 22: "N190 M8", 26: "@"},
    ),
    Mistake("M5 before the last cut", r"[Ss]pindle", {17: "@N135 M5\n@N140 G1 Y-10."}),
    Mistake("S0 M3", r"[Ss]pindle|S0", {7: "@N40 S0 M3", 12: "@"}),
    Mistake("M4 with a right-hand mill", r"M4|[Ss]pindle", {7: "@N40 S8000 M4", 12: "@"}),
    Mistake("S above what the spindle can", r"S30000|30000", {7: "@N40 S30000 M3"}),
    Mistake(
        "S above what the tool can",
        r"8000",
        {6: "N30 T31 M6", 7: "@", 10: "N70 G43 Z25. H31"},
        cell="[tool.31]\ndiameter_mm = 80\nteeth = 6\nlength_mm = 90\nmax_rpm = 6000\n",
    ),
    Mistake("negative S", r"S-8000", {7: "@N40 S-8000 M3"}),
    Mistake("M3 and M4 in one block", r"M3|M4", {7: "@N40 S8000 M3 M4"}),
    Mistake("G96 of a lathe", r"G96|surface", {7: "@N40 G96 S200 M3"}),
    Mistake("M19 left in", r"M19", {20: "N170 M5\n@N175 M19"}),
    Mistake(
        "spindle never started in a real program",
        r"[Ss]pindle|M3",
        {10: "@(NO SPINDLE)", 15: "@"},
        program="raster_finish.nc",
    ),
)

FEED_MISTAKES = (
    Mistake("F missing", r"feed|F", {12: "@N90 G1 Z-4.", 13: "N100 Y70."}),
    Mistake("F0", r"[Ff]eed|F0", {12: "@N90 G1 Z-4. F0"}),
    Mistake("negative F", r"F-600", {12: "@N90 G1 Z-4. F-600."}),
    Mistake(
        "F with one digit too many, above what the robot does", r"[Ff]eed|F", {13: "@N100 Y70. F150000."}
    ),
    Mistake("inch program with F in mm/min", r"[Ff]eed|F6000", {12: "@N90 Y2.7559 F6000."}, program="inch"),
    Mistake("G95 with F in mm/min", r"[Ff]eed|F|G95", {4: "@N10 G90 G95 G17 G21 G40 G49 G80", 12: "@"}),
    Mistake("G93 left active", r"F|G93", {4: "@N10 G90 G93 G17 G21 G40 G49 G80", 12: "@", 13: "@", 14: "@"}),
    Mistake(
        "F missing in a real program",
        r"feed|F",
        {19: "@G1 Z-8.950", 20: "G1 X320.000", 25: "G1 Z-8.950"},
        program="test_piece.nc",
    ),
)

UNIT_MISTAKES = (
    Mistake(
        "comment says INCH, program says G21",
        r"(?i)inch|unit",
        {2: "@", 4: "@N10 G90 G94 G17 G21 G40 G49 G80"},
        program="inch",
        or_whole=True,
    ),
    Mistake(
        "inch program without G20 or any unit",
        r"(?i)inch|unit|G20",
        {2: "(BRACKET)", 4: "@N10 G90 G94 G17 G40 G49 G80", 8: "@"},
        program="inch",
        or_whole=True,
    ),
    Mistake(
        "G20 in a millimetre program",
        r"(?i)reach|inch|unit|G20",
        {4: "@N10 G90 G94 G17 G20 G40 G49 G80", 15: "@"},
    ),
    Mistake("decimal point lost in Z, down (thousandths)", r"reach", {12: "@N90 G1 Z-4000 F600."}),
    Mistake("decimal point lost in Z, up", r"reach", {10: "@N70 G43 Z25000 H7"}),
    Mistake(
        "decimal point lost in a real program", r"reach", {17: "@X1.056 Z-3703"}, program="raster_finish.nc"
    ),
)

START_MISTAKES = (
    Mistake(
        "first move a plunge, X and Y unknown",
        r"X, Y|X and Y|position",
        {9: None, 10: "N70 G0 G43 Z25. H7", 12: "@"},
    ),
    Mistake("feed before Z is known", r"Z|position", {9: "@N60 G1 X-10. Y-10. F2000."}),
    Mistake(
        "Z never programmed before the cut",
        r"Z|position",
        {10: "N70 G43 H7", 11: None, 12: "@N90 G1 Y0. F600."},
    ),
    Mistake("cut straight after G28", r"Z|position", {17: "N135 G28 G91 Z0.\nN136 G90\n@N140 G1 Y-10."}),
    Mistake(
        "cut after a new G43 without Z",
        r"Z|position",
        {24: "N210 G43 H14", 25: None, 26: "@N230 G1 X30. F400."},
    ),
    Mistake(
        "G90 missing after G28 G91",
        r"Z|position|G91|G90",
        {18: "N150 G28 G91 Z0.", 24: "@", 25: "@", 26: "@"},
    ),
    Mistake(
        "G90 missing after G28 G91 in a real program",
        r"X|position|G91|G90",
        {9: None, 17: "@", 18: "@", 19: "@", 20: "@"},
        program="cam_style.nc",
    ),
    Mistake(
        "G28 in the header, no clearance plane",
        r"clearance",
        {5: "@N15 G28 G91 Z0.\nN16 G90\nN20 G54"},
        cell=NO_PLANE,
    ),
    Mistake(
        "G28 in a real program, no clearance plane",
        r"clearance",
        {8: "@"},
        cell=NO_PLANE,
        program="cam_style.nc",
    ),
    Mistake("no clearance plane at all", r"clearance", cell=NO_PLANE),
    Mistake(
        "clearance plane below the cut",
        r"clearance",
        {12: "@"},
        cell="[clearance]\nz_mm = -10.0\n",
        or_whole=True,
    ),
    Mistake("feed down in machine coordinates", r"G53|machine", {17: "@N140 G53 G1 Z-50. F500."}),
    Mistake("G53 under G91", r"G53", {18: "@N150 G91 G53 G0 Z0.\nN151 G90"}),
    Mistake("work offset not in the cell", r"G55", {5: "@N20 G55"}),
)

CODE_MISTAKES = (
    Mistake("unknown G code", r"G12\b", {27: "@N240 G12 X100. F900."}),
    Mistake("drilling cycle without R", r"G81|cycle", {27: "@N240 G81 X100. Y20. Z-10. F200."}),
    Mistake("pecking cycle without Q", r"G83|cycle", {27: "@N240 G83 X100. Y20. Z-10. R2. F200."}),
    Mistake("cutter compensation G41 left in", r"G41|compensation", {12: "@N90 G1 G41 D7 Z-4. F600."}),
    Mistake(
        "G92 where the machine's home is",
        r"G92",
        {27: "N230 G28 X0. Y0.\n@N235 G92 X50. Y0.\nN240 G0 X100. Y0."},
    ),
    Mistake("G10 for an offset that does not exist", r"G10|P", {5: "@N15 G10 L2 P12 X0. Y0. Z-20.\nN20 G54"}),
    Mistake("G52 without an axis", r"G52", {27: "@N235 G52\nN240 X100. F900."}),
    Mistake("G68 rotates the coordinates", r"G68", {27: "@N235 G68 X0. Y0. R45.\nN240 X100. F900."}),
    Mistake("subprogram call M98", r"M98|subprogram", {27: "@N240 M98 P1000"}),
    Mistake("O-word subprogram", r"O-word|subprogram", {27: "@O100 CALL"}),
    Mistake("parameter that nothing sets", r"#|parameter", {27: "@N240 X#100 F900."}),
    Mistake("expression that is not complete", r"\[|expression", {27: "@N240 X[50+] F900."}),
    Mistake("M-code nobody mapped", r"M88", {8: "@N50 M88"}),
    Mistake("rotary axis word", r"\bA\b", {27: "@N240 X100. A90. F900."}),
    Mistake("two motion codes in one block", r"G0|G1", {27: "@N240 G0 G1 X100. F900."}),
)

ARC_MISTAKES = (
    Mistake("arc with unequal radii", r"radius", {14: "@N110 G2 X0. Y80. I9. J0."}),
    Mistake("arc without a centre", r"I, J|centre", {14: "@N110 G2 X0. Y80."}),
    Mistake("G18 left active", r"plane|G18|radi", {4: "@N10 G90 G94 G18 G21 G40 G49 G80", 14: "@"}),
    Mistake("arc radius too small", r"R", {14: "@N110 G2 X0. Y80. R5."}),
    Mistake("full circle by R", r"circle|R", {14: "@N110 G2 X-10. Y70. R10."}),
    Mistake(
        "wrong sign of the centre in a real program",
        r"radius",
        {16: "@G3 X14.000 Y50.000 I0.000 J-10.000 F1500"},
        program="contour_arcs.nc",
    ),
    Mistake(
        "G90.1 instead of G91.1 in a real program",
        r"radius|G90\.1|centre",
        {5: "@G21 G90 G90.1 G17 G40 G49 G80 G94", 16: "@"},
        program="contour_arcs.nc",
    ),
)

TYPING_MISTAKES = (
    Mistake("letter without a number", r"X", {27: "@N240 X F900."}),
    Mistake("letter O for zero: XO", r"X|O", {13: "@N100 XO Y70. F1200."}),
    Mistake("letter O for zero: GO", r"G|O", {9: "@N60 GO X-10. Y-10."}),
    Mistake("letter l for one", r"X|[lL]", {27: "@N240 Xl00. F900."}),
    Mistake("X twice in a block", r"X", {27: "@N240 X100. X101. F900."}),
    Mistake("comma as decimal separator", r"','|,", {27: "@N240 X100,5 F900."}),
    Mistake("two decimal points", r"X|'\.'|number", {27: "@N240 X100.5.2 F900."}),
    Mistake("two signs", r"X|'-'|number", {27: "@N240 X--100. F900."}),
    Mistake("comment not closed", r"comment", {26: "@N230 (PLUNGE G1 Z-2. F400."}),
    Mistake(
        "comment within an expression",
        r"expression",
        {27: "#5=100 (LENGTH)\n@N240 X[#5 (PLATE) - 0.5] F900."},
    ),
    Mistake("comment within a number", r"'0'|number|character", {27: "@N240 X10(PLATE)0. F900."}),
)
SUB = {5: "o<pass> sub\nG1 X#1 Y#2 F900.\no<pass> endsub\nG54"}
PROGRAM_MISTAKES = (
    Mistake(
        "words behind the comment of a call",
        r"behind the O-word",
        {**SUB, 27: "@o<pass> call [100] (LONG SIDE) G1 Y60."},
    ),
    Mistake(
        "comment between a label and its word", r"O-word", {**SUB, 27: "@o<pass> (LONG SIDE) call [100] [20]"}
    ),
    Mistake(
        "comment of a call not closed, its second argument within",
        r"comment",
        {**SUB, 27: "@o<pass> call [100] (LONG SIDE [20]"},
    ),
    Mistake(
        "comment within the condition of an if",
        r"expression",
        {27: "@o1 if [#5 (LENGTH) GT 2]\nX100. F900.\no1 endif"},
    ),
    Mistake(
        "comment before else, so that it is none",
        r"O-word|comment",
        {27: "o1 if [0]\nX20.\n@(LONG SIDE) o1 else\nX100. F900.\no1 endif"},
    ),
)

FILE_MISTAKES = (
    Mistake("file cut off inside a word", r"X|end|cut off", {27: "@"}, cut_after="N240 X", or_whole=True),
    Mistake(
        "file cut off inside a number",
        r"(?i)end|M30|M2|cut off|truncated",
        {27: "@"},
        cut_after="N240 X1",
        or_whole=True,
    ),
    Mistake(
        "file cut off at the end of a line",
        r"(?i)end|M30|M2|cut off|truncated",
        {28: "@"},
        cut_after="N250 Y60.\n",
        or_whole=True,
    ),
    Mistake("empty file", r"(?i)empty|motion|move", data=b""),
    Mistake("header without any move", r"(?i)motion|move", data=b"%\nG21 G90 G17\nG54\nT7 M6\nM30\n%\n"),
    Mistake(
        "KRL source given as G-code",
        r"(?i)KRL|&|G-code",
        {1: "@"},
        data=KRL,
        or_whole=True,
        name="part.src.txt",
    ),
    Mistake(
        "KRL data list given as G-code",
        r"(?i)KRL|G-code|number|D",
        {1: "@"},
        data=KRL_DATA,
        or_whole=True,
        name="part.dat",
    ),
    Mistake(
        "picture given as G-code", r"(?i)binary|text|character|G-code", {3: "@"}, data=BINARY, or_whole=True
    ),
)

ROBOT_MISTAKES = (
    Mistake("X far out of reach", r"reach", {27: "@N240 X2110. F900."}),
    Mistake("stray digit in X, an arc follows", r"reach|radius", {15: "@N120 G1 X2110.", 16: "@"}),
    Mistake("Z far below reach", r"reach", {26: "@N230 G1 Z-2500. F400."}),
    Mistake(
        "A1 beyond a limit set for the cables", r"A1", {13: "@"}, cell=LIMITS.replace("-185, 185", "-3, 3")
    ),
    Mistake(
        "base low and Z-400 for Z-4.00: A2 beyond its limit",
        r"A2",
        {12: "@N90 G1 Z-400 F600."},
        cell="[frames.base]\nx_mm = 1500.0\ny_mm = 0.0\nz_mm = 0.0\n" + NO_TURN,
    ),
    Mistake(
        "spindle turned to the robot: A5 beyond its limit",
        r"A5",
        {9: "@", 10: "@"},
        cell="[frames]\nspin = 180\n",
        or_whole=True,
    ),
    Mistake("A5 through zero in the cut", r"(?i)singular", {17: "@"}, cell=A5_ZERO),
    Mistake(
        "base in metres",
        r"reach|A\d|metres",
        {9: "@", 10: "@", 12: "@"},
        cell="[frames.base]\nx_mm = 1.5\ny_mm = 0.0\nz_mm = 0.8\n" + NO_TURN,
        or_whole=True,
    ),
    Mistake(
        "work offset in thousandths of a millimetre",
        r"reach",
        {9: "@", 10: "@"},
        cell="[work_offsets.G54]\nx_mm = 0.0\ny_mm = 0.0\nz_mm = 15000.0\n" + NO_TURN,
        or_whole=True,
    ),
    Mistake("HOME beyond a joint limit", r"HOME", cell="[home]\nq_deg = [0, -150, 90, 0, 0, 0]\n"),
    Mistake("HOME in radians", r"HOME", cell="[home]\nq_deg = [0, -1.571, 1.571, 0, 0, 0]\n"),
    Mistake(
        "HOME with the tip below the clearance plane",
        r"HOME|clearance",
        cell="[frames.base]\nx_mm = 1500.0\ny_mm = 0.0\nz_mm = 1480.0\n" + NO_TURN,
    ),
    Mistake(
        "clearance plane out of reach",
        r"reach|clearance",
        {9: "@", 10: "@"},
        cell="[clearance]\nz_mm = 5000.0\n",
        or_whole=True,
    ),
    Mistake("robot without known joint limits", r"limits", cell='[robot]\nmodel = "KR 120 R2500 pro"\n'),
)

CELL_MISTAKES = (
    Mistake("BASE_DATA number 0", r"base_data", cell="[frames]\nbase_data = 0\n"),
    Mistake("BASE_DATA number 40", r"base_data", cell="[frames]\nbase_data = 40\n"),
    Mistake("TOOL_DATA number 0", r"tool_data", cell='[tool.1]\ntool_data = 0\naxis = "+x"\n'),
    Mistake("TOOL_DATA without the axis", r"axis", cell="[tool.1]\ntool_data = 3\n"),
    Mistake("frame key in metres", r"x_m\b", cell="[frames.base]\nx_m = 1.5\n"),
    Mistake("tool frame key misspelt", r"b_degree", cell="[frames.tool]\nb_degree = -90.0\n"),
    Mistake("section misspelt", r"clearence", cell="[clearence]\nz_mm = 50.0\n"),
    Mistake("TOML syntax: bracket missing", r"end of a table declaration", cell="[frames\nspin = 0\n"),
    Mistake("negative diameter", r"diameter_mm", cell="[tool.1]\ndiameter_mm = -16.0\n"),
    Mistake(
        "corner radius above half the diameter",
        r"corner_radius_mm",
        cell="[tool.1]\ncorner_radius_mm = 10.0\n",
    ),
    Mistake("negative k_s", r"k_s", cell="[controller]\nk_s = -0.168\n"),
    Mistake("robot model misspelt", r"ulta", cell='[robot]\nmodel = "KR 300 R2500 ulta"\n'),
    Mistake("joint limits the wrong way round", r"A2|q_deg", cell=LIMITS.replace("-140, -5", "-5, -140")),
    Mistake("HOME with five joints", r"q_deg", cell="[home]\nq_deg = [0, -90, 90, 0, 0]\n"),
    Mistake(
        "KRL template of M3 names nothing",
        r"(?i)template|spindel|M3",
        {7: "@"},
        cell='[m_code]\nM3 = "$OUT[{{ spindel.run_cw_output }}]=TRUE"\n',
        or_whole=True,
    ),
    Mistake("load above what the robot carries", r"(?i)load|mass_kg", cell="[load]\nmass_kg = 450\n"),
    Mistake("negative load", r"mass_kg", cell="[load]\nmass_kg = -120\n"),
)

STOCK = "[stock]\nbox_mm = [[-12.0, -14.0, -20.0], [132.0, 92.0, 0.0]]\n"
HIGH_STOCK = STOCK.replace("132.0, 92.0, 0.0", "132.0, 92.0, 10.0")
TOOL_9 = {6: "N30 T9 M6", 10: "N70 G43 Z25. H9"}
MATERIAL_MISTAKES = (
    Mistake("retract forgotten: rapid across the plate", r"(?i)rapid", {28: "@N250 G0 X60. Y40."}, STOCK),
    Mistake("rapid down into the plate", r"(?i)rapid", {25: "@N220 Z-2."}, STOCK),
    Mistake("raw part higher than the program thinks", r"(?i)rapid", {11: "@"}, HIGH_STOCK),
    Mistake(
        "flutes shorter than the cut is deep",
        r"(?i)shank",
        {**TOOL_9, 12: "@"},
        STOCK + "[tool.9]\nlength_mm = 110.0\nflute_length_mm = 3.0\n",
    ),
    Mistake(
        "holder in the plate",
        r"(?i)holder",
        {**TOOL_9, 12: "@N90 G1 Z-18. F600.", 13: "@"},
        STOCK + "[tool.9]\nlength_mm = 110.0\nstick_out_mm = 15.0\nholder_diameter_mm = 60.0\n",
    ),
    Mistake(
        "plunging with a mill that does not cut at its centre",
        r"(?i)plunge|centre",
        {**TOOL_9, 12: "@"},
        STOCK + "[tool.9]\nlength_mm = 110.0\ncentre_cutting = false\n",
    ),
    Mistake("left-hand rotation", r"(?i)M4|wrong way", {7: "N40 S8000 M4", 12: "@", 13: "@"}, STOCK),
    Mistake("stock mesh that is not there", r"(?i)stock", cell='[stock]\nmesh = "raw.stl"\n'),
    Mistake("stock box the wrong way round", r"box_mm", cell=STOCK.replace("-20.0", "20.0")),
    Mistake(
        "two force laws",
        r"linear_edge|kienzle",
        cell=(
            "[material]\nkienzle = { kc11 = 641.0, mc = 0.27 }\n"
            "linear_edge = { Ktc = 800.0, Krc = 170.0, Kte = 28.0, Kre = 31.0 }\n"
        ),
    ),
)

MISTAKES = (
    *TOOL_MISTAKES,
    *SPINDLE_MISTAKES,
    *FEED_MISTAKES,
    *UNIT_MISTAKES,
    *START_MISTAKES,
    *CODE_MISTAKES,
    *ARC_MISTAKES,
    *TYPING_MISTAKES,
    *PROGRAM_MISTAKES,
    *FILE_MISTAKES,
    *ROBOT_MISTAKES,
    *CELL_MISTAKES,
    *MATERIAL_MISTAKES,
)

CLEAN = (
    Clean("base program, two tools"),
    Clean("base program in the demonstration cell", cell=None),
    Clean("base program with its stock", cell=STOCK),
    Clean("example cam_style.nc", "cam_style.nc", cell=None),
    Clean("example contour_arcs.nc", "contour_arcs.nc", cell=None),
    Clean("example raster_finish.nc", "raster_finish.nc", cell=None),
    Clean("example test_piece.nc", "test_piece.nc", cell=None),
    Clean("CRLF line ends", form="crlf"),
    Clean("lower case", form="lower"),
    Clean("no spaces", form="tight"),
    Clean("byte-order mark, no line end at the end", form="mark"),
    Clean("no T, no M6, no G43: the mounted tool", "no tool"),
    Clean("inch program with G20", "inch"),
    Clean("G28 in header and footer", change={5: "G28 G91 Z0.\nG90\nG54", 30: f"M5\n{HOME_END}"}),
    Clean("G53 G0 Z0 before the tool change", change={20: "M5\nG53 G0 Z0."}),
    Clean(
        "work offset G55 of the cell",
        change={5: "G55"},
        cell="[work_offsets.G55]\nx_mm = 0.0\ny_mm = 0.0\nz_mm = 30.0\n" + NO_TURN,
    ),
    Clean("comments with ; and remarks after the end", change={8: "M8 ; coolant", 32: "%\nend of file"}),
    Clean("next tool preselected with T alone", change={7: "S8000 M3\nT14", 21: "M6"}),
    Clean("typed by hand, neither M30 nor %", "no tool", change={10: None}),
    Clean(
        "comments between the arguments of a call",
        change={**SUB, 27: "o<pass> call [100] (LONG SIDE) [20] (END; OF IT) ; [5]"},
    ),
    Clean("G43 without H", change={10: "G43 Z25."}),
    Clean("dwell after the spindle start, G64 tolerance", change={8: "M8\nG4 P2.\nG64 P0.02"}),
    Clean("G41 named only in a comment", change={3: "(NO G41, NO G81, NO #100, UNITS MM)"}),
)

LATER = ("a tool too thick for the groove: needs the nominal part",)
"""Not checked here."""
