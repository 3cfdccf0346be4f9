"""Subprograms of a Sinumerik: called by name or by L and a number, found beside the program; CASE, GOTOC."""

import numpy as np
import pytest

from gcode2krl import Gcode2KrlError, read_gcode
from gcode2krl.gcode.dependencies import possible_files
from tests.reference import controls

HEAD = "G710 G90 G17 G94 G54\nG0 X0 Y0 Z5\nF100\n"


def write(folder, lines, **subprograms):
    for name, text in subprograms.items():
        (folder / f"{name}.SPF").write_text(text + "\n")
    main = folder / "PART.MPF"
    main.write_text(f"{HEAD}{lines}\nM30\n")
    return main


def places(folder, lines, **subprograms):
    """Return the places behind the head, (n, 3)."""
    main = write(folder, lines, **subprograms)
    return read_gcode(main, dialect="sinumerik").position_mm[2:].tolist()


def refusal(folder, lines, **subprograms):
    main = write(folder, lines, **subprograms)
    with pytest.raises(Gcode2KrlError) as refused:
        read_gcode(main, dialect="sinumerik")
    return next(issue for issue in refused.value.issues if issue.severity == "error")


SLOT = "; a slot\nPROC SLOT(REAL LENGTH, INT TIMES, BOOL BACK)\nX=LENGTH Y=TIMES\nIF BACK\nX0\nENDIF\nRET"


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("SLOT(7,2)", [[7, 2, 5]]),
        ("N40 SLOT ( 3+4 , 2.4 , TRUE ) ; twice", [[7, 2, 5], [0, 2, 5]]),
        ("R1=7\nslot(R1*2,,0)", [[14, 0, 5]]),
        ("EXTERN SLOT(REAL,INT,BOOL)\nSLOT", [[0, 0, 5]]),
        ("SLOT(,3)\nX9", [[0, 3, 5], [9, 3, 5]]),
        ("SLOT(1,1)\nSLOT(2,2)", [[1, 1, 5], [2, 2, 5]]),
        ("FOR R1=1 TO 2\nSLOT(R1,R1)\nENDFOR", [[1, 1, 5], [2, 2, 5]]),
        ("IF R5==0 GOTOF GO_ON\nX99\nGO_ON: SLOT(4)", [[4, 0, 5]]),
    ],
)
def test_arguments_go_to_the_names_behind_proc_and_what_is_left_out_is_0(tmp_path, lines, expected):
    assert places(tmp_path, lines, SLOT=SLOT) == expected
    again = controls.siemens(f"{HEAD}{lines.replace('TRUE', '1').replace('2.4', '2')}\nM30\n", {"SLOT": SLOT})
    assert [list(place) for place in again[1:]] == expected


def test_a_subprogram_is_run_as_often_as_p_says_and_shares_r_parameters(tmp_path):
    step = "%_N_STEP_SPF\nR1=R1+1\nG91 X1\nG90 M17"
    assert places(tmp_path, "STEP P3\nY=R1", STEP=step)[-1] == [3, 3, 5]
    assert places(tmp_path, "L6 P=2", L6="G91 Y2\nG90\nRET")[-1] == [0, 4, 5]
    assert places(tmp_path, "L6", L6="X1\nY1 M17\nX50")[-1] == [1, 1, 5]


def test_variables_belong_to_their_own_program(tmp_path):
    """The same name in both, and one in a subprogram of the subprogram."""
    outer = "PROC OUTER(REAL DEPTH)\nDEF REAL WIDTH=DEPTH*2\nINNER(WIDTH)\nX=WIDTH\nRET"
    inner = "PROC INNER(REAL WIDTH)\nDEF REAL DEPTH\nDEPTH=WIDTH+1\nY=DEPTH\nRET"
    found = places(tmp_path, "DEF REAL WIDTH=50\nOUTER(3)\nX=WIDTH", OUTER=outer, INNER=inner)
    assert found == [[0, 7, 5], [6, 7, 5], [50, 7, 5]]


def test_labels_and_loops_of_a_subprogram_are_its_own(tmp_path):
    sub = (
        "R1=0\nNEXT: R1=R1+1\nX=R1\nIF R1<3 GOTOB NEXT\nREPEAT NEXT_A NEXT_E P=1\nRET\nNEXT_A: Y1\nNEXT_E: Y2"
    )
    found = places(tmp_path, "GOTOF NEXT\nX77\nNEXT: SUB\nY9", SUB=sub)
    assert found == [[1, 0, 5], [2, 0, 5], [3, 0, 5], [3, 1, 5], [3, 2, 5], [3, 9, 5]]


def test_rows_of_a_subprogram_name_the_line_that_calls_it(tmp_path):
    toolpath = read_gcode(write(tmp_path, "X1\nSLOT(7)", SLOT=SLOT), dialect="sinumerik")
    assert toolpath.source_line[2:].tolist() == [4, 5]


def test_files_of_subprograms_are_told(tmp_path):
    main = write(tmp_path, "OUTER", OUTER="inner\nRET", INNER="X1\nRET", OTHER="X2\nRET")
    assert possible_files(main, ()) == (tmp_path / "INNER.SPF", tmp_path / "OUTER.SPF")
    (tmp_path / "sub.spf").write_text("X5\nRET\n")
    assert places(tmp_path, "SUB")[-1] == [5, 0, 5]


@pytest.mark.parametrize(
    ("lines", "sub", "code", "says"),
    [
        ("OTHER(1)", "RET", "subprogram-missing", "beside the program"),
        ("L7", "RET", "subprogram-missing", "NAME.SPF"),
        ("SUB(1)", "PROC SUB\nRET", "o-word", "at most as many arguments"),
        ("SUB(1) P2", "PROC SUB(REAL WIDE)\nRET", "o-word", "P, how often"),
        ("SUB(1", "PROC SUB(REAL WIDE)\nRET", "dialect-statement", ""),
        ("SUB P0", "RET", "o-word", "how often"),
        ("X5 SUB", "RET", "dialect-statement", "subprograms"),
        ("SUB", "PROC SUB(VAR REAL WIDE)\nRET", "o-word", "by reference"),
        ("SUB", "PROC SUB SAVE\nRET", "o-word", "SAVE"),
        ("SUB", "PROC SUB(STRING[9] NAME)\nRET", "o-word", "REAL, INT or BOOL"),
        ("SUB", "SUB\nRET", "o-word", "calls itself"),
        ("SUB", "X1\nM30", "o-word", "M17 or RET"),
        ("SUB", "X1 M17 Y3", "o-word", "the last word"),
        ("SUB", "X1", "o-word", "ends within a subprogram"),
        ("SUB", "AA: X1\nRET\nBB: X2\nREPEAT AA BB", "", ""),
        ("SUB", "GOTOF CC\nAA: X1\nRET\nBB: X2\nCC: REPEAT AA BB\nRET", "o-word", "jump leads out"),
        ("MCALL SUB", "RET", "dialect-statement", ""),
    ],
)
def test_a_call_that_is_not_sure_is_refused(tmp_path, lines, sub, code, says):
    if not code:
        assert places(tmp_path, lines, SUB=sub)
        return
    first = refusal(tmp_path, lines, SUB=sub)
    assert first.code == code
    assert says in f"{first.message} {first.remedy}"
    assert "line" not in first.message or first.line == 0 or first.line == 4


def test_an_error_in_a_subprogram_names_its_file_and_line(tmp_path):
    found = refusal(tmp_path, "SUB", SUB="X1\nX=1/0\nRET")
    assert found.file_line == 2
    assert "SUB.SPF" in found.message


CASE = (
    "CASE {} OF 1 GOTOF ONE 2 GOTOF TWO -1 GOTOF LESS DEFAULT GOTOF OTHER\n"
    "ONE: X10\nGOTOF LAST\nTWO: X20\nGOTOF LAST\nOTHER: X30\nGOTOF LAST\nLESS: X40\nLAST: Y1"
)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("R1=1\n" + CASE.format("R1"), [[10, 0, 5], [10, 1, 5]]),
        ("R1=2\n" + CASE.format("R1"), [[20, 0, 5], [20, 1, 5]]),
        ("R1=2+5\n" + CASE.format("R1"), [[30, 0, 5], [30, 1, 5]]),
        ("R1=-1\n" + CASE.format("R1"), [[40, 0, 5], [40, 1, 5]]),
        ("CASE (R1+3) OF 1 GOTOF ONE\nX5\nONE: Y5", [[5, 0, 5], [5, 5, 5]]),
        ("GOTOC NOWHERE\nX5\nGOTOC LAST\nX6\nLAST: Y5", [[5, 0, 5], [5, 5, 5]]),
    ],
)
def test_case_leads_to_the_label_of_its_value(tmp_path, lines, expected):
    assert places(tmp_path, lines) == expected


@pytest.mark.parametrize(
    "line",
    [
        "CASE 1.5 OF 1 GOTOF ONE",
        "CASE 1 OF ONE",
        "CASE 1 OF 1 GOTOF ONE X3",
        "CASE 1 OF 1 GOTOF TWO",
    ],
)
def test_a_case_that_leads_nowhere_sure_is_refused(tmp_path, line):
    assert refusal(tmp_path, f"{line}\nONE: X1").code == "o-word"


def test_the_steps_of_a_subprogram_that_drills(tmp_path):
    """MCALL stays in force in a subprogram: its moves are drilled too."""
    row = "PROC ROW(REAL STEP, INT NUMBER)\nDEF INT KK\nFOR KK=1 TO NUMBER\nX=KK*STEP\nENDFOR\nRET"
    found = np.array(places(tmp_path, "MCALL CYCLE81(10,0,2,-8)\nROW(10,3)\nMCALL", ROW=row))
    assert found[found[:, 2] == -8][:, 0].tolist() == [10, 20, 30]
