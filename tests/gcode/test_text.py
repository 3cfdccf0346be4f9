"""Files as they come: packed, cut off, growing without end, with other encodings and line ends."""

import gzip
import io
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import read_gcode
from gcode2krl.files.program_names import is_program_file, likely_text_bytes, program_stem
from gcode2krl.gcode import text as text_of_files
from gcode2krl.gcode.text import pieces
from tests.conftest import EXAMPLES
from tests.gcode import errors, read

PROGRAM = b"G21 G90\nG0 X0 Y0 Z5\nG1 Z-1 F100\nX10\nG0 Z5\nM30\n"


def positions(content):
    return read(content).position_mm


def refusal(content):
    (issue,) = errors(content, name="part.nc.gz")
    assert "\n" not in issue.message
    assert issue.remedy
    return issue


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.name)
def test_a_packed_program_is_the_program(example, tmp_path):
    packed = tmp_path / "part.nc.gz"
    packed.write_bytes(gzip.compress(example.read_bytes()))
    np.testing.assert_array_equal(read_gcode(packed).position_mm, read_gcode(example).position_mm)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.binary(max_size=300), max_size=5), st.integers(2, 700))
def test_members_and_pieces_say_what_was_packed(parts, piece_bytes):
    lines = [b"(" + part.hex().encode() + b")\n" for part in parts]
    packed = b"".join(gzip.compress(line) for line in [b"G21\n", *lines])
    before = text_of_files._PIECE_BYTES
    text_of_files._PIECE_BYTES = piece_bytes
    try:
        found = b"".join(text for _, text in pieces(io.BytesIO(packed), "part.nc.gz"))
    finally:
        text_of_files._PIECE_BYTES = before
    assert found == b"".join([b"G21\n", *lines])


@pytest.mark.parametrize("missing", [1, 8, 9, 20])
def test_a_gzip_file_that_is_cut_off_is_one_line(missing):
    issue = refusal(gzip.compress(PROGRAM)[:-missing])
    assert issue.code == "gzip-damaged"
    assert "cut off" in issue.message


def test_each_byte_that_is_wrong_is_noticed():
    packed = gzip.compress(PROGRAM, mtime=0)
    for place in range(10, len(packed)):
        wrong = packed[:place] + bytes([packed[place] ^ 0x55]) + packed[place + 1 :]
        assert "gzip-damaged" in {issue.code for issue in errors(wrong, name="part.nc.gz")}, place


def test_a_file_that_grows_without_end_is_refused_early():
    packer = zlib.compressobj(9, wbits=31)
    line = b"G1 X1 F100\n" * 100_000
    bomb = b"".join([*(packer.compress(line) for _ in range(60)), packer.flush()])
    issue = refusal(bomb)
    assert issue.code == "gzip-damaged"
    assert "100 times" in issue.message


@pytest.mark.parametrize(
    "form",
    [
        lambda text: text.replace(b"\n", b"\r\n"),
        lambda text: text.rstrip(b"\n"),
        lambda text: text.replace(b"\n", b"\r\n").rstrip(),
        lambda text: b"\xef\xbb\xbf" + text,
        lambda text: b"(Fr\xe4ser \xd8 6)\n" + text,
        lambda text: "(Fräser Ø 6)\n".encode() + text,
        lambda text: text + b"\x1a",
        lambda text: gzip.compress(b"\xef\xbb\xbf" + text.replace(b"\n", b"\r\n")),
    ],
)
def test_encodings_and_line_ends_change_nothing(form):
    np.testing.assert_array_equal(positions(form(PROGRAM)), positions(PROGRAM))


def test_text_in_utf16_without_a_mark_is_called_so():
    issue = refusal("G21 G90\nG0 X0\n".encode("utf-16-le"))
    assert issue.code == "binary-file"
    assert "UTF-16" in issue.message


@pytest.mark.parametrize(
    ("name", "stem", "read"),
    [
        ("part.nc", "part", True),
        ("jobs/part.nc.gz", "part", True),
        ("PART.MPF.GZ", "PART", True),
        ("part.v2.tap", "part.v2", True),
        ("part.min", "part", True),
        ("part.txt", "part", False),
        ("part.gz", "part", False),
    ],
)
def test_names(name, stem, read):
    assert program_stem(name) == stem
    assert is_program_file(name) == read


def test_a_packed_file_is_expected_to_grow(tmp_path):
    for name, times in (("a.nc", 1), ("a.nc.gz", 10)):
        (tmp_path / name).write_bytes(b"12345")
        assert likely_text_bytes(tmp_path / name) == 5 * times
