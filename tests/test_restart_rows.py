"""Which row a restart begins at, and what is in force there; no material."""

import io
from dataclasses import replace

import numpy as np
import pytest

from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode import read_stream
from gcode2krl.restart.rows import ENTRY_MM_S, approached_row, begun_at, begun_row, row_before, state_words
from gcode2krl.tables import Restart

PROGRAM = """G21 G90 G17
T1 M6
G0 X0 Y0
G0 G43 H1 Z50
S12000 M3
M8
G0 X5
G1 Z-2 F600
G2 X15 Y0 I5 J0 F6000
G1 X50
M10
G28 Z0
T2 M6
S8000 M3
G0 X60 Y0
G43 H2 Z20
M7
G1 Z-1 F300
G1 X90
G0 Z50
M9
M5
M30
"""
ARC, STRAIGHT, AFTER_CHANGE, SECOND = 9, 10, 15, 19


@pytest.fixture(scope="module")
def path(cell):
    m10 = cell.model_copy(update={"m_code": {**cell.m_code, "M10": "; clamp"}})
    return read_stream(io.BytesIO(PROGRAM.encode("ascii")), "two tools", m10)


def begun(path, line, way=((0.0, 0.0, 80.0), (0.0, 0.0, 5.0), (0.0, 0.0, 0.0))):
    row = begun_row(path, line)
    return begun_at(path, row, Restart(line, line), np.array(way))


def refusal(path, line):
    with pytest.raises(NotUnderstoodError) as caught:
        begun_row(path, line)
    (issue,) = caught.value.issues
    assert issue.code == "restart-line"
    assert issue.line == line
    return f"{issue.message} -> {issue.remedy}"


def test_the_middle_of_an_arc_cannot_be_meant_so_its_first_chord_is_the_start(path):
    row = begun_row(path, ARC)
    assert path.arc[row] >= 0
    assert path.arc[row - 1] != path.arc[row]
    assert np.count_nonzero(path.source_line == ARC) > 10


def test_a_line_without_motion_names_the_next_that_has_one(path):
    assert (
        refusal(path, 6) == "line 6 moves nothing -> --from-line 7 is the next that has a motion of its own"
    )


def test_a_machine_move_is_none_to_begin_with(path):
    assert "line 12 is a machine move (G28, G30, G53)" in refusal(path, 12)


def test_lines_behind_the_last_motion_name_it(path):
    assert "behind the last line that moves the tool, 20" in refusal(path, 21)
    assert "behind the last line that moves the tool, 20" in refusal(path, 5000)


def test_a_line_within_a_tool_change_names_the_one_where_it_is_over(path):
    words = refusal(path, AFTER_CHANGE)
    assert "within the change to T2 of line 13" in words
    assert "--from-line 16" in words
    assert "within the change to T1 of line 2" in refusal(path, 3)


def test_a_line_that_runs_twice_is_refused(path):
    lines = np.array(path.source_line)
    lines[begun_row(path, SECOND)] = STRAIGHT
    assert "line 10 runs 2 times" in refusal(replace(path, source_line=lines), STRAIGHT)


def test_what_was_switched_on_before_is_switched_on_again_and_no_more(path):
    assert state_words(begun(path, STRAIGHT)) == "T1, M3 S12000, M8"
    assert state_words(begun(path, 7)) == "T1, M3 S12000, M8"
    assert state_words(begun(path, SECOND)) == "T2, M3 S8000, M7, M8"  # M8 has never been switched off
    assert state_words(begun(path, 20)) == "T2, M3 S8000, M7, M8"


def test_tool_at_home_spindle_and_coolant_over_the_work(path):
    events = [(event.row, event.kind) for event in begun(path, STRAIGHT).events]
    assert events[:3] == [(0, "tool"), (1, "spindle"), (1, "coolant")]


def test_the_rest_is_the_rest(path):
    row = begun_row(path, STRAIGHT)
    rest = begun(path, STRAIGHT)
    for name in ("position_mm", "rapid", "feed_mm_s", "spindle_rad_s", "tool", "source_line", "known"):
        assert np.array_equal(getattr(rest, name)[4:], getattr(path, name)[row:]), name
    later = [event for event in path.events if event.row >= row]
    assert [event.values for event in rest.events[-len(later) :]] == [event.values for event in later]
    assert [event.row - 4 for event in rest.events[-len(later) :]] == [event.row - row for event in later]


def test_the_way_down_is_rapid_but_for_its_last_piece_which_is_slow(path):
    rest = begun(path, STRAIGHT)  # F6000
    assert rest.restart.way_rows == 3
    assert rest.rapid[1:4].tolist() == [True, True, False]
    assert rest.feed_mm_s[3] == pytest.approx(ENTRY_MM_S)
    assert begun(path, SECOND).feed_mm_s[3] == pytest.approx(5.0)  # F300
    assert rest.exact_stop[1:4].all()
    assert not rest.known[0].any()
    assert rest.known[1:4].all()


def test_a_rapid_is_approached_at_its_end_a_feed_move_at_its_start(path):
    rapid, feed = begun_row(path, 7), begun_row(path, 8)
    assert approached_row(path, rapid) == rapid
    assert approached_row(path, feed) == feed - 1


def test_the_move_before_is_the_whole_line_before(path):
    assert row_before(path, begun_row(path, STRAIGHT)) == begun_row(path, ARC)


def test_an_m_code_that_is_not_repeated_is_named(path):
    assert not [i for i in begun(path, STRAIGHT).issues if i.code == "restart-not-repeated"]
    (issue,) = [i for i in begun(path, SECOND).issues if i.code == "restart-not-repeated"]
    assert issue.message == "M10 of line 11, before the restart, is not repeated"
