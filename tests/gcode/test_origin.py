"""Who wrote a file: foreign ones get one sentence; a control is named by its marks, and read both ways."""

import time

import pytest

from gcode2krl import load_cell, read_gcode
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode.origin import cam_of, control_of
from tests.gcode import errors

MILL = (
    "G21 G17 G90 G94 G40 G49 G80\nG54\nT1 M6\nS8000 M3\nG43 H1 G0 Z30.\nG0 X0. Y0.\nG0 Z2.\nG1 Z-1. F300.\n"
)
END = "G0 Z30.\nM5\nM30\n"
FOREIGN = {
    "Okuma": "$SHAFT.MIN%\nO7\nG15 H2\nG0 X0 Y0\nG56 HA Z40\nG1 X5 F100\nM2\n",
    "DIN/ISO of a Heidenhain": "%PLATE G71 *\nN10 G30 G17 X+0 Y+0 Z-20*\nN20 G31 G90 X+100 Y+80 Z+0*\n"
    "N30 T4 G17 S1200*\nN40 G00 G40 G90 Z+50*\nN99999 %PLATE G71 *\n",
    "MillPlus": "%PM9001\nN9001 (PLATE)\nN1 G17 T1 M6\nN2 G0 X0 Y0 Z50\nN3 G1 X5 F100\nN4 M30\n",
    "3D printer": ";FLAVOR:Marlin\nM104 S210\nG28\nG92 E0\nG1 X5 Y5 F900 E0.4\n",
    "plasma": "G21\nF#<_hal[plasmac.cut-feed-rate]>\nG0 X1 Y1\nM3 S1\nG1 X5\nM5\nM2\n",
    "laser": "; a laser\nG21 G90\nM4\nG0 X1 Y1\nG1 X5S500F900\nM5\nM2\n",
    "lathe": "%\nO0020\nG21 G99\nT0303\nG0 X40. Z5.\nG1 Z-20. F0.2\nU2. W-1.\nM30\n%\n",
    "circuit board": "M48\nMETRIC,TZ\nT1C0.800\n%\nT1\nX10Y10\nM30\n",
    "STEP": "ISO-10303-21;\nHEADER;\nENDSEC;\nEND-ISO-10303-21;\n",
    "DXF": "  0\nSECTION\n  2\nHEADER\n  0\nEOF\n",
    "STL": "solid part\n facet normal 0 0 1\n  outer loop\n",
    "APT": "PARTNO/PLATE\nLOADTL/1\nFEDRAT/500,MMPM\nGOTO/1,2,3\nGOTO/4,5,6\nFINI\n",
    "HPGL": "IN;SP1;PU100,100;PD200,100;\n",
    "subprogram": "%_N_SLOT_SPF\n; a slot\nN10 PROC SLOT(REAL LENGTH)\nG1 X=LENGTH\nRET\n",
    "KRL": "&ACCESS RVP\n&REL 1\nDEF PART()\nPTP HOME\nEND\n",
    "cell file": 'based_on = "demonstration"\n[tool.1]\ndiameter_mm = 6.0\n',
}


def found(text, dialect="linuxcnc"):
    """Return the errors of a program read from a stream."""
    return errors(text, load_cell(), dialect=dialect)


def refused(tmp_path, text, dialect="linuxcnc"):
    part = tmp_path / "part.nc"
    part.write_text(text)
    with pytest.raises(NotUnderstoodError) as error:
        read_gcode(part, load_cell(), dialect=dialect)
    return error.value.issues


def doubts(tmp_path, text, dialect="linuxcnc"):
    """Return what reading a file says of another control."""
    part = tmp_path / "part.nc"
    part.write_text(text)
    issues = read_gcode(part, load_cell(), dialect=dialect).issues
    return [i for i in issues if i.code in ("other-dialect", "decimal-point")]


@pytest.mark.parametrize("what", FOREIGN)
def test_what_is_no_milling_program_gets_one_sentence(what):
    (issue,) = found(FOREIGN[what])
    assert issue.code in ("not-a-part", "dialect-unknown")
    assert what in issue.message
    assert issue.line
    assert issue.remedy
    assert "dialect" not in issue.remedy


@pytest.mark.parametrize(
    ("text", "title", "line"),
    [
        ("%\nO0001\nG0 X1.\n", "Fanuc", 2),
        ("%\nO0001(A PART)\nG0 X1.\n", "Fanuc", 2),
        ("(A PART)\n:1234\nG0 X1.\n", "Fanuc", 2),
        ("G0 X1.\nG187 P3\n", "Fanuc", 2),
        ("G0 X1.\nIF [#1 GT 2] GOTO 5\n", "Fanuc", 2),
        ("%_N_PART_MPF\nG0 X1\n", "Sinumerik", 1),
        ("G0 X1\nMCALL CYCLE81(10,0,2,-8)\n", "Sinumerik", 2),
        ("G0 X=IC(5)\n", "Sinumerik", 1),
        ("$H\nG0 X1\n", "Grbl", 1),
        ("(post for grbl)\nG0 X1\n", "Grbl", 1),
        ("o100 sub\nG0 X1\no100 endsub\n", "LinuxCNC", 1),
        ("#<deep> = 4\n", "LinuxCNC", 1),
    ],
)
def test_a_control_is_named_by_its_own_marks(text, title, line):
    mark = control_of(text.encode())
    assert title in mark.control.title
    assert mark.line == line


@pytest.mark.parametrize(
    "text", [MILL + END, "%\n(1001)\n" + MILL + END + "%\n", "G0 X1 (O0001, G187)\nM2\n"]
)
def test_what_any_control_writes_names_none(text):
    assert control_of(text.encode()) is None


def test_the_cam_system_is_read_from_the_comments_at_the_top():
    assert cam_of(b"(Exported by FreeCAD)\nG0 X1\n") == "FreeCAD"
    assert cam_of(b"G0 X1\n") == ""


@pytest.mark.parametrize(
    ("line", "word"),
    [
        ("G0 Z30.\nG81 X10. Y10. Z-8. R2. F200.\nG80", "goes elsewhere"),
        ("G4 P50\nG1 X5.", "0.05 s there, 50 s here"),
        ("G92 X0. Y0.", "G92"),
    ],
)
def test_a_fanuc_program_is_not_read_with_another_meaning(tmp_path, line, word):
    (doubt,) = doubts(tmp_path, f"%\nO0001\n{MILL}{line}\n{END}%\n")
    assert (doubt.severity, doubt.code) == ("warning", "other-dialect")
    assert word in doubt.message
    assert "O0001 (line 2)" in doubt.message
    assert not doubts(tmp_path, f"{MILL}{line}\n{END}"), "nothing tells a Fanuc"


def test_where_both_read_the_same_nothing_is_said(tmp_path):
    assert not doubts(tmp_path, f"%\nO0001\n{MILL}G1 X5. F500.\n{END}%\n")
    assert not doubts(tmp_path, f"%\nO0001\n{MILL}G4 P0.5\nG1 X5. F500.\n{END}%\n"), "as on a Haas"
    assert not doubts(tmp_path, f"(made for Grbl)\n{MILL}G1 X5. F500.\n{END}")


def test_numbers_without_a_point_under_a_fanucs_head_are_a_warning(tmp_path):
    (doubt,) = doubts(tmp_path, f"%\nO0001\n{MILL}G1 X5 F500.\n{END}%\n")
    assert (doubt.severity, doubt.code, doubt.line) == ("warning", "decimal-point", 11)
    assert not doubts(tmp_path, f"%\nO0001\n{MILL}G1 X5 F500.\n{END}%\n", "fanuc-calculator")


@pytest.mark.parametrize(
    ("text", "dialect"),
    [
        ("$H\nG21\nG0 X1 Y1 Z1\nM2\n", "grbl"),
        ('G710 G90\nMSG("A")\nG0 X=1 Y1 Z1\nM30\n', "sinumerik"),
        ("G21\nG50.1\nG0 X1. Y1. Z1.\nM30\n", "fanuc"),
        ("G21\nG187 P3\nG0 X1 Y1 Z1\nM30\n", "fanuc-calculator"),
    ],
)
def test_one_sentence_names_the_dialect_and_it_reads_the_program(tmp_path, text, dialect):
    (issue,) = refused(tmp_path, text)
    assert issue.code == "other-dialect"
    assert f"--dialect {dialect}" in issue.remedy
    assert not [i for i in found(text, dialect) if i.severity == "error"]


def test_what_the_named_dialect_refuses_then_is_told_beforehand(tmp_path):
    text = "G710 G90\nG0 X=1 Y1 Z1\nCYCLE72(1)\nM30\n"
    (issue,) = refused(tmp_path, text)
    first = next(i for i in found(text, "sinumerik") if i.severity == "error")
    assert f"line {first.line}: {first.message}" in issue.remedy


def test_a_mistake_that_stays_is_no_matter_of_the_dialect(tmp_path):
    issues = refused(tmp_path, f"%\nO0001\n{MILL}G1 X\n{END}%\n")
    assert [(i.code, i.line) for i in issues] == [("no-number", 11)]
    assert "--dialect" not in issues[0].remedy


def test_a_refusal_about_meaning_names_no_other_dialect(tmp_path):
    """A move that is too short for the tool is not longer in a dialect that leads in otherwise."""
    (issue,) = refused(tmp_path, f"{MILL}G41 D1\nG1 X5 Y0 F500\nG1 X50\nG40 G1 X60\n{END}")
    assert issue.code == "cutter-entry"
    assert "--dialect" not in issue.remedy


@pytest.mark.parametrize("line", ["(" + " " * 60 + ")", "", " " * 60, "O<" * 30, "N10 ", "; " + "-" * 60])
def test_a_mark_is_looked_for_in_a_time_that_grows_with_the_text(line):
    """Twice the text takes some twice the time, not its square or cube."""
    text = (f"{line}\n" * 6000).encode()
    begun = time.process_time()
    assert control_of(text) is None
    assert time.process_time() - begun < 2.0  # some hundredths; where blanks are passed in two ways, hours


def test_a_doubt_about_g41_names_the_dialect_and_the_keys_of_the_cell(tmp_path):
    contour = "G0 X-30. Y-30.\nG41 D1 G1 X0. Y-20. F800.\nY40.\nX50.\nY0.\nX-20.\nG40 X-30. Y-30.\n"
    (found,) = doubts(tmp_path, "%\nO0001\n" + MILL + contour + END)
    assert found.remedy.startswith("--dialect fanuc, and state lead_in")


@pytest.mark.parametrize(
    "text", ["DEF INT NUMBER=2\nG1 X=NUMBER F100\nM30\n", "DEF STRING[9] TEXT\nG0 X1\nM30\n"]
)
def test_a_program_that_defines_variables_is_a_sinumerik_s_and_no_krl(text):
    assert "Sinumerik" in control_of(text.encode()).control.title
    assert "not-a-part" not in {issue.code for issue in found(text, "sinumerik")}
