"""Every physical key of the cell has a usual and a possible range with a source; types are strict."""

import types
import typing

import pytest
from pydantic import BaseModel

from gcode2krl import load_cell
from gcode2krl.cell import Cell, resolve_cell
from gcode2krl.cell.ranges import all_ranges, general, range_issues
from gcode2krl.errors import NotUnderstoodError
from tests.cells import over_demonstration

NO_MEASURE = (
    "advance", "ptp_percent", "tool_data", "base_data", "machine_def", "mounted_tool", "spin",
    "max_active", "rest_cycles", "most_cycles", "settle_cycles", "port", "timeout_cycles", "lost_cycles",
    "decimals", "t1_output", "ready_output", "run_cw_output", "run_ccw_output", "speed_analog_output",
    "at_speed_input", "flood_output", "mist_output", "number", "max_lines", "comment_every",
    "memory_moves", "warn_size_mb", "tool",
)  # fmt: skip  # word list, kept compact
"""Numbers that name or count something; their types bound them. Effects state their own bounds."""


def keys(kind, key=""):
    """Yield the dotted key of every number that a cell file may state."""
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        yield from keys(inner[0], key)
    elif origin is dict:
        yield from keys(inner[1], f"{key}.*")
    elif origin in (typing.Union, types.UnionType, tuple):
        for one in inner:
            yield from keys(one, key)
    elif isinstance(kind, type) and issubclass(kind, BaseModel):
        for name, field in kind.model_fields.items():
            yield from keys(field.annotation, f"{key}.{name}" if key else name)
    elif kind in (int, float):
        yield key


def test_every_physical_key_has_a_range_and_every_range_a_key():
    known = set(all_ranges())
    physical = {
        key
        for key in keys(Cell)
        if key.rpartition(".")[2] not in NO_MEASURE
        and not key.endswith(".axis")
        and not key.startswith("effects")
    }
    assert physical == known


def test_every_range_has_a_source_and_lies_inside_the_possible():
    for key, row in all_ranges().items():
        assert row.source, key
        assert row.possible[0] <= row.plausible[0] < row.plausible[1] <= row.possible[1], key


def test_the_demonstration_and_the_library_are_usual():
    from gcode2krl.cell import library

    assert list(range_issues(load_cell())) == []
    for kind in ("robots", "tools", "materials"):
        for name in library.names(kind):
            section = {"tools": {"tool": {"1": {"model": name}}}, "robots": {"robot": {"model": name}}}
            found = list(range_issues(resolve_cell(section.get(kind, {"material": {"model": name}}))))
            assert found == [], name


def test_a_key_of_any_tool_has_the_range_of_tools():
    assert general("tool.17.diameter_mm") == "tool.*.diameter_mm"
    assert general("work_offsets.G59.1.x_mm") == "work_offsets.*.x_mm"


FRAME = {"x_mm": 1500.0, "y_mm": 0.0, "z_mm": 800.0, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.0}


@pytest.mark.parametrize(
    ("data", "key"),
    [
        ({"load": {"mass_kg": 0.12}}, "load.mass_kg"),
        ({"robot": {"limits": {"q_deg": [[-400, 400]] * 6}}}, "robot.limits.q_deg"),
        ({"robot": {"speeds": {"qd_deg_s": [1.83, 1.76, 1.87, 2.13, 1.97, 3.05]}}}, "robot.speeds.qd_deg_s"),
        ({"controller": {"acc_cp_m_s2": 2000}}, "controller.acc_cp_m_s2"),
        ({"controller": {"rapid_m_s": 200}}, "controller.rapid_m_s"),
        ({"controller": {"vel_cp_m_s": 2000}}, "controller.vel_cp_m_s"),
        ({"controller": {"cycle_s": 12}}, "controller.cycle_s"),
        ({"controller": {"k_s": 168}}, "controller.k_s"),
        (
            {"compliance": {"virtual_joints": {"A1": {"k_c": 2.1e5, "k_b": 2.1e5, "k_a": 1.3e5}}}},
            "compliance.virtual_joints.A1.k_c",
        ),
        ({"frames": {"base": {**FRAME, "a_deg": 1.5708}}}, "frames.base"),
        ({"frames": {"base": {**FRAME, "c_deg": -3.14159}}}, "frames.base"),
        ({"frames": {"tool": {**FRAME, "b_deg": -1.5707963}}}, "frames.tool"),
        ({"work_offsets": {"G55": {**FRAME, "a_deg": 0.785398}}}, "work_offsets.G55"),
        ({"home": {"q_deg": [0, -1.5708, 1.5708, 0, 0, 0]}}, "home.q_deg"),
        ({"tool": {"1": {"diameter_mm": 0.016, "teeth": 3}}}, "tool.1.diameter_mm"),
        ({"tool": {"1": {"diameter_mm": 16, "teeth": 3, "length_mm": 0.1}}}, "tool.1.length_mm"),
        ({"spindle": {"max_power_W": 12}}, "spindle.max_power_W"),
        ({"load": {"mass_kg": 80, "jx_kgm2": 4e6}}, "load.jx_kgm2"),
        ({"stock": {"box_mm": [[0, 0, 0], [1e6, 1, 1]]}}, "stock.box_mm"),
    ],
)
def test_what_cannot_be_is_an_error_that_names_the_key(data, key):
    with pytest.raises(NotUnderstoodError) as error:
        resolve_cell(data)
    assert {issue.code for issue in error.value.issues} == {"cell-impossible"}
    assert all(key in issue.message and key in issue.remedy for issue in error.value.issues[:1])


@pytest.mark.parametrize(
    ("data", "key"),
    [
        ({"controller": {"acc_cp_m_s2": 20}}, "controller.acc_cp_m_s2"),
        ({"controller": {"cdis_mm": 50}}, "controller.cdis_mm"),
        ({"load": {"mass_kg": 1.2}}, "load.mass_kg"),
        ({"tool": {"1": {"model": "flat 16 z3", "length_mm": 700}}}, "tool.1.length_mm"),
        ({"home": {"q_deg": [0, -90, 90, 0, 0, 355]}}, "home.q_deg"),
    ],
)
def test_what_is_doubtful_is_a_warning_of_the_program(data, key):
    found = list(range_issues(over_demonstration(data)))
    assert [(issue.severity, issue.code) for issue in found] == [("warning", "cell-doubtful")]
    assert key in found[0].message


def test_a_warning_reaches_the_program(tmp_path):
    from tests.krl.conftest import Made

    made = Made(tmp_path, data={"controller": {"acc_cp_m_s2": 20.0}})
    assert "cell-doubtful" in {issue.code for issue in made.targets.issues}


@pytest.mark.parametrize("axis", ["a_deg", "b_deg", "c_deg"])
@pytest.mark.parametrize("angle", [0.0, 90.0, -45.0, 180.0, 30.0, 1.5, 3.5e-15])
def test_angles_in_degrees_pass(axis, angle):
    resolve_cell({"frames": {"base": {**FRAME, axis: angle}}})


@pytest.mark.parametrize(
    ("data", "key"),
    [
        ({"tool": {"1": {"diameter_mm": True, "teeth": 2}}}, "tool.1.diameter_mm"),
        ({"tool": {"1": {"diameter_mm": "120", "teeth": 2}}}, "tool.1.diameter_mm"),
        ({"tool": {"1": {"diameter_mm": 12.0, "teeth": 2.0}}}, "tool.1.teeth"),
        (
            {"tool": {"1": {"diameter_mm": 12.0, "teeth": 2, "centre_cutting": "yes"}}},
            "tool.1.centre_cutting",
        ),
        ({"load": {"mass_kg": "120"}}, "load.mass_kg"),
        ({"home": {"q_deg": [0, "-90", 90, 0, 0, 0]}}, "home.q_deg"),
        ({"frames": {"base": {**FRAME, "x_mm": True}}}, "frames.base.x_mm"),
        ({"frames": {"base": {**FRAME, "x_mm": float("nan")}}}, "frames.base.x_mm"),
        ({"frames": {"spin": True}}, "frames.spin"),
        ({"controller": {"advance": True}}, "controller.advance"),
        ({"spindle": {"run_cw_output": 3.0}}, "spindle.run_cw_output"),
        ({"mounted_tool": "1"}, "mounted_tool"),
        ({"guard_inputs": [{"number": 3, "value": 1, "meaning": "door"}]}, "guard_inputs"),
        ({"tool": 5}, "tool"),
        ({"tool": {"1": 5}}, "tool.1"),
        ({"robot": 5}, "robot"),
        ({"m_code": 5}, "m_code"),
        ({"m_code": {"M3": 5}}, "m_code.M3"),
        ({"frames": []}, "frames"),
        ({"based_on": 5}, "based_on"),
        ({"stock": {"mesh": 5}}, "stock.mesh"),
        ({"compliance": {"virtual_joints": 5}}, "compliance.virtual_joints"),
    ],
)
@pytest.mark.parametrize("base", [{}, {"based_on": "demonstration"}])
def test_types_are_strict_and_a_wrong_one_names_its_key(data, key, base):
    with pytest.raises(NotUnderstoodError) as error:
        resolve_cell({**base, **data})
    assert any(key in issue.message for issue in error.value.issues)


@pytest.mark.parametrize(
    "text",
    [
        "a = " + "[" * 100_000,
        "a." * 100_000 + "a = 1",
        '"a".' * 100_000 + "a = 1",
        "[" + "a." * 100_000 + "a]",
        "a = {" + "a." * 100_000 + "a = 1}",
        "a = " + "{a = " * 5000,
        "a = " + "1" * 10_000,
        "x = 1\n" * 2,
        "\0",
        "a = " + "[" * 40 + "]" * 40,
        "#" + "x" * 5_000_000,
    ],
    ids=[
        "brackets",
        "dots",
        "quoted",
        "header",
        "inline",
        "tables",
        "digits",
        "twice",
        "nul",
        "lists",
        "size",
    ],
)
def test_a_hostile_file_is_one_line_at_once(tmp_path, text):
    import time

    path = tmp_path / "cell.toml"
    path.write_text(text, encoding="utf-8")
    started = time.perf_counter()
    with pytest.raises(NotUnderstoodError) as error:
        load_cell(path)
    assert time.perf_counter() - started < 5.0
    assert len(error.value.issues) == 1
    assert len(str(error.value)) < 1000
