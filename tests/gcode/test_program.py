"""Programs that compute and jump: rows by hand, and findings with their line."""

import pytest

from gcode2krl import Gcode2KrlError, read_gcode
from gcode2krl.gcode import program
from tests.gcode import Control

LINUXCNC = Control("G21 G90 G17 G94 F500\nG0 X0 Y0 Z0\n")
HEAD = LINUXCNC.head
SUB = "o<p> sub\nG1 X#1 Y#2\no<p> endsub\n"


read, ends, refused = LINUXCNC.read, LINUXCNC.xs, LINUXCNC.refused


def test_assignments_take_effect_behind_their_line():
    assert ends("#1=5\n#1=7 #2=#1 G1 X#1\nG1 X#1\nX#2") == [5.0, 7.0, 5.0]


def test_functions_of_round_angles_are_not_a_unit_short_behind_fix():
    assert ends("G0 X[FIX[10*SIN[30]]]\nX[FIX[10*COS[60]]]\nX[FIX[10*TAN[45]]]") == [5.0, 5.0, 10.0]


@pytest.mark.parametrize(
    ("text", "line"),
    [("#3=5\nG1 X#3 Y#100", 1), ("#3=[2*#4]", 0), ("#3=1\n#3=[#3+1]\nG1 X#3", None)],
)
def test_a_parameter_that_nothing_has_set_is_told_once(text, line):
    issues = read(text + "\nG1 Y#100" * (line is not None)).issues
    told = [issue.line for issue in issues if issue.code == "parameter-unset"]
    assert told == ([] if line is None else [line + 3])


def test_rows_have_the_line_that_made_them():
    assert read("o1 repeat [2]\nX1\nX2\no1 endrepeat").source_line[2:].tolist() == [4, 5, 4, 5]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("X[1/0]", ("expression-value", 1)),
        ("X[SQRT[-1]]", ("expression-value", 1)),
        ("X[LN[0]]", ("expression-value", 1)),
        ("X[[-8]**0.5]", ("expression-value", 1)),
        ("X[10**400]", ("expression-value", 1)),
        ("X[5 MOD 0]", ("expression-value", 1)),
        ("X[ACOS[1.1]]", ("expression-value", 1)),
        ("X#<a>", ("parameter-undefined", 1)),
        ("#<a>=[#<a>+1]", ("parameter-undefined", 1)),
        ("X#0", ("parameter-number", 1)),
        ("X#5602", ("parameter-number", 1)),
        ("X#1.5", ("parameter-number", 1)),
        ("#5221=3", ("parameter-read-only", 1)),
        ("#<_x>=3", ("parameter-read-only", 1)),
        ("X[1+2", ("expression", 1)),
        ("X[1 2 +]", ("expression", 1)),
        ("X[FOO[1]]", ("expression", 1)),
        ("XSIN 30", ("no-number", 1)),
        ("X[ATAN[1]]", ("expression", 1)),
        ("X#<a", ("expression", 1)),
        ("#1", ("expression", 1)),
        ("X[" + "[" * 300 + "1" + "]" * 300 + "]", ("expression", 1)),
        ("o1 do\no1 while [1]", ("endless-loop", 2)),
        ("o1 while\no1 endwhile", ("expression", 1)),
        ("o1 while [1] X5\no1 endwhile", ("expression", 1)),
        ("o1 if [1]\nX1", ("o-word", 1)),
        ("X1\no1 endif", ("o-word", 2)),
        ("o1 if [1]\nX1\nZ5 (never closed", ("o-word", 1)),  # the missing end first
        ("o1 if [1]\nX1\no1 endif (never closed", ("comment-open", 3)),
        ("o1 if [1]\no2 while [0]\no1 endif\no2 endwhile", ("o-word", 3)),
        ("o1 break", ("o-word", 1)),
        ("o1 foo", ("o-word", 1)),
        ("X1 o1 call", ("o-word", 1)),
        ("o<gone> call", ("subprogram-missing", 1)),
        ("o1 sub\no1 call\no1 endsub\no1 call", ("calls-too-deep", 2)),
        ("o1 sub\no2 sub\no2 endsub\no1 endsub", ("o-word", 1)),
        ("o1 sub\no1 endsub\nM98 P1", ("o-word", 3)),
        ("M98 X1", ("o-word", 1)),
        ("G1 M98 P1", ("o-word", 1)),
        ("M99", ("o-word", 1)),
        ("M98 P77", ("subprogram-missing", 1)),
        ("#1=1\nM66 P1", ("unsupported-m", 2)),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(text, found):
    assert refused(text) == found


def test_a_caret_stands_before_the_culprit():
    assert LINUXCNC.refusal("X[1 + 2/[3-3]]").excerpt == "X[1 + 2^/[3-3]]"


def test_what_is_passed_over_may_be_anything():
    assert ends("o1 if [0]\nX[1/0] $ )\no2 call [1/0]\no1 endif\nX1") == [1.0]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("o1 if [0]\nX1\no1 lese\nX2\no1 endif", 3),
        ("o1 if [1]\nX1\no1 lese\nX2\no1 endif", 3),
        ("o1 if [0]\nX1\no1 elsee\nX2\no1 endif", 3),
        ("o1 if [0]\nX1\no2 else\nX2\no1 endif", 3),
        ("o1 if [0]\nX1\no1 endif 5", 3),
        ("o1 while [0]\no2 if [0]\no2 elfe\no2 endif\no1 endwhile", 3),
        ("o1 repeat [2]\nX1\no1 endrepeatt", 3),
        ("#1=0\no1 while [#1 LT 2]\n#1=[#1+1]\no1 endwhile x", 4),
        ("o1 do x\nX1\no1 while [0]", 1),
        ("o1 do\nX1\no1 breakk\no1 while [0]", 3),
        ("o1 subb\nX1\no1 endsub\no1 call", 1),
        ("o1 sub\no2 if [0]\no2 elso\nX1\no2 endif\no1 endsub\no1 call", 3),
    ],
)
def test_an_o_word_is_never_passed_over_unread(text, line):
    """It may be the else, or the end, of what it stands in."""
    assert refused(text) == ("o-word", line)


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("G91\no1 while [#<_x> LT 3]\nG1 X1\no1 endwhile", 3),
        ("o1 repeat [5]\nG1 X1\no1 endrepeat", 5),
        ("o1 do\nG10 L2 P2 X[#5241 + 1]\nG1 X1\no1 while [#5241 LT 3]", 3),
        ("o1 sub\n#<_n>=[#<_n> + 1]\no1 endsub\n#<_n>=0\no2 do\no1 call\nG1 X1\no2 while [#<_n> LT 4]", 4),
        ("#1=0\no1 do\n#2=0\no2 do\n#2=[#2+1]\nG1 X1\no2 while [#2 LT 3]\n#1=[#1+1]\no1 while [#1 LT 3]", 9),
        ("#1=0\no1 while [#1 LT 2]\n#2=#1\n#1=5\n#1=[#2+1]\nG1 X1\no1 endwhile", 2),
    ],
)
def test_a_loop_that_changes_something_is_not_endless(text, rows):
    assert len(ends(text, dialect="linuxcnc")) == rows


@pytest.mark.parametrize(
    "text",
    [
        "o1 do\nG1 X1\nX2 (MSG, still)\no1 while [#<_x> EQ 2]",
        "#1=3\no1 while [#1 LT 5]\n#1=3\nG1 X#1\no1 endwhile",
        "#1=0\no1 while [1]\no2 do\nG1 X#1\no2 while [#1 EQ 1]\no1 endwhile",
    ],
)
def test_a_loop_that_changes_nothing_is_seen_at_once(text, monkeypatch):
    monkeypatch.setattr(program, "MOST_STEPS", 10**15)
    assert refused(text)[0] == "endless-loop"


def test_behind_an_o_word_a_comment_may_stand():
    text = "o1 if [0] (a)\nX1\no1 else ; b\nX2\no1 endif (c)\no2 repeat [2]\nX3\no2 endrepeat\t(d)"
    assert ends(text) == [2.0, 3.0, 3.0]


@pytest.mark.parametrize(
    "call",
    [
        "o<p> call [60] (end of the pass) [-40]",
        "o<p> call (a)[60](b)(c;d) [-40](e);[3]",
        "O<P>CALL[60]\t(\t)[-40]",
    ],
)
def test_a_comment_between_the_arguments_of_a_call_is_nothing(call):
    assert read(SUB + call).position_mm[-1].tolist() == [60.0, -40.0, 0.0]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (SUB + "o<p> call [60] (c) G1 X3", ("expression", 4)),
        (SUB + "o<p> (c) call [60] [-40]", ("o-word", 4)),
        (SUB + "o<p (c)> call [60] [-40]", ("o-word", 4)),
        (SUB + "o<p> call [60 (c)] [-40]", ("expression", 4)),
        (SUB + "o<p> call [60] (c [-40]", ("comment-open", 4)),
        (SUB + "o<p> call [60] (c (d) [-40])", ("comment-nested", 4)),
        ("o10 sub\nX#1\no10 endsub\n#1=10\no#1 (c) call [60]", ("o-word", 5)),
        ("o10 sub\nX#1\no10 endsub\n#1=10\no#1 ; call [60]", ("o-word", 5)),
        ("o1 sub\nX5\no1 return (c) [5]\no1 endsub\no1 call", ("expression", 3)),
        ("o1 sub (c) X5\nX5\no1 endsub", ("o-word", 1)),
        ("o1 if [1] (c) [0]\nX5\no1 endif", ("expression", 1)),
        ("o1 if [1]\nX5\no1 elseif [1] (c) [0]\nX6\no1 endif", ("expression", 3)),
        ("o1 if [0]\nX5\no1 else (c) X7\nX6\no1 endif", ("o-word", 3)),
        ("o1 if [0]\nX5\n(c) o1 else\nX6\no1 endif", ("o-word", 3)),
        ("o1 if [0]\nX5\no1 else (c\nX6\no1 endif", ("comment-open", 3)),
        ("o1 if [0]\nX5 (c\no1 endif", ("comment-open", 2)),
        ("o1 sub\nX5 (a(b)\no1 endsub", ("comment-nested", 2)),
        ("#<a(c)>=5\nX#<a(c)>", ("expression", 1)),
        ("#<a;c>=5\nX#<a;c>", ("expression", 1)),
        ("(c)N5 X3", ("n-not-first", 1)),
        ("(c)/X3", ("bad-character", 1)),
        ("O1000 (c) X5", ("o-word", 1)),
    ],
)
def test_a_comment_hides_nothing_and_joins_nothing(text, found):
    assert refused(text) == found


@pytest.mark.parametrize("line", ["/o1 else (c", "/(c) o1 else", "/X9 (c", "/o1 else (c) X9"])
def test_a_line_that_is_left_out_may_be_anything(line):
    text = f"o1 if [0]\nX1\n{line}\nX2\no1 endif\nX3"
    assert ends(text, block_delete=True) == [3.0]
    assert refused(text)[1] == 3


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        (SUB + "o<p> call [1] [2]", []),
        (SUB + "o<p> call [1] [2]\no<p> call [1]\no<p> call", [7]),
        (SUB + "o<p> call [1] (c) [2] [3]", [6]),
        ("o1 sub\no2 if [#2 EQ 0]\n#2=7\no2 endif\nX#1 Y#2\no1 endsub\no1 call [1]", []),
        ("o1 sub\n#2=[#1+1]\nX#2\no1 endsub\no1 call [1]\no1 call [1] [2]", [8]),
        ("o1 sub\no2 if [#1 EQ 1]\nX#2\no2 endif\no1 endsub\no1 call [2] [3]", []),
        ("o1 sub\no2 if [#1 EQ 1]\n#2=5\no2 endif\nX#2\no1 endsub\no1 call [1] [3]", []),
        ("o1 sub\nX##1\no1 endsub\no1 call [2] [3]", []),
        ("o1 sub\nX#1 (and #2)\no1 endsub\no1 call [2] [3]", [6]),
        ("o1 sub\no2 call [#1] [#2]\no1 endsub\no2 sub\nX#1 Y#2\no2 endsub\no1 call [5]", [9]),
    ],
)
def test_a_call_with_fewer_or_more_arguments_than_its_subprogram_reads_is_told(text, lines):
    issues = [issue for issue in read(text).issues if issue.code == "argument-count"]
    assert [issue.line for issue in issues] == lines


def test_a_call_with_too_few_arguments_names_the_line_that_reads_the_missing_one():
    (issue,) = (issue for issue in read(SUB + "o<p> call [60]").issues if issue.code == "argument-count")
    assert (issue.severity, issue.line) == ("warning", 6)
    assert issue.message == "O<p> is called with 1 argument, and line 4 reads #2, which is 0"
    assert "2 arguments" in issue.remedy


def test_a_subprogram_of_another_file_names_its_caller(tmp_path):
    (tmp_path / "side.ngc").write_text("o<side> sub\nG0 X#1\no<side> endsub\n")
    main = tmp_path / "part.nc"
    main.write_text(HEAD + "o<side> call [7]\no<side> call [8]\nM2\n")
    toolpath = read_gcode(main)
    assert toolpath.position_mm[2:, 0].tolist() == [7.0, 8.0]
    assert toolpath.source_line[2:].tolist() == [3, 4]


@pytest.mark.parametrize(
    ("block", "more", "line", "message"),
    [
        ("G0 X[1/0]", "", 0, "division by zero (in side.ngc line 2)"),
        ("G93", "G1 X5\n", 4, "feed move without F under G93 of line 2 of side.ngc"),
    ],
)
def test_a_finding_names_the_line_of_another_file(tmp_path, block, more, line, message):
    (tmp_path / "side.ngc").write_text(f"o<side> sub\n{block}\no<side> endsub\n")
    main = tmp_path / "part.nc"
    main.write_text(f"{HEAD}o<side> call [7]\n{more}M2\n")
    with pytest.raises(Gcode2KrlError) as caught:
        read_gcode(main)
    first = caught.value.issues[0]
    assert (first.line, first.message) == (line, message)
    assert line or first.excerpt == "G0 X[1^/0]"


@pytest.mark.parametrize(
    "text",
    [
        "G20\nX#5221",
        "G20\nX#5161",
        "X#5403",
        "X#5423",
        "G20\nF#<_feed>",
        "G93 G1 X1 F2\nX2 F#<_feed>",
    ],
)
def test_a_number_that_only_the_control_knows_is_refused(text):
    assert refused(text) == ("expression-value", len(text.splitlines()))


def test_the_place_in_machine_coordinates_is_rotated():
    text = "G10 L2 P1 X5 Y6 R90\nG0 X10 Y20\nG53 X#<_abs_x> Y#<_abs_y>"
    x, y, _ = read(text).position_mm[-1]
    assert (x, y) == pytest.approx((-15.0, 16.0))


def test_a_subprogram_is_looked_for_beside_the_program_and_in_named_folders_only(tmp_path):
    for folder in ("own", "other"):
        (tmp_path / folder).mkdir()
    (tmp_path / "other" / "side.ngc").write_text("o<side> sub\nG0 X9\no<side> endsub\n")
    main = tmp_path / "own" / "part.nc"
    main.write_text(HEAD + "o<side> call\nM2\n")
    with pytest.raises(Gcode2KrlError):
        read_gcode(main)
    assert read_gcode(main, search=[tmp_path / "other"]).position_mm[-1, 0] == 9.0
    main.write_text(HEAD + "o<../other/side> call\nM2\n")
    with pytest.raises(Gcode2KrlError):
        read_gcode(main)


@pytest.mark.parametrize(
    ("opening", "closing"),
    [("if [1]", "endif"), ("while [1]", "endwhile"), ("repeat [3]", "endrepeat"), ("do", "while [1]")],
)
@pytest.mark.parametrize("label", ["<inner>", "<deep>", "100"])
def test_a_return_leaves_its_subprogram_from_within_whatever_its_label_is(opening, closing, label):
    """As LinuxCNC, which does not look at the label of a return."""
    inside = f"o<inner> {opening}\nG1 X[#1]\no{label} return\no<inner> {closing}\n"
    sub = f"o<deep> sub\n{inside}G1 X99\no<deep> endsub\n"
    assert ends(f"{sub}o<deep> call [3]\no<deep> call [4]\nG1 X7") == [3, 4, 7]
