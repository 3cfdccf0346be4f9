"""Characters of documents and other encodings are named, so that they can be found and replaced."""

import io
import re

import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode import read_stream

HEAD = b"G21 G90 G17\nG0 X0 Y0 Z5\n"


def finding(block: bytes):
    with pytest.raises(NotUnderstoodError) as refused:
        read_stream(io.BytesIO(HEAD + block + b"\nM30\n"), "part.nc")
    return refused.value.issues[0]


@pytest.mark.parametrize(
    ("block", "name"),
    [
        ("G1 Z−4. F600".encode(), "U+2212 MINUS SIGN"),
        ("G1 X10–4. F600".encode(), "U+2013 EN DASH"),
        (b"G1 Z\x964. F600", "U+2013 EN DASH"),
    ],
)
def test_a_dash_for_a_minus_is_named_with_what_to_write(block, name):
    issue = finding(block)
    assert (issue.code, issue.line) == ("bad-character", 3)
    assert name in issue.message
    assert "write -" in issue.remedy


@pytest.mark.parametrize(
    ("block", "name"),
    [
        ("G1 Z“4.” F600".encode(), "U+201C LEFT DOUBLE QUOTATION MARK"),
        (b"G1 Z\x93" + b"4.\x94 F600", "U+201C LEFT DOUBLE QUOTATION MARK"),
        ("G1 X10 Y5°".encode(), "U+00B0 DEGREE SIGN"),
        (b"G1 X10 Y5\xb0", "U+00B0 DEGREE SIGN"),
        ("G1 X\u00a010".encode(), "U+00A0 NO-BREAK SPACE"),
        ("G1 X10 \U0001d7d9".encode(), "U+1D7D9 MATHEMATICAL DOUBLE-STRUCK DIGIT ONE"),
        (b"G1 X10 \x81", "character 0x81"),
        (b"G1 X10 \xe2\x88", "U+00E2"),
        (b"G1 X10 $", "character '$'"),
    ],
)
def test_other_characters_are_named(block, name):
    issue = finding(block)
    assert (issue.code, issue.line) == ("bad-character", 3)
    assert name in issue.message
    assert re.match("remove (it|the line)|write a plain blank", issue.remedy)


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
    with pytest.raises(NotUnderstoodError) as refused:
        read_stream(io.BytesIO(mark + "G21 G90\nG0 X0\n".encode(encoding)), "part.nc")
    (issue,) = refused.value.issues
    assert (issue.code, issue.line) == ("binary-file", 1)
    assert "UTF-16" in issue.message
    assert "UTF-8" in issue.remedy
