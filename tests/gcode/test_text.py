"""Files as they come: packed, cut off, growing without end, encoded otherwise, and read in small pieces."""

import gzip
import io
import zlib
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import read_gcode
from gcode2krl.files.program_names import is_program_file, likely_text_bytes, program_stem
from gcode2krl.gcode import read as reading
from gcode2krl.gcode import text as text_of_files
from gcode2krl.gcode.text import pieces
from tests.conftest import EXAMPLES
from tests.gcode import errors, read, with_little_room

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


LONG_ARC = "G21 G17 G90\nS1000 M3\nG0 X0 Y0 Z0\nG1 Z-1 F600\nG2 X0 Y0 I50 J0 P40\nG4 P0.5\nG1 X1\nM5\nM30\n"
COMPUTING = {
    "linuxcnc": "#1=0\no1 while [#1 LT 50]\n#1=[#1+1] (MSG, a) M3 M7\nG2 X[#1] Y0 I.5\no1 endwhile\nM2\n",
    "fanuc": "#1=0\nN1 #1=#1+1\nG0 X0. Y0.\nG2 X1. Y0. I.5 M8\nG1 X#1 M98 P2\nIF [#1 LT 9] GOTO 1\nM30\n"
    "O2\nG1 Y1. M3 M7\nM99\n",
    "sinumerik": "R1=0\nAB: R1=R1+1\nG0 X0 Y0\nG2 X1 Y0 I0.5 M8\nG1 X=R1 M3\nIF R1<9 GOTOB AB\nM30\n",
}


def assert_alike(one, other):
    """Assert that two toolpaths are equal to the bit."""
    for field in fields(one):
        ours, theirs = getattr(one, field.name), getattr(other, field.name)
        if isinstance(ours, np.ndarray):
            np.testing.assert_array_equal(ours, theirs, err_msg=field.name)
        else:
            assert ours == theirs, field.name


@pytest.mark.parametrize(("piece_bytes", "buffer_rows"), [(64, 8), (1000, 17), (10**7, 5), (50, 10**5)])
@pytest.mark.parametrize("text", [*(p.read_bytes() for p in EXAMPLES), LONG_ARC.encode()])
def test_same_table(monkeypatch, text, piece_bytes, buffer_rows):
    whole = read(text)
    monkeypatch.setattr(text_of_files, "_PIECE_BYTES", piece_bytes)
    monkeypatch.setattr(reading, "_FIRST_ROWS", buffer_rows)
    assert_alike(read(text), whole)


@pytest.mark.parametrize("dialect", COMPUTING)
def test_a_program_that_computes_needs_no_more_room_than_it_has(monkeypatch, dialect):
    unit = "G710" if dialect == "sinumerik" else "G21"
    text = f"{unit} G90 G17 G94 F500.\nG0 X0. Y0. Z0.\n{COMPUTING[dialect]}"
    whole = read(text, dialect=dialect)
    with_little_room(monkeypatch)
    assert_alike(read(text, dialect=dialect), whole)


def test_an_arc_longer_than_the_buffer_keeps_its_dwell():
    toolpath = read(LONG_ARC, chord_tolerance_mm=0.0005)
    chords = np.flatnonzero(toolpath.arc == 0)
    assert len(chords) > reading._FIRST_ROWS
    assert np.flatnonzero(toolpath.dwell_s).tolist() == [chords[-1]]
    radius = np.hypot(toolpath.position_mm[chords, 0] - 50, toolpath.position_mm[chords, 1])
    np.testing.assert_allclose(radius, 50, rtol=0, atol=1e-9)


def test_a_line_may_have_more_messages_than_there_is_room_for_events():
    events = read("G21\n" + "(MSG, a)" * 400 + "\nG0 X1\nM30\n").events
    assert [event.values["text"] for event in events[:-1]] == ["a"] * 400


@pytest.mark.parametrize("piece_bytes", [30, 10**6])
def test_lines_behind_the_end_are_noticed_in_a_later_piece(monkeypatch, piece_bytes):
    monkeypatch.setattr(text_of_files, "_PIECE_BYTES", piece_bytes)
    issues = read("G21\nG0 X0 Y0 Z5\nM30\n" + "\n" * 100 + "%\nG0 X1\n").issues
    assert [issue.line for issue in issues if issue.code == "after-end"] == [105]


def test_blank_lines_longer_than_a_piece_are_not_an_empty_file(monkeypatch):
    monkeypatch.setattr(text_of_files, "_PIECE_BYTES", 16)
    assert read("\n" * 50 + "G21 G0 X1 Y2 Z3\nM30\n").source_line[-1] == 51
