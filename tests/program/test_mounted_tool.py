"""A start that the cell states: the mounted tool is in the spindle, for every check, until the first M6."""

import io

import pytest

from gcode2krl import load_cell
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
