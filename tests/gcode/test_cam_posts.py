"""Programs in the shapes of CAM posts: what is harmless is read, with a note; what is not is refused."""

import numpy as np
import pytest

from gcode2krl import load_cell
from gcode2krl.program.checks import check_toolpath
from tests.cells import over_demonstration
from tests.gcode import errors, named, read, refusal

FUSION = """\
%
(1001)
(T1  D=10. CR=0. - ZMIN=-2. - FLAT END MILL)
N10 G90 G94 G17 G91.1
N15 G21
N20 G53 G0 Z0.
(2D BORE)
N25 T1 M6
N30 S9000 M3
N35 G54
N40 M8
N45 G0 X40. Y30.
N50 G43 Z15. H1
N55 Z5.
N60 G1 Z1. F333.
N65 G3 X30. Z0. I-5. J0. F1000.
N70 X40. Z-1. I5.
N75 I-5. J0.
N80 G1 X35.
N85 G0 Z15.
N90 M9
N95 G53 G0 Z0.
N100 M30
%
"""
FREECAD = """\
(Exported by FreeCAD)
(Post Processor: grbl_post)
G17 G90
G21
(Begin operation: Profile)
M6 T2
G43 H2
M3 S12000
G0 Z5.000
G0 X64.535 Y55.513
G0 Z3.000
G1 X64.535 Y55.513 Z-1.000 F180.000
G2 X71.271 Y57.964 Z-1.000 I2.796 J2.796 K0.000 F600.000
G2 X71.272 Y52.3 Z-1.000 I-2.245 J-2.832 K0.000
G0 Z5.000
M5
G17 G90
M2
"""
MASTERCAM = """\
%
O0000(BRACKET)
(MCX FILE - C:\\PARTS\\BRACKET.MCX-9)
N100 G21
N102 G0 G17 G40 G49 G80 G90
N104 T3 M6
N106 G0 G90 G54 X10. Y10. A0. S4000 M3
N108 G43 H3 Z25.
N110 Z2.
N112 G1 Z-1. F200.
N114 X60. F600.
N116 G0 Z25.
N118 M5
N120 G91 G28 Z0.
N122 G28 X0. Y0. A0.
N124 M30
%
"""
FANUC = """\
%
O1234 (PLATE)
N1 G0 G17 G40 G49 G80 G90 G97
N2 G21
N3 G0 G91 G28 Z0
N4 T4 M6
N5 G0 G90 G54 X0 Y0 S3000 M3
N6 G43 Z50. H4 M8
N7 G1 Z-1. F250
N8 X50. F500
N9 G0 Z50. M9
N10 G0 G91 G28 Z0
N11 G28 G0 X0 Y0
N12 M48
N13 M30
%
"""
INCH = """\
G90 G94 G17 G20
T1 M6
S8000 M3
G0 X0 Y0
G43 Z1. H1
G1 Z-.04 F20.
G2 X70.5157 Y0. I35.2570 J.001 F40.
G0 Z1.
M30
"""


@named(
    ("text", "notes"),
    {  # whole programs of posts stand in tests/reference/posts
        "fusion": (FUSION, {}),
        "freecad": (FREECAD, {("centre-zero", 13): "K0 is not in the plane of this arc, in 2 blocks"}),
        "mastercam": (MASTERCAM, {("rotary-zero", 7): "in 2 blocks"}),
        "fanuc": (FANUC, {("home-beside-rapid", 5): "", ("override-switch", 14): ""}),
    },
)
def test_a_short_program_of_a_post_is_read_with_one_note_a_kind(text, notes):
    found = {(i.code, i.line): i.message for i in read(text, load_cell()).issues if i.severity == "note"}
    assert found.keys() == notes.keys()
    assert all(notes[place].rpartition(", ")[2] in message for place, message in found.items())


def test_a_centre_alone_is_a_full_circle_under_modal_g2_and_g3():
    toolpath = read(FUSION, load_cell())
    circle = toolpath.position_mm[toolpath.source_line == 18]
    np.testing.assert_allclose(np.hypot(circle[:, 0] - 35, circle[:, 1] - 30), 5, atol=1e-9)
    np.testing.assert_array_equal(circle[-1], [40, 30, -1])
    turned = np.unwrap(np.arctan2(circle[:, 1] - 30, circle[:, 0] - 35))
    assert turned[-1] - turned[0] == pytest.approx(2 * np.pi * (1 - 1 / len(circle)))


@pytest.mark.parametrize("word", ["A", "B", "C", "U", "V", "W"])
def test_the_first_rotary_word_other_than_zero_is_the_error(word):
    (found,) = errors(f"G21 G0 X0 Y0 Z0 {word}0\nG1 X5 F100 {word}0.\nX6 {word}0.5\nX7 {word}9\nM2\n")
    assert (found.code, found.line) == ("rotary-axis", 3)
    assert "[machine]" in found.remedy


def test_g28_with_a_rotary_word_alone_moves_no_other_axis():
    toolpath = read("G21 G0 X1 Y2 Z3\nG28 A0\nM2\n")
    np.testing.assert_array_equal(toolpath.position_mm[1:], [[1, 2, 3]] * 3)
    assert toolpath.known[-1].all()


def test_a_centre_word_other_than_zero_outside_the_plane_is_refused():
    found = refusal(FREECAD.replace("K0.000", "K0.001"), load_cell())
    assert "K0.001 is not in the plane of this arc (G17)" in found.message


def test_g28_beside_g0_is_a_machine_move_and_leaves_g0_in_force():
    toolpath = read("G21 G90\nG1 X0 Y0 Z0 F100\nG0 G91 G28 Z0\nG90 X5\nG28 G0 X0 Y0\nM2\n")
    at_5 = int(np.flatnonzero(toolpath.source_line == 4)[0])
    assert toolpath.rapid[at_5]
    assert toolpath.machine[toolpath.source_line == 3].all()
    assert toolpath.machine[toolpath.source_line == 5].all()


@pytest.mark.parametrize("block", ["G91 G28 G0", "G28 G1 X0", "G28 G2 X0 I1"])
def test_what_has_no_plain_meaning_beside_g28_is_refused(block):
    found = refusal(f"G21 G0 X0 Y0 Z0 F100\n{block}\nM2\n")
    assert (found.code, found.line) == ("two-axis-codes", 2)


UNIT_REST = "G0 X1 Y1 Z1\nM2\n"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("G20\nG71\n", 2),
        ("G71\nG21\n", 1),
        ("G21\nG70\n", 2),
        ("G21\nG71 Q10 X5 Z-5 D1\n", 2),
        ("G21\nG71 G20\n", 2),
    ],
)
def test_g70_and_g71_that_say_another_unit_are_refused(text, line):
    assert refusal(text + UNIT_REST).line == line


@pytest.mark.parametrize(
    ("text", "mm"),
    [("G21\nG71G91.1\n", 1), ("G21 G71\n", 1), ("G21\nG71 G21\n", 1), ("G20\nG70\n", 25.4)],
)
def test_g70_and_g71_may_say_the_unit_again(text, mm):
    np.testing.assert_allclose(read(text + UNIT_REST).position_mm[-1], [mm] * 3)


@pytest.mark.parametrize(
    ("move", "found"), [("", set()), (" X0 Y0 Z0", {"undefined-position", "spindle-off"})]
)
def test_a_feed_move_that_names_no_axis_moves_nothing_and_is_no_fault(cell, move, found):
    text = f"G21\nG1{move} F120\nG0 X0 Y0 Z5\nT1 M6\nG43 H1\nG0 Z5\nS900 M3\nG1 Z-1\nM2\n"
    faults = {i.code for i in check_toolpath(read(text, cell), cell) if i.severity == "error"}
    assert faults & {"undefined-position", "spindle-off"} == found


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("T4\n", [("tool-not-changed", 2)]),
        ("T1\n", []),
        ("T4\nM6\nT5\n", []),
        ("", []),
    ],
)
def test_a_tool_that_is_named_and_never_changed_to_is_found(cell, text, found):
    issues = read(f"G21\n{text}G0 X1 Y1 Z1\nM2\n", cell).issues
    assert [(i.code, i.line) for i in issues if i.code == "tool-not-changed"] == found


@pytest.mark.parametrize("block", ["G2", "N5.G3 X5 I2.5", "N+10 X1", "N.5 X1", "M6"])
def test_what_linuxcnc_refuses_or_is_unsafe_is_refused(block):
    assert refusal(f"G21 G0 X0 Y0 Z0 F100\n{block}\nM2\n").line == 2


def test_m60_stops_as_m0_and_switches_of_overrides_do_nothing():
    toolpath = read("G21 G97 G0 X1 Y1 Z1\nM48\nM50 P1\nM53\nM60\nM2\n")
    assert [e.values["m"] for e in toolpath.events if e.kind == "message"] == [0, 2]
    assert [(i.code, i.line) for i in toolpath.issues] == [("override-switch", 2)]


@pytest.mark.parametrize(
    ("setting", "i_mm", "end_mm", "fits"),
    [
        ("G21", 5.0, 10.009, "exact"),
        ("G21", 5.0, 10.02, "spiral"),
        ("G21", 5.0, 10.0282, "spiral"),
        ("G21", 5.0, 10.0290, "refused"),
        ("G21", 100.0, 200.099, "spiral"),
        ("G21", 100.0, 200.110, "refused"),
        ("G20", 5.0, 10.0715, "spiral"),
        ("G20", 5.0, 10.0725, "refused"),
    ],
)
def test_radii_fit_by_the_rule_of_linuxcnc(setting, i_mm, end_mm, fits):
    unit = 25.4 if setting == "G20" else 1.0
    text = f"{setting} G0 X0 Y0 Z0\nG2 X{end_mm / unit:.9f} Y0 I{i_mm / unit:.9f} J0 F9\nM2\n"
    refused = errors(text)
    issues = refused or [i for i in read(text).issues if i.code == "arc-radius-differs"]
    said = {"refused": ("error", "arc-radius-mismatch"), "spiral": ("warning", "arc-radius-differs")}
    assert [(i.severity, i.code, i.line) for i in issues] == ([] if fits == "exact" else [(*said[fits], 2)])
    assert all(f"{end_mm - 2 * i_mm:.4f} mm" in found.message for found in issues)
    assert all(f"{4 if unit > 1 else 3} decimals" in found.remedy for found in issues)


def test_spirals_are_one_warning_that_names_the_worst():
    text = "G21 G0 X0 Y0 Z0\n" + "".join(f"G2 X10.0{k} I5 F9\nG0 X0 Y0\n" for k in (12, 25, 15))
    (found,) = [i for i in read(text + "M2\n").issues if i.code == "arc-radius-differs"]
    assert found.message.startswith("3 arcs")
    assert found.line == 4
    assert "0.0250 mm" in found.message


def test_an_inch_arc_of_four_decimals_is_read():
    toolpath = read(INCH, load_cell())
    assert (toolpath.arc >= 0).any()


def test_arcs_in_the_other_centre_mode_are_one_finding_that_says_so():
    text = "G21 G0 X10 Y10 Z0 F100\nG2 X20 Y20 I20 J10\nX28 Y4 I20 J10\nX20 Y0 I20 J10\nM2\n"
    (found,) = errors(text)
    assert (found.code, found.line) == ("arc-radius-mismatch", 2)
    assert "2 more (lines 3, 4)" in found.message
    assert "G90.1" in found.remedy


# --- whose length it is ----------------------------------------------------------------------------


FROM_TABLE = over_demonstration({"program": {"tool_length": "from_table"}})


def test_a_length_from_the_table_holds_from_the_tool_change_on():
    text = "G21 G90 G49\nT1 M6\nG0 X0 Y0 Z5\nG49\nX1\nT2 M6\nX2\nZ5\nT0 M6\nX3\nM2\n"
    toolpath = read(text, FROM_TABLE)
    np.testing.assert_array_equal(toolpath.length_offset_tool[1:], [1, 1, 2, 2, -1])
    lengths = [FROM_TABLE.tool[n].length_mm for n in (1, 1, 2, 2)]
    np.testing.assert_allclose(toolpath.length_offset_mm[1:5], lengths)
    as_g43 = read(text.replace("G49\nX1", "X1").replace("M6\n", "M6\nG43\n"), load_cell())
    np.testing.assert_allclose(toolpath.position_mm, as_g43.position_mm)
    np.testing.assert_array_equal(toolpath.known, as_g43.known)


def test_another_h_than_the_tool_is_still_another_length():
    toolpath = read("G21 T1 M6\nG43 H2\nG0 X0 Y0 Z5\nM2\n", FROM_TABLE)
    assert toolpath.length_offset_tool[-1] == 2
    assert "h-differs" in [i.code for i in toolpath.issues]
