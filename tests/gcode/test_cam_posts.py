"""Programs in the shapes of CAM posts: what is harmless is read, with a note; what is not is refused."""

import io

import numpy as np
import pytest

from gcode2krl import Gcode2KrlError, load_cell
from gcode2krl.cell import Cell
from gcode2krl.gcode import read_stream
from gcode2krl.program.checks import check_toolpath

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
VECTRIC = """\
( Sign )
G00G21G17G90G40G49G80
G91.1
T1M06
G00Z20.320
S12000M03
G94
X0.000Y0.000F2540.0
G00X50.000Y50.000Z6.000
G1X50.000Y50.000Z-3.000F762.0
G1X100.000F2540.0
G00Z6.000
G00X0.000Y0.000
M09
M30
"""
PYCAM = """\
;PYCAM-META-DATA: Filename: part.stl
G40 (disable tool radius compensation)
G49 (disable tool length compensation)
G80 (cancel modal motion)
G54 (select coordinate system 1)
G90 (use absolute coordinates)
G21 (metric)
G61 (exact path mode)
F1000.00000
S1000.00000
T5 M6
M3
G4 P3
G0 Z5.0000
G0 X0.0000 Y0.0000
G1 Z-1.0000
X10.0000
G0 Z5.0000
M5
M2
"""
CARBIDE = """\
%
(TOOL/MILL,0.1, 0.05, 0.000, 0)
(FILENAME: part.c2d)
G90
G21
M05
M0 ;T102
M6T2
M03S10000
G0X10.000Y5.000
Z2.000
G1Z-1.000F300.0
G3X0.000Y15.000I-10.000J0.000F900.0
X-10.000Y5.000J-10.000
G0Z10.000
M05
M02
"""
ESTLCAM = """\
( Project part )
G21
G90
T1 M6
M03 S10000
G00 Z5.0000
G00 X10.0000 Y0.0000
G01 Z-1.0000 F600 S10000
G02 X0.0000 Y-10.0000 I-10.0000 J0.0000 F1200
G03 I5 J5
G00 Z5.0000
M05
M30
"""
SOLIDCAM = """\
%
O5000 (POCKET)
(T6 D16 R0)
N10 G21 G40 G80 G90 G94 G97
N20 T6 M6
N30 G54 G0 X0 Y0 S2500 M3 B0. C0.
N40 G43 H6 Z100. M8
N50 G64
N60 Z5.
N70 G1 Z-2. F300
N80 G2 X20. Y0. R10. F800
N90 G1 Y20.
N100 G0 Z100. M9
N110 M5
N120 M60
N130 M30
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


def read(text, cell=None, **options):
    return read_stream(io.BytesIO(text.encode()), "part.nc", cell, **options)


def noted(text, severity="note"):
    """Return code and line of each note that reading gives."""
    return {(i.code, i.line) for i in read(text, load_cell()).issues if i.severity == severity}


@pytest.mark.parametrize(
    ("text", "notes"),
    [
        (FUSION, set()),
        (FREECAD, {("centre-zero", 13)}),
        (MASTERCAM, {("rotary-zero", 7)}),
        (FANUC, {("home-beside-rapid", 5), ("override-switch", 14)}),
        (VECTRIC, set()),
        (PYCAM, set()),
        (CARBIDE, set()),
        (ESTLCAM, set()),
        (SOLIDCAM, {("rotary-zero", 6)}),
    ],
    ids=["fusion", "freecad", "mastercam", "fanuc", "vectric", "pycam", "carbide", "estlcam", "solidcam"],
)
def test_a_short_program_of_a_post_is_read_with_one_note_a_kind(text, notes):
    assert noted(text) == notes


def test_a_centre_alone_is_a_full_circle_under_modal_g2_and_g3():
    toolpath = read(FUSION, load_cell())
    circle = toolpath.position_mm[toolpath.source_line == 18]
    np.testing.assert_allclose(np.hypot(circle[:, 0] - 35, circle[:, 1] - 30), 5, atol=1e-9)
    np.testing.assert_array_equal(circle[-1], [40, 30, -1])
    turned = np.unwrap(np.arctan2(circle[:, 1] - 30, circle[:, 0] - 35))
    assert turned[-1] - turned[0] == pytest.approx(2 * np.pi * (1 - 1 / len(circle)))


def test_centre_words_that_nothing_uses_are_one_finding():
    with pytest.raises(Gcode2KrlError, match="uses I and J; G1 is in force since line 2") as caught:
        read("G21 G0 X0 Y0 Z0\nG1 X5 F100\nI1 J1\nM2\n")
    assert len(caught.value.issues) == 1


@pytest.mark.parametrize("word", ["A", "B", "C", "U", "V", "W"])
def test_the_first_rotary_word_other_than_zero_is_the_error(word):
    program = f"G21 G0 X0 Y0 Z0 {word}0\nG1 X5 F100 {word}0.\nX6 {word}0.5\nX7 {word}9\nM2\n"
    with pytest.raises(Gcode2KrlError) as caught:
        read(program)
    (found,) = [i for i in caught.value.issues if i.severity == "error"]
    assert (found.code, found.line) == ("rotary-axis", 3)
    assert "[machine]" in found.remedy


def test_g28_with_a_rotary_word_alone_moves_no_other_axis():
    toolpath = read("G21 G0 X1 Y2 Z3\nG28 A0\nM2\n")
    np.testing.assert_array_equal(toolpath.position_mm[1:], [[1, 2, 3]] * 3)
    assert toolpath.known[-1].all()


def test_notes_count_their_blocks():
    (note,) = [i for i in read(MASTERCAM, load_cell()).issues if i.severity == "note"]
    assert "in 2 blocks" in note.message
    (note,) = [i for i in read(FREECAD, load_cell()).issues if i.code == "centre-zero"]
    assert note.message.startswith("K0 ")
    assert "in 2 blocks" in note.message


def test_a_centre_word_other_than_zero_outside_the_plane_is_refused():
    with pytest.raises(Gcode2KrlError, match=r"K0\.001 is not in the plane of this arc \(G17\)"):
        read(FREECAD.replace("K0.000", "K0.001"), load_cell())


def test_g28_beside_g0_is_a_machine_move_and_leaves_g0_in_force():
    toolpath = read("G21 G90\nG1 X0 Y0 Z0 F100\nG0 G91 G28 Z0\nG90 X5\nG28 G0 X0 Y0\nM2\n")
    at_5 = int(np.flatnonzero(toolpath.source_line == 4)[0])
    assert toolpath.rapid[at_5]
    assert toolpath.machine[toolpath.source_line == 3].all()
    assert toolpath.machine[toolpath.source_line == 5].all()


@pytest.mark.parametrize("block", ["G91 G28 G0", "G28 G1 X0", "G28 G2 X0 I1"])
def test_what_has_no_plain_meaning_beside_g28_is_refused(block):
    with pytest.raises(Gcode2KrlError) as caught:
        read(f"G21 G0 X0 Y0 Z0 F100\n{block}\nM2\n")
    assert (caught.value.issues[0].code, caught.value.issues[0].line) == ("two-axis-codes", 2)


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
def test_g70_and_g71_say_the_unit_again_or_are_refused(text, line):
    rest = "G0 X1 Y1 Z1\nM2\n"
    with pytest.raises(Gcode2KrlError) as caught:
        read(text + rest)
    assert caught.value.issues[0].line == line
    for again in ("G21\nG71G91.1\n", "G21 G71\n", "G71 G21\n".replace("G71 G21", "G21\nG71 G21")):
        np.testing.assert_array_equal(read(again + rest).position_mm[-1], [1, 1, 1])
    np.testing.assert_allclose(read("G20\nG70\n" + rest).position_mm[-1], [25.4] * 3)


def test_a_feed_move_that_names_no_axis_moves_nothing_and_is_no_fault(cell):
    head, end = "G21\nG1 F120\nG0 X0 Y0 Z5\nT1 M6\nG43 H1\nG0 Z5\nS900 M3\n", "G1 Z-1\nM2\n"
    faults = {i.code for i in check_toolpath(read(head + end, cell), cell) if i.severity == "error"}
    assert not faults & {"undefined-position", "spindle-off"}
    named = head.replace("G1 F120", "G1 X0 Y0 Z0 F120")
    faults = {i.code for i in check_toolpath(read(named + end, cell), cell) if i.severity == "error"}
    assert faults >= {"undefined-position", "spindle-off"}


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
    with pytest.raises(Gcode2KrlError) as caught:
        read(f"G21 G0 X0 Y0 Z0 F100\n{block}\nM2\n")
    assert caught.value.issues[0].line == 2


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
    if fits == "refused":
        with pytest.raises(Gcode2KrlError) as caught:
            read(text)
        (found,) = caught.value.issues
        assert (found.code, found.line) == ("arc-radius-mismatch", 2)
        assert f"differ by {end_mm - 2 * i_mm:.4f} mm" in found.message
        assert f"{4 if unit > 1 else 3} decimals" in found.remedy
        return
    issues = [i for i in read(text).issues if i.code == "arc-radius-differs"]
    assert len(issues) == (fits == "spiral")
    for found in issues:
        assert (found.severity, found.line) == ("warning", 2)
        assert f"{end_mm - 2 * i_mm:.4f} mm" in found.message
        assert f"{4 if unit > 1 else 3} decimals" in found.remedy


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
    with pytest.raises(Gcode2KrlError) as caught:
        read(text)
    (found,) = caught.value.issues
    assert (found.code, found.line) == ("arc-radius-mismatch", 2)
    assert "2 more (lines 3, 4)" in found.message
    assert "G90.1" in found.remedy


# --- whose length it is ----------------------------------------------------------------------------


def cell_from_table(tmp_path) -> Cell:
    path = tmp_path / "cell.toml"
    path.write_text('based_on = "demonstration"\n[program]\ntool_length = "from_table"\n', encoding="ascii")
    return load_cell(path)


def test_a_length_from_the_table_holds_from_the_tool_change_on(tmp_path):
    cell = cell_from_table(tmp_path)
    text = "G21 G90 G49\nT1 M6\nG0 X0 Y0 Z5\nG49\nX1\nT2 M6\nX2\nZ5\nT0 M6\nX3\nM2\n"
    toolpath = read(text, cell)
    np.testing.assert_array_equal(toolpath.length_offset_tool[1:], [1, 1, 2, 2, -1])
    lengths = [cell.tool[n].length_mm for n in (1, 1, 2, 2)]
    np.testing.assert_allclose(toolpath.length_offset_mm[1:5], lengths)
    as_g43 = read(text.replace("G49\nX1", "X1").replace("M6\n", "M6\nG43\n"), load_cell())
    np.testing.assert_allclose(toolpath.position_mm, as_g43.position_mm)
    np.testing.assert_array_equal(toolpath.known, as_g43.known)


def test_another_h_than_the_tool_is_still_another_length(tmp_path):
    toolpath = read("G21 T1 M6\nG43 H2\nG0 X0 Y0 Z5\nM2\n", cell_from_table(tmp_path))
    assert toolpath.length_offset_tool[-1] == 2
    assert "h-differs" in [i.code for i in toolpath.issues]
