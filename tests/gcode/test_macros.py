"""Custom macro B of a Fanuc: rows worked out by hand, and what is refused with its line."""

import io

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gcode2krl import Gcode2KrlError, read_gcode
from gcode2krl.gcode import read_stream
from gcode2krl.gcode.program import MOST_STEPS
from tests.gcode import Control, named

FANUC = Control("%\nO0001 (MAIN)\nG21 G90 G17 G94 F500.\nG0 X0. Y0. Z0.\n", "M30", "fanuc")


read, xs, refused = FANUC.read, FANUC.xs, FANUC.refused


def value_of(expression):
    return xs(f"#500={expression}\nG0 X#500")[-1]


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1+2*3", 7.0),
        ("[1+2]*3", 9.0),
        ("10-4-3", 3.0),
        ("2*[3-[4-5]]", 8.0),
        ("-5+2", -3.0),
        ("8/4/2", 1.0),
        ("SIN[30]*2", 1.0),
        ("COS[60]+TAN[45]", 1.5),
        ("ASIN[0.5]", 30.0),
        ("ACOS[-0.5]", 120.0),
        ("ATAN[1]/[1]", 45.0),
        ("ATAN[1]/[-1]", 135.0),
        ("ATAN[0]/[-1]", 180.0),
        ("SQRT[16]+ABS[-3]", 7.0),
        ("ROUND[2.5]+ROUND[-1.4]", 2.0),
        ("FIX[1.9]+FIX[-1.9]", 0.0),
        ("FUP[1.1]+FUP[-1.1]", 0.0),
        ("LN[EXP[2]]", 2.0),
        ("7 MOD 4", 3.0),
        ("-7 MOD 4", -3.0),
        ("12 AND 10", 8.0),
        ("12 OR 3", 15.0),
        ("5 XOR 1", 4.0),
        ("1+12 AND 10", 9.0),
        ("2*4 OR 1", 9.0),
        ("100", 100.0),
        ("[3 GT 2]+[3 LT 2]", 1.0),
    ],
)
def test_a_calculation(expression, value):
    assert value_of(expression) == pytest.approx(value, abs=1e-12)


WAYS = {
    "variables take effect at once": (
        "#1=5\n#[#1+100]=7\n#2=#105\n#105=#105+#2\nG0 X#105\nX-#2\nX[#1*2]",
        [14, -7, 10],
    ),
    "goto forwards and backwards": (
        "#1=1\nN10 G0 X#1\n#1=#1+1\nIF [#1 LE 3] GOTO 10\nGOTO 99\nG0 X50.\nN99 G0 X#1",
        [1, 2, 3, 4],
    ),
    "goto takes the next line of a number, then the first": (
        "#1=0\nN1 G0 X1.\n#1=#1+1\nIF[#1GT2]GOTO3\nGOTO1\nN1 G0 X2.\n#1=#1+1\nGOTO[#1-1]\nN3 G0 X3.",
        [1, 2, 1, 3],
    ),
    "goto back to plain blocks before the first calculation": (
        "N10 G91 G0 X1.\nG90\n#101=#5+1\nIF [#101 GT 1] GOTO 20\n#5=1\nGOTO 10\nN20",
        [1, 2],
    ),
    "then": ("#1=2\nIF [#1 EQ 2] THEN #1=7\nIF [#1 NE 7] THEN #1=9\nG0 X#1", [7]),
    "loops within each other": (
        "#1=1\nWHILE [#1 LE 2] DO1\n#2=1\nWHILE [#2 LE 3] DO2\nG0 X[#1*10+#2]\n#2=#2+1\nEND2\n#1=#1+1\nEND1\n"
        "WHILE [#1 LT 0] DO1\nG0 X99.\nEND1",
        [11, 12, 13, 21, 22, 23],
    ),
    "a loop without a test": ("#1=0\nDO1\n#1=#1+1\nG0 X#1\nIF [#1 EQ 3] GOTO 5\nEND1\nN5", [1, 2, 3]),
    "goto within a loop": (
        "#1=0\nWHILE [#1 LT 3] DO1\n#1=#1+1\nIF [#1 EQ 2] GOTO 5\nG0 X#1\nN5\nEND1",
        [1, 3],
    ),
    "an empty variable is 0, and not equal to it": (
        "G65 P9010 A1.\nM30\nO9010\n#2=#3\nIF [#2 EQ 0] GOTO 9\nIF [#2 NE #0] GOTO 9\nIF [#2 GT 0] GOTO 9\n"
        "G0 X[#2+5]\nM99\nN9 G0 X-1.\nM99",
        [5],
    ),
    "g65 has variables of its own, m98 the caller's": (
        "#1=1\n#100=7\nG65 P2 A5.\nG0 X[#1+10*#100]\nM98 P3\nG0 X#1\nM30\n"
        "O2\n#1=#1+1\n#100=#1\nM99\nO3\n#1=8\nM99",
        [61, 8],
    ),
    "m98 and m99 behind words": ("X5. M98 P2\nX9.\nM30\nO2\nG91 X1.\nG90 X3. M99", [5, 6, 3, 9]),
    "a call of a subprogram before": ("M98 P3\nM30\nO2\nG0 X2.\nM99\nO3\nM98 P2\nG0 X3.\nM99", [2, 3]),
    "labels are those of the own program": (
        "#1=1\nM98 P2\nGOTO 5\nG0 X9.\nN5 G0 X1.\nM30\nO2\nGOTO 5\nG0 X8.\nN5 G0 X2.\nM99",
        [2, 1],
    ),
    "what is passed over may be anything": ("GOTO 5\n#1=1/0\nPOPEN\nIF [] GOTO\nG0 X1 $\nN5 G0 X1.", [1]),
    "inches": ("G20\n#1=0.5\nG0 X[#1*2]", [25.4]),
}


@named(("lines", "expected"), WAYS)
def test_where_a_program_leads(lines, expected):
    assert xs(lines) == pytest.approx(expected)


def test_an_argument_that_is_not_passed_is_empty_and_its_word_is_left_out():
    text = (
        "G65 P9010 A4. X2. K-1.\nG65 P9010 A#0 X3. K1.\nM30\nO9010\n"
        "IF [#1 EQ #0] GOTO 9\nIF [#2 NE #0] GOTO 9\nG0 X#24 Y#25 Z#6\nM99\nN9 G0 X-#24\nM99"
    )
    toolpath = read(text)
    assert toolpath.position_mm[2:].tolist() == [[2.0, 0.0, -1.0], [-3.0, 0.0, -1.0]]
    assert toolpath.issues == ()


@pytest.mark.parametrize("call", ["M98 P1234 L3", "M98 P31234", "M98 P00031234", "M98P1234L3"])
def test_a_subprogram_is_called_several_times(call):
    assert read(f"{call}\nM30\nO1234\nG91 G0 X2.\nG90\nM99").position_mm[-1, 0] == 6.0


@pytest.mark.parametrize("name", ["O1234.nc", "1234.nc", "O1234", "o1234.nc"])
@pytest.mark.parametrize("head", ["%\nO1234 (SIDE)\n", ":1234\n", "", "O77\n"])
def test_a_subprogram_of_another_file_is_found_by_its_number(tmp_path, name, head):
    folder = tmp_path / "macros"
    folder.mkdir()
    (folder / name).write_text(f"{head}G0 X#1\nN5 M99\n%\n")
    main = tmp_path / "part.nc"
    main.write_text(FANUC.text("G65 P1234 A7.\nN5 G0 Y1."))
    if head != "O77\n":
        toolpath = read_gcode(main, dialect="fanuc", search=[folder])
        assert toolpath.position_mm[2:, :2].tolist() == [[7.0, 0.0], [7.0, 1.0]]
        assert toolpath.source_line[2:].tolist() == [5, 6]
    for search in [[folder]] * (head == "O77\n") + [[]]:
        with pytest.raises(Gcode2KrlError) as caught:
            read_gcode(main, dialect="fanuc", search=search)
        assert caught.value.issues[0].code == "subprogram-missing"


def test_rows_have_the_line_that_made_them():
    assert read("M98 P2\nG0 X1.\nM30\nO2\nG0 X2.\nM99").source_line[2:].tolist() == [9, 6]


def test_skip_levels_are_left_out_where_they_are_asked_for():
    text = "#1=1\n/2 #1=5\n/ GOTO 9\nG0 X#1\nN9"
    assert xs(text, block_delete=True) == [1.0]
    assert xs(text) == []


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ("G0 X#100 Y5.", [5]),
        ("IF [#100 EQ #0] GOTO 5\nN5", [5]),
        ("#100=#0\nIF [#100 EQ #0] GOTO 5\nN5", []),
    ],
)
def test_a_variable_that_nothing_has_set_is_told(lines, told):
    issues = read(lines).issues
    assert [(issue.code, issue.line) for issue in issues] == [("parameter-unset", line) for line in told]


def test_a_word_of_a_variable_that_nothing_has_set_is_left_out():
    toolpath = read("G0 X#100 Y5.")
    assert "left out" in toolpath.issues[0].message
    assert toolpath.position_mm[-1].tolist() == [0.0, 5.0, 0.0]


def test_numbers_without_a_point_in_a_line_that_computes_go_by_the_dialect():
    text = "#1=5\nG0 X100 Y#1"
    assert refused(text) == ("decimal-point", 2)
    assert FANUC.places(text, dialect="fanuc-calculator").tolist() == [[100.0, 5.0, 0.0]]
    assert FANUC.places(text, dialect="fanuc-increments") == pytest.approx(np.array([[0.1, 5.0, 0.0]]))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("#1=1/0", ("expression-value", 1)),
        ("#1=SQRT[-1]", ("expression-value", 1)),
        ("#1=#5041", ("expression-value", 1)),
        ("#3003=1", ("expression-value", 1)),
        ("#3000=1 (TOO DEEP)", ("expression-value", 1)),
        ("#4001=1", ("expression-value", 1)),
        ("#34=1", ("expression-value", 1)),
        ("#200=1", ("expression-value", 1)),
        ("#1=#100000", ("expression-value", 1)),
        ("#0=1", ("expression", 1)),
        ("#1.5=1", ("parameter-number", 1)),
        ("#<a>=1", ("expression", 1)),
        ("#1=1 #2=2", ("expression", 1)),
        ("G0 X1. #1=2", ("expression", 1)),
        ("#1", ("expression", 1)),
        ("#1=", ("expression", 1)),
        ("#1=2]", ("expression", 1)),
        ("#1=[2", ("expression", 1)),
        ("#1=2**3", ("expression", 1)),
        ("#1=EXISTS[#2]", ("expression", 1)),
        ("#1=ATAN[-1]/[1]", ("expression-value", 1)),
        ("#1=ASIN[-0.5]", ("expression-value", 1)),
        ("#1=1.5\nG0 X[ROUND[#1]]", ("expression-value", 2)),
        ("#1=1.5 MOD 2", ("expression-value", 1)),
        ("#1=-1 AND 3", ("expression-value", 1)),
        ("#1=0.1+0.2\nIF [#1 EQ 0.3] GOTO 5\nN5", ("expression-value", 2)),
        ("IF [1 EQ 1 AND 2 EQ 2] GOTO 5\nN5", ("expression", 1)),
        ("IF [1 EQ 1] M3", ("expression", 1)),
        ("IF [1 EQ 1] THEN G0 X1.", ("expression", 1)),
        ("IF [1 EQ 1] GOTO 5 X1.\nN5", ("expression", 1)),
        ("IF 1 GOTO 5", ("o-word", 1)),
        ("GOTO 5", ("o-word", 1)),
        ("GOTO", ("expression", 1)),
        ("GOTO 1.5\nN1", ("o-word", 1)),
        ("GOTO 5\nM30\nO2\nN5 M99", ("o-word", 1)),
        ("GOTO 5\nWHILE [1 GT 2] DO1\nN5\nEND1", ("o-word", 1)),
        ("WHILE [1 GT 2]\nEND1", ("o-word", 1)),
        ("WHILE [1 GT 2] DO4\nEND4", ("o-word", 1)),
        ("WHILE [1 GT 2] DO1\nWHILE [1 GT 2] DO2\nEND1\nEND2", ("o-word", 1)),
        ("DO1", ("o-word", 1)),
        ("END1", ("o-word", 1)),
        ("POPEN", ("o-word", 1)),
        ("DPRNT[X#1[53]]", ("o-word", 1)),
        ("M98 P77", ("subprogram-missing", 1)),
        ("M98", ("o-word", 1)),
        ("M98 P31234 L2", ("o-word", 1)),
        ("M98 P30000", ("o-word", 1)),
        ("M98 P2 X1.", ("o-word", 1)),
        ("M99", ("o-word", 1)),
        ("M98 P2\nM30\nO2\nM99 P5", ("o-word", 4)),
        ("M98 P2\nM30\nO2\nM99\nO2\nM99", ("o-word", 1)),
        ("M98 P2\nM30\nO2\nG0 X1.\nO3\nM99", ("o-word", 5)),
        ("#1=1\nO2\nM99", ("o-word", 2)),
        ("G0 X1.\nO2\nM99", ("o-word", 2)),
        ("M98 P2\nM30\nO2\nG0 X1.", ("o-word", 5)),
        ("M98 P2\nM30\nO2\nM98 P2\nM99", ("calls-too-deep", 4)),
        ("G65 A1.", ("o-word", 1)),
        ("G65 P2 A1", ("o-word", 1)),
        ("G65 P2 A1. A2.", ("o-word", 1)),
        ("G65 P2 J1. I2.", ("o-word", 1)),
        ("G65 P2 L3 A1.", ("o-word", 1)),
        ("G90 G65 P2", ("o-word", 1)),
        ("G66 P2", ("dialect-code", 1)),
        ("N10 GOTO 10", ("endless-loop", 1)),
        ("WHILE [1 EQ 1] DO1\nEND1", ("endless-loop", 2)),
        ("N10 #1=5\nIF [#1 GT 3] GOTO 10", ("endless-loop", 2)),
    ],
)
def test_what_is_refused(text, found):
    assert refused(text) == found


def test_a_caret_stands_before_the_statement():
    assert FANUC.refusal("N7 GOTO 5").excerpt == "N7 ^GOTO 5"


def test_no_dialect_is_recommended_that_never_reached_the_line(tmp_path):
    main = tmp_path / "part.nc"
    main.write_text(FANUC.text("G65 P2 A1.\nM30\nO2\nIF [#2 EQ #0] THEN #3000=1\nM99"))
    with pytest.raises(Gcode2KrlError) as caught:
        read_gcode(main, dialect="fanuc")
    assert "--dialect" not in caught.value.issues[0].remedy


def test_a_step_limit_is_one_for_all_dialects():
    found = FANUC.refusal("#1=0\nN1 #1=#1+1\nGOTO 1")
    assert f"{MOST_STEPS // 1_000_000},000,0" in found.message


def _sums(values):
    """Return expressions as Python writes them: each operator between two, some in brackets."""
    return st.builds(
        lambda left, operator, right, bracket: (
            f"({left}{operator}{right})" if bracket else f"{left}{operator}{right}"
        ),
        values,
        st.sampled_from("+-*"),
        values,
        st.booleans(),
    )


@settings(max_examples=150, deadline=None)
@given(st.recursive(st.integers(0, 9).map(str), _sums, max_leaves=12))
def test_ranks_and_brackets_are_those_of_arithmetic(expression):
    assume(abs(eval(expression)) < 1e6)  # a coordinate beyond is refused
    of_fanuc = expression.replace("(", "[").replace(")", "]")
    assert value_of(of_fanuc) == pytest.approx(eval(expression), rel=1e-12)
    siemens = f"G710 G90\nG0 X0 Y0 Z0\nR1={expression}\nX=R1\nM30\n"
    found = read_stream(io.BytesIO(siemens.encode()), "part.mpf", dialect="sinumerik")
    assert found.position_mm[-1, 0] == pytest.approx(eval(expression), rel=1e-12)


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 5),
    st.integers(1, 3),
    st.integers(-5, 5),
    st.integers(1, 4),
)
def test_loops_run_as_those_of_linuxcnc_do(start, step, shift, inner):
    """The same loops in O-words, whose rows are compared with LinuxCNC's own elsewhere."""
    macro = (
        f"#1={start}\nWHILE [#1 LT 9] DO1\n#2=0\nWHILE [#2 NE {inner}] DO2\nG1 X[#1*10+#2] Y[#2-{shift}]\n"
        f"#2=#2+1\nEND2\nIF [#1 GT 6] GOTO 5\n#1=#1+{step}\nEND1\nN5 G0 Z#1\nM30\n"
    )
    o_words = (
        f"#1={start}\nO1 while [#1 LT 9]\n#2=0\nO2 while [#2 NE {inner}]\nG1 X[#1*10+#2] Y[#2-{shift}]\n"
        f"#2=[#2+1]\nO2 endwhile\nO3 if [#1 GT 6]\nO1 break\nO3 endif\n#1=[#1+{step}]\nO1 endwhile\n"
        "G0 Z#1\nM30\n"
    )
    head = "G21 G90 G17 G94 F500.\nG0 X0. Y0. Z0.\n"
    found = read_stream(io.BytesIO((head + macro).encode()), "part.nc", dialect="fanuc")
    wanted = read_stream(io.BytesIO((head + o_words).encode()), "part.ngc")
    assert found.position_mm.tolist() == wanted.position_mm.tolist()
    assert found.rapid.tolist() == wanted.rapid.tolist()


def test_a_call_that_gives_what_the_macro_never_reads_is_told():
    text = "G65 P9010 X5. Z-1. Q3.\nM30\nO9010\nIF [#26 EQ #0] GOTO 5\nG0 X#24 Z#26\nN5 M99"
    (issue,) = (issue for issue in read(text).issues if issue.code == "argument-count")
    assert issue.line == 5
    assert "gives Q, which" in issue.message


@pytest.mark.parametrize(
    "text",
    [
        "#1=5 (a) #2=6",
        "#1=5 (a) G0 X5.",
        "#1=5 (a) +3",
        "IF [1 EQ 1] THEN #1=5 (a) #2=6",
        "GOTO 5 (a) + 3",
        "WHILE [1 LT 0] DO1 (a) G0 X5.\nEND1",
        "WHILE [1 LT 0] (a) DO1\nEND1",
        "WHILE [1 LT 0] ;] DO1\nEND1",
        "#1=5; X3.",
        "#1=5\nG0 X1.; Y#1",
        "#1=5\n(a) N5 G0 X1.",
    ],
)
def test_nothing_is_hidden_behind_a_comment(text):
    assert refused(text)[1] == text.count("#1=5\n") + 1
