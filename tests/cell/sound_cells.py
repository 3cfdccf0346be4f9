"""Sound cells of many kinds: arms of 6 to 600 kg, spindles on outputs and by hand, a rail, a hanging arm."""

OUTPUT = "$ANOUT[{{ spindle.speed_analog_output }}]={{ '%.4f' % (rpm / spindle.max_rpm) }}\n"
CW, CCW = "$OUT[{{ spindle.run_cw_output }}]=TRUE\n", "$OUT[{{ spindle.run_ccw_output }}]=TRUE\n"
STOP = "$OUT[{{ spindle.run_cw_output }}]=FALSE\nWAIT SEC {{ spindle.stop_s }}"
AT_SPEED, WAITED = "WAIT FOR $IN[{{ spindle.at_speed_input }}]", "WAIT SEC {{ spindle.start_s }}"
BY_HAND = "HALT ; change to tool {{ tool }} by hand, then start"


def frame(x, y, z, a=0.0, b=0.0, c=0.0):
    return {"x_mm": x, "y_mm": y, "z_mm": z, "a_deg": a, "b_deg": b, "c_deg": c}


def tool(diameter_mm, length_mm, **more):
    return {"kind": "flat", "diameter_mm": diameter_mm, "teeth": 3, "length_mm": length_mm, **more}


def cell(robot, base, tip, length_mm, load, tools, spindle, m_code, **more):
    """Return a cell file as tables; ``load`` is mass and centre."""
    mass, *centre = load
    return {
        "robot": {"model": robot},
        "frames": {"base": base, "tool": tip, "tool_length_mm": length_mm},
        "home": {"q_deg": [0.0, -90.0, 90.0, 0.0, 0.0, 0.0]},
        "clearance": {"z_mm": 150.0},
        "load": dict(zip(("mass_kg", "x_mm", "y_mm", "z_mm"), (mass, *centre), strict=True)),
        "tool": tools,
        "spindle": spindle,
        "m_code": m_code,
        "tool_change": BY_HAND,
        **more,
    }


MILL = cell(
    "KR 120 R2700-2",
    frame(1450.0, 20.0, 700.0),
    frame(250.0, 0.0, 250.0, b=-90.0),
    100.0,
    (42.0, 110.0, 0.0, 160.0),
    {"1": tool(16.0, 112.5, flute_length_mm=32.0), "2": tool(10.0, 118.0, kind="ball")},
    {
        "max_rpm": 18000.0,
        "run_cw_output": 11,
        "run_ccw_output": 12,
        "speed_analog_output": 1,
        "at_speed_input": 17,
        "start_s": 5.0,
        "stop_s": 8.0,
        "flood_output": 13,
        "mist_output": 14,
    },
    {
        "M3": OUTPUT + CW + AT_SPEED,
        "M4": OUTPUT + CCW + AT_SPEED,
        "M5": "$OUT[{{ spindle.run_cw_output }}]=FALSE\n$OUT[{{ spindle.run_ccw_output }}]=FALSE\n"
        "WAIT SEC {{ spindle.stop_s }}",
        "M7": "$OUT[{{ spindle.mist_output }}]=TRUE",
        "M8": "$OUT[{{ spindle.flood_output }}]=TRUE",
        "M9": "$OUT[{{ spindle.mist_output }}]=FALSE\n$OUT[{{ spindle.flood_output }}]=FALSE",
    },
    table={"z_mm": -60.0},
)
MILL["load"] |= {"jx_kgm2": 1.5, "jy_kgm2": 1.5, "jz_kgm2": 0.8}
DIGITAL = {"max_rpm": 24000.0, "run_cw_output": 9, "start_s": 4.0, "stop_s": 6.0}
DRIVE = "SPINDLE_ON({{ '%.0f' % rpm }})\nWAIT FOR $IN[40]"
"""A subprogram of the integrator."""
SOUND = {
    "mill with clamps and stock": MILL
    | {
        "stock": {"box_mm": [[0.0, 0.0, -20.0], [200.0, 100.0, 0.0]], "resolution_mm": 0.5},
        "obstacle": [
            {"name": "clamp", "box_mm": [[-40.0, 20.0, -60.0], [2.0, 60.0, 15.0]]},
            {"name": "table", "box_mm": [[-300.0, -300.0, -400.0], [600.0, 600.0, -60.0]]},
            {"name": "fence", "frame": "robroot", "box_mm": [[-1500, -2500, 0], [-1450, 2500, 2200]]},
            {"name": "floor", "frame": "robroot", "plane": {"point_mm": [0, 0, -10], "normal": [0, 0, 1]}},
        ],
    },
    "KR 6 with a cutter of 2 mm": cell(
        "KR 6 R900-2",
        frame(450.0, 0.0, 120.0),
        frame(60.0, 0.0, 90.0, b=-90.0),
        30.0,
        (2.4, 35.0, 0.0, 55.0),
        {"1": tool(2.0, 28.0, max_rpm=40000.0), "2": tool(1.0, 25.0, teeth=2)},
        {"max_rpm": 40000.0, "run_cw_output": 3, "start_s": 2.0, "stop_s": 2.0},
        {"M3": "HALT ; set the drive to {{ rpm }} rpm\n" + CW + WAITED, "M5": STOP},
        clearance={"z_mm": 40.0},
        home={"q_deg": [0.0, -90.0, 90.0, 0.0, 20.0, 0.0]},
    ),
    "KR 500 with a head of 125 mm": cell(
        "KR 500 R2830",
        frame(1900.0, -300.0, 600.0),
        frame(0.0, 0.0, 620.0, b=180.0),
        180.0,
        (310.0, 0.0, 0.0, 260.0),
        {"1": tool(125.0, 165.0, teeth=8, max_rpm=6000.0, stick_out_mm=63.0, holder_diameter_mm=60.0)},
        DIGITAL | {"max_rpm": 8000.0, "max_power_W": 40000.0, "max_torque_Nm": 250.0, "start_s": 9.0},
        {"M3": "HALT ; set {{ rpm }} rpm\n" + CW + WAITED, "M5": STOP},
    ),
    "one tool that stays": cell(
        "KR 16-2",
        frame(900.0, -50.0, 450.0),
        frame(120.0, 0.0, 140.0, b=-90.0),
        85.0,
        (9.5, 55.0, 0.0, 80.0),
        {"1": tool(6.0, 92.4)},
        DIGITAL,
        {"M3": "HALT ; set {{ rpm }} rpm\n" + CW + WAITED, "M5": STOP, "M0": "WAIT FOR $IN[33]"},
        tool_change="; tool {{ tool }} stays in the spindle",
        mounted_tool=1,
    ),
    "a person starts the spindle": cell(
        "KR 60 HA",
        frame(1300.0, 0.0, 500.0),
        frame(0.0, 0.0, 310.0, b=180.0),
        100.0,
        (24.0, 0.0, 0.0, 140.0),
        {"1": tool(8.0, 104.0)},
        {"max_rpm": 24000.0},
        {"M3": "HALT ; start the spindle at {{ rpm }} rpm", "M5": "HALT ; stop the spindle"},
    ),
    "subprograms of the integrator": cell(
        "KR 210 R2700 prime",
        frame(1400.0, 0.0, 600.0),
        frame(230.0, 0.0, 240.0, b=-90.0),
        95.0,
        (80.0, 90.0, 0.0, 150.0),
        {"4": tool(12.0, 95.0), "7": tool(20.0, 130.0)},
        {"max_rpm": 22000.0, "start_s": 8.0, "stop_s": 8.0, "flood_output": 5},
        {
            "M3": DRIVE,
            "M5": "SPINDLE_OFF()",
            "M8": "$OUT[{{ spindle.flood_output }}]=TRUE",
            "M9": "$OUT[{{ spindle.flood_output }}]=FALSE",
            "M10": "PULSE ($OUT[60],TRUE,0.5)\nWAIT FOR $IN[60] OR $IN[61]",
            "M63": "$OUT[{{ p | int }}]=FALSE",
            "M68": "$ANOUT[{{ e | int }}]={{ q }}",
        },
        tool_change="CHANGE({{ tool }})",
        program={"externals": ["SPINDLE_ON(INT :IN)", "SPINDLE_OFF()", "CHANGE(INT :IN)"]},
    ),
    "drive that turns both ways": cell(
        "KR 240 R2900-2",
        frame(1600.0, 0.0, 700.0),
        frame(260.0, 0.0, 250.0, b=-90.0),
        110.0,
        (90.0, 120.0, 0.0, 170.0),
        {"1": tool(20.0, 120.0)},
        {"max_rpm": 15000.0, "run_cw_output": 21, "speed_analog_output": 2, "start_s": 6.0, "stop_s": 9.0},
        {
            "M3": OUTPUT + CW + WAITED,
            "M4": "$ANOUT[2]={{ '%.3f' % (-rpm / spindle.max_rpm) }}\n$OUT[22]=TRUE\n" + WAITED,
            "M5": "$ANOUT[2]=0.0\n$OUT[22]=FALSE\n" + STOP,
            "M30": "$OUT[70]=FALSE",
        },
        program={"prologue": "$OUT[70]=TRUE ; suction\nWAIT SEC 1", "epilogue": "$OUT[70]=FALSE"},
    ),
    "spindle on a pulse": cell(
        "KR 150 R3100-2",
        frame(1700.0, 0.0, 700.0),
        frame(250.0, 0.0, 260.0, b=-90.0),
        100.0,
        (60.0, 100.0, 0.0, 150.0),
        {"1": tool(16.0, 110.0)},
        {"max_rpm": 18000.0, "run_cw_output": 31, "at_speed_input": 31, "stop_s": 4.0},
        {
            "M3": "PULSE ($OUT[31],TRUE,0.5)\n" + AT_SPEED,
            "M5": "$OUT[31]=FALSE\nPULSE ($OUT[32],TRUE,0.5)\nWAIT FOR NOT $IN[31]",
        },
    ),
    "tools by TOOL_DATA": cell(
        "KR 300 R2500 ultra",
        frame(1500.0, 0.0, 800.0),
        frame(250.0, 0.0, 250.0, b=-90.0),
        100.0,
        (120.0, 100.0, 0.0, 180.0),
        {
            "1": tool(16.0, 100.0, tool_data=1, axis="+x", frame=frame(250.0, 0.0, 250.0, a=180.0)),
            "2": tool(
                12.0,
                130.0,
                tool_data=2,
                axis="+x",
                frame=frame(280.0, 0.0, 250.0, a=180.0),
                load={"mass_kg": 118.0, "x_mm": 99.0, "y_mm": 0.0, "z_mm": 180.0},
            ),
        },
        DIGITAL,
        {"M3": "HALT ; set {{ rpm }} rpm\n" + CW + "WAIT SEC 2\nWAIT SEC 2.5", "M5": STOP},
    ),
    "upside down": cell(
        "KR 60 HA",
        frame(1400.0, -100.0, 350.0),
        frame(0.0, 0.0, 310.0, b=180.0),
        100.0,
        (24.0, 0.0, 0.0, 140.0),
        {"1": tool(8.0, 104.0)},
        {
            "max_rpm": 24000.0,
            "speed_analog_output": 1,
            "run_cw_output": 5,
            "at_speed_input": 6,
            "stop_s": 6.0,
        },
        {
            "M3": OUTPUT + CW + AT_SPEED,
            "M5": STOP,
            "M63": "$OUT[{{ p | int }}]=FALSE",
            "M68": "$ANOUT[{{ e | int }}]={{ q }}",
        },
        home={"q_deg": [0.0, -60.0, 75.0, 0.0, -105.0, 0.0]},
        clearance={"z_mm": 100.0},
    ),
    "on a rail of 8 m": cell(
        "KR 300 R2500 ultra",
        frame(1500.0, 0.0, 800.0),
        frame(250.0, 0.0, 250.0, b=-90.0),
        100.0,
        (120.0, 100.0, 0.0, 180.0),
        {"1": tool(16.0, 100.0)},
        DIGITAL | {"speed_analog_output": 3},
        {
            "M3": OUTPUT
            + "IF $IN[8] THEN\n"
            + CW
            + WAITED
            + "\nELSE\nHALT ; close the door\n"
            + CW
            + WAITED
            + "\nENDIF",
            "M5": STOP,
        },
        external={"E1": {"kind": "rail", "axis": "y", "limits": [-4000.0, 4000.0], "speed": 1500.0}},
        stock={"box_mm": [[-100.0, -3000.0, -40.0], [400.0, 3000.0, 0.0]]},
        table={"z_mm": -45.0},
    ),
    "spindle on the drive's full value of 24,000": cell(
        "KR 600 R2830",
        frame(1800.0, 0.0, 600.0),
        frame(300.0, 0.0, 300.0, b=-90.0),
        140.0,
        (260.0, 140.0, 10.0, 200.0),
        {"1": tool(40.0, 160.0, teeth=5), "12": tool(8.0, 120.0, kind="drill", teeth=2, point_deg=140.0)},
        {
            "max_rpm": 18000.0,
            "run_cw_output": 4,
            "speed_analog_output": 1,
            "at_speed_input": 4,
            "stop_s": 10.0,
        },
        {
            "M3": "$ANOUT[1]={{ rpm }}/24000\n$OUT[4]=TRUE\nWAIT FOR ($IN[4]==TRUE) AND ($IN[5]==TRUE)",
            "M5": STOP,
        },
        tool_change="$OUT[80]=TRUE\nWAIT FOR $IN[80]\nHALT ; tool {{ tool }}",
        stock={"box_mm": [[0.0, -300.0, -100.0], [600.0, 300.0, 20.0]], "through_mm": 2.0},
        table={"z_mm": -120.0},
    ),
}
"""Name → cell file as tables: none of them has a finding."""
SOUND["upside down"]["frames"]["robroot"] = frame(0.0, 0.0, 2600.0, c=180.0)
