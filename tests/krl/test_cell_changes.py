"""A program against cells that have changed since it was written: each is told, with its section."""

import copy

import pytest

from gcode2krl import predict, read_gcode, verify_krl, write_krl
from gcode2krl.cell import resolve_cell

PART = """G21 G90 G17 G40 G49 G80 G94 G54
T1 M6
S8000 M3
G0 G43 H1 Z40
G0 X0 Y0
G0 Z12
G1 Z8 F600
G1 X40 F1500
G1 Y30
G0 Z40
M5
M30
"""
DATA = {
    "based_on": "demonstration",
    "stock": {"box_mm": [[-10, -10, 0], [50, 40, 10]]},
    "table": {"z_mm": -30.0},
    "frames": {"tool_length_mm": 100.0},
    "tool": {"1": {"diameter_mm": 10.0, "teeth": 2, "length_mm": 100.0, "stick_out_mm": 40.0}},
    "obstacle": [
        {"name": "clamp", "frame": "base", "box_mm": [[80, 0, 0], [100, 30, 30]]},
    ],
    "verified": {"by": "A. Miller", "date": "2026-01-15"},
}
CAPSULE = {"from_mm": [0, 0, 0], "to_mm": [0, 0, 50], "radius_mm": 60}
BASE = {"x_mm": 1500, "y_mm": 10, "z_mm": 500, "a_deg": 0, "b_deg": 0, "c_deg": 0}
LIMITS = [(-100, 100), (-140, -5), (-120, 155), (-350, 350), (-122.5, 122.5), (-350, 350)]
OFF = "$OUT[1]=FALSE\n$OUT[2]=FALSE\n$ANOUT[1]=0.0\nWAIT SEC 9.0"
CHANGES = {
    "clamp 10 mm higher": ("obstacle", {"obstacle.0.box_mm": [[80, 0, 0], [100, 30, 40]]}),
    "clamp in the way": ("obstacle", {"obstacle.0.box_mm": [[20, 0, 0], [60, 30, 30]]}),
    "obstacle added": (
        "obstacle",
        {"obstacle.1": {"name": "vice", "frame": "base", "box_mm": [[-90, 0, 0], [-80, 30, 30]]}},
    ),
    "no obstacle left": ("obstacle", {"obstacle": []}),
    "cutter of 12 for 10 mm": ("tool.1", {"tool.1.diameter_mm": 12.0}),
    "a weaker cutter": ("tool.1", {"tool.1.max_force_N": 5.0}),
    "a body of the spindle": ("spindle", {"spindle.body": {"capsules": [CAPSULE]}}),
    "cutter 5 mm longer": ("tool.1", {"tool.1.length_mm": 105.0}),
    "cutter with round corners": ("tool.1", {"tool.1.corner_radius_mm": 1.0}),
    "one tooth more": ("tool.1", {"tool.1.teeth": 3}),
    "sticks out less": ("tool.1", {"tool.1.stick_out_mm": 15.0}),
    "another holder": ("tool.1", {"tool.1.holder_diameter_mm": 63.0}),
    "table 5 mm higher": ("table", {"table.z_mm": -25.0}),
    "thicker stock": ("stock", {"stock.box_mm": [[-10, -10, 0], [50, 40, 20]]}),
    "stock moved": ("stock", {"stock.box_mm": [[-5, -10, 0], [55, 40, 10]]}),
    "no stock": ("stock", {"stock": None}),
    "clearance plane": ("clearance", {"clearance.z_mm": 90.0}),
    "another HOME": ("home", {"home.q_deg": [0, -90, 90, 0, 30, 0]}),
    "$BASE moved": ("frames", {"frames.base": BASE}),
    "a heavier spindle": ("load", {"load.mass_kg": 140.0}),
    "a slower spindle": ("spindle", {"spindle.max_rpm": 7000.0}),
    "another template for M5": ("m_code", {"m_code.M5": OFF}),
    "another tool change": ("tool_change", {"tool_change": "; by hand\nHALT"}),
    "a lower limit of force": ("limits", {"limits.force_N": 5.0}),
    "another material": ("material", {"material": {"model": "Al 7075-T6"}}),
    "joint limits": ("robot", {"robot.limits.q_deg": LIMITS}),
    "another robot": ("robot", {"robot": {"model": "KR 210 R2700 extra"}}),
    "clearance of collisions": ("collision", {"collision.clearance_mm": 60.0}),
}


def changed(data, keys):
    """Return the data of a cell with other values at dotted keys; None takes one out."""
    data = copy.deepcopy(data)
    for key, value in keys.items():
        *steps, last = key.split(".")
        inner = data
        for step in steps:
            inner = inner[int(step)] if isinstance(inner, list) else inner.setdefault(step, {})
        if isinstance(inner, list):
            inner[int(last) : int(last) + 1] = [value]
        elif value is None:
            del inner[last]
        else:
            inner[last] = value
    return data


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("changes")
    part, src = folder / "part.nc", folder / "part.src"
    part.write_text(PART)
    prediction = predict(part, resolve_cell(DATA))
    write_krl(prediction, src)
    return part, src


def sections(report):
    return {issue.key for issue in report.issues if issue.code == "verify-cell-changed"}


def test_the_same_cell_agrees(written):
    part, src = written
    cell = resolve_cell(DATA)
    report = verify_krl(src, read_gcode(part, cell), cell)
    assert report.ok, report.issues
    assert not sections(report)
    signed = resolve_cell(changed(DATA, {"name": "other", "verified.by": "B", "program.max_lines": 500}))
    assert verify_krl(src, read_gcode(part, signed), signed).ok, "no word of the program, and no check"


@pytest.mark.parametrize("step", [7, pytest.param(1, marks=pytest.mark.slow)])
def test_every_changed_cell_is_told_with_its_section(written, step):
    part, src = written
    told = []
    for name, (section, keys) in list(CHANGES.items())[::step]:
        cell = resolve_cell(changed(DATA, keys))
        report = verify_krl(src, read_gcode(part, cell), cell)
        assert not report.ok, name
        assert section in sections(report) <= {section, "compliance"}, name
        told.append(name)
    print(f"{len(told)} changed cells told with their section")


@pytest.mark.parametrize(
    ("name", "code", "line"),
    [
        ("clamp in the way", "collision", 8),
        ("a lower limit of force", "force-high", 7),
        ("thicker stock", "rapid-in-stock", 6),
    ],
)
def test_hazards_are_found_anew_with_their_line(written, name, code, line):
    part, src = written
    cell = resolve_cell(changed(DATA, CHANGES[name][1]))
    report = verify_krl(src, read_gcode(part, cell), cell)
    lines = {issue.line for issue in report.issues if issue.code == code and issue.file == str(part)}
    assert line in lines, report.issues
