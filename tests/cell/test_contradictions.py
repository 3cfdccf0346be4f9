"""A cell that contradicts itself is no cell: it is found by its key, and sound cells have no finding."""

import copy
from pathlib import Path

import pytest

from gcode2krl import load_cell
from gcode2krl.cell import library, resolve_cell
from gcode2krl.cell.contradictions import contradictory
from gcode2krl.cell.krl_effect import effect_of
from gcode2krl.cli.cell_list import findings
from gcode2krl.errors import NotUnderstoodError
from tests.cell.sound_cells import MILL, SOUND
from tests.cells import over_demonstration

EXAMPLES = Path(__file__).parents[2] / "examples"
CELLS = [
    *sorted((EXAMPLES / "cells").glob("*.toml")),
    EXAMPLES / "five_axis" / "cell.toml",
    EXAMPLES / "external" / "robot_on_rail.toml",
    *library.names("cells").values(),
]
M3 = "$ANOUT[1]={{ '%.4f' % (rpm / spindle.max_rpm) }}\n"
CW, CCW, WAITED = "$OUT[11]=TRUE\n", "$OUT[12]=TRUE\n", "WAIT FOR $IN[17]"
ALL_OFF = "$OUT[11]=FALSE\n$OUT[12]=FALSE\n"
BOX = [[0.0, 0.0, -20.0], [200.0, 100.0, 0.0]]
FRAME = {"x_mm": 250.0, "y_mm": 0.0, "z_mm": 250.0, "a_deg": 0.0, "b_deg": -90.0, "c_deg": 0.0}
TOOL_2 = {"kind": "flat", "diameter_mm": 8.0, "teeth": 2, "length_mm": 90.0}
GONE = {"spindle.at_speed_input": None}
"""A cell without the at-speed input."""


def speed_by(expression):
    """Return a spindle whose speed is set by an expression, which is wrong."""
    return {"m_code.M3": f"$ANOUT[1]={{{{ {expression} }}}}\n{CW}{WAITED}"}


def clamp(low, high, **more):
    return [{"name": "clamp", "box_mm": [low, high], **more}]


LISTED = {
    "tool change without a stop": {"tool_change": "; tool {{ tool }}"},
    "tool change that halts for T1 only": {"tool_change": "{% if tool == 1 %}HALT{% endif %}"},
    "integer division": speed_by("rpm // spindle.max_rpm"),
    "S itself as output": speed_by("rpm"),
    "output that does not grow": {"m_code.M3": f"$ANOUT[1]=0.5\n{CW}{WAITED}"},
    "output that falls": speed_by("1 - rpm / 20000"),
    "output with an offset": speed_by("0.5 + rpm / 36000"),
    "output of 0 below 5000": speed_by("0 if rpm < 5000 else rpm / 18000"),
    "output beyond 1 at full speed": speed_by("rpm / 12000"),
    "M3 drives the other direction": {"m_code.M3": M3 + CCW + WAITED},
    "M4 drives the other direction": {"m_code.M4": M3 + CW + WAITED},
    "M4 drives both directions": {"m_code.M4": M3 + CW + CCW + WAITED},
    "M3 switches nothing on": {"m_code.M3": M3 + WAITED},
    "M3 without the speed": {"m_code.M3": CW + WAITED},
    "M3 that does not wait": {**GONE, "m_code.M4": M3 + CCW + "WAIT SEC 5", "m_code.M3": M3 + CW},
    "M3 without the at-speed input": {"m_code.M3": M3 + CW},
    "M3 that waits for the negation": {"m_code.M3": M3 + CW + "WAIT FOR NOT $IN[17]"},
    "M3 that waits for another input": {"m_code.M3": M3 + CW + "WAIT FOR $IN[71]"},
    "M5 that leaves something on": {"m_code.M5": "$OUT[11]=FALSE\nWAIT SEC 8"},
    "M5 that does not wait": {"m_code.M5": ALL_OFF},
    "M3 that waits before it switches on": {"m_code.M3": M3 + WAITED + "\n" + CW},
    "M0 that does not stop": {"m_code.M0": "; stop"},
    "M8 without the flood": {"m_code.M8": "; flood"},
    "M7 without the mist": {"m_code.M9": "$OUT[13]=FALSE\n$OUT[15]=FALSE", "m_code.M7": "$OUT[15]=TRUE"},
    "M9 that leaves the flood on": {"m_code.M9": "$OUT[14]=FALSE"},
    "plane below a clamp": (
        "clearance.z_mm",
        {"stock.box_mm": BOX, "obstacle": clamp([10, -30, -20], [40, 5, 180])},
    ),
    "plane below the stock": (
        "clearance.z_mm",
        {"stock.box_mm": [[0, 0, 0], [200, 100, 160]], "table.z_mm": -60.0},
    ),
    "table above the underside": {"stock.box_mm": BOX, "table.z_mm": -10.0},
    "clamp inside the stock": (
        "obstacle.0.box_mm",
        {"stock.box_mm": BOX, "obstacle": clamp([10, 10, -15], [40, 40, -5])},
    ),
    "clamp below the table": (
        "obstacle.0.box_mm",
        {"stock.box_mm": BOX, "obstacle": clamp([10, 10, -150], [40, 40, -80])},
    ),
    "stock out of reach": {"stock.box_mm": [[9000, 0, -20], [9200, 100, 0]]},
    "reference length in metres": {"frames.tool_length_mm": 0.1},
    "tip within the flange": (
        "tool.2.frame",
        {"tool.2": {**TOOL_2, "frame": {**FRAME, "x_mm": 0.25, "z_mm": 0.25}}},
    ),
    "tip beyond the reach": {"frames.tool": {**FRAME, "x_mm": 2500.0}},
    "one frame, two lengths": ("tool.2.frame", {"tool.1.frame": FRAME, "tool.2": {**TOOL_2, "frame": FRAME}}),
    "load on the flange": {"load.z_mm": 0.0, "load.x_mm": 0.1},
    "load behind the flange": {"load.z_mm": -160.0},
    "load above the payload": {"load.mass_kg": 190.0},
    "load of nothing": {"load.mass_kg": 0.0},
    "inertia of no body": {"load.jx_kgm2": 9.0},
    "inertia in g·m²": {"load.jy_kgm2": 0.0002, "load.jz_kgm2": 0.0002, "load.jx_kgm2": 0.0002},
    "HOME beyond a limit": {"home.q_deg": [0, -90, 200, 0, 0, 0]},
    "base upside down": {"frames.base": {**MILL["frames"]["base"], "c_deg": 180.0}},
    "base out of reach": {"frames.base": {**MILL["frames"]["base"], "x_mm": 5400.0}},
    "base in metres": {"frames.base": {**MILL["frames"]["base"], "x_mm": 1.45, "y_mm": 0.02, "z_mm": 0.7}},
    "robot root in metres": {
        "frames.robroot": {**FRAME, "x_mm": 0.0, "z_mm": 2.6, "b_deg": 0.0, "c_deg": 180.0}
    },
    "one input, two meanings": {"guard_inputs": [{"number": 17, "value": False, "meaning": "door"}]},
}
OWN = {
    "KRL divides integers": speed_by("rpm | int }}}}/{{{{ spindle.max_rpm | int"),
    "output rounded to 0 and 1": speed_by("'%.0f' % (rpm / spindle.max_rpm)"),
    "a tenth of the output": speed_by("rpm / 180000"),
    "negative output for M3": speed_by("-rpm / 18000"),
    "speed set behind the wait": {"m_code.M3": CW + WAITED + "\nWAIT SEC 5\n" + M3},
    "M3 on above 5000 only": {"m_code.M3": M3 + "{% if rpm > 5000 %}$OUT[11]=TRUE\n{% endif %}" + WAITED},
    "M3 on under a condition": {"m_code.M3": M3 + "IF $IN[3] THEN\n$OUT[11]=TRUE\nENDIF\n" + WAITED},
    "M3 switches on and off": {"m_code.M3": M3 + CW + "$OUT[11]=FALSE\n" + WAITED},
    "wait in milliseconds": {
        **GONE,
        "m_code.M4": M3 + CCW + "WAIT SEC 5",
        "m_code.M3": M3 + CW + "WAIT SEC 5000",
    },
    "half of the run-up": {
        **GONE,
        "spindle.start_s": 12.0,
        "m_code.M4": M3 + CCW + "WAIT SEC 12",
        "m_code.M3": M3 + CW + "WAIT SEC 1",
    },
    "wait in one branch only": {
        **GONE,
        "m_code.M4": M3 + CCW + "WAIT SEC 5",
        "m_code.M3": M3 + CW + "IF $IN[3] THEN\nWAIT SEC 5\nENDIF",
    },
    "at speed or door closed": {"m_code.M3": M3 + CW + "WAIT FOR $IN[17] OR $IN[18]"},
    "at speed == FALSE": {"m_code.M3": M3 + CW + "WAIT FOR $IN[17]==FALSE"},
    "waits for FALSE": {"m_code.M10": "WAIT FOR FALSE"},
    "loop without an end": {"m_code.M10": "LOOP\nWAIT SEC 1\nENDLOOP"},
    "M5 waits for the speed": {"m_code.M5": ALL_OFF + WAITED},
    "M4 does what M3 does": {
        "spindle.run_ccw_output": None,
        "spindle.run_cw_output": None,
        "m_code.M3": M3 + CW + WAITED,
        "m_code.M5": ALL_OFF + "WAIT SEC 8",
        "m_code.M4": M3 + CW + WAITED,
    },
    "analogue spindle never set to 0": {
        "spindle.run_cw_output": None,
        "spindle.run_ccw_output": None,
        "m_code.M4": None,
        "m_code.M3": M3 + WAITED,
        "m_code.M5": "WAIT SEC 8",
    },
    "M9 stops the spindle": {"m_code.M9": "$OUT[13]=FALSE\n$OUT[14]=FALSE\n$OUT[11]=FALSE"},
    "a clamp code stops the spindle": {"m_code.M10": "$OUT[11]=FALSE"},
    "M0 stops the spindle": {"m_code.M0": "$OUT[11]=FALSE\nHALT"},
    "M0 stops in one branch": {"m_code.M0": "IF $IN[3] THEN\nHALT\nENDIF"},
    "M8 and M7 exchanged": {"m_code.M7": "$OUT[13]=TRUE", "m_code.M8": "$OUT[14]=TRUE"},
    "M8 sets the speed of the spindle": {"m_code.M8": "$OUT[13]=TRUE\n$ANOUT[1]=0.5"},
    "M30 starts the spindle": {"m_code.M30": "$OUT[11]=TRUE"},
    "epilogue opens the coolant": {"program.epilogue": "$OUT[13]=TRUE"},
    "prologue starts the spindle": {"program.prologue": "$OUT[11]=TRUE"},
    "pressure in per cent": {"m_code.M10": "$ANOUT[4]=80"},
    "change to the same tool": {"program.externals": ["CHANGE(INT :IN)"], "tool_change": "CHANGE(1)"},
    "change speaks of another tool": {"tool_change": "HALT ; change to tool 1 by hand"},
    "holder thinner than the shank": {"tool.1.stick_out_mm": 60.0, "tool.1.holder_diameter_mm": 6.0},
    "edges in the holder": {"tool.1.holder_diameter_mm": 40.0, "tool.1.stick_out_mm": 15.0},
    "deeper than the edges": {"tool.1.max_depth_mm": 90.0},
    "drill that does not drill": (
        "tool.2.centre_cutting",
        {"tool.2": {**TOOL_2, "kind": "drill", "centre_cutting": False}},
    ),
    "point of a mill": ("tool.2.point_deg", {"tool.2": {**TOOL_2, "point_deg": 118.0}}),
    "taper of a flat mill": ("tool.2.taper_deg", {"tool.2": {**TOOL_2, "taper_deg": 5.0}}),
    "teeth and diameter exchanged": ("tool.2.teeth", {"tool.2": {**TOOL_2, "teeth": 10, "diameter_mm": 2.0}}),
    "S of a mill for a face mill": (
        "tool.2.max_rpm",
        {"tool.2": {**TOOL_2, "diameter_mm": 125.0, "max_rpm": 40000.0}},
    ),
    "TOOL_DATA twice": (
        "tool.2.tool_data",
        {
            "tool.1.tool_data": 3,
            "tool.1.axis": "+z",
            "tool.1.frame": FRAME,
            "tool.2": {**TOOL_2, "tool_data": 3, "axis": "+z", "frame": {**FRAME, "x_mm": 230.0}},
        },
    ),
    "power that the torque does not make": {"spindle.max_power_W": 12000.0, "spindle.max_torque_Nm": 1.2},
    "$TOOL is a copy of $BASE": {"frames.tool": MILL["frames"]["base"]},
    "G54 is a copy of $BASE": {"work_offsets.G54": MILL["frames"]["base"]},
    "centre of gravity is the tip": {"load.z_mm": 250.0, "load.x_mm": 262.5},
    "centre of gravity beside": {"load.z_mm": 60.0, "load.x_mm": -160.0},
    "rated payload as load": {"load.mass_kg": 120.0},
    "load of the tool alone": (
        "tool.2.load.mass_kg",
        {"tool.2": {**TOOL_2, "load": {"mass_kg": 3.0, "z_mm": 160.0}}},
    ),
    "stock in metres": {"stock.box_mm": [[0, 0, -0.02], [0.2, 0.1, 0]]},
    "clamp in metres": ("obstacle.0.box_mm", {"obstacle": clamp([0.1, 0.1, 0], [0.2, 0.2, 0.1])}),
    "robot in the obstacle": (
        "obstacle.0.box_mm",
        {"obstacle": clamp([-500, -500, -100], [500, 500, 2000], frame="robroot")},
    ),
    "stock in the obstacle": (
        "obstacle.0.box_mm",
        {"stock.box_mm": BOX, "obstacle": clamp([-50, -50, -50], [300, 300, 20])},
    ),
    "two obstacles in one place": (
        "obstacle.1",
        {
            "obstacle": [
                *clamp([300, 0, 0], [350, 50, 50]),
                {"name": "other", "box_mm": [[300, 0, 0], [350, 50, 50]]},
            ]
        },
    ),
    "floor with its normal down": (
        "obstacle.0.plane",
        {
            "obstacle": [
                {
                    "name": "floor",
                    "frame": "robroot",
                    "plane": {"point_mm": [0, 0, -100], "normal": [0, 0, -1]},
                }
            ]
        },
    ),
    "cut through the table": {"stock.box_mm": BOX, "table.z_mm": -25.0, "stock.through_mm": 12.0},
    "cells larger than the cutter": {"stock.box_mm": BOX, "stock.resolution_mm": 18.0},
    "clearance wider than the plane": {"stock.box_mm": BOX, "collision.clearance_mm": 200.0},
    "tip in the body of the spindle": (
        "spindle.body",
        {"spindle.body.capsules": [{"from_mm": [250, 0, 250], "to_mm": [250, 0, 0], "radius_mm": 60}]},
    ),
    "sensor longer than the tool": {"compliance.sensor_height_mm": 900.0},
    "limits in radians": {"robot.limits.q_deg": [[-3.2, 3.2]] * 6},
    "a joint that does not move": {
        "robot.limits.q_deg": [[-185, 185], [-140, -5], [-120, 155], [-3, 1], [-122, 122], [-350, 350]]
    },
    "$TRAFONAME of another robot": {"robot.trafo_name": "KR210R2700"},
    "name of another robot": ("robot.model", {"name": "KR 60, cell 2"}),
    "reach of another robot": {"robot.payload.reach_mm": 901.5},
    "rapid above the path speed": ("controller.rapid_m_s", {"controller.vel_cp_m_s": 0.1}),
    "acceleration that never gets there": {"controller.acc_cp_m_s2": 0.01},
    "turning in radians": {"controller.vel_ori_deg_s": 3.5},
    "rail in metres": (
        "external.E1.limits",
        {"external": {"E1": {"kind": "rail", "axis": "y", "limits": [0.0, 8.0]}}},
    ),
    "rail in m/s": (
        "external.E1.speed",
        {"external": {"E1": {"kind": "rail", "axis": "y", "limits": [0.0, 8000.0], "speed": 1.5}}},
    ),
    "table in radians": (
        "external.E2.limits",
        {"external": {"E2": {"kind": "turntable", "axis": "z", "limits": [-3.14, 3.14], "machine_def": 2}}},
    ),
    "index and hash in one variable": {"pilot.hash_variable": "$SEN_PINT[1]"},
    "pilot variable set by M10": {"m_code.M10": "MY_INDEX=3", "pilot.index_variable": "MY_INDEX"},
    "threshold above the largest force": {"online.threshold_N": 2500.0},
    "step above the largest correction": {"online.step_mm": 3.0},
    "filter above half the rate": {"online.lowpass_hz": 400.0},
    "lead below a cycle": {"pilot.lead_s": 0.002},
    "coolant that no code switches": (
        "spindle.flood_output",
        {"m_code.M7": None, "m_code.M8": None, "m_code.M9": None},
    ),
}


def changed(changes):
    """Return the sound mill with dotted keys changed; None takes a key away."""
    data = copy.deepcopy(MILL)
    for dotted, value in changes.items():
        table = data
        *path, last = dotted.split(".")
        for step in path:
            table = table.setdefault(step, {})
        if value is None:
            table.pop(last, None)
        else:
            table[last] = copy.deepcopy(value)
    return data


def judged(data):
    """Return the findings of `gcode2krl models check`, of a file that is refused too."""
    try:
        return findings(resolve_cell(data))
    except NotUnderstoodError as error:
        return list(error.issues)


@pytest.mark.parametrize("title", [*LISTED, *OWN])
def test_a_contradiction_is_found_by_its_key(title):
    """It is told at the last of the keys that were changed, if no other is named before them."""
    case = (LISTED | OWN)[title]
    key, changes = case if isinstance(case, tuple) else (list(case)[-1], case)
    issues = [issue for issue in judged(changed(changes)) if issue.severity in ("error", "warning")]
    assert key in {issue.key for issue in issues}, [(issue.key, issue.message) for issue in issues]
    assert all(key.split(".")[-1] in issue.message for issue in issues if issue.key == key)
    assert all(issue.remedy for issue in issues)


def test_as_many_were_thought_of_as_are_told():
    assert len(OWN) >= 40
    assert not OWN.keys() & LISTED.keys()


@pytest.mark.parametrize("name", SOUND)
def test_a_sound_cell_has_none(name):
    cell = resolve_cell(SOUND[name])
    assert [(issue.key, issue.message) for issue in contradictory(cell)] == []
    assert [issue.message for issue in findings(cell) if issue.severity == "error"] == []


@pytest.mark.parametrize("file", CELLS, ids=lambda file: file.stem)
def test_the_cells_of_examples_and_library_have_none(file):
    assert [(issue.key, issue.message) for issue in contradictory(load_cell(file))] == []


def test_values_of_another_cell_under_a_template_of_its_own_are_doubtful_only():
    data = {"m_code": {"M8": "$OUT[33]=TRUE", "M9": "$OUT[33]=FALSE\n$OUT[4]=FALSE"}}
    found = [(issue.severity, issue.key) for issue in contradictory(over_demonstration(data))]
    assert found == [("warning", "m_code.M8")]


def test_both_branches_are_carried_out_and_joined():
    effect = effect_of(
        "IF $IN[1] THEN\n$OUT[1]=TRUE\nWAIT SEC 2\nELSE\n$OUT[1]=TRUE\n$OUT[2]=TRUE\nWAIT SEC 1.5\nENDIF\n"
        "WAIT FOR ($IN[5]==TRUE) AND NOT $IN[6]"
    )
    assert effect.signals["$OUT[1]"].surely_on
    assert not effect.signals["$OUT[2]"].surely_on
    assert effect.waited_s("$OUT[1]") == 1.5
    assert effect.waited_for("$OUT[1]") == {(5, True), (6, False)}


@pytest.mark.parametrize(
    ("text", "value"),
    [("12000/24000", 0.0), ("12000.0/24000", 0.5), ("-(1.0+1)/4", -0.5), ("2**9", None), ("$IN[3]", None)],
)
def test_krl_reckons_with_integers_and_reals(text, value):
    assert effect_of(f"$ANOUT[1]={text}").signals["$ANOUT[1]"].values == {value}


@pytest.mark.parametrize(
    ("text", "stops", "endless"),
    [
        ("IF 2==1 THEN\nHALT\nENDIF", False, False),
        ("IF 1==1 THEN\nHALT\nENDIF", True, False),
        ("LOOP\nIF $IN[1] THEN\nEXIT\nENDIF\nENDLOOP\nHALT", True, False),
        ("LOOP\nWAIT SEC 1\nENDLOOP", False, True),
        ("SWITCH N\nCASE 1\nHALT\nDEFAULT\nHALT\nENDSWITCH", True, False),
        ("SWITCH N\nCASE 1\nHALT\nENDSWITCH", False, False),
        ("IF $IN[1] THEN\n" * 900 + "ENDIF\n" * 900, False, False),
    ],
)
def test_blocks_of_every_kind(text, stops, endless):
    effect = effect_of(text)
    assert (bool(effect.stops), bool(effect.endless)) == (stops, endless)
