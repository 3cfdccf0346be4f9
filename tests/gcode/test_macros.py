"""Custom macro B of a Fanuc: rows worked out by hand, and what is refused with its line."""

import io

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gcode2krl import Gcode2KrlError, read_gcode
from gcode2krl.gcode import read_stream
from gcode2krl.gcode.program import MOST_STEPS

HEAD = "%\nO0001 (MAIN)\nG21 G90 G17 G94 F500.\nG0 X0. Y0. Z0.\n"
FIRST = HEAD.count("\n") + 1
"""The line behind the head."""


def read(text, dialect="fanuc", **options):
    return read_stream(io.BytesIO(f"{HEAD}{text}\n".encode()), "part.nc", dialect=dialect, **options)


def xs(text, **options):
    """Return X of every row behind the head's."""
    return read(f"{text}\nM30", **options).position_mm[2:, 0].tolist()


def last(text, **options):
    """Return the last position of a program that computes."""
    return read(f"{text}\nM30", **options).position_mm[-1].tolist()


def value_of(expression):
    return last(f"#500={expression}\nG0 X#500")[0]


def refused(text):
    """Return code and line of the first error, counted from the head."""
    with pytest.raises(Gcode2KrlError) as caught:
        read(text)
    first = caught.value.issues[0]
    assert first.remedy
    return first.code, first.line - FIRST + 1


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


def test_variables_take_effect_at_once_and_may_be_computed():
    assert last("#1=5\n#[#1+100]=7\n#2=#105\n#105=#105+#2\nG0 X#105 Y-#2 Z[#1*2]") == [14.0, -7.0, 10.0]


def test_goto_leads_forwards_and_backwards():
    text = "#1=1\nN10 G0 X#1\n#1=#1+1\nIF [#1 LE 3] GOTO 10\nGOTO 99\nG0 X50.\nN99 G0 X#1"
    assert xs(text) == [1.0, 2.0, 3.0, 4.0]


def test_goto_takes_the_next_line_of_a_number_then_the_first():
    text = "#1=0\nN1 G0 X1.\n#1=#1+1\nIF[#1GT2]GOTO3\nGOTO1\nN1 G0 X2.\n#1=#1+1\nGOTO[#1-1]\nN3 G0 X3."
    assert xs(text) == [1.0, 2.0, 1.0, 3.0]


def test_goto_leads_back_to_plain_blocks_before_the_first_calculation():
    text = "N10 G91 G0 X1.\nG90\n#101=#5+1\nIF [#101 GT 1] GOTO 20\n#5=1\nGOTO 10\nN20"
    assert xs(text) == [1.0, 2.0]


def test_then_carries_out_one_calculation():
    assert xs("#1=2\nIF [#1 EQ 2] THEN #1=7\nIF [#1 NE 7] THEN #1=9\nG0 X#1") == [7.0]


def test_loops_run_within_each_other():
    text = (
        "#1=1\nWHILE [#1 LE 2] DO1\n#2=1\nWHILE [#2 LE 3] DO2\nG0 X[#1*10+#2]\n#2=#2+1\nEND2\n#1=#1+1\nEND1\n"
        "WHILE [#1 LT 0] DO1\nG0 X99.\nEND1"
    )
    assert xs(text) == [11.0, 12.0, 13.0, 21.0, 22.0, 23.0]


def test_a_loop_without_a_test_is_left_by_goto():
    assert xs("#1=0\nDO1\n#1=#1+1\nG0 X#1\nIF [#1 EQ 3] GOTO 5\nEND1\nN5") == [1.0, 2.0, 3.0]


def test_an_argument_that_is_not_passed_is_empty_and_its_word_is_left_out():
    text = (
        "G65 P9010 A4. X2. K-1.\nG65 P9010 A#0 X3. K1.\nM30\nO9010\n"
        "IF [#1 EQ #0] GOTO 9\nIF [#2 NE #0] GOTO 9\nG0 X#24 Y#25 Z#6\nM99\nN9 G0 X-#24\nM99"
    )
    toolpath = read(text)
    assert toolpath.position_mm[2:].tolist() == [[2.0, 0.0, -1.0], [-3.0, 0.0, -1.0]]
    assert toolpath.issues == ()


def test_an_empty_variable_counts_as_0_but_is_not_equal_to_it():
    text = (
        "G65 P9010 A1.\nM30\nO9010\n#2=#3\nIF [#2 EQ 0] GOTO 9\nIF [#2 NE #0] GOTO 9\nIF [#2 GT 0] GOTO 9\n"
        "G0 X[#2+5]\nM99\nN9 G0 X-1.\nM99"
    )
    assert read(text).position_mm[-1, 0] == 5.0


def test_each_call_of_g65_has_variables_of_its_own_and_m98_has_the_callers():
    text = (
        "#1=1\n#100=7\nG65 P2 A5.\nG0 X#1 Y#100\nM98 P3\nG0 X#1\nM30\n"
        "O2\n#1=#1+1\n#100=#1\nM99\nO3\n#1=8\nM99"
    )
    assert read(text).position_mm[2:, :2].tolist() == [[1.0, 6.0], [8.0, 6.0]]


@pytest.mark.parametrize("call", ["M98 P1234 L3", "M98 P31234", "M98 P00031234", "M98P1234L3"])
def test_a_subprogram_is_called_several_times(call):
    assert read(f"{call}\nM30\nO1234\nG91 G0 X2.\nG90\nM99").position_mm[-1, 0] == 6.0


def test_m98_and_m99_may_stand_behind_words():
    text = "X5. M98 P2\nX9. Y1.\nM30\nO2\nG91 X1.\nG90 Y3. M99"
    assert read(text).position_mm[2:, :2].tolist() == [[5.0, 0.0], [6.0, 0.0], [6.0, 3.0], [9.0, 1.0]]


def test_a_subprogram_may_call_one_before_it():
    text = "M98 P3\nM30\nO2\nG0 X2.\nM99\nO3\nM98 P2\nG0 X3.\nM99"
    assert read(text).position_mm[2:, 0].tolist() == [2.0, 3.0]


@pytest.mark.parametrize("name", ["O1234.nc", "1234.nc", "O1234", "o1234.nc"])
@pytest.mark.parametrize("head", ["%\nO1234 (SIDE)\n", ":1234\n", ""])
def test_a_subprogram_of_another_file_is_found(tmp_path, name, head):
    folder = tmp_path / "macros"
    folder.mkdir()
    (folder / name).write_text(f"{head}G0 X#1\nN5 M99\n%\n")
    main = tmp_path / "part.nc"
    main.write_text(f"{HEAD}G65 P1234 A7.\nN5 G0 Y1.\nM30\n%\n")
    toolpath = read_gcode(main, dialect="fanuc", search=[folder])
    assert toolpath.position_mm[2:, :2].tolist() == [[7.0, 0.0], [7.0, 1.0]]
    assert toolpath.source_line[2:].tolist() == [FIRST, FIRST + 1]
    with pytest.raises(Gcode2KrlError) as caught:
        read_gcode(main, dialect="fanuc")
    assert caught.value.issues[0].code == "subprogram-missing"


def test_a_file_with_a_program_of_another_number_is_not_taken(tmp_path):
    (tmp_path / "O1234.nc").write_text("O77\nG0 X5.\nM99\n")
    main = tmp_path / "part.nc"
    main.write_text(f"{HEAD}M98 P1234\nM30\n")
    with pytest.raises(Gcode2KrlError) as caught:
        read_gcode(main, dialect="fanuc")
    assert caught.value.issues[0].code == "subprogram-missing"


def test_labels_are_those_of_the_own_program():
    text = "#1=1\nM98 P2\nGOTO 5\nG0 X9.\nN5 G0 X1.\nM30\nO2\nGOTO 5\nG0 X8.\nN5 G0 X2.\nM99"
    assert read(text).position_mm[2:, 0].tolist() == [2.0, 1.0]


def test_rows_have_the_line_that_made_them():
    toolpath = read("M98 P2\nG0 X1.\nM30\nO2\nG0 X2.\nM99")
    assert (toolpath.source_line[2:] - FIRST + 1).tolist() == [5, 2]


def test_skip_levels_are_left_out_where_they_are_asked_for():
    text = "#1=1\n/2 #1=5\n/ GOTO 9\nG0 X#1\nN9"
    assert xs(text, block_delete=True) == [1.0]
    assert xs(text) == []


def test_a_variable_that_nothing_has_set_is_told():
    (issue,) = (i for i in read("G0 X#100 Y5.\nM30").issues if i.code == "parameter-unset")
    assert issue.line == FIRST
    assert "left out" in issue.message
    assert read("G0 X#100 Y5.\nM30").position_mm[-1].tolist() == [0.0, 5.0, 0.0]
    assert any(i.code == "parameter-unset" for i in read("IF [#100 EQ #0] GOTO 5\nN5 M30").issues)
    assert not read("#100=#0\nIF [#100 EQ #0] GOTO 5\nN5 M30").issues


def test_numbers_without_a_point_in_a_line_that_computes_go_by_the_dialect():
    text = "#1=5\nG0 X100 Y#1"
    assert refused(text + "\nM30") == ("decimal-point", 2)
    assert last(text, dialect="fanuc-calculator") == [100.0, 5.0, 0.0]
    assert last(text, dialect="fanuc-increments") == pytest.approx([0.1, 5.0, 0.0])


def test_an_inch_program_computes_in_inches():
    assert last("G20\n#1=0.5\nG0 X[#1*2]") == pytest.approx([25.4, 0.0, 0.0])


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
    assert refused(f"{text}\nM30" if found[0] != "endless-loop" else text) == found


def test_a_subprogram_ends_with_m99():
    assert refused("M98 P2\nM30\nO2\nG0 X1.") == ("o-word", 5)


def test_what_is_passed_over_may_be_anything():
    assert xs("GOTO 5\n#1=1/0\nPOPEN\nIF [] GOTO\nG0 X1 $\nN5 G0 X1.") == [1.0]


def test_a_label_of_a_loop_may_be_gone_to_within_it():
    text = "#1=0\nWHILE [#1 LT 3] DO1\n#1=#1+1\nIF [#1 EQ 2] GOTO 5\nG0 X#1\nN5\nEND1"
    assert xs(text) == [1.0, 3.0]


def test_no_dialect_is_recommended_that_never_reached_the_line(tmp_path):
    main = tmp_path / "part.nc"
    main.write_text(f"{HEAD}G65 P2 A1.\nM30\nO2\nIF [#2 EQ #0] THEN #3000=1\nM99\n")
    with pytest.raises(Gcode2KrlError) as caught:
        read_gcode(main, dialect="fanuc")
    assert "--dialect" not in caught.value.issues[0].remedy


def test_a_caret_stands_before_the_statement():
    with pytest.raises(Gcode2KrlError) as caught:
        read("N7 GOTO 5\nM30")
    assert caught.value.issues[0].excerpt == "N7 ^GOTO 5"


def test_little_room_changes_nothing(monkeypatch):
    from gcode2krl.gcode import read as module
    from gcode2krl.gcode import text as text_of_files

    text = (
        "#1=0\nN1 #1=#1+1\nG0 X0. Y0.\nG2 X1. Y0. I.5 M8\nG1 X#1 M98 P2\nIF [#1 LT 9] GOTO 1\nM30\n"
        "O2\nG1 Y1. M3 M7\nM99"
    )
    expected = read(text)
    monkeypatch.setattr(module, "_FIRST_ROWS", 1)
    monkeypatch.setattr(module, "_FIRST_EVENTS", 0)
    monkeypatch.setattr(text_of_files, "_PIECE_BYTES", 20)
    found = read(text)
    assert found.position_mm.tolist() == expected.position_mm.tolist()
    assert found.events == expected.events


def test_a_step_limit_is_one_for_all_dialects():
    with pytest.raises(Gcode2KrlError) as caught:
        read("#1=0\nN1 #1=#1+1\nGOTO 1")
    assert f"{MOST_STEPS // 1_000_000},000,0" in caught.value.issues[0].message


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
    assert issue.line == FIRST
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
