"""Characters of documents and other encodings are named, so that they can be found and replaced."""

import pytest

from tests.gcode import refusal


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


def test_a_letter_without_any_number_is_still_that():
    assert finding(b"G1 X F600").code == "no-number"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-be"])
def test_a_file_in_utf16_is_called_so(encoding):
    mark = b"\xfe\xff" if encoding == "utf-16-be" else b""
    issue = refusal(mark + "G21 G90\nG0 X0\n".encode(encoding))
    assert (issue.code, issue.line) == ("binary-file", 1)
    assert "UTF-16" in issue.message
    assert "UTF-8" in issue.remedy
