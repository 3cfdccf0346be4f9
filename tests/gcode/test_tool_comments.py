"""Diameters and changes that CAM comments name, against the cell's tools."""

import pytest

from gcode2krl.gcode import tool_comments
from gcode2krl.gcode.tool_comments import named_tools
from tests.cells import over_demonstration
from tests.gcode import read

CELL = over_demonstration()  # T1 is 16 mm wide, T6 10 mm
BODY = "G21 G90 G17\nT{tool} M6\nS9000 M3\nG0 G43 H{tool} Z30\nG0 X0 Y0\nG1 Z-5 F600\nG0 Z30\nM5\nM30\n"


def differing(text, cell=CELL, **options):
    return [issue for issue in read(text, cell, **options).issues if issue.code == "tool-differs"]


def warned(comment, tool=1, more=""):
    body = BODY.format(tool=tool).replace("M30\n", more + "M30\n%\n")
    return [(issue.severity, issue.line) for issue in differing(f"%\n{comment}\n{body}")]


OTHERS = [
    "(T1 D=10. CR=0. - ZMIN=-5 - flat end mill)",
    "(T1  D=0.5 CR=0. - ZMIN=-5 - flat end mill)",
    "(TOOL 1 - 10MM ENDMILL)",
    "( Tool Diameter 6 mm )",
    "(10MM FLAT ENDMILL | TOOL - 1 | DIA. OFF. - 1 | LEN. - 1 | TOOL DIA. - 10.)",
    "( T1 | 10. FLAT ENDMILL | H1 | D1 )",
    "(TC: 5mm Endmill)",
    "(T1 - End Mill {6 mm})",
    "( End Mill {0.25 inch})",
    "(1/4 FLAT ENDMILL)",
    "; cutter diameter = 3.175",
    "(Compensated Tool Path. Diameter: 4.0)",
]
SAME_OR_SILENT = [
    "(T1 D=16. CR=0. - ZMIN=-5 - flat end mill)",
    "(T1 D=0.63 CR=0. flat end mill)",
    "(T7 D=10. CR=0. - flat end mill)",
    "(16MM ENDMILL)",
    "(5/8 ENDMILL)",
    "(STOCK DIAMETER 50)",
    "(HOLE DIA 8 WITH ENDMILL)",
    "(DIA. OFF. - 1)",
    "(4 FLUTE ENDMILL)",
    "(POCKET 12. ENDMILL)",
    "(T1 D=10. CR=0. TAPER=45deg - chamfer mill)",
    "(LEAD IN 2.0 CUTTER COMP ON)",
    "(MILL 10 DEEP)",
    "(DIAMETER 10)",
]


@pytest.mark.parametrize(
    ("comment", "expected"), [*((c, [("warning", 2)]) for c in OTHERS), *((c, []) for c in SAME_OR_SILENT)]
)
def test_another_diameter_is_a_warning_with_the_comments_line(comment, expected):
    assert warned(comment) == expected


@pytest.mark.parametrize(("diameter_mm", "expected"), [(10, []), (12, [("warning", 2)])])
def test_the_tool_that_the_comment_names_is_compared(diameter_mm, expected):
    assert warned(f"(T6 D={diameter_mm}. CR=0. - flat end mill)", tool=6) == expected


def test_a_comment_without_a_number_says_nothing_where_there_are_two_tools():
    second = "T6 M6\nS9000 M3\nG0 G43 H6 Z30\nG0 X0 Y0\nG1 Z-5 F600\nG0 Z30\nM5\n"
    assert warned("(TOOL DIAMETER 10.)") == [("warning", 2)]
    assert warned("(TOOL DIAMETER 10.)", more=second) == []


def test_the_message_tells_both_and_each_tool_once():
    (issue,) = differing("(T1 D=10. - flat end mill)\n" * 3 + BODY.format(tool=1))
    assert "diameter of 10," in issue.message
    assert "16 mm" in issue.message
    assert "tool.1.diameter_mm" in issue.remedy


def test_lines_are_right_far_into_a_long_file():
    filler = "G1 X1.234 Y5.678 Z-0.123 F600 (a)\n" * 60_000  # several pieces
    text = BODY.format(tool=1).replace("M5\n", filler + "(T1 D=10.)\nM5\n")
    assert [issue.line for issue in differing(text)] == [7 + 60_000 + 1]


@pytest.mark.parametrize(
    "line", [b"G1 X1.2345 Y5.6789 Z-0.1234 F600\n", b"G1 X1.2345 (wall finish) Y5.6789\n"]
)
def test_a_file_without_such_words_is_not_searched_line_by_line(line, monkeypatch):
    monkeypatch.setattr(tool_comments, "_COMMENT", None)  # whatever asks it fails
    assert not list(named_tools(line * 1000, 1))


GRBL = "G17 G90 G21\n{first}\nM3 S10000\nG54\nG0 Z5\nG0 X0 Y0\nG1 Z-1 F200\n{second}\nG1 X50\nG0 Z5\nM5\nM2\n"


def changes_told(first, second, mounted):
    cell = CELL.model_copy(update={"mounted_tool": mounted})
    issues = read(GRBL.format(first=first, second=second), cell, dialect="grbl").issues
    return [(i.line, i.remedy) for i in issues if i.code == "tool-not-changed"]


def test_a_change_that_only_a_comment_names_is_no_change():
    ((line, remedy),) = changes_told("( M6 T2 )", "", 1)
    assert (line, "mounted_tool = 2" in remedy) == (2, True)
    assert changes_told("( M6 T2 )", "", 2) == []
    assert changes_told("( M6 T2 )", "", None) == []
    assert changes_told("(T2 before)", "", 1) == []


@pytest.mark.parametrize("mounted", [1, 2, 5])
def test_a_second_tool_of_the_comments_is_never_cut_with_the_first(mounted):
    ((_, remedy),) = changes_told("( M6 T2 )", "( M06 T5 )", mounted)
    assert "one program a tool" in remedy


def test_a_change_in_a_comment_beside_a_real_one():
    assert changes_told("(M6 T2)\nT2 M6", "", 1) == []
    assert changes_told("T2 M6", "(T5 M6)", 1)[0][0] == 8


def test_a_diameter_behind_a_change_in_a_comment_is_that_tools():
    said = list(named_tools(b"( M6 T2 )\n(Compensated Tool Path. Diameter: 4.0)\n", 1))
    assert [(s.tool, s.value, s.is_change) for s in said] == [(2, 0.0, True), (2, 4.0, False)]


@pytest.mark.parametrize(("h", "mounted", "differs"), [(1, 1, False), (6, 1, True), (1, 6, True)])
def test_the_mounted_tool_is_the_one_of_h_until_a_change(h, mounted, differs):
    cell = CELL.model_copy(update={"mounted_tool": mounted})
    issues = read(f"G21 G90\nT1\nG0 X0 Y0\nG43 Z9 H{h}\nM2\n", cell).issues
    assert ("h-differs" in {issue.code for issue in issues}) == differs
