"""A file read in small pieces, through a small buffer, is the file read at once."""

from dataclasses import fields

import numpy as np
import pytest

from gcode2krl.gcode import read as reading
from gcode2krl.gcode import text as text_of_files
from tests.conftest import EXAMPLES
from tests.gcode import read, with_little_room

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
