"""One cause is one finding: what rests on a block that was not understood is counted, not reported."""

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import Gcode2KrlError, read_gcode
from gcode2krl.errors import Issue
from gcode2krl.gcode import read_stream

HEAD = "G21 G90 G17\nG0 X0 Y0 Z0 F100\n"


def errors(text, head=HEAD):
    """Return code and line of each error, and how many consequences were counted."""
    with pytest.raises(Gcode2KrlError) as caught:
        read_stream(io.BytesIO((head + text).encode("latin-1")), "part.nc")
    issues = caught.value.issues
    assert "consequences" not in [i.code for i in issues[:-1]]
    return [(i.code, i.line) for i in issues if i.severity == "error"]


@pytest.mark.parametrize(
    "fault",
    [
        "G41 D1 G1 X10",
        "G1 X10 E5",
        "G1 X10 $",
        "G1 X10 (open",
        "G1 X10 G187",
        "X10 G1 A5",
        "G1 X10 T1.5",
        "G1 X10 S-1",
        "G1 X10 M66 P1",
        "G1 X10 G64 P-1",
        "G0 G1 X10",
        "G1 X10 F#1",
        "G4 P-1 G1 X10",
        "G1 X10 N5",
        "N10.G1 X10",
        "G1 X10 [",
        "G1 X10 J5",
    ],
)
def test_a_correct_arc_behind_a_refused_block_is_not_blamed(fault):
    found = errors(f"{fault}\nG2 X20 I5 F100\nG3 X10 Y0 I-5\nM2\n")
    assert [line for _, line in found] == [3]


@pytest.mark.parametrize(
    "fault",
    [
        "G1 X#0 Y5",
        "G1 X[1+]",
        "#1=3 G1 X#<a>",
        "G87 X5 Y5 Z-5 R1",
        "G10 L2 P1.5 X5",
        "G91 G1 X5,5",
        "G92 X[7+]",
    ],
)
def test_an_arc_from_a_position_in_doubt_is_not_judged(fault):
    found = errors(f"{fault}\nG2 X20 I5 F100\nG0 X20 Y0 Z0\nG90\nM2\n")
    assert [line for _, line in found] == [3]


def test_an_arc_is_judged_again_from_a_position_that_is_stated_anew():
    found = errors("G1 X#[\nG2 X20 I5\nG90 G17 G94 G21 G91.1 G0 X0 Y0 F9\nG2 X20 I5\nM2\n")
    assert found == [("expression", 3), ("arc-radius-mismatch", 6)]


def test_words_under_a_cycle_that_is_not_read_are_consequences():
    text = "G87 X5 Y5 Z-5 R1\nX10 R2\nX15 P1\nX20 K3\nG80\nG0 Z5\nM2\n"
    assert errors(text) == [("unsupported-g", 3)]


def test_consequences_are_counted_behind_their_cause():
    with pytest.raises(Gcode2KrlError) as caught:
        read_stream(io.BytesIO((HEAD + "G87 X5 Y5 Z-5 R1\nX10 R2\nX15 P1\nG80\nM2\n").encode()), "part.nc")
    cause, rest = caught.value.issues
    assert (cause.code, rest.code, rest.severity) == ("unsupported-g", "consequences", "note")
    assert rest.message.startswith("2 more findings")


def test_a_missing_feed_is_one_finding_however_many_moves_follow():
    text = "G21 G0 X0 Y0 Z0\nG1 X1\nX2\nG2 X4 I1\nX6 I1\nF100 X7 I.5\nG94\nX8 I.5\nX9 I.5\nM2\n"
    found = errors(text, head="")
    assert found == [("no-feed", 2), ("no-feed", 8)]


def test_a_missing_motion_code_is_one_finding():
    assert errors("G80\nX1\nX2\nY3\nG1 X4\nM2\n") == [("no-motion-mode", 4)]


def test_an_expression_in_the_unit_or_motion_leaves_all_in_doubt():
    assert errors("G[1+] X5\nX7\nG2 X20 I3\nI7 J7\nM2\n") == [("expression", 3)]


def test_plain_blocks_behind_an_expression_are_still_read():
    assert errors("X[1*2+[3]] Y#<_name> F100\nA7\nM2\n") == [("parameter-undefined", 3), ("rotary-axis", 4)]
    assert errors("X[1*2\nX#<_name>\nX[2+]\nM2\n") == [("expression", 3), ("expression", 5)]


def test_nothing_behind_an_o_word_without_its_end_is_run():
    assert errors("O100 sub\nX1 I1\nG2 X9 I1\nM2\n") == [("o-word", 3)]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("G80\nX1\nM2\n", "G80 of line 3"),
        ("G1 X1\nI5\nM2\n", "G1 is in force since line 3"),
        ("G2 X2 I1\nX3\nM2\n", "in force since line 3"),
        ("G94\nG1 X1\nM2\n", "G94 of line 3"),
        ("G93\nG1 X1\nM2\n", "G93 of line 3"),
        ("G95 F1\nG1 X1\nM2\n", "G95 of line 3"),
    ],
)
def test_the_modal_state_that_led_there_is_named(text, named):
    with pytest.raises(Gcode2KrlError) as caught:
        read_stream(io.BytesIO((HEAD + text).encode()), "part.nc")
    assert named in caught.value.issues[0].message


@pytest.mark.parametrize(
    ("block", "quoted"),
    [
        ("G1 X10 I5", "G1 X10 ^I5"),
        ("G1 X10 Z", "G1 X10 ^Z"),
        ("g1 x10 ; Z\tnext $", None),
        ("G1 X10 (Q) $5", "G1 X10 (Q) ^$5"),
        ("G1 X1 X2", "G1 X1 ^X2"),
        ("N5 G01 G41 X1", "N5 G01 ^G41 X1"),
        ("G1 X[1 / 0]", "G1 X[1 ^/ 0]"),
        ("G1 X10 (never closed", "G1 X10 ^(never closed"),
        ("M3 M04 S1", "M3 ^M04 S1"),
        ("G1 X10 T1.5" + " " * 60 + "F5", "G1 X10 ^T1.5..."),
        ("(" + "x" * 60 + ") G1 X10 A5", "...xxxxxxxxxxxxxxx) G1 X10 ^A5"),
        ("G1 X1 \x01\xe9", "G1 X1 ^??"),
    ],
)
def test_the_culprit_is_quoted_with_a_caret(block, quoted):
    if quoted is None:
        read_stream(io.BytesIO((HEAD + block + "\nM2\n").encode()), "part.nc")
        return
    with pytest.raises(Gcode2KrlError) as caught:
        read_stream(io.BytesIO((HEAD + block + "\nM2\n").encode("latin-1")), "part.nc")
    found = caught.value.issues[0]
    assert found.excerpt == quoted
    assert f"near `{quoted}`" in found.text("part.nc")
    assert "\n" not in found.text("part.nc")


@pytest.mark.parametrize(
    ("block", "column"),
    [
        ("G1 X5 F100 Q3", 12),
        ("(45°) G1 X5 F100 Q3", 18),  # in characters, not in bytes
        ("\tG1 X5 F100 Q3", 13),
        ("G1 X[1 + 2/[3-3]] F100", 11),
        ("G1 X- F100", 4),
        ("G1 X5,5,5 F100", 0),  # two commas: which one is not told
        ("G2 X5 Y5 F100", 0),
    ],
)
def test_the_column_of_the_culprit_where_it_is_certain(block, column):
    with pytest.raises(Gcode2KrlError) as caught:
        read_stream(io.BytesIO(f"G21 G0 X0 Y0 Z0\n{block}\nM2\n".encode()), "part.nc")
    assert caught.value.issues[0].column == column


def test_a_finding_without_a_quotation_is_as_before():
    assert (
        Issue("error", "code", 3, "wrong", "mend it").text("a.nc") == "a.nc:3: error: wrong [code] -> mend it"
    )


def test_a_nul_byte_has_its_line(tmp_path):
    part = tmp_path / "part.nc"
    part.write_bytes(b"G21\nG0 X1\nG1 X\x002\n")
    with pytest.raises(Gcode2KrlError) as caught:
        read_gcode(part)
    assert (caught.value.issues[0].code, caught.value.issues[0].line) == ("binary-file", 3)


def test_lines_left_out_by_block_delete_keep_later_findings_right():
    text = "G21 G0 X0 Y0 Z0\n/ G1 X$ F5\nX5 &\nM2\n"
    with pytest.raises(Gcode2KrlError) as caught:
        read_stream(io.BytesIO(text.encode()), "part.nc", block_delete=True)
    (found,) = caught.value.issues
    assert (found.line, "'&'" in found.message) == (3, True)


BLOCKS = [
    "G1 X1",
    "G2 X5 I2",
    "I1",
    "G81 X1 Z-1 R1",
    "X#1",
    "G0 X0 Y0 Z0",
    "Y[2]",
    "$",
    "G91",
    "G20",
    "F10",
    "O1 if [1]",
    "A1",
    "N1.G2",
    "G18",
    "K0",
    "M98 P1",
    "G90.1",
    "Z5 (a",
    "G93",
    "M6",
    "G4 P#2",
    "X9 E1",
]


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(st.lists(st.sampled_from(BLOCKS), max_size=12))
def test_doubt_never_hides_that_a_program_is_not_understood(blocks):
    """The first block that is refused alone, behind the blocks before it, is the first that is reported."""

    def first_error(count):
        text = "G21 G0 X0 Y0 Z0 F9\n" + "".join(f"{block}\n" for block in blocks[:count])
        try:
            read_stream(io.BytesIO(text.encode()), "part.nc")
        except Gcode2KrlError as error:
            return error.issues[0].line
        return 0

    whole = first_error(len(blocks))
    beginnings = [first_error(count) for count in range(len(blocks) + 1)]
    refused = [line for line in beginnings if line]
    assert whole == (refused[0] if refused else 0)
