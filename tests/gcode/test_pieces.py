"""A file read in small pieces, through a small buffer, is the file read at once."""

import io
from dataclasses import fields

import numpy as np
import pytest

from gcode2krl.gcode import read, read_stream
from gcode2krl.gcode import text as text_of_files
from tests.conftest import EXAMPLES

LONG_ARC = "G21 G17 G90\nS1000 M3\nG0 X0 Y0 Z0\nG1 Z-1 F600\nG2 X0 Y0 I50 J0 P40\nG4 P0.5\nG1 X1\nM5\nM30\n"


def columns(text, name="part.nc"):
    toolpath = read_stream(io.BytesIO(text), name)
    found = {f.name: getattr(toolpath, f.name) for f in fields(toolpath)}
    return found


@pytest.mark.parametrize(("piece_bytes", "buffer_rows"), [(64, 8), (1000, 17), (10**7, 5), (50, 10**5)])
@pytest.mark.parametrize("text", [*(p.read_bytes() for p in EXAMPLES), LONG_ARC.encode()])
def test_same_table(monkeypatch, text, piece_bytes, buffer_rows):
    whole = columns(text)
    monkeypatch.setattr(text_of_files, "_PIECE_BYTES", piece_bytes)
    monkeypatch.setattr(read, "_FIRST_ROWS", buffer_rows)
    for name, column in columns(text).items():
        if isinstance(column, np.ndarray):
            np.testing.assert_array_equal(column, whole[name], err_msg=name)
        else:
            assert column == whole[name], name


def test_an_arc_longer_than_the_buffer_keeps_its_dwell():
    toolpath = read_stream(io.BytesIO(LONG_ARC.encode()), "part.nc", chord_tolerance_mm=0.0005)
    chords = np.flatnonzero(toolpath.arc == 0)
    assert len(chords) > read._FIRST_ROWS
    assert toolpath.dwell_s[chords[-1]] == 0.5
    assert np.count_nonzero(toolpath.dwell_s) == 1
    radius = np.hypot(toolpath.position_mm[chords, 0] - 50, toolpath.position_mm[chords, 1])
    np.testing.assert_allclose(radius, 50, rtol=0, atol=1e-9)


def test_a_line_may_have_more_messages_than_there_is_room_for_events():
    text = "G21\n" + "(MSG, a)" * 400 + "\nG0 X1\nM30\n"
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc")
    assert [event.values["text"] for event in toolpath.events[:400]] == ["a"] * 400
    assert len(toolpath.events) == 401


@pytest.mark.parametrize("piece_bytes", [30, 10**6])
def test_lines_behind_the_end_are_noticed_in_a_later_piece(monkeypatch, piece_bytes):
    monkeypatch.setattr(text_of_files, "_PIECE_BYTES", piece_bytes)
    text = "G21\nG0 X0 Y0 Z5\nM30\n" + "\n" * 100 + "%\nG0 X1\n"
    (found,) = [i for i in read_stream(io.BytesIO(text.encode()), "part.nc").issues if i.code == "after-end"]
    assert found.line == 105


def test_blank_lines_longer_than_a_piece_are_not_an_empty_file(monkeypatch):
    monkeypatch.setattr(text_of_files, "_PIECE_BYTES", 16)
    toolpath = read_stream(io.BytesIO(b"\n" * 50 + b"G21 G0 X1 Y2 Z3\nM30\n"), "part.nc")
    assert toolpath.source_line[-1] == 51
