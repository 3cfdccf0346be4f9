"""A start that the cell states: tool, spindle and place of the tip, until the program changes them."""

import io

import numpy as np
import pytest

from gcode2krl import load_cell, set_targets, write_krl
from gcode2krl.cell.sections.fields import Frame
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode import read_stream
from gcode2krl.program.checks import check_toolpath

CUT = "G0 X0 Y0\nG0 Z5\nG1 Z-1 F600\nG1 X20\nG0 Z50\nM5\nM2\n"
HEAD = "G21 G90 G17 G94\n"


def cell(**keys):
    demonstration = load_cell()
    tools = dict(demonstration.tool)
    tools[1] = tools[1].model_copy(update={"max_rpm": 5000.0, "length_mm": 80.0})
    tools[2] = tools[1].model_copy(update={"length_mm": 120.0})
    return demonstration.model_copy(update={"tool": tools, "mounted_tool": 1, **keys})


def read(text, of_cell, dialect="linuxcnc"):
    return read_stream(io.BytesIO((HEAD + text).encode()), "part.ngc", of_cell, dialect=dialect)


def codes(text, of_cell):
    toolpath = read(text, of_cell)
    found = [*toolpath.issues, *check_toolpath(toolpath, of_cell)]
    return {issue.code for issue in found}


def test_its_number_is_in_every_row_and_variable():
    toolpath = read(f"S900 M3\n{CUT}", cell())
    assert set(toolpath.tool[1:].tolist()) == {1}
    assert (
        read("S900 M3\nF[#5400*100]\nG0 X0 Y0 Z5\nG1 X[#<_current_tool>]\nM2\n", cell()).position_mm[-1, 0]
        == 1
    )
    assert set(read(f"S900 M3\n{CUT}", cell(mounted_tool=None)).tool.tolist()) == {0}


@pytest.mark.parametrize("first", ["", "T1 M6\nG43 H1\n"])
def test_its_largest_speed_is_asked_with_and_without_a_change(first):
    assert "spindle-speed" in codes(f"{first}S9000 M3\n{CUT}", cell())
    assert "spindle-speed" not in codes(f"{first}S4000 M3\n{CUT}", cell())


def test_its_length_is_in_force_where_no_program_selects_one():
    program = cell().program.model_copy(update={"tool_length": "from_table"})
    toolpath = read(f"S900 M3\n{CUT}", cell(program=program))
    assert set(toolpath.length_offset_tool[1:].tolist()) == {1}
    assert set(toolpath.length_offset_mm[1:].tolist()) == {80.0}


def test_another_length_than_its_own_is_told_as_behind_a_change():
    for first in ("", "T1 M6\n"):
        found = codes(f"{first}S900 M3\nG43 H2\n{CUT}", cell())
        assert {"h-differs", "g43-missing"} <= found
    assert not {"h-differs", "g43-missing"} & codes(f"S900 M3\nG43 H1\n{CUT}", cell())
    assert not {"h-differs", "g43-missing"} & codes(f"S900 M3\n{CUT}", cell())  # touched off
    assert "g43-missing" in codes(f"T1 M6\nS900 M3\n{CUT}", cell())


def test_a_tool_that_only_t_names_is_not_in_the_spindle():
    found = codes(f"T2\nS900 M3\nG43 H1\n{CUT}", cell())
    assert "tool-not-changed" in found
    assert "h-differs" not in found


def test_that_it_is_assumed_is_said_only_where_it_moves():
    assert "tool-assumed" in codes(f"S900 M3\n{CUT}", cell())
    assert "tool-assumed" in codes(f"S900 M3\nG0 X0 Y0 Z50\nT2 M6\nG43 H2\nS900 M3\n{CUT}", cell())
    assert "tool-assumed" not in codes(f"T1 M6\nG43 H1\nS900 M3\n{CUT}", cell())
    assert "tool-missing" in codes(f"S900 M3\n{CUT}", cell(mounted_tool=None))
    assert "tool-missing" in codes(f"T0 M6\nS900 M3\n{CUT}", cell())


def stated(**start):
    program = load_cell().program
    return cell(program=program.model_copy(update={"start": program.start.model_copy(update=start)}))


def test_a_spindle_that_is_switched_by_hand_turns_until_the_program_stops_it():
    by_hand = stated(spindle_rpm=4000.0)
    toolpath = read(CUT, by_hand)
    assert toolpath.spindle_rad_s[:5].tolist() == pytest.approx([4000 * 2 * np.pi / 60] * 5)
    assert toolpath.events[0].values["m"] == 5  # nothing of the robot has switched it on
    assert "spindle-off" in codes(CUT, cell())
    assert not {"spindle-off", "spindle-speed"} & codes(CUT, by_hand)
    assert "spindle-off" in codes("M5\n" + CUT, by_hand)
    assert "spindle-off" in codes("T1 M6\nG43 H1\n" + CUT, by_hand)
    assert "spindle-speed" in codes(CUT, stated(spindle_rpm=9000.0))


def test_the_program_halts_until_a_person_has_seen_the_spindle_turn(tmp_path):
    cases = (("A", stated(spindle_rpm=4000.0), "", 1), ("B", stated(), "S4000 M3\n", 0))
    for name, of_cell, first, asked in cases:
        write_krl(set_targets(read(first + CUT, of_cell), of_cell), tmp_path / f"{name}.src", of_cell)
        before_motion = (tmp_path / f"{name}.src").read_text("utf-8").partition("\nPTP ")[0]
        assert before_motion.count("Spindle switched by hand: does it turn at 4000 rpm?") == asked
        assert before_motion.count("\nHALT") >= 1 + asked


def test_the_tip_begins_where_the_cell_says():
    """The rows are those of the program with a G0 to that place before it, under G91 too."""
    there = stated(position_mm=(5.0, -2.0, 30.0), spindle_rpm=4000.0)
    for text in ("G1 Z-1 F600\nX20\nG0 Z50\nM2\n", "G91\nG1 Z-4 F600\nX20\nG0 Z50\nM2\n"):
        begun, written = read(text, there), read(f"G0 X5 Y-2 Z30\nG90\n{text}", stated(spindle_rpm=4000.0))
        assert begun.position_mm.tolist() == written.position_mm.tolist()
        assert begun.is_position().tolist() == written.is_position().tolist()
        assert begun.rapid.tolist() == written.rapid.tolist()
        assert begun.feed_mm_s.tolist() == written.feed_mm_s.tolist()
        assert "undefined-position" in codes(text, stated(spindle_rpm=4000.0))
        assert "undefined-position" not in codes(text, there)


def test_a_place_at_the_start_that_would_be_ambiguous_is_refused():
    turned = {"G54": Frame(x_mm=0, y_mm=0, z_mm=0, a_deg=30, b_deg=0, c_deg=0)}
    of_cell = stated(position_mm=(0.0, 0.0, 50.0)).model_copy(update={"work_offsets": turned})
    with pytest.raises(NotUnderstoodError) as error:
        read(CUT, of_cell)
    assert error.value.issues[0].code == "cell-key"


def test_a_zero_that_is_set_where_the_tip_stands_is_there():
    there = stated(position_mm=(100.0, 0.0, 30.0), spindle_rpm=4000.0)
    for zero in ("G92 X0 Y0 Z0", "G10 L20 P1 X0 Y0 Z0"):
        toolpath = read(f"{zero}\nG1 X10 F600\nM2\n", there)
        assert toolpath.position_mm[-1].tolist() == [110.0, 0.0, 30.0]
        assert not {issue.code for issue in toolpath.issues} & {"offset-at-start", "offset-from-unknown"}
