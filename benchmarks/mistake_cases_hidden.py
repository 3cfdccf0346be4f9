"""Mistakes that an interpreter does not see: values of another cell, slips that hide themselves, nonsense.

Written down before the translator was run on them, in two lists: `REPORTED` are mistakes that people found
with earlier states of this program, `FURTHER` are others thought of for this benchmark. ``severity`` is the
least that is right: ``warning`` where a person may mean it.
"""

from mistake_cases import CELL_TOOLS, STOCK, SUB, Mistake

TWO_RAPIDS = {14: "@N110 G0 X60. Y40.", 15: "N120 G1 X110. Y80."}
"""A rapid at cutting depth; the move after it leads to the start of the next arc."""
T9 = {6: "N30 T9 M6", 10: "N70 G43 Z25. H9"}
BIG_STOCK = "[stock]\nbox_mm = [[-30.0, -30.0, -20.0], [150.0, 110.0, 0.0]]\n"


def _own(text: str) -> dict[str, str]:
    """Return a cell that is based on nothing."""
    return {"cell": text, "head": "", "tools": ""}


REPORTED = (
    Mistake(
        "a cell with tools only: frames, load and HOME of nobody",
        r"(?i)missing|not state|no \$?BASE|frames",
        **_own(
            "[tool.7]\ndiameter_mm = 12\nteeth = 3\nlength_mm = 120\n"
            "[tool.14]\ndiameter_mm = 10\nteeth = 2\nlength_mm = 90\n"
        ),
    ),
    Mistake("M8 replaced, M9 not", r"M9", cell='[m_code]\nM8 = "$OUT[33]=TRUE"\n'),
    Mistake(
        "M3 replaced, M5 clears another output",
        r"M5|\b33\b",
        cell='[m_code]\nM3 = "$OUT[33]=TRUE"\nM4 = "$OUT[34]=TRUE"\n',
    ),
    Mistake("M5 without text", r"M5", cell='[m_code]\nM5 = ""\n'),
    Mistake("half a frame for $BASE", r"base", cell="[frames]\nbase = { x_mm = 1480.0 }\n"),
    Mistake("BASE_DATA without the frame to compare", r"base_data", cell="[frames]\nbase_data = 3\n"),
    Mistake("flood and spindle on one output", r"(?i)output|\$OUT", cell="[spindle]\nflood_output = 1\n"),
    Mistake(
        "template that changes $BASE",
        r"BASE",
        cell='[m_code]\nM8 = "$BASE=$NULLFRAME"\nM9 = """\n$OUT[3]=FALSE\n$OUT[4]=FALSE"""\n',
    ),
    Mistake("template that moves", r"(?i)LIN|move", cell='tool_change = "LIN_REL {Z 300}"\n'),
    Mistake(
        "template that reads a file",
        r"(?i)template|M8",
        cell="""[m_code]\nM8 = "{{ cell.parse_file('x.json') }}"\n""",
    ),
    Mistake(
        "template that unpickles code",
        r"(?i)template|M8",
        cell='[m_code]\nM8 = """{{ cell.parse_raw("cos\\nsystem\\n(S\'touch x\'\\ntR.", proto="pickle", '
        'allow_pickle=True) }}"""\n',
    ),
    Mistake(
        "template that takes all memory",
        r"(?i)template|M8",
        cell="""[m_code]\nM8 = "{{ 'x'*3000000000 }}"\n""",
    ),
    Mistake("retract forgotten, no stock stated", r"(?i)rapid", TWO_RAPIDS, severity="warning"),
    Mistake(
        "rapid down into the plate, no stock stated", r"(?i)rapid", {12: "@N90 G0 Z-4."}, severity="warning"
    ),
    Mistake(
        "the stated stock is never touched",
        r"(?i)stock",
        {5: "G55", 12: "@"},
        or_whole=True,
        severity="warning",
        cell=STOCK + "[work_offsets.G55]\nx_mm = 0.0\ny_mm = 0.0\nz_mm = 60.0\n"
        "a_deg = 0.0\nb_deg = 0.0\nc_deg = 0.0\n",
    ),
    Mistake(
        "cut through the underside of the stock",
        r"(?i)underside|below|through",
        {12: "@N90 G1 Z-24. F600.", 13: "@"},
        STOCK,
        severity="warning",
    ),
    Mistake("cut into the table", r"(?i)table", {12: "@N90 G1 Z-24. F600."}, "[table]\nz_mm = -20.0\n"),
    Mistake(
        "stiffness per degree",
        r"(?i)stiff|k_[abc]|deflection",
        cell="[compliance.virtual_joints]\nspindle = { k_c = 3.3e3, k_b = 1.2e3, k_a = 1.6e3 }\n",
        severity="warning",
        or_whole=True,
    ),
    Mistake(
        "S80 for S8000",
        r"(?i)chip|force|S80",
        {7: "@N40 S80 M3", 12: "@", 13: "@", 15: "@", 14: "@"},
        severity="warning",
    ),
    Mistake(
        "angles of $BASE in radians",
        r"(?i)deg|radian",
        cell="[frames]\nbase = { x_mm = 1500.0, y_mm = 0.0, z_mm = 800.0, "
        "a_deg = 3.14159, b_deg = 0.0, c_deg = 0.0 }\n",
        severity="warning",
        or_whole=True,
    ),
    Mistake("load in tonnes", r"mass_kg", cell="[load]\nmass_kg = 0.12\n", severity="warning", or_whole=True),
    Mistake(
        "joint limits of a drawing, all 400",
        r"q_deg|A5|A2",
        cell="[robot.limits]\nq_deg = [[-400, 400], [-400, 400], [-400, 400], [-400, 400], [-400, 400], "
        "[-400, 400]]\n",
        severity="warning",
        or_whole=True,
    ),
    Mistake(
        "acceleration in mm/s2",
        r"acc_cp",
        cell="[controller]\nacc_cp_m_s2 = 2000\n",
        severity="warning",
        or_whole=True,
    ),
    Mistake("diameter true", r"diameter_mm", cell="[tool.9]\ndiameter_mm = true\nteeth = 3\n"),
    Mistake("diameter as text", r"diameter_mm", cell='[tool.9]\ndiameter_mm = "12"\nteeth = 3\n'),
    Mistake(
        "chord tolerance in the wrong unit", r"(?i)chord", options=("--chord-tolerance", "500"), or_whole=True
    ),
    Mistake(
        "blend tolerance of 5 mm",
        r"(?i)toleran|corner|blend",
        {5: "@G54 G64 P5", 13: "@"},
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "CDIS of 50 mm",
        r"(?i)cdis|corner",
        cell="[controller]\ncdis_mm = 50\n",
        or_whole=True,
        severity="warning",
    ),
    Mistake("dwell in milliseconds", r"(?i)dwell|G4", {8: "N50 M8\n@G4 P2000."}, severity="warning"),
    Mistake("stop in the cut", r"(?i)M0", {15: "N120 G1 X110.\n@M0"}, severity="warning"),
    Mistake(
        "face mill of 80 mm plunges",
        r"(?i)plung",
        {6: "N30 T40 M6", 10: "N70 G43 Z25. H40", 12: "@N90 G1 Z-4. F600."},
        severity="warning",
        cell="[tool.40]\ndiameter_mm = 80.0\nteeth = 6\nlength_mm = 110.0\n",
    ),
    Mistake(
        "comment gives another diameter than the cell",
        r"(?i)diameter|D=?10",
        {3: "@(T7 D=10. CR=0. - ZMIN=-4. - FLAT END MILL)"},
        severity="warning",
    ),
    Mistake(
        "Z retract typed with a minus, no stock stated",
        r"(?i)rapid",
        {17: "@N150 G0 Z-25."},
        severity="warning",
    ),
    Mistake("cell nested too deep", r"(?i)nest|deep", cell="x = " + "[" * 100_000 + "]" * 100_000 + "\n"),
    Mistake("key of 100,000 parts", r"(?i)nest|deep|long", cell=".".join("a" * 100_000) + " = 1\n"),
    Mistake("tool is a number", r"tool", **_own("tool = 5\n")),
    Mistake("rapid of 200 m/s", r"rapid_m_s", cell="[controller]\nrapid_m_s = 200\n"),
    Mistake("output name that KRL reserves", r"(?i)name|circ", output="circ.src", or_whole=True),
    Mistake("output name with a digit first", r"(?i)name|digit", output="1abc.src", or_whole=True),
    Mistake(
        "M6 without length of the touched-off tool",
        r"(?i)G43|from_table",
        {4: "N10 G90 G94 G17 G21 G40 G80", 10: "N70 Z25.", 12: "@", 21: "N210 Z25."},
    ),
    Mistake("NUL byte", r"(?i)NUL|0x00|byte|character", {13: "@N100 Y70.\0 F1200."}),
)
"""Found by independent checks."""

FURTHER = (
    Mistake(
        "call with an argument too few",
        r"1 argument.*line 6 reads #2",
        {**SUB, 27: "@o<pass> call [100]"},
        severity="warning",
    ),
    Mistake(
        "call with an argument too many",
        r"#3",
        {**SUB, 27: "@o<pass> call [100] [20] [-2]"},
        severity="warning",
    ),
    Mistake("G92 at the start", r"G92", {9: "@N55 G92 X0. Y0.\nN60 G0 X-10. Y-10."}, severity="warning"),
    Mistake("G10 sets an offset", r"G10", {5: "@N15 G10 L2 P1 X0. Y0. Z-20.\nN20 G54"}, severity="warning"),
    Mistake("F in mm/s", r"(?i)chip|feed|F", {13: "@N100 Y70. F20.", 12: "@", 15: "@"}, severity="warning"),
    Mistake(
        "F with a zero too many",
        r"(?i)chip|force|tooth",
        {12: "@", 13: "@N100 Y70. F12000.", 14: "@", 15: "@", 16: "@"},
        severity="warning",
    ),
    Mistake(
        "S in revolutions a second",
        r"(?i)chip|force|tooth",
        {7: "@N40 S133 M3", 12: "@", 13: "@", 14: "@", 15: "@"},
        severity="warning",
    ),
    Mistake("S0 in the middle of the cut", r"(?i)spindle", {15: "@N120 G1 X110. S0"}),
    Mistake("M5 in the block of the last cut", r"(?i)spindle", {17: "@N140 G1 Y-10. M5"}),
    Mistake(
        "M30 in the middle, the rest is left out",
        r"(?i)after|end|M30",
        {18: "N150 G0 Z25.\n@M30", 19: "@N160 M9"},
        severity="warning",
    ),
    Mistake(
        "drill used as a mill",
        r"(?i)drill|side",
        {6: "N30 T41 M6", 10: "N70 G43 Z25. H41", 13: "@", 12: "@"},
        severity="warning",
        cell='[tool.41]\nkind = "drill"\ndiameter_mm = 8.0\n'
        "teeth = 2\npoint_deg = 118.0\nlength_mm = 120.0\n",
    ),
    Mistake(
        "slot three times as deep as the flutes",
        r"(?i)flute|depth|shank|force",
        {12: "@N90 G1 Z-18. F600.", 13: "@"},
        cell=BIG_STOCK,
        tools="[tool.7]\nlength_mm = 120.0\nflute_length_mm = 6.0\n[tool.14]\nlength_mm = 90.0\n",
        severity="warning",
    ),
    Mistake("Unicode minus copied from a document", r"(?i)character", {12: "@N90 G1 Z−4. F600."}),
    Mistake("typographic quotes in a block", r"(?i)character", {12: "@N90 G1 Z“4.” F600."}),
    Mistake(
        "file saved as UTF-16",
        r"(?i)UTF|text|binary|character",
        data="G21 G90\nG0 X0 Y0\n".encode("utf-16"),
        expected=(1,),
        or_whole=True,
    ),
    Mistake(
        "web page saved instead of the program",
        r"(?i)character|not read|letter|number",
        data=b"<!DOCTYPE html>\n<html><body>404 not found</body></html>\n",
        expected=(1,),
    ),
    Mistake(
        "3D printer program",
        r"(?i)\bE\b|letter",
        data=b"G21\nG90\nG28\nG1 X10 Y10 Z0.2 F1200\nG1 X50 E2.5\nM30\n",
        expected=(4, 5),
    ),
    Mistake(
        "laser program without Z",
        r"\bZ\b",
        data=b"G21\nG90\nM3 S8000\nG0 X0 Y0\nG1 X50 F1200\nX50 Y50\nM5\nM30\n",
        expected=(5,),
    ),
    Mistake(
        "Heidenhain dialogue program",
        r"(?i)not|letter|number|character",
        data=b"0 BEGIN PGM 12 MM\n1 TOOL CALL 5 Z S8000\n2 L X+10 Y+20 R0 FMAX M3\n3 END PGM 12 MM\n",
        expected=(1, 2, 3, 4),
    ),
    Mistake("Sinumerik assignment X=", r"(?i)=|express", {13: "@N100 G1 Y=70. F1200."}),
    Mistake("Sinumerik cycle", r"(?i)CYCLE|letter|not read|number|L\b", {11: "N80 Z2.\n@CYCLE832(0.01,3)"}),
    Mistake(
        "the cell given as program",
        r"(?i)number|letter|character|express",
        data=CELL_TOOLS.encode(),
        expected=(1, 2),
    ),
    Mistake(
        "ball with a small corner radius",
        r"corner_radius_mm",
        cell='[tool.9]\nkind = "ball"\ndiameter_mm = 10.0\n'
        "teeth = 2\ncorner_radius_mm = 1.0\nlength_mm = 100.0\n",
    ),
    Mistake(
        "flat mill with a corner radius",
        r"corner_radius_mm",
        T9,
        cell='[tool.9]\nkind = "flat"\ndiameter_mm = 10.0\n'
        "teeth = 2\ncorner_radius_mm = 5.0\nlength_mm = 100.0\n",
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "stick-out longer than the tool",
        r"stick_out",
        cell="[tool.9]\ndiameter_mm = 10.0\nteeth = 2\nlength_mm = 80.0\nstick_out_mm = 120.0\n",
    ),
    Mistake(
        "cutting coefficients in kN/mm2",
        r"Ktc|linear_edge|material",
        cell="[material]\nlinear_edge = { "
        "Ktc = 0.8, Krc = 0.17, Kac = 0.2, Kte = 0.028, Kre = 0.031, Kae = 0.001 }\n",
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "Kienzle in GPa",
        r"kc11",
        cell="[material]\nkienzle = { kc11 = 0.7, mc = 0.25 }\n",
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "inertia in kg mm2",
        r"jx_kgm2|inertia",
        cell="[load]\njx_kgm2 = 4000000.0\n",
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "centre of mass in metres given as 18 m",
        r"z_mm|centre",
        cell="[load]\nz_mm = 18000.0\n",
        or_whole=True,
        severity="warning",
    ),
    Mistake("cycle in milliseconds", r"cycle_s", cell="[controller]\ncycle_s = 12\n"),
    Mistake("k in milliseconds", r"k_s", cell="[controller]\nk_s = 168\n", or_whole=True, severity="warning"),
    Mistake(
        "40 teeth on a 12 mm mill",
        r"teeth",
        tools=CELL_TOOLS + "diameter_mm = 12.0\nteeth = 40\n",
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "spindle up to speed in 0.05 s",
        r"start_s",
        cell="[spindle]\nstart_s = 0.05\n",
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "tool mounted that the table does not have",
        r"mounted|T55|tool 55",
        cell="mounted_tool = 55\n",
        program="no tool",
        change={4: "@", 5: "@", 6: "@", 7: "@"},
        or_whole=True,
    ),
    Mistake(
        "tool frame turned by 180 degrees",
        r"(?i)reach|limit|axis|HOME",
        cell="[frames]\ntool = { "
        "x_mm = 250.0, y_mm = 0.0, z_mm = 250.0, a_deg = 0.0, b_deg = 90.0, c_deg = 0.0 }\n",
        or_whole=True,
        change={10: "@"},
    ),
    Mistake(
        "a small robot with the large one's load",
        r"(?i)load|payload|mass|reach",
        cell='[robot]\nmodel = "KR 6 R900 sixx"\n',
        or_whole=True,
        change={10: "@"},
    ),
    Mistake("material misspelt", r"AW-2071", cell='[material]\nmodel = "AW-2071A"\n'),
    Mistake(
        "verified on no day",
        r"verified|date",
        **{
            "cell": "",
            "head": 'based_on = "demonstration"\nverified = { by = "benchmark", date = "2026-13-45" }\n',
        },
    ),
    Mistake(
        "verified in the future",
        r"in the future",
        **{
            "cell": "",
            "head": 'based_on = "demonstration"\nverified = { by = "benchmark", date = "2126-01-15" }\n',
        },
        or_whole=True,
        severity="warning",
    ),
    Mistake("the same section twice", r"(?i)tool|twice|declare|line", cell="[tool.7]\nteeth = 2\n"),
    Mistake("look-ahead of nine", r"advance", cell="[controller]\nadvance = 9\n"),
    Mistake("guard input 0", r"number|guard", cell='guard_inputs = [{ number = 0, meaning = "door" }]\n'),
    Mistake(
        "blend tolerance of the option in micrometres",
        r"(?i)toleran|corner|blend",
        {13: "@"},
        options=("--tolerance", "20"),
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "release of a finding that is not there",
        r"allow",
        options=("--allow", "g43-missing:12"),
        or_whole=True,
    ),
    Mistake("cell file that does not exist", r"(?i)cell|read", options=("--cell", "cel.toml"), or_whole=True),
    Mistake(
        "G43 before the tool is in the spindle",
        r"(?i)H7|H|G43",
        {6: "@G43 H7\nN30 T7 M6", 10: "@N70 Z25.", 12: "@"},
    ),
    Mistake(
        "first plunge with the feed of the last tool's cut",
        r"(?i)plunge|force|feed",
        {12: "@N90 G1 Z-4. F6000."},
        severity="warning",
    ),
    Mistake(
        "two parts of one file: G91 from the first",
        r"(?i)reach|below|rapid|Z|table|plunge|limit",
        {20: "N180 T14 M6\nG91", 25: "@", 24: "@", 23: "@", 26: "@", 28: "@"},
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "work offset turned by 90 degrees by mistake in radians",
        r"(?i)deg|radian",
        cell="[work_offsets.G54]\nx_mm = 0.0\ny_mm = 0.0\n"
        "z_mm = 0.0\na_deg = 1.5708\nb_deg = 0.0\nc_deg = 0.0\n",
        or_whole=True,
        severity="warning",
    ),
    Mistake(
        "lengths of two tools exchanged",
        r"length",
        cell="",
        tools="[tool.7]\nlength_mm = 90.0\n[tool.14]\nlength_mm = 120.0\n",
    ),
    Mistake(
        "G3 for G2: the long way round",
        r"(?i)arc|direction",
        {14: "@N110 G3 X0. Y80. I10. J0."},
        severity="warning",
    ),
    Mistake(
        "spin in radians", r"(?i)spin", cell="[frames]\nspin = 1.5708\n", severity="warning", or_whole=True
    ),
    Mistake(
        "helix in radians",
        r"(?i)helix",
        T9,
        cell="[tool.9]\ndiameter_mm = 10.0\nteeth = 2\nhelix_deg = 0.52\nlength_mm = 100.0\n",
        severity="warning",
        or_whole=True,
    ),
    Mistake(
        "X and Y of the part's place exchanged",
        r"(?i)reach|stock",
        {10: "@"},
        cell="[work_offsets.G54]\nx_mm = 20.0\ny_mm = 50.0\n"
        "z_mm = 0.0\na_deg = 0.0\nb_deg = 0.0\nc_deg = 0.0\n",
        severity="warning",
        or_whole=True,
    ),
)
"""New cases, in no list before. The last five can hardly be distinguished from intended programs."""
