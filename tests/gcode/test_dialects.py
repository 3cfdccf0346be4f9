"""Dialects: the same motion as plain G-code says it, and nothing that is read otherwise than it is meant."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import read_gcode
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.files.program_names import DIALECT_NAMES
from gcode2krl.gcode import dialect_marks as marks
from gcode2krl.gcode.dialects import DIALECTS, REASONS
from tests.gcode import Control, errors, read, refusal

HEAD = "G21 G90 G17\nG0 X0. Y0. Z5.\n"
FANUC = Control(HEAD, "M30", "fanuc")
SIEMENS = "G710 G90 G17\nG0 X0 Y0 Z5\n"
SINUMERIK = Control(SIEMENS, "M30", "sinumerik")


def same(text, dialect, plain):
    """Assert that a program of a dialect moves as a plain one does."""
    found, wanted = read(text, dialect=dialect), read(plain)
    for name, apart in (("position_mm", 1e-9), ("dwell_s", 1e-12), ("feed_mm_s", 1e-9)):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=1e-12, atol=apart)
    for name in ("rapid", "exact_stop", "machine"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))


def test_the_names_are_those_of_the_tables():
    assert tuple(DIALECTS) == DIALECT_NAMES


@pytest.mark.parametrize("name", DIALECT_NAMES)
def test_a_table_is_whole(name):
    dialect = DIALECTS[name]
    table = dialect.core_g()
    assert table.shape == (marks.MOST_CODES + 1,)
    assert table.min() >= marks.CODE_REFUSED - len(REASONS) + 1
    text, kinds = dialect.names()
    assert bytes(text).count(b"\n") == len(kinds)
    assert all(
        kind // marks.KIND_STEP < len(REASONS) for kind in kinds if kind % marks.KIND_STEP == marks.REFUSED
    )


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("G4 P1500\nG1 X10. F100\n", "G4 P1.5\nG1 X10 F100\n"),
        ("G4 X2.\nG1 X10. F100.\n", "G4 P2\nG1 X10 F100\n"),
        ("G4 U0.5\nG1 X1. F100\n", "G4 P0.5\nG1 X1 F100\n"),
        ("G1 G9 X1. F100\nX2.\n", "G61 G1 X1 F100\nG64 X2\n"),
        ("G63\nG1 X1. F100\n", "G64\nG1 X1 F100\n"),
        ("G15 G69 G50.1 G40 G80\nG5.1 Q1\nG1 X1. F100\nG5.1 Q0\n", "G1 X1 F100\n"),
        ("/2 G1 X1. F100\n", "G1 X1 F100\n"),
        ("G1 X0 Y-0 Z1. F100\n", "G1 X0 Y0 Z1 F100\n"),
        ("G99 G82 X5. Z-5. R1. P500 F100\nX8.\nG80\n", "G99 G82 X5 Z-5 R1 P0.5 F100\nX8\nG80\n"),
        (
            "G81 X5. Z-5. R1. F100\nG91 X2. Z-6. R-4. K3\nG80\n",
            "G98\nG81 X5 Z-5 R1 F100\nG91 X2 Z-6 R-4 L3\nG80\n",
        ),
        ("G2 X10. Y0 R5. F100\n", "G2 X10 Y0 R5 F100\n"),
        ("G99 G81 X5. Z-5. R1. F100\nG80\nZ9.\n", "G99 G81 X5 Z-5 R1 F100\nG0 Z9\n"),
        ("G1 X1. F100\nG99 G81 X5. Z-5. R1.\nG80\nZ9.\n", "G1 X1 F100\nG99 G81 X5 Z-5 R1\nG1 Z9\n"),
        ("G80\nZ9.\n", "G0 Z9\n"),
        ("G187 P2\nG103 P1\nG1 X1. F100\nG187\nG103\n", "G1 X1 F100\n"),
        ("G1 X1. D36 F100\nD2\nX2.\n", "G1 X1 F100\nX2\n"),
    ],
)
@pytest.mark.parametrize("name", ["O0001 (PART)", ":1234"])
def test_fanuc(text, plain, name):
    same(f"%\n{name}\n{HEAD}{text}M30\n%\n", "fanuc", f"{HEAD}{plain}M30\n")


def test_an_arc_before_a_cycle_is_in_force_again_behind_g80():
    found = FANUC.errors("G2 X10. Y0. R5. F100\nG99 G81 X5. Z-5. R1.\nG80\nX9.")
    assert [issue.code for issue in found] == ["arc-no-centre"]


@pytest.mark.parametrize(
    ("dialect", "unit", "x", "mm"),
    [
        ("fanuc-calculator", "G21", "100", 100.0),
        ("fanuc-increments", "G21", "100", 0.1),
        ("fanuc-increments", "G20", "10000", 25.4),
    ],
)
def test_a_number_without_a_point_goes_by_the_dialect(dialect, unit, x, mm):
    text = f"{unit} G90\nG0 X0 Y0 Z1.\nG1 X{x} F10.\nM30\n"
    assert read(text, dialect=dialect).position_mm[-1, 0] == pytest.approx(mm, abs=1e-9)


@pytest.mark.parametrize("lines", ["G1 X100 F500", "G20\nG1 X1. F10"])
def test_a_number_without_a_point_is_never_guessed(lines):
    assert FANUC.refused(lines) == ("decimal-point", 1 + lines.count("\n"))


def test_grbl_starts_in_mm_with_g0():
    same("$H\n$X\nZ5\nX1 Y1\nG1 Z-1F100\nM2\n", "grbl", "G21\nG0 Z5\nX1 Y1\nG1 Z-1 F100\nM2\n")
    issues = read("$H\nX1 Y1 Z1\nM2\n", dialect="grbl").issues
    assert not [i for i in issues if i.severity == "warning"]


@pytest.mark.parametrize("line", ["$J=G91 X10", "$32=1", "$100=250"])
def test_grbl_settings_and_jogs_are_refused(line):
    assert [i.code for i in errors(f"G21\n{line}\nG0 X1\nM2\n", dialect="grbl")] == ["dialect-statement"]


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("X=5 Y=-2.5\n", "X5 Y-2.5\n"),
        ("G0 X10 Y10\nX=IC(5) Y=IC(-1)\nX=AC(3)\n", "G0 X10 Y10\nX15 Y9\nX3\n"),
        ("G0 X10\nG91 X=AC(4) Y2\nX1\n", "G0 X10\nX4 Y2\nX5\n"),
        ("G1 F=500 X10\nG2 X20 Y0 CR=5\n", "G1 F500 X10\nG2 X20 Y0 R5\n"),
        ("G1 F500 X10\nG3 X0 Y0 CR=-5.5\n", "G1 F500 X10\nG3 X0 Y0 R-5.5\n"),
        ("G1 F500 X10\nG3 X0 Y0 I=AC(5) J=AC(0)\n", "G1 F500 X10\nG3 X0 Y0 I-5 J0\n"),
        ("G1 F500 X10\nG3 X10 Y0 Z1 I-5 J0 TURN=2\n", "G1 F500 X10\nG3 X10 Y0 Z1 I-5 J0 P3\n"),
        ("G4 F1.5\nG0 X1\n", "G4 P1.5\nG0 X1\n"),
        ("S1=600 M1=3\nG4 S30\nG0 X1\n", "S600 M3\nG4 P3\nG0 X1\n"),
        ("G0 SUPA Z0 D0\n", "G53 G0 Z0\n"),
        ("G60 G1 X1 F100\nG641 ADIS=0.1\nX2\n", "G61 G1 X1 F100\nG64 X2\n"),
        ('MSG("A ; (b)")\nCYCLE832(0.01,_FINISH,1)\nCOMPCAD SOFT FFWON\nTRAORI\nG0 X1\nTRAFOOF\n', "G0 X1\n"),
        ('WORKPIECE(,"",,"BOX",112,0,-20,-80,0,0,100,100)\nSTOPRE\nG0 X1\n', "G0 X1\n"),
        ("/3 N10 G0 X1\n", "G0 X1\n"),
        ("START:\nG0 X1\n", "G0 X1\n"),
    ],
)
def test_sinumerik(text, plain):
    same(f"%_N_PART_MPF\n;$PATH=/_N_WKS_DIR\n{SIEMENS}{text}M17\n", "sinumerik", f"{HEAD}{plain}M30\n")


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("TRANS X10 Y=5\nX1 Y1\n", "G52 X10 Y5\nX1 Y1\n"),
        ("TRANS X10 Y5\nATRANS Z-1 X1\nX0 Y0 Z0\n", "G52 X11 Y5 Z-1\nX0 Y0 Z0\n"),
        ("TRANS X10 Y5\nTRANS Y1\nX0 Y0\n", "G52 X0 Y1\nX0 Y0\n"),
        ("TRANS X10 Y5\nX1\nTRANS\nX1 Y1\n", "G52 X10 Y5\nX1\nG52 X0 Y0\nX1 Y1\n"),
        ("G700\nTRANS X1\nG710\nX0\n", "G52 X25.4\nX0\n"),
        ("G54\nTRANS X10\nG55\nX0\nSUPA G0 X0\n", "G52 X10\nG55\nX0\nG53 G0 X0\n"),
        ("TRANS X10\nX=IC(5)\nX=IC(5) Y=AC(1)\n", "X5\nX10 Y1\n"),
        ("TRANS X10 Z2\nG91 X1 Y1\nG90 X0\n", "G91 X1 Y1\nG90 X10\n"),
    ],
)
def test_a_sinumerik_shifts_its_zero(text, plain):
    same(SINUMERIK.text(text), "sinumerik", f"{HEAD}{plain}M30\n")


def test_a_shift_of_the_zero_is_told_by_its_name():
    assert {issue.code: issue.message for issue in SINUMERIK.read("TRANS X10\nX0").issues} == {
        "program-offset": "TRANS moves the zero by X10 mm",
        "offset-left": "the shift by X10 mm is in force at the end",
    }


def test_a_message_is_kept():
    events = SINUMERIK.read('N10 MSG("Pocket (1); rough")\nG0 X1').events
    assert events[0].values == {"m": -1, "text": "Pocket (1); rough", "line": 3}


@pytest.mark.parametrize(
    "line",
    [
        *('CYCLE800(1,"TC",0)', "ROT X45", "SCALE X2", "G110 X0", "MCALL CYCLE81(1,2,3)", "GOTOF ENDE"),
        *("IF R1>2 GOTOF A", "R1=", "X=R", "X=IC(R1", "X=5+", "X=IC(5", "X=SIN(3", 'T="MILL"', "D2"),
        *("DEF REAL A", "A3=0 B3=0 C3=1", "G147 X1", "G500 X1", "NONSENSE", "S2=100", "CR", "G58 X1"),
        *(
            "ATRANS",
            "G0 TRANS X10",
            "TRANS X10 G153",
            "TRANS X10 TRANS Y5",
            "TRANS X=IC(5)",
            "AROT",
            "G70",
            "G41",
            "G26 S5000",
            "G92 X0",
            "G20",
            "G4 S30",
            "M3 S600 G4 F1 S3",
            "#1=5",
        ),
        *(
            "X[1+1]",
            "M98 P1000",
            "G55 X=IC(5)",
            "SUPA G0 X=IC(1)",
            "D1 Z=IC(1)",
            "O1 call",
            "G2 X0 Y0 I=IC(3) G54",
        ),
    ],
)
def test_sinumerik_statements_that_are_refused(line):
    assert SINUMERIK.refused(f"{line}\nG0 X1")[1] == 1


def test_a_word_that_counts_needs_a_known_position():
    assert refusal("G710 G90\nG0 X=IC(5)\nM30\n", dialect="sinumerik").code == "undefined-position"


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(-9999, 9999), st.integers(-9999, 9999), st.booleans()), min_size=1, max_size=8
    )
)
def test_counted_words_are_the_points_they_lead_to(steps):
    siemens, plain, x, y = SIEMENS, HEAD, 0.0, 0.0
    for dx, dy, counted in steps:
        if counted:
            siemens += f"X=IC({dx / 1000}) Y=IC({dy / 1000})\n"
            x, y = x + dx / 1000, y + dy / 1000
        else:
            siemens += f"G91 X=AC({dx / 1000}) Y=AC({dy / 1000})\nG90\n"
            x, y = dx / 1000, dy / 1000
        plain += f"X{x:.6f} Y{y:.6f}\n"
    same(siemens + "M30\n", "sinumerik", plain + "M30\n")


@pytest.mark.parametrize("dialect", DIALECT_NAMES[:-1])
@pytest.mark.parametrize(
    "text",
    [
        "0 BEGIN PGM PART MM\n1 BLK FORM 0.1 Z X+0 Y+0 Z-20\n2 L X+10 Y+0 R0 FMAX\n",
        "BEGIN PGM 12 INCH\n",
        "10 TOOL CALL 1 Z S5000\n11 L X+10 Y-5 R0 FMAX M3\n",
    ],
)
def test_conversational_programs_are_one_clear_sentence(dialect, text):
    (issue,) = errors(text, dialect=dialect)
    assert "Heidenhain" in issue.message
    assert issue.remedy == "read it with --dialect heidenhain"


def test_a_dialect_that_is_none_is_told_which_there_are():
    with pytest.raises(NotUnderstoodError, match="fanuc-calculator"):
        read("G21\n", dialect="okuma")


def test_a_line_that_no_dialect_reads_names_none(tmp_path):
    part = tmp_path / "part.nc"
    part.write_text("G21\nG0 X1. Y1. Z1.\nG999 X1.\nM30\n")
    with pytest.raises(NotUnderstoodError) as refused:
        read_gcode(part)
    assert not any("--dialect" in issue.remedy for issue in refused.value.issues)


@pytest.mark.parametrize("dialect", ["grbl", "sinumerik"])
@pytest.mark.parametrize(
    "line", ["#1=5", "G1 X#1", "G1 X[1+1] F100", "O100 sub", "M98 P1000", "M99", "G1 @5. ^30. F100"]
)
def test_programs_that_compute_or_jump_are_not_of_every_dialect(dialect, line):
    """A line that is worked out is read by LinuxCNC's rules: X100 in it would be 100 mm."""
    unit = "G710" if dialect == "sinumerik" else "G21"
    found = refusal(f"{unit} G90\nG0 X0. Y0. Z5.\n{line}\nG0 X1.\nM30\n", dialect=dialect)
    assert (found.code, found.line) == ("dialect-statement", 3)


@pytest.mark.parametrize(
    "line",
    [
        *(
            "G4 P1.5",
            "G4 P500 X1.",
            "G10 L2 P0 X0.",
            "G10 L2 P7 X0.",
            "G91 G10 L2 P1 X1.",
            "G10 L10 P1 R5.",
            "G10 L2 P1 R5.",
            "G92 X0. Y0.",
            "G41 D1",
            "G43.1 Z1.",
            "G59.1",
        ),
        *("G95\nG1 X1. F20", "G93\nG1 X1. F20", "G20\nG1 X1. F10", "G82 X1. Z-1. R1. P0.5 F100"),
        "G83 X1. Z-1. R1. Q2000 F100",
    ],
)
@pytest.mark.parametrize("dialect", ["fanuc", "fanuc-calculator", "fanuc-increments"])
def test_what_hangs_on_the_parameters_of_a_fanuc_is_refused(dialect, line):
    assert FANUC.errors(f"G99\n{line}", dialect=dialect)


@pytest.mark.parametrize(("dialect", "dwell_s"), [("fanuc-increments", 1.5), ("fanuc-calculator", 1500.0)])
def test_times_have_their_own_increments(dialect, dwell_s):
    text = "G20 G90\nG0 X0. Y0. Z1.\nG4 X1500\nM30\n"
    assert read(text, dialect=dialect).dwell_s.sum() == pytest.approx(dwell_s)


@pytest.mark.parametrize("dialect", ["fanuc", "fanuc-calculator", "fanuc-increments"])
def test_a_fanuc_sets_a_work_offset_by_words_as_linuxcnc_does(dialect):
    found = FANUC.places("G10 L2 P2 X10. Y-5. Z1.\nG55\nG0 X1. Y1. Z1.", dialect=dialect)
    assert found[-1].tolist() == [11.0, -4.0, 2.0]


@pytest.mark.parametrize(
    ("line", "dialect", "reason"),
    [
        ("G1 X5. ,R2. F100", "fanuc", "corner"),
        ("G1 X5. , C1. F100", "fanuc-calculator", "corner"),
        ("G1 X5 RND=2 F100", "sinumerik", "corner"),
        ("G1 X5 CHF=1 F100", "sinumerik", "corner"),
        ("G1 X5 CHR=1 F100", "sinumerik", "corner"),
        ("G83 X5. Z-5. R1. Q2. F100 L0", "fanuc", "drill nothing"),
        ("G81 X5. Z-5. R1. F100 K0", "fanuc", "drill nothing"),
        ("G10 L10 P1 R5.", "fanuc", "what the cell states"),
        ("G10 L2 P0 X5.", "fanuc", "G10 L2 P1 to P6"),
        ("G41 D1 G1 X5. F100", "fanuc", "leads in"),
        ("MCALL CYCLE83(10,0,2,-8)", "sinumerik", "first depth"),
        ('T="MILL" D1', "sinumerik", "this name"),
    ],
)
def test_what_is_not_carried_out_is_refused_with_its_own_reason(line, dialect, reason):
    found = (SINUMERIK if dialect == "sinumerik" else FANUC).errors(f"{line}\nG0 X1.", dialect=dialect)
    assert [i.line for i in found] == [1]
    assert reason in found[0].message
    assert "--dialect" not in found[0].remedy


@pytest.mark.parametrize(
    ("text", "dialect", "lines"),
    [
        ("G21\nG0 X1. Y1. Z1.\nG90\nM30\n", "fanuc", [2]),
        ("G21 G90\nG0 X1. Y1. Z1.\nM30\n", "fanuc", []),
        ("G21\nG91 G28 Z0.\nG90 G0 X1. Y1. Z1.\nM30\n", "fanuc", []),
        ("G21\nG0 X1. Y1. Z1.\nM30\n", "linuxcnc", []),
    ],
)
def test_a_fanuc_program_that_leaves_g90_to_the_control_is_told(text, dialect, lines):
    issues = read(text, dialect=dialect).issues
    assert [issue.line for issue in issues if issue.code == "start-unnamed"] == lines
