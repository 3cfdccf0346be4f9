"""Reading: conventions beyond what LinuxCNC's interpreter prints, memory, tools, events."""

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcode2krl import Gcode2KrlError, read_gcode
from gcode2krl.cell import resolve_cell
from gcode2krl.gcode import text as text_of_files
from tests.gcode import errors, named, read


def test_row_0_is_the_start_and_axes_not_programmed_stay():
    toolpath = read("G21 G0 X5\nZ7\nM2\n")
    np.testing.assert_array_equal(toolpath.position_mm, [[0, 0, 0], [5, 0, 0], [5, 0, 7]])
    np.testing.assert_array_equal(toolpath.known, [[0, 0, 0], [1, 0, 0], [1, 0, 1]])
    assert toolpath.feed_mm_s[1] == np.inf
    np.testing.assert_array_equal(toolpath.axis, [[0, 0, 1]] * 3)


@pytest.mark.parametrize("radius", ["99999999999", "999999999999999"])
def test_an_arc_of_more_than_a_million_chords_is_a_mistake(radius):
    with pytest.raises(Gcode2KrlError, match="more than a million chords") as caught:
        read(f"G21 G17 G90 G0 X0 Y0 Z0\nG2 I{radius} J0 F500\nM2\n")
    assert [(issue.code, issue.line) for issue in caught.value.issues] == [("too-far", 2)]


@named(
    ("lines", "axis", "known"),
    {
        "incremental moves make none known": ("G21 G91 G0 X5\nG90 X1\nG91 X1", 0, [0, 0, 1, 1]),
        "machine moves make it unknown": (
            "G21 G0 X1 Y2 Z3\nG28 G91 Z0\nG90 G0 X4\nZ5",
            2,
            [0, 1, 1, 0, 0, 1],
        ),
    },
)
def test_what_is_known_of_an_axis(lines, axis, known):
    np.testing.assert_array_equal(read(f"{lines}\nM2\n").known[:, axis], known)


def test_machine_moves_are_marked():
    toolpath = read("G21 G0 X1 Y2 Z3\nG28 G91 Z0\nG90 G0 X4\nZ5\nM2\n")
    np.testing.assert_array_equal(toolpath.machine, [0, 0, 1, 1, 0, 0])


def test_a_change_of_length_offset_makes_z_unknown(cell):
    toolpath = read("G21 T1 M6\nG0 X0 Y0 Z50\nG43 H1\nX10\nG0 Z40\nM2\n", cell)
    np.testing.assert_array_equal(toolpath.known[:, 2], [0, 1, 0, 1])
    np.testing.assert_allclose(toolpath.position_mm[:, 2], [0, 50, -50, 40])
    np.testing.assert_array_equal(np.isnan(toolpath.length_offset_mm), [1, 1, 0, 0])


def test_events_stand_at_the_row_where_the_tool_stands():
    toolpath = read("G21 (MSG, look out)\nT3 M6\nS500 M3 M8\nG0 X1 Y1 Z1\nS700\nM7\nG0 X2\nM0\nM30\n")
    kinds = [(event.row, event.kind, event.values.get("m")) for event in toolpath.events]
    assert kinds == [
        (0, "message", -1),
        (0, "tool", None),
        (0, "spindle", 3),
        (0, "coolant", 8),
        (1, "spindle", 3),
        (1, "coolant", 7),
        (2, "message", 0),
        (2, "message", 30),
        (2, "spindle", 5),
        (2, "coolant", 9),
    ]
    assert toolpath.events[0].values["text"] == "look out"
    assert toolpath.events[5].values["flood"]
    assert toolpath.events[5].values["mist"]
    np.testing.assert_allclose(toolpath.spindle_rad_s[1:] * 60 / (2 * np.pi), [500, 700])


def test_dwells_add_up_at_the_row():
    toolpath = read("G21 G0 X1 Y1 Z1\nG4 P0.5\nG4 P1\nX2\nM2\n")
    np.testing.assert_allclose(toolpath.dwell_s, [0, 1.5, 0])


def test_path_modes():
    toolpath = read("G21 G0 X1\nG61 X2\nG64 P0.1 X3\nG20 G64 P0.1 X4\nG64 X5\nM2\n")
    np.testing.assert_array_equal(toolpath.exact_stop, [0, 0, 1, 0, 0, 0])
    np.testing.assert_allclose(toolpath.tolerance_mm, [np.nan, np.nan, np.nan, 0.1, 2.54, np.nan])


def test_chords_of_an_arc_share_a_number_and_end_exactly():
    toolpath = read("G21 G0 X10 Y0 Z0\nG3 X-10 I-10 F100\nG1 X0\nG2 X1 Y1 R1\nM2\n")
    assert set(toolpath.arc.tolist()) == {-1, 0, 1}
    last = np.flatnonzero(toolpath.arc == 0)[-1]
    np.testing.assert_array_equal(toolpath.position_mm[last], [-10, 0, 0])


@settings(max_examples=60, deadline=None)
@given(
    st.floats(0.01, 500),
    st.floats(0, 2 * np.pi),
    st.floats(0.05, 2 * np.pi - 0.05),
    st.booleans(),
    st.sampled_from([0.001, 0.01, 0.1]),
)
def test_chords_stay_within_the_tolerance(radius, start, sweep, ccw, tolerance):
    end = start + sweep if ccw else start - sweep
    x0, y0 = radius * np.cos(start), radius * np.sin(start)
    x1, y1 = radius * np.cos(end), radius * np.sin(end)
    code = "G3" if ccw else "G2"
    text = f"G21 G0 X{x0:.9f} Y{y0:.9f} Z0\n{code} X{x1:.9f} Y{y1:.9f} I{-x0:.9f} J{-y0:.9f} F100\nM2\n"
    points = read(text, chord_tolerance_mm=tolerance).position_mm[1:, :2]
    np.testing.assert_allclose(np.hypot(*points.T), radius, atol=1e-6)
    middle = (points[1:] + points[:-1]) / 2
    assert (radius - np.hypot(*middle.T)).max() <= tolerance + 1e-7
    turned = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert abs(turned[-1] - turned[0]) == pytest.approx(sweep, abs=1e-5)


def test_long_files_are_read_in_pieces_with_the_same_result(monkeypatch):
    text = (
        "G21 G0 X0 Y0 Z0\nG1 F500 X1\n"
        + "".join(f"X{k % 97}.{k % 10} (MSG, {k})\n" for k in range(3000))
        + "M2\n"
    )
    whole = read(text)
    monkeypatch.setattr(text_of_files, "_PIECE_BYTES", 5000)
    pieces = read(text)
    np.testing.assert_array_equal(pieces.position_mm, whole.position_mm)
    np.testing.assert_array_equal(pieces.source_line, whole.source_line)
    assert pieces.events == whole.events
    assert len(whole) == 3003


def test_a_large_arc_grows_the_rows():
    toolpath = read("G21 G0 X0 Y0 Z0\nG3 X0 Y0 I900 P30 F100\nM2\n", chord_tolerance_mm=0.001)
    assert len(toolpath) > 60_000
    np.testing.assert_array_equal(toolpath.position_mm[-1], [0, 0, 0])


def test_work_offsets_of_the_cell():
    zero = dict.fromkeys(("y_mm", "a_deg", "b_deg", "c_deg"), 0.0)
    cell = resolve_cell({"work_offsets": {"G55": {"x_mm": 100.0, "z_mm": -5.0, **zero}}})
    toolpath = read("G21 G55 G0 X1 Y1 Z1\nG56 X1\nM2\n", cell)
    np.testing.assert_allclose(toolpath.position_mm[1:], [[101, 1, -4], [1, 1, -4]])
    assert [(issue.code, issue.line) for issue in toolpath.issues] == [("work-offset-unknown", 2)]


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ("G0 X1.2345 Y2 Z3\n", ["no-program-end", "unit-doubtful"]),
        ("G0 X100\nM2\nG1 X5\n", ["after-end", "unit-unnamed"]),
        ("(part in INCHES)\nG21 G0 X100\nM2\n", ["unit-doubtful"]),
    ],
)
def test_findings_of_a_whole_program(text, codes):
    assert [issue.code for issue in read(text).issues] == codes


def test_all_errors_come_together_with_their_lines():
    found = errors("G21\nG77\nG0 X\nG1 X1\nG0 X1 Q5\nM2\n")
    assert [issue.line for issue in found] == [2, 3, 4, 5]
    assert all(issue.remedy for issue in found)


def test_warnings_never_crowd_out_an_error():
    assert "G77" in errors("G21\n" + "G55\nG54\n" * 2000 + "G77\n")[0].message


@settings(max_examples=300, deadline=None)
@given(st.text(alphabet="GXYZFIJRMTSHNPO0123456789.-+ ()%/;#[]=\n\r\tßA", max_size=200))
def test_any_text_gives_a_table_or_findings(text):
    if found := errors(text):
        assert all(issue.message for issue in found)
    else:
        assert np.isfinite(read(text).position_mm).all()


def test_a_folder_is_not_a_part(tmp_path):
    with pytest.raises(Gcode2KrlError, match="cannot read"):
        read_gcode(tmp_path)


def test_a_tool_table_in_mm(tmp_path):
    table = tmp_path / "tool.tbl"
    table.write_text("T1 P1 Z12.5 D6 ; mill\n\nT2 P2 Z+20\n", encoding="ascii")
    toolpath = read("G21 T2 M6\nG43 G0 Z50 X0 Y0\nM2\n", tools=table)
    np.testing.assert_array_equal(toolpath.length_offset_mm[1:], [20.0])
    table.write_text("Z1\n", encoding="ascii")
    with pytest.raises(Gcode2KrlError, match=r"tool\.tbl:1"):
        read("G21\n", tools=table)


def test_a_refused_program_leaves_no_thread_behind():
    before = threading.active_count()
    kept = [errors("BEGIN PGM PART MM\nL X+10 R0 FMAX\n") for _ in range(3)]
    assert all(kept)
    assert threading.active_count() == before


@pytest.mark.parametrize(
    ("arc", "is_flat"),
    [
        ("G2 X0.001 Y-7.5 I-0.001 J0", True),
        ("G3 X0.002 Y-7.5 R0.0008", True),
        ("G2 X0.001 Y-7.5 Z3 I-0.001", True),
        ("G2 X0.001 Y-7.5 I-0.002", False),
    ],
)
def test_an_arc_below_the_chord_tolerance_is_a_straight_move_with_a_note(arc, is_flat):
    toolpath = read(f"G21 G90\nG0 X0.001 Y-7.5 Z5\n{arc} F600\nG1 X20\nM2\n")
    assert [i.code for i in toolpath.issues] == ["arc-small"] * is_flat
    assert (toolpath.arc[2] == -1) == is_flat
    assert not is_flat or (len(toolpath), toolpath.position_mm[2, 2]) == (4, 3.0 if "Z3" in arc else 5.0)
