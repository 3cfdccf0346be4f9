"""Nothing goes below the table: feed, rapid, approach, inclined tools, compensated targets."""

from dataclasses import fields, replace

import numpy as np
import pytest

from gcode2krl import frames as fr
from gcode2krl import load_cell, read_gcode, set_targets
from gcode2krl.cell import resolve_cell
from gcode2krl.chain import Plan
from gcode2krl.compiled import chunks
from gcode2krl.program import blending, targets
from gcode2krl.program.table import below_table, lowest_points
from tests.conftest import EXAMPLES

HEAD = "G21 G90 G17\nT1 M6\nS9000 M3\nG0 G43 H1 Z30\n"
TABLE = {"based_on": "demonstration", "table": {"z_mm": -10.0}}


def lines(plan):
    return [issue.line for issue in plan.targets.issues if issue.code == "below-table"]


@pytest.mark.parametrize(
    ("body", "wanted"),
    [
        ("G0 X0 Y0\nG1 Z-10 F600\nG1 X50\nG0 Z30\n", []),
        ("G0 X0 Y0\nG1 Z-10.1 F600\nG1 X50\nG0 Z30\n", [6]),
        ("G0 X0 Y0\nG0 Z-12\nG1 Z-9 F600\nG1 X50\nG1 X60 Z-11\nG0 Z30\n", [6, 9]),
        ("G0 X0 Y0 Z-11\nG1 Z-5 F600\nG0 Z30\n", [5]),
    ],
)
def test_any_move_below_the_table_is_an_error_with_its_line(plan, body, wanted):
    found = plan(HEAD + body + "M5\nM30\n", TABLE)
    assert lines(found) == wanted
    assert {i.severity for i in found.targets.issues if i.code == "below-table"} <= {"error"}
    assert not lines(plan(HEAD + body + "M5\nM30\n"))


def test_the_first_position_counts_as_the_approach_goes_there(plan):
    text = "G21 G90\nT1 M6\nS9000 M3\nG43 H1\nG0 X0 Y0 Z-11\nG1 X50 F600\nM5\nM30\n"
    assert lines(plan(text, TABLE)) == [5]


def test_compensated_targets_are_looked_at_again(plan):
    found = plan(HEAD + "G0 X0 Y0\nG1 Z-10 F600\nG1 X50\nG0 Z30\nM5\nM30\n", TABLE)
    moved = found.targets.position_mm - [0.0, 0.0, 0.05]
    targets = replace(found.targets, position_mm=moved, issues=())
    again = Plan.of(found.toolpath, targets, found.cell).judged().targets
    assert [issue.line for issue in again.issues if issue.code == "below-table"] == [6]


@pytest.mark.parametrize(
    ("tool", "lean_deg"),
    [
        ({"diameter_mm": 16.0}, 20.0),
        ({"diameter_mm": 16.0, "kind": "bull-nose", "corner_radius_mm": 3.0}, 20.0),
        ({"diameter_mm": 16.0, "kind": "ball", "corner_radius_mm": 8.0}, 35.0),
        ({"diameter_mm": 16.0}, 0.0),
    ],
)
def test_the_lowest_point_of_a_tool_that_leans(plan, tool, lean_deg):
    found = plan(HEAD + "G0 X0 Y0\nG1 Z-10 F600\nG0 Z30\nM5\nM30\n", {"based_on": "demonstration"})
    own = found.cell.tool[1].model_copy(update=tool)
    cell = found.cell.model_copy(update={"tool": {**found.cell.tool, 1: own}})
    turn = fr.rotation_from_abc(np.radians([30.0, 0.0, lean_deg]))
    lin = ~found.targets.home
    rotation = np.where(lin[:, None], fr.quaternion_from_rotation(turn[None]), found.targets.rotation)
    lowest = lowest_points(replace(found.targets, rotation=rotation), cell)
    radius, corner = 8.0, tool.get("corner_radius_mm", 0.0)
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, 721), np.linspace(0, np.pi / 2, 181))
    r, z = radius - corner + corner * np.sin(up), corner - corner * np.cos(up)
    body = np.stack([r * np.cos(around), r * np.sin(around), z], axis=-1).reshape(-1, 3)
    wanted = found.targets.position_mm[:, 2] + min(0.0, (body @ turn.T)[:, 2].min())
    assert lowest[lin] == pytest.approx(wanted[lin], abs=1e-3)


def test_home_below_the_table_is_said(plan):
    found = plan(HEAD + "G0 X0 Y0\nG1 Z-10 F600\nG0 Z30\nM5\nM30\n", {"based_on": "demonstration"})
    height = found.targets.position_mm[0, 2]
    cell = resolve_cell(
        {"based_on": "demonstration", "table": {"z_mm": height + 1.0}, "clearance": {"z_mm": height + 2.0}}
    )
    assert next(i.line for i in below_table(found.targets, cell)) == 0


def test_it_is_seen_without_forces(run, tmp_path):
    (tmp_path / "part.nc").write_text(HEAD + "G0 X0 Y0\nG0 Z2\nG1 Z-11 F600\nX50\nG0 Z30\nM5\nM30\n")
    (tmp_path / "cell.toml").write_text('based_on = "demonstration"\n[table]\nz_mm = -10\n')
    done = run("part.nc", "-o", "part.src", "--cell", "cell.toml", "--no-forces", code=1)
    assert "part.nc:7: error: T1 is up to 1.000 mm below the table" in done.err
    assert "below-table" in done.err
    assert not (tmp_path / "part.src").exists()


@pytest.mark.parametrize("rows", [3, 50])
@pytest.mark.parametrize("tolerance_mm", [None, 0.02])
@pytest.mark.parametrize("part", EXAMPLES, ids=lambda path: path.stem)
def test_same_targets(monkeypatch, part, rows, tolerance_mm):
    cell = load_cell()
    toolpath = read_gcode(part, cell)
    whole = set_targets(toolpath, cell, tolerance_mm)
    for module in (targets, blending):
        monkeypatch.setattr(module, "chunk_borders", lambda count: chunks.chunk_borders(count, rows))
    planned = set_targets(toolpath, cell, tolerance_mm)
    for spec in fields(whole):
        left, right = getattr(planned, spec.name), getattr(whole, spec.name)
        if isinstance(left, np.ndarray):
            np.testing.assert_array_equal(left, right, err_msg=spec.name)
        else:
            assert left == right, spec.name
