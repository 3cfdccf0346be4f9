"""What the guard at the start of a program accepts: its conditions carried out as a controller does."""

import re

import pytest

from gcode2krl.cell import library
from gcode2krl.cell.sections import Robot
from tests.cells import OWN_CELL

ONE_TOOL = "G21 G90 G17\nT1 M6\nG43 H1\nG0 X0 Y0 Z20\nS9000 M3\nG1 Z5 F300\nG1 X40\nG0 Z20\nM5\nM30\n"
FRAME = {"x_mm": 240.5, "y_mm": -7.25, "z_mm": 251.125, "a_deg": 177.5, "b_deg": -1.5, "c_deg": -179.25}
LOAD = {"mass_kg": 120.0, "x_mm": -120.0, "y_mm": 4.0, "z_mm": 180.0,
        "jx_kgm2": 6.0, "jy_kgm2": 5.0, "jz_kgm2": 4.0}  # fmt: skip


def strfind(start, text, part, _mode):
    """As KUKA documents StrFind: the position of the first occurrence, counted from 1, or 0."""
    return text.upper().find(part.upper(), start - 1) + 1


def strcomp(text, other, _mode):
    """As KUKA documents StrComp: true where the two are the same."""
    return text.upper() == other.upper()


def stops(condition, variables):
    """Tell whether a WHILE of the guard would halt, with the controller's variables."""
    words = {"OR": "or", "AND": "and", "NOT": "not", "<>": "!=", "#NOT_CASE_SENS": "None"}
    text = re.sub(r"<>|#NOT_CASE_SENS|\b(?:OR|AND|NOT)\b", lambda match: words[match[0]], condition)
    for name, value in variables.items():
        text = text.replace(name, repr(value))
    return eval(text, {"STRFIND": strfind, "STRCOMP": strcomp, "ABS": abs})


def conditions(made, mark):
    return re.findall(rf"(?m)^WHILE (.*{mark}.*?)\r?$", made.src.read_bytes().decode())


NAMES = [
    ("KR60", "#KR60 C4 FLR ZH02", True),
    ("KR60", "KR60", True),
    ("KR60", "#kr60", True),
    ("KR60", "#KR600R2830 C4 FLR", False),
    ("KR60", "#KR60HA C2 FLR", False),
    ("KR60", "#KR60L30_3 C2 FLR", False),
    ("KR60", "XKR60 C4", False),
    ("KR60", "KR6", False),
    ("KR60", "", False),
    ("KR210R2700_2", "#KR210R2700_2 C4 FLR", True),
    ("KR210R2700_2", "#KR210R2700_2 C01 FLR", True),
    ("KR210R2700_2", "#KR210R2700 EXTRA C4 FLR", False),
    ("KR210R2700_2", "#KR210R2700 PRIME C4 FLR", False),
    ("KR210R2700 PRIME", "#KR210R2700 EXTRA C4 FLR", False),
    ("#KR210R2700 EXTRA C4 FLR", "KR210R2700 EXTRA C4 FLR", True),
    ("#KR210R2700 EXTRA C4 FLR", "#KR210R2700 EXTRA C4 FLR K", True),
    ("KR240R2900", "#KR240R2900_2 C4 FLR", False),
]


@pytest.mark.parametrize(("name", "shown", "is_it"), NAMES)
def test_the_robot_is_named_as_a_whole(make, name, shown, is_it):
    [condition] = conditions(make(ONE_TOOL, data={"robot": {"trafo_name": name}}), "TRAFONAME")
    assert stops(condition, {"$TRAFONAME[]": shown}) is not is_it
    assert Robot(trafo_name=name).is_named(shown) is is_it


def test_no_two_robots_of_the_library_have_a_name_that_one_guard_accepts():
    """Unless nobody has told their names apart yet; then both say so."""
    robots = {name: Robot.model_validate(robot(name)) for name in library.names("robots")}
    alike = {
        frozenset((one, other))
        for one in robots
        for other in robots
        if one != other and robots[one].is_named(f"#{robots[other].trafo_name} C4 FLR")
    }
    assert alike == {frozenset(("KR 500 R2830", "KR 500 R2830 MT"))}
    assert all(robots[name].trafo_sure == "memory" for pair in alike for name in pair)
    three = [name for name in robots if name.startswith("KR 210 R2700")]
    assert len(three) == 3
    assert len({robots[name].trafo_name for name in three}) == 3


def robot(name):
    model = library.read_model("robots", name)
    return {key: model[key] for key in ("model", "trafo_name", "trafo_source", "trafo_sure")}


def controller(**changed):
    """Return LOAD_DATA[4] of a controller, as the cell states it but for some values."""
    values = {"M": 120.0, "CM.X": -120.0, "CM.Y": 4.0, "CM.Z": 180.0, "J.X": 6.0, "J.Y": 5.0, "J.Z": 4.0}
    values |= {key.replace("_", "."): value for key, value in changed.items()}
    return {f"LOAD_DATA[4].{key}": value for key, value in values.items()}


@pytest.mark.parametrize(
    ("changed", "is_stopped"),
    [
        ({}, False),
        ({"M": 121.1}, False),
        ({"M": 121.3}, True),
        ({"M": -1.0}, True),
        ({"CM_X": 120.0}, True),
        ({"CM_X": -115.5}, False),
        ({"CM_Z": 186.0}, True),
        ({"J_X": 4.0, "J_Z": 6.0}, False),
        ({"J_X": 0.0}, True),
        ({"J_X": 10.0}, True),
    ],
)
def test_the_load_of_a_number_is_compared(make, changed, is_stopped):
    data = {"tool": {"1": {"tool_data": 4, "axis": "+x", "frame": FRAME, "load": LOAD}}}
    made = make(ONE_TOOL, data=data)
    [condition] = conditions(made, "LOAD_DATA")
    assert stops(condition, controller(**changed)) is is_stopped
    assert "LOAD_DATA[4] is not as in the cell file" in made.src.read_text()


def test_a_load_that_is_not_compared_is_told(make):
    tool = {"tool_data": 4, "axis": "+x", "frame": FRAME, "load": {"mass_kg": 120.0}}
    without_inertia = make(ONE_TOOL, data={"tool": {"1": tool}})
    assert "; the inertia in LOAD_DATA[4] is not compared" in without_inertia.src.read_text()
    assert ".J." not in conditions(without_inertia, "LOAD_DATA")[0]
    del tool["load"]
    unknown = make(ONE_TOOL, data=OWN_CELL | {"load": {}, "tool": {"1": OWN_CELL["tool"]["1"] | tool}})
    assert "; LOAD_DATA[4] IS NOT COMPARED: the cell states no load" in unknown.src.read_text()
    assert conditions(unknown, "LOAD_DATA") == []
    assert "LOAD_DATA" not in make(ONE_TOOL).src.read_text()
