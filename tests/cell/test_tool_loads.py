"""A load of its own for a tool: what the program sets, and what the robot is judged by."""

import json

import numpy as np
import pytest

from gcode2krl import Gcode2KrlError, load_cell, set_targets, write_krl
from gcode2krl.cell import resolve_cell
from gcode2krl.cell.job import with_tools
from gcode2krl.cli.cell_list import missing_keys, to_confirm
from gcode2krl.effects.inputs import bodies_of
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode import read_gcode
from gcode2krl.krl.statements import tool_statements
from gcode2krl.runkit.kit import _tool_lines
from gcode2krl.translation import Order, carry_out
from tests.cells import over_demonstration

HEAVY = {
    "mass_kg": 130.0,
    "x_mm": 10.0,
    "y_mm": -5.0,
    "z_mm": 250.0,
    "jx_kgm2": 2.0,
    "jy_kgm2": 3.0,
    "jz_kgm2": 1.0,
}
PROGRAM = (
    "G21 G90 G94\nT1 M6\nS9000 M3\nG43 H1\nG0 X0 Y0 Z50\nG1 Z20 F900\nG0 Z60\n"
    "T2 M6\nS9000 M3\nG43 H2\nG0 X10 Z60\nG1 Z20 F900\nG0 Z60\nM2\n"
)


@pytest.fixture(scope="module")
def cell():
    return over_demonstration({"tool": {"2": {"model": "flat 16 z3", "length_mm": 112.5, "load": HEAVY}}})


def test_each_tool_is_set_with_its_load(cell, tmp_path):
    part = tmp_path / "part.nc"
    part.write_text(PROGRAM)
    text = write_krl(set_targets(read_gcode(part, cell), cell), None, cell).texts["PART.src"].decode()
    loads = list(dict.fromkeys(line for line in text.splitlines() if line.startswith("$LOAD=")))
    assert [line[9:16] for line in loads] == ["120.000", "130.000"]
    assert "CM {X 10.000,Y -5.000,Z 250.000" in loads[1]
    assert "J {X 2.0000,Y 3.0000,Z 1.0000}" in loads[1]
    assert loads[1] in tool_statements(cell, 2)


def test_an_overload_names_its_tool(tmp_path):
    heavy = {**HEAVY, "mass_kg": 400.0}
    cell = over_demonstration({"tool": {"2": {"model": "flat 16 z3", "length_mm": 112.5, "load": heavy}}})
    part = tmp_path / "part.nc"
    part.write_text(PROGRAM)
    (found,) = [
        issue for issue in set_targets(read_gcode(part, cell), cell).issues if issue.code == "overload"
    ]
    assert found.message == "the load of 400 kg with T2 is above the rated 300 kg"
    assert found.remedy == "correct [tool.2] load"
    part.write_text(PROGRAM.split("T2")[0] + "M2\n")
    assert not [i for i in set_targets(read_gcode(part, cell), cell).issues if i.code == "overload"]


def test_the_weight_of_the_arm_is_that_of_the_tool_in_the_spindle(cell):
    axes, tip, turn = np.zeros((2, 6, 3)), np.zeros((2, 3)), np.broadcast_to(np.eye(3), (2, 3, 3))
    bodies = bodies_of(cell, axes, tip, turn, np.array([1, 2], dtype=np.int32))
    assert np.diff(bodies.mass_kg.sum(axis=1)) == pytest.approx(10.0)
    np.testing.assert_allclose(
        bodies.centre_mm[:, -1],
        [
            cell.tool_matrix(n)[:3, :3].T @ (np.array(flange) - cell.tool_matrix(n)[:3, 3])
            for n, flange in ((1, [cell.load.x_mm, cell.load.y_mm, cell.load.z_mm]), (2, [10.0, -5.0, 250.0]))
        ],
    )


def test_a_person_confirms_both(cell):
    rows = {what: value for what, value, _ in to_confirm(cell) if what.startswith("$LOAD")}
    assert rows["$LOAD"].startswith("120 kg")
    assert rows["$LOAD with T2"] == "130 kg at X 10 Y -5 Z 250, J 2 3 1 kgm2"
    assert any("130.000" in line for line in _tool_lines(cell, 2))


def test_a_tool_whose_load_is_stated_needs_no_other():
    frame = {"x_mm": 200.0, "y_mm": 0.0, "z_mm": 300.0, "a_deg": 0.0, "b_deg": 90.0, "c_deg": 0.0}
    tool = {"model": "flat 16 z3", "frame": frame, "axis": "+z"}
    from gcode2krl.cell import resolve_cell

    assert "load.mass_kg" in missing_keys(resolve_cell({"tool": {"1": tool}}))
    assert "load.mass_kg" not in missing_keys(resolve_cell({"tool": {"1": {**tool, "load": HEAVY}}}))


@pytest.mark.parametrize(
    ("load", "words"),
    [
        ({"x_mm": 5.0}, "load needs mass_kg"),
        ({**HEAVY, "mass_kg": 1e5}, "tool.2.load.mass_kg = 100000 is not possible"),
        ({**HEAVY, "mass": 5.0}, "tool.2.load.mass"),
    ],
)
def test_what_is_wrong_is_named(load, words):
    with pytest.raises(Gcode2KrlError, match=words):
        over_demonstration({"tool": {"2": {"model": "flat 16 z3", "length_mm": 112.5, "load": load}}})


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
