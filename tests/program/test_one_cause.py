"""Checks of a Toolpath: one finding for one cause, which is named; lengths from the table."""

import io

import pytest

from gcode2krl import load_cell
from gcode2krl.errors import told
from gcode2krl.gcode import read_stream
from gcode2krl.program.checks import check_toolpath


def found(text, code, cell=None):
    cell = cell or load_cell()
    toolpath = read_stream(io.BytesIO(text.encode()), "part.nc", cell)
    issues = [issue for issue in check_toolpath(toolpath, cell) if issue.code == code]
    return [finding.first for finding in told(issues).findings]


CUTS = "".join(f"G0 X{k} Y0 Z5\nG1 Z-1 F100\n" for k in range(30))


@pytest.mark.parametrize(
    ("head", "cause"),
    [
        ("G21 T1 M6\nG43\n", "no M3 comes before it"),
        ("G21 T1 M6\nG43\nM3\n", "M3 without S in line 3"),
        ("G21 T1 M6\nG43\nS900 M3\nM5\n", "stopped by M5 in line 4"),
        ("G21 S900 M3\nG43\nT1 M6\nG43\n", "stopped by M6 in line 3"),
    ],
)
def test_a_spindle_that_stands_is_one_finding_that_names_its_cause(head, cause):
    (issue,) = found(head + CUTS + "M30\n", "spindle-off")
    assert cause in issue.message


def test_a_height_that_never_comes_is_one_finding_that_counts_the_lines():
    text = "G21 T1 M6\nG43\nS900 M3\nG0 X0 Y0\n" + "G0 X1\nG1 X2 F100\n" * 600 + "M30\n"
    (issue,) = found(text, "undefined-position")
    assert issue.line == 6
    assert "no Z in 1,204 lines" in issue.message


def test_a_height_that_comes_too_late_names_the_line_where_it_comes():
    (issue,) = found("G21 T1 M6\nG43\nS900 M3\nG0 X0 Y0\nG1 X2 F100\nG0 Z5\nM30\n", "undefined-position")
    assert issue.line == 5
    assert "no Z before line 6" in issue.message


def test_a_height_lost_by_a_machine_move_names_it():
    text = "G21 T1 M6\nG43\nS900 M3\nG0 X0 Y0 Z5\nG28 G91 Z0\nG90 G1 X2 F100\nM30\n"
    (issue,) = found(text, "undefined-position")
    assert "machine move (G28, G30, G53) in line 5" in issue.message


def test_a_program_without_g43_is_told_once_with_both_ways_out(tmp_path):
    text = "G21 G90\nT1 M6\nS900 M3\n" + CUTS + "M30\n"
    (issue,) = found(text, "g43-missing")
    assert 'tool_length = "from_table"' in issue.remedy
    assert "--allow g43-missing" in issue.remedy
    path = tmp_path / "cell.toml"
    path.write_text('based_on = "demonstration"\n[program]\ntool_length = "from_table"\n', encoding="ascii")
    assert not found(text, "g43-missing", load_cell(path))


def test_the_length_of_another_tool_is_never_the_tables(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text('based_on = "demonstration"\n[program]\ntool_length = "from_table"\n', encoding="ascii")
    text = "G21 G90\nT1 M6\nG43 H2\nS900 M3\n" + CUTS + "M30\n"
    (issue,) = found(text, "g43-missing", load_cell(path))
    assert "from_table" not in issue.remedy


HEAD = "G21 G90 G17\n"
CUT = "S8000 M3\nG0 X0 Y0\nG43 H{0} Z30\nG1 Z-1 F600\nX20\nG0 Z30\nM5\n"
SILENT = "; tool {{ tool }}"


def program(*tools):
    return HEAD + "".join(f"T{tool} M6\n" + CUT.format(tool) for tool in tools) + "M30\n"


def silent(plan, tools, **cell):
    return [i for i in plan(program(*tools), cell).targets.issues if i.code == "tool-change-silent"]


@pytest.mark.parametrize(
    ("tools", "tool_change", "lines"),
    [
        ((1, 2), SILENT, [10]),
        ((2,), SILENT, [2]),
        ((1, 2, 1), SILENT, [10]),
        ((1, 2), "{% if tool == 1 %}HALT{% endif %}", [10]),
        ((1, 2), "$OUT[41]=TRUE", [10]),
        ((1, 2), "IF $IN[5] THEN\nHALT\nENDIF", [10]),
        ((1, 1), SILENT, []),
        ((1, 2), "HALT ; tool {{ tool }}", []),
        ((1, 2), "$OUT[41]=TRUE\nWAIT FOR $IN[41]", []),
        ((1, 2), "$OUT[41]=TRUE\nWAIT SEC 8.0", []),
    ],
)
def test_a_change_needs_somebody_who_changes(plan, tools, tool_change, lines):
    """Tool 1 is mounted in the demonstration cell."""
    found = silent(plan, tools, tool_change=tool_change)
    assert [(issue.severity, issue.line, issue.key) for issue in found] == [
        ("error", line, "tool_change") for line in lines
    ]


def test_a_subprogram_may_change_the_tool(plan):
    externals = {"externals": ["CHANGE(INT :IN)"]}
    assert silent(plan, (1, 2), tool_change="CHANGE({{ tool }})", program=externals) == []
