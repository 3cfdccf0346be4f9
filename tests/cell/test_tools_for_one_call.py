"""``--tools LIBRARY``: tools that the cell does not have; and comments against a tool that was checked."""

import json

import pytest

from gcode2krl import load_cell
from gcode2krl.cell import resolve_cell
from gcode2krl.cell.job import with_tools
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.translation import Order, carry_out

PART = """(T21 D=8. CR=0. - flat end mill)
G21 G90 G17
T{n} M6
S9000 M3
G0 G43 H{n} Z30
G0 X0 Y0
G1 Z-1 F600
G1 X20
G0 Z30
M5
M30
"""


def library(folder, *tools):
    rows = [
        {
            "type": "flat end mill",
            "unit": "millimeters",
            "description": f"mill {number}",
            "geometry": {"DC": diameter, "NOF": 3, **({"assemblyGaugeLength": length} if length else {})},
            "post-process": {"number": number},
            "holder": {"description": "chuck"},
        }
        for number, diameter, length in tools
    ]
    file = folder / "library.json"
    file.write_text(json.dumps({"data": rows, "version": 1}), "utf-8")
    return file


def part(folder, number):
    file = folder / "part.nc"
    file.write_text(PART.format(n=number), "utf-8")
    return file


def test_a_tool_with_a_length_is_there_for_one_call(tmp_path):
    file = library(tmp_path, (21, 8.0, 110.0))
    order = Order(part(tmp_path, 21), tmp_path / "part.src")
    refused = carry_out(order)
    assert refused.exit_code == 1
    assert "--tools LIBRARY" in str(refused.record["issues"])
    written = carry_out(Order(order.part, order.output, tools_path=file))
    assert written.exit_code == 0, written.error
    assert "tools=library.json" in (tmp_path / "part.src").read_text("ascii")
    assert any(
        issue["code"] == "tool-file" and "T21" in issue["message"] for issue in written.record["issues"]
    )


def test_a_tool_without_a_length_stays_refused(tmp_path):
    file = library(tmp_path, (21, 8.0, None))
    attempt = carry_out(Order(part(tmp_path, 21), tmp_path / "part.src", tools_path=file))
    assert attempt.exit_code == 1
    assert not (tmp_path / "part.src").exists()


def test_the_cells_own_tool_stays(tmp_path):
    cell, issues = with_tools(load_cell(), library(tmp_path, (1, 8.0, 110.0)))
    assert cell.tool[1] == load_cell().tool[1]
    assert "tool-differs" in {issue.code for issue in issues}


def test_a_confirmed_cell_is_not_confirmed_with_them(tmp_path):
    confirmed = load_cell().model_copy(update={"unconfirmed": ()})
    cell, _ = with_tools(confirmed, library(tmp_path, (21, 8.0, 110.0)))
    assert [one.key for one in cell.unconfirmed] == ["tool.21"]


def test_what_is_no_library_is_refused(tmp_path):
    (tmp_path / "no.json").write_text("{", "utf-8")
    with pytest.raises(NotUnderstoodError):
        with_tools(load_cell(), tmp_path / "no.json")


@pytest.mark.parametrize(("sure", "exit_code"), [("checked", 1), ("assumption", 0)])
def test_a_comment_against_a_tool_that_was_checked_is_an_error(tmp_path, sure, exit_code):
    """The comment says 8 mm, the cell 12 mm."""
    tool = {"diameter_mm": 12.0, "teeth": 3, "length_mm": 100.0, "sure": sure}
    cell = tmp_path / "cell.toml"
    lines = "\n".join(f"{key} = {json.dumps(value)}" for key, value in tool.items())
    cell.write_text(f'based_on = "demonstration"\n[tool.21]\n{lines}\n', "utf-8")
    assert resolve_cell({"based_on": "demonstration", "tool": {"21": tool}}).tool[21].sure == sure
    attempt = carry_out(Order(part(tmp_path, 21), tmp_path / "part.src", cell_path=cell))
    assert attempt.exit_code == exit_code
    assert "tool-differs" in str(attempt.record["issues"])
