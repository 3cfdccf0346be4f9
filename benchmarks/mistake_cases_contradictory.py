"""Cells that contradict themselves, each in a cell that is sound otherwise: templates, geometry, loads.

What a template does is compared with ``[spindle]``, and what stands in the cell with everything else in it.
``about`` names the key. Over the demonstration cell, whose signals a file may replace, a warning is enough.
"""

from mistake_cases import CELL_TOOLS, STOCK, Mistake

SPEED = "$ANOUT[1]={{ '%.4f' % (rpm / spindle.max_rpm) }}\n"
CW, CCW, WAITED = "$OUT[1]=TRUE\n", "$OUT[2]=TRUE\n", "WAIT SEC 5.0"
BASE = "a_deg = 0.0, b_deg = {b}, c_deg = {c} }}\n"


def _code(title: str, code: str, krl: str, more: str = "", severity: str = "warning") -> Mistake:
    return Mistake(
        title, rf"m_code\.{code}", cell=f'{more}[m_code]\n{code} = """\n{krl}"""\n', severity=severity
    )


def _keys(title: str, about: str, cell: str, severity: str = "warning", **more: str) -> Mistake:
    return Mistake(title, about, cell=cell, severity=severity, **more)


def _frame(x: float, y: float, z: float, b: float = 0.0, c: float = 0.0) -> str:
    return f"{{ x_mm = {x}, y_mm = {y}, z_mm = {z}, " + BASE.format(b=b, c=c)


def _clamp(low: str, high: str) -> str:
    return f'[[obstacle]]\nname = "clamp"\nbox_mm = [[{low}], [{high}]]\n'


CONTRADICTIONS = (
    Mistake(
        "tool change without a stop",
        r"tool_change",
        {6: "@", 21: "@"},
        cell='tool_change = "; tool {{ tool }}"\n',
    ),
    Mistake(
        "tool change that halts for T7 only",
        r"tool_change",
        {21: "@"},
        cell='tool_change = "{% if tool == 7 %}HALT{% endif %}"\n',
    ),
    _code(
        "speed by integer division",
        "M3",
        f"$ANOUT[1]={{{{ rpm // spindle.max_rpm }}}}\n{CW}{WAITED}",
        severity="error",
    ),
    _code("speed is S itself", "M3", f"$ANOUT[1]={{{{ rpm }}}}\n{CW}{WAITED}", severity="error"),
    _code("speed that does not grow with S", "M3", f"$ANOUT[1]=0.5\n{CW}{WAITED}", severity="error"),
    _code(
        "speed that is not proportional to S", "M3", f"$ANOUT[1]={{{{ 0.5 + rpm / 48000 }}}}\n{CW}{WAITED}"
    ),
    _code(
        "speed that is 0 below S5000",
        "M3",
        f"$ANOUT[1]={{{{ 0 if rpm < 5000 else rpm / 24000 }}}}\n{CW}{WAITED}",
        severity="error",
    ),
    _code(
        "speed beyond 1 at the largest S",
        "M3",
        f"$ANOUT[1]={{{{ rpm / 12000 }}}}\n{CW}{WAITED}",
        severity="error",
    ),
    _code("M3 drives the output of M4", "M3", SPEED + CCW + WAITED, severity="error"),
    _code("M4 drives the output of M3", "M4", SPEED + CW + WAITED, severity="error"),
    _code("M4 drives both directions", "M4", SPEED + CW + CCW + WAITED, severity="error"),
    _code("M3 switches nothing on", "M3", SPEED + WAITED),
    _code("M3 without the speed", "M3", CW + WAITED),
    _code("M3 that does not wait", "M3", SPEED + CW),
    _code("M3 without the at-speed input", "M3", SPEED + CW, "[spindle]\nat_speed_input = 7\n", "error"),
    _code(
        "M3 that waits until it is not at speed",
        "M3",
        SPEED + CW + "WAIT FOR NOT $IN[7]",
        "[spindle]\nat_speed_input = 7\n",
        "error",
    ),
    _code("M3 that waits before it switches on", "M3", SPEED + WAITED + "\n" + CW),
    _code("M5 that does not wait", "M5", "$OUT[1]=FALSE\n$OUT[2]=FALSE"),
    _code("M0 that does not stop", "M0", "; stop", severity="error"),
    _code("M8 without the flood", "M8", "; flood"),
    _code("M7 with the flood", "M7", "$OUT[3]=TRUE"),
    _code("M9 that leaves the mist on", "M9", "$OUT[3]=FALSE", severity="error"),
    _keys(
        "plane below a clamp at the stock",
        r"clearance\.z_mm",
        STOCK + _clamp("20.0, -40.0, -20.0", "40.0, -12.0, 130.0"),
    ),
    _keys(
        "plane below the top of the stock",
        r"clearance\.z_mm",
        STOCK.replace("92.0, 0.0", "92.0, 120.0"),
    ),
    _keys(
        "table above the underside of the stock", r"table\.z_mm", STOCK + "[table]\nz_mm = -10.0\n", "error"
    ),
    _keys(
        "clamp inside the stock",
        r"obstacle\.0",
        STOCK + _clamp("10.0, 10.0, -15.0", "30.0, 30.0, -5.0"),
        "error",
    ),
    _keys(
        "clamp below the table",
        r"obstacle\.0",
        "[table]\nz_mm = -20.0\n" + _clamp("10.0, 10.0, -90.0", "30.0, 30.0, -50.0"),
    ),
    Mistake(
        "stock beside the program",
        r"stock",
        {12: "@"},
        STOCK.replace("-12.0, -14", "400.0, -14").replace("132.0", "544.0"),
    ),
    Mistake(
        "stock below the program",
        r"stock",
        {12: "@"},
        "[stock]\nbox_mm = [[-12.0, -14.0, -60.0], [132.0, 92.0, -40.0]]\n",
        severity="warning",
    ),
    _keys(
        "stock out of reach",
        r"stock\.box_mm",
        STOCK.replace("-12.0", "7000.0").replace("132.0", "7144.0"),
        "error",
    ),
    _keys(
        "reference length in metres", r"frames\.tool_length_mm", "[frames]\ntool_length_mm = 0.1\n", "error"
    ),
    _keys(
        "tip within the flange",
        r"frames\.tool",
        "[frames]\ntool_length_mm = 100.0\ntool = " + _frame(0.25, 0.0, 0.25, -90.0),
        "error",
    ),
    _keys(
        "tip beyond the reach of the arm",
        r"frames\.tool",
        "[frames]\ntool_length_mm = 100.0\ntool = " + _frame(2900.0, 0.0, 250.0, -90.0),
        "error",
    ),
    Mistake(
        "two tools of different length in one frame",
        r"tool\.14\.frame",
        tools=CELL_TOOLS.replace("\n[tool.14]", "\nframe = " + _frame(250.0, 0.0, 250.0, -90.0) + "[tool.14]")
        + "frame = "
        + _frame(250.0, 0.0, 250.0, -90.0),
    ),
    _keys(
        "centre of the load on the flange",
        r"load\.x_mm",
        "[load]\nmass_kg = 120.0\nx_mm = 0.1\ny_mm = 0.0\nz_mm = 0.0\n",
        "error",
    ),
    _keys(
        "centre of the load behind the flange",
        r"load\.z_mm",
        "[load]\nmass_kg = 120.0\nx_mm = 100.0\ny_mm = 0.0\nz_mm = -180.0\n",
    ),
    _keys(
        "load of twice the payload",
        r"load\.mass_kg",
        "[load]\nmass_kg = 640.0\nx_mm = 100.0\ny_mm = 0.0\nz_mm = 180.0\n",
        "error",
    ),
    _keys("inertia of no body", r"load\.jx_kgm2", "[load]\njx_kgm2 = 40.0\n", "error"),
    _keys("inertia of a point", r"load\.j", "[load]\njx_kgm2 = 0.0004\njy_kgm2 = 0.0004\njz_kgm2 = 0.0003\n"),
    _keys("base upside down", r"frames\.base", "[frames]\nbase = " + _frame(1500.0, 0.0, 800.0, 0.0, 180.0)),
    _keys("base out of reach", r"frames\.base|reach", "[frames]\nbase = " + _frame(5800.0, 0.0, 800.0)),
    _keys(
        "robot root in metres",
        r"frames\.robroot",
        "[frames]\nrobroot = " + _frame(0.0, 0.0, 2.6, 0.0, 180.0),
        "error",
    ),
    _keys(
        "at-speed input and guard are one",
        r"\$IN\[7\]",
        '[spindle]\nat_speed_input = 7\n[[guard_inputs]]\nnumber = 7\nvalue = false\nmeaning = "door"\n',
        "error",
    ),
)
