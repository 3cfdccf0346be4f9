"""Usual slips of hand-written code, of posts and of encodings are named, each with a remedy that helps."""

import pytest

from tests.gcode import Control, refusal

SLIPS = Control("G21 G90 G17\nG0 X0 Y0 Z5\nG1 Z-1 F300\n", "G0 Z5\nM2")


@pytest.mark.parametrize(
    ("block", "says", "remedy", "mended"),
    [
        ("G1 X1O Y5", "the letter O stands in the number of X", "X10", "G1 X10 Y5"),
        ("G1 XO.5", "the letter O stands in the number of X", "X0.5", "G1 X0.5"),
        ("g1 x1o5", "the letter O stands", "X105", "g1 x105"),
        ("G1 Xl", "the letter l stands in the number of X", "digit 1", "G1 X1"),
        ("G1 X--1", "two signs", "one sign", "G1 X-1"),
        ("G1 X1E-3", "exponent", "0.001", "G1 X0.001"),
        ("G1 X10 E5", "E is not a word", "extruder", "G1 X10"),
        ("G1 X10 $", "character '$'", "command to the control", "G1 X10"),
        ("G1\u00a0X10", "NO-BREAK SPACE", "plain blank", "G1 X10"),
        ("G2 X20 Y0 I-10", "signs of I, J, K reversed", "from the start to the centre", "G2 X20 Y0 I10"),
        ("G2 X20 Y0 J10", "centre words exchanged", "which axis", "G2 X20 Y0 I10"),
        ("G2 X20 Z-1 I10 K0", "K0 is not in the plane of this arc (G17)", "plane", "G18 G2 X20 Z-1 I10 K0"),
        ("G2 X20 Z-2 I10 K3", "K3 is not in the plane", "plane", "G2 X20 Z-2 I10"),
    ],
)
def test_a_slip_is_named_and_its_remedy_helps(block, says, remedy, mended):
    (found,) = SLIPS.errors(block)
    assert found.line == 1
    assert says in found.message
    assert remedy in found.remedy
    assert not SLIPS.errors(mended)


@pytest.mark.parametrize("block", ["G2 X20 Y0 I3", "G2 X20 Y0 I10.2 J0.7"])
def test_an_arc_that_fits_in_no_way_gets_no_hint(block):
    (found,) = SLIPS.errors(block)
    assert found.code == "arc-radius-mismatch"
    assert "radii fit" not in found.message


def test_a_zero_across_the_plane_is_no_slip_where_the_plane_is_named():
    assert not SLIPS.errors("G2 X20 Y0 Z-2 I10 J0 K0")
    assert not SLIPS.errors("G2 X20 Z-2 I10 J0 K0")
    assert not SLIPS.errors("G2 X20 I10 K0")


def finding(block: bytes):
    return refusal(b"G21 G90 G17\nG0 X0 Y0 Z5\n" + block + b"\nM30\n")


@pytest.mark.parametrize(
    ("block", "name", "remedy"),
    [
        ("G1 Z−4. F600".encode(), "U+2212 MINUS SIGN", "write -"),
        ("G1 X10–4. F600".encode(), "U+2013 EN DASH", "write -"),
        (b"G1 Z\x964. F600", "U+2013 EN DASH", "write -"),
        ("G1 Z“4.” F600".encode(), "U+201C LEFT DOUBLE QUOTATION MARK", "remove it"),
        (b"G1 Z\x93" + b"4.\x94 F600", "U+201C LEFT DOUBLE QUOTATION MARK", "remove it"),
        ("G1 X10 Y5°".encode(), "U+00B0 DEGREE SIGN", "remove it"),
        (b"G1 X10 Y5\xb0", "U+00B0 DEGREE SIGN", "remove it"),
        ("G1 X\u00a010".encode(), "U+00A0 NO-BREAK SPACE", "write a plain blank"),
        ("G1 X10 \U0001d7d9".encode(), "U+1D7D9 MATHEMATICAL DOUBLE-STRUCK DIGIT ONE", "remove it"),
        (b"G1 X10 \x81", "character 0x81", "remove it"),
        (b"G1 X10 \xe2\x88", "U+00E2", "remove it"),
        (b"G1 X10 $", "character '$'", "remove the line"),
    ],
)
def test_a_character_is_named_with_what_to_write(block, name, remedy):
    issue = finding(block)
    assert (issue.code, issue.line) == ("bad-character", 3)
    assert name in issue.message
    assert issue.remedy.startswith(remedy)


def test_the_caret_stands_before_the_character():
    assert finding("G1 X10 Y5 (−) Z−4".encode()).excerpt.endswith("Z^???4")


@pytest.mark.parametrize(
    ("block", "letter"), [(b"G1 X F600", "X"), (b"G1 X10 Y FOO", "Y"), (b"G1 X10 FOO", "F"), (b"FOO", "F")]
)
def test_a_letter_without_any_number_is_still_that(block, letter):
    issue = finding(block)
    assert (issue.code, issue.message) == ("no-number", f"{letter} is not followed by a number")


@pytest.mark.parametrize("block", [b"G1 X10 O<foo> call", b"G1 X10 OFOO", b"G1 X10 GOTO 5"])
def test_a_word_that_begins_with_o_or_jumps_is_an_o_word(block):
    assert finding(block).code == "o-word"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_a_file_in_utf16_is_called_so(encoding):
    mark = b"\xfe\xff" if encoding == "utf-16-be" else b""
    issue = refusal(mark + "G21 G90\nG0 X0\n".encode(encoding))
    assert (issue.code, issue.line) == ("binary-file", 1)
    assert "UTF-16" in issue.message
    assert "UTF-8" in issue.remedy
