"""One cause is one finding: what rests on a block that was not understood is counted, not reported."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import Gcode2KrlError
from gcode2krl.errors import Issue
from tests.gcode import Control, named, refusal
from tests.gcode import errors as errors_of

LINUXCNC = Control("G21 G90 G17\nG0 X0 Y0 Z0 F100\n")


def errors(lines):
    """Return code and line of each error, lines counted behind the head."""
    return [(issue.code, issue.line) for issue in LINUXCNC.errors(lines)]


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
        # from here on the place behind the block is in doubt
        "G1 X#0 Y5",
        "G1 X[1+]",
        "#1=3 G1 X#<a>",
        "G87 X5 Y5 Z-5 R1",
        "G10 L2 P1.5 X5",
        "G91 G1 X5,5",
        "G92 X[7+]",
    ],
)
def test_a_correct_arc_behind_a_refused_block_is_not_blamed(fault):
    assert [line for _, line in errors(f"{fault}\nG2 X20 I5 F100\nG0 X20 Y0 Z0\nG90")] == [1]


@named(
    ("lines", "found"),
    {
        "an arc is judged again from a place that is stated anew": (
            "G1 X#[\nG2 X20 I5\nG90 G17 G94 G21 G91.1 G0 X0 Y0 F9\nG2 X20 I5",
            [("expression", 1), ("arc-radius-mismatch", 4)],
        ),
        "words under a cycle that is not read are consequences": (
            "G87 X5 Y5 Z-5 R1\nX10 R2\nX15 P1\nX20 K3\nG80\nG0 Z5",
            [("unsupported-g", 1)],
        ),
        "a missing feed is one finding however many moves follow": (
            "G94\nG1 X1\nX2\nG2 X4 I1\nX6 I1\nF100 X7 I.5\nG93 F1 X8 I.5\nG94\nX9 I.5\nX10 I.5",
            [("no-feed", 2), ("no-feed", 9)],
        ),
        "a missing motion code": ("G80\nX1\nX2\nY3\nG1 X4", [("no-motion-mode", 2)]),
        "an expression in the motion leaves all in doubt": (
            "G[1+] X5\nX7\nG2 X20 I3\nI7 J7",
            [("expression", 1)],
        ),
        "plain blocks behind an expression are still read": (
            "X[1*2+[3]] Y#<_name> F100\nA7",
            [("parameter-undefined", 1), ("rotary-axis", 2)],
        ),
        "each expression is judged": ("X[1*2\nX#<_name>\nX[2+]", [("expression", 1), ("expression", 3)]),
        "nothing behind an O-word without its end is run": ("O100 sub\nX1 I1\nG2 X9 I1", [("o-word", 1)]),
    },
)
def test_one_cause_is_one_error(lines, found):
    assert errors(lines) == found


def test_consequences_are_counted_behind_their_cause():
    with pytest.raises(Gcode2KrlError) as caught:
        LINUXCNC.read("G87 X5 Y5 Z-5 R1\nX10 R2\nX15 P1\nG80")
    cause, rest = caught.value.issues
    assert (cause.code, rest.code, rest.severity) == ("unsupported-g", "consequences", "note")
    assert rest.message.startswith("2 more findings")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("G80\nX1\nM2\n", "G80 of line 3"),
        ("G1 X1\nI5\nM2\n", "G1 is in force since line 3"),
        ("G2 X2 I1\nX3\nM2\n", "in force since line 3"),
        ("G94\nG1 X1\nM2\n", "G94 of line 3"),
        ("G93\nG1 X1\nM2\n", "G93 of line 3"),
        ("G95 F1\nG1 X1\nM2\n", "G95 of line 3"),
    ],
)
def test_the_modal_state_that_led_there_is_named(text, words):
    assert words in LINUXCNC.refusal(text).message


@pytest.mark.parametrize(
    ("block", "quoted"),
    [
        ("G1 X10 I5", "G1 X10 ^I5"),
        ("G1 X10 Z", "G1 X10 ^Z"),
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
    found = refusal((LINUXCNC.head + block + "\nM2\n").encode("latin-1"))
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
    assert refusal(f"G21 G0 X0 Y0 Z0\n{block}\nM2\n").column == column


def test_a_finding_without_a_quotation_is_as_before():
    assert (
        Issue("error", "code", 3, "wrong", "mend it").text("a.nc") == "a.nc:3: error: wrong [code] -> mend it"
    )


def test_a_nul_byte_has_its_line():
    found = refusal(b"G21\nG0 X1\nG1 X\x002\n")
    assert (found.code, found.line) == ("binary-file", 3)


def test_lines_left_out_by_block_delete_keep_later_findings_right():
    (found,) = errors_of("G21 G0 X0 Y0 Z0\n/ G1 X$ F5\nX5 &\nM2\n", block_delete=True)
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
        found = errors_of("G21 G0 X0 Y0 Z0 F9\n" + "".join(f"{block}\n" for block in blocks[:count]))
        return found[0].line if found else 0

    beginnings = [first_error(count) for count in range(len(blocks) + 1)]
    assert beginnings[-1] == next((line for line in beginnings if line), 0)
