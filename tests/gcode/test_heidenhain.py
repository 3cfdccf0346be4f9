"""Heidenhain's conversational programs: places worked out by hand, and what is refused with its line."""

import numpy as np
import pytest

from gcode2krl import Gcode2KrlError, read_gcode
from tests.cells import over_demonstration
from tests.gcode import Control

HEAD = (
    "0 BEGIN PGM PART MM\n1 BLK FORM 0.1 Z X+0 Y+0 Z-20\n2 TOOL CALL 1 Z S1000 F400\n"
    "3 L X+0 Y+0 Z+5 R0 FMAX M3\n"
)
CELL = over_demonstration({"tool": {1: {"diameter_mm": 10.0, "teeth": 2, "length_mm": 60.0}}})
HEIDENHAIN = Control(HEAD, "99 END PGM PART MM", "heidenhain", CELL)
DRILL = (
    "10 CYCL DEF {} ~\n Q200=+2 ;SET-UP ~\n Q201=-8 ;DEPTH ~\n Q206=+150 ;FEED ~\n Q202=+{} ;STEP ~\n"
    " Q203=+0 ~\n Q204=+20 ;2ND{}\n"
)


def read(lines, cell=None):
    """Read lines that are numbered, or numbers them from 10 on."""
    return HEIDENHAIN.read("\n".join(lines if isinstance(lines, list) else numbered(lines)), cell)


def way(lines):
    """Return the places behind the head, (n, 3)."""
    return read(lines).position_mm[2:]


def numbered(lines):
    return [f"{k} {line}" for k, line in enumerate(lines.split("\n"), start=10)]


@pytest.mark.parametrize(
    ("lines", "last"),
    [
        ("L X+10 Y-2,5 Z-1 F200", [10, -2.5, -1]),
        ("L IX+10 F200\nL IX-3 IY+1", [7, 1, 5]),
        ("CC X+10 Y+0\nC X+20 Y+0 DR- F100", [20, 0, 5]),
        ("CC X+10 Y+0\nCP IPA+90 DR+ F100", [10, -10, 5]),
        ("CC X+10 Y+0\nCP PA+90 DR- F100", [10, 10, 5]),
        ("CC X+10 Y+0\nCP IPA-1080 IZ-6 DR- F100", [0, 0, -1]),
        ("CC X+10 Y+0\nCP IPA-450 IZ-6 DR- F100", [10, 10, -1]),
        ("CC X+10 Y+20\nLP PR+5 PA+90 FMAX", [10, 25, 5]),
        ("CR X+10 Y+0 R+5 DR- F100", [10, 0, 5]),
        ("L X+5 F100\nCT X+10 Y+5", [10, 5, 5]),
        ("L X+10 F100\nCHF 2\nL Y+10", [10, 10, 5]),
        ("CYCL DEF 7.0 DATUM SHIFT\nCYCL DEF 7.1 X+100\nCYCL DEF 7.2 Y-5\nL X+1 Y+1 FMAX", [101, -4, 5]),
        ("L Z+100 R0 FMAX M91\nL X+4 Y+5 Z+6 FMAX", [4, 5, 6]),
        ("PLANE RESET STAY\nCYCL DEF 19.0 WORKING PLANE\nCYCL DEF 19.1 A+0 B+0 C+0\nL X+1 FMAX", [1, 0, 5]),
        (
            "CYCL DEF 32.0 TOLERANCE\nCYCL DEF 32.1 T0.05\n* - SECTION\n; comment\nL X+1 M120 LA5 FMAX",
            [1, 0, 5],
        ),
        ("Q1 = 3 * (2 + 4)\nFN 3: Q2 = +Q1 * -2\nL X+Q1 Y-Q2 FMAX", [18, 36, 5]),
        ("FN 0: Q1 = +0\nLBL 1\nL IX+2 FMAX\nFN 1: Q1 = +Q1 + +1\nFN 12: IF +Q1 LT +3 GOTO LBL 1", [6, 0, 5]),
        ("LBL 1\nL IX+1 FMAX\nCALL LBL 1 REP 4/4", [5, 0, 5]),
        (
            'CALL LBL 2\nCALL LBL "HOLE"\nSTOP\nL M30\nLBL 2\nL IX+1 FMAX\nLBL 0\n'
            'LBL "HOLE"\nCALL LBL 2\nL IY+1 FMAX\nLBL 0',
            [2, 1, 5],
        ),
        ("CALL LBL 1\nL M2\nLBL 1\nCC X+5 Y+0\nC X+10 Y+0 DR+ F100\nLBL 0", [10, 0, 5]),
    ],
)
def test_where_a_conversational_program_leads(lines, last):
    np.testing.assert_allclose(way(lines)[-1], last, atol=1e-8)


def test_lines_feeds_and_functions_are_those_of_the_file():
    found = read("L X+10 F300 M8\nL X+20 FMAX\nL X+30\nL X+40 FAUTO M13\nL X+50 M5 M9")
    assert found.source_line[2:].tolist() == [5, 6, 7, 8, 9]
    assert (60 * found.feed_mm_s[2:]).tolist() == [300, np.inf, 300, 400, 400]
    assert [e.values["m"] for e in found.events if e.kind in ("spindle", "coolant")][:4] == [3, 8, 3, 8]
    assert found.tool[-1] == 1


def test_a_compensated_contour_leads_in_at_right_angles():
    """Outside of the corner at (20, 20) the path goes by an arc of the tool's radius."""
    found = way("L X+20 RR F100\nL Y+20 RR\nL X+0\nL Y+40 R0")[:, :2]
    np.testing.assert_allclose(found[[0, 1, -2, -1]], [[25, 0], [25, 20], [0, 25], [0, 40]], atol=1e-9)
    np.testing.assert_allclose(np.hypot(*(found[2:-2] - [20, 20]).T), 5, atol=1e-6)


@pytest.mark.parametrize(
    "call",
    ["11 L X+10 R0 FMAX M99", "11 L X+10 R0 FMAX\n12 CYCL CALL", "11 CYCL CALL POS X+10 FMAX"],
)
def test_cycle_200(call):
    found = read([DRILL.format("200 DRILLING", 5, " ~\n Q211=+0.5 ;DWELL ~\n Q210=+0.25").rstrip(), call])
    holes = [[10, 0, 5], [10, 0, 2], [10, 0, -5], [10, 0, 2], [10, 0, -3], [10, 0, -8], [10, 0, 20]]
    np.testing.assert_allclose(found.position_mm[2:], holes, atol=1e-12)
    assert found.dwell_s[2:].tolist() == [0, 0, 0, 0.25, 0, 0.5, 0]
    assert (60 * found.feed_mm_s[[4, 7]]).tolist() == [150, 150]


def test_a_cycle_stays_defined_and_in_a_called_label_takes_the_last_definition():
    moves = ["11 L X+10 FMAX M89", "12 L X+20 FMAX M99", "13 L X+30 FMAX"]
    twice = [DRILL.format("200 DRILLING", 9, "").rstrip(), *moves]
    depths = way(twice)
    assert depths[depths[:, 2] < 0].tolist() == [[10, 0, -8], [20, 0, -8]]
    deeper = DRILL.format("200 DRILLING", 99, "").rstrip().replace("Q201=-8", "Q201=-9")
    label = ["14 L M2", "15 LBL 1", "16 L IX+1 FMAX M99", "17 LBL 0"]
    called = [*twice[:1], "11 CALL LBL 1", deeper, "13 CALL LBL 1", *label]
    depths = way(called)
    assert depths[depths[:, 2] < 0].tolist() == [[1, 0, -8], [2, 0, -9]]


def test_cycles_201_203_and_207():
    ream = DRILL.format("201 REAMING", 9, " ~\n Q208=+300").rstrip()
    assert (60 * read([ream, "11 L X+1 FMAX M99"]).feed_mm_s[4:6]).tolist() == [150, 300]
    universal = DRILL.format("203 UNIVERSAL DRILLING", 9, " ~\n Q208=+0").rstrip()
    found = read([universal, "11 L X+1 FMAX M99"])
    assert found.position_mm[3:, 2].tolist() == [2, -8, 2, 20]
    tap = "10 CYCL DEF 207 RIGID TAPPING ~\n Q200=+2 ~\n Q201=-8 ~\n Q239=+1 ~\n Q203=+0 ~\n Q204=+2"
    found = read([tap, "11 L X+1 FMAX M99"])
    np.testing.assert_allclose(60 * found.feed_mm_s[4:6], 1000)
    assert [e.values["m"] for e in found.events if e.kind == "spindle"] == [3, 3, 5, 4, 5, 3, 5]


PECKING = (
    "CYCL DEF 1.0 PECKING\nCYCL DEF 1.1 SET UP 2\nCYCL DEF 1.2 DEPTH -9\nCYCL DEF 1.3 PECKG 5\n"
    "CYCL DEF 1.4 DWELL 0.5\nCYCL DEF 1.5 F80"
)


def test_cycle_1_begins_where_the_tool_stands():
    """Strokes of 5 mm from 2 mm below; back in to 0.6 mm above the last depth."""
    found = read(f"{PECKING}\nL Z+12 FMAX\nL X+3 FMAX M99")
    z = found.position_mm[:, 2].tolist()
    without_a_move = read(f"{PECKING}\nL X+3 Z+12 FMAX\nL FMAX M99").position_mm[:, 2]
    np.testing.assert_allclose(without_a_move[-5:], z[-5:])
    np.testing.assert_allclose(z[-6:], [12, 5, 12, 5.6, 1, 12], atol=1e-9)
    assert found.dwell_s[-2] == 0.5


@pytest.mark.parametrize(
    ("lines", "line"),
    [
        *((line, 1) for line in ("PLANE SPATIAL SPA+30 SPB+0 SPC+0 TURN", "FUNCTION TCPM F TCP")),
        *((line, 1) for line in ("APPR LT X+1 Y+1 LEN5", "CYCL DEF 251 POCKET ~\n Q215=0", "CALL PGM TEST")),
        *((line, 1) for line in ("CYCL DEF 10.0 ROTATION", "FL X+5", "TOOL CALL 2 X S100", "L X+1 U+5")),
        *((line, 1) for line in ("TOOL CALL 1 Z S100 DR+0.5", "L X+1 FMAX M109", "C X+1 Y+1 DR+")),
        *((line, 1) for line in ("CC IX+1", "L X+1 PR5 FMAX", "CALL LBL 7", "CYCL CALL")),
        ("FN 18: SYSREAD Q1 = ID1", 1),
        ("LBL 1\nL X+1 FMAX M89", 2),
        ("CC X+1 Y+1\nC X+1 Z+1 DR+", 2),
        ("CC X+1 Y+1\nCP IPA+90 DR-", 2),
        ("CALL LBL 1\nL M2\nLBL 1\nL X+1", 1),
        ("L X+1 F100\nRND R5 F50\nL Y+9", 2),
        ("CYCL DEF 1.0 PECKING\nCYCL CALL", 2),
        (f"{PECKING}\nL FMAX M89", 7),
        ("L FMAX M99", 1),
        (f"{PECKING}\nTOOL CALL 1 Z S900\nCYCL CALL", 8),
        (f"{PECKING}\nL Z+9 FMAX\nCYCL DEF 7.0 DATUM\nCYCL DEF 7.1 Z+5\nCYCL CALL", 10),
        ("CC X+1 Y+1\nL X+3 Y+1 FMAX\nCYCL DEF 7.0 DATUM\nCYCL DEF 7.1 X+5\nCP PA+90 DR+", 5),
        ("CC X+1 Y+1\nL X+3 Y+1 FMAX\nLBL 1\nCP PA+90 DR+\nL X+9 FMAX\nCALL LBL 1 REP 1", 4),
        ("CYCL DEF 247 DATUM ~\n Q339=+0", 1),
        ("CYCL DEF 247 DATUM ~\n Q339=Q5", 1),
        ("CYCL DEF 203 DRILL ~\n Q200=2 ~\n Q201=-9 ~\n Q206=1 ~\n Q202=2 ~\n Q203=0 ~\n Q208=0", 1),
        ("L C+30 FMAX", 1),
        ("Q1 = Q2 ^ 2", 1),
        ("L X+Q7 FMAX\nQ7 = 1", 1),
    ],
)
def test_what_is_not_sure_is_refused_with_its_line(lines, line):
    text = f"10 {lines}" if "~" in lines else "\n".join(numbered(lines))
    assert HEIDENHAIN.errors(text)[0].line == line
    assert HEIDENHAIN.errors(text)[0].remedy


def test_the_marks_of_a_conversational_program_name_its_dialect(tmp_path):
    part = tmp_path / "part.h"
    part.write_text(f"{HEAD}10 L X+1 FMAX\n11 END PGM PART MM\n", encoding="utf-8")
    with pytest.raises(Gcode2KrlError) as refused:
        read_gcode(part, CELL)
    (issue,) = refused.value.issues
    assert (issue.code, issue.line, issue.remedy) == ("other-dialect", 1, "--dialect heidenhain reads it")
    assert read_gcode(part, CELL, dialect="heidenhain").position_mm[-1].tolist() == [1, 0, 5]


def test_inches_are_refused():
    inches = HEIDENHAIN._replace(head=HEAD.replace(" MM", " INCH"))
    assert inches.refused("10 L X+1 FMAX")[1] == 1 - HEAD.count("\n")


def test_a_finding_quotes_the_line_of_the_file():
    assert "QV" not in HEIDENHAIN.refusal("10 L X+999999999 FMAX").excerpt


@pytest.mark.parametrize(("preset", "code"), [(1, "G54"), (4, "G57"), (5, "G505"), (99, "G599")])
def test_a_preset_is_the_offset_that_the_cell_states(preset, code):
    frame = {"x_mm": 100.0, "y_mm": 20.0, "z_mm": 0.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}
    cell = over_demonstration({"work_offsets": {code: frame}})
    lines = [f"10 CYCL DEF 247 DATUM ~\n Q339=+{preset} ;NUMBER", "11 L X+1 Y+2 FMAX"]
    np.testing.assert_allclose(read(lines, cell=cell).position_mm[-1, :2], [101.0, 22.0])


def test_a_preset_that_the_cell_does_not_state_is_reported():
    issues = read(["10 CYCL DEF 247 DATUM ~\n Q339=+2 ;NUMBER", "11 L X+1 Y+2 FMAX"]).issues
    assert "work-offset-unknown" in {issue.code for issue in issues}  # an error in a program for a robot
