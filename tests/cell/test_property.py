"""No value in a written program that the cell or its named base did not state, over generated cells."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gcode2krl import frames as fr
from gcode2krl.errors import Gcode2KrlError
from tests.krl.conftest import Made
from tests.krl.replay import components

PART = "G21 G90 G54\nT{0} M6\nG43 H{0}\nS8000 M3\nM8\n"
PART += "G0 X0 Y0\nG0 Z20\nG1 Z-1 F600\nG1 X20\nG0 Z50\nM9\nM5\nM30\n"
DEMONSTRATION = {"M": 120.0, "outputs": {1, 2, 3, 4}, "base": [1500, 0, 800, 0, 0, 0], "tip_x": 250.0}


def frame(x, y, z, b=0.0):
    return {"x_mm": x, "y_mm": y, "z_mm": z, "a_deg": 0.0, "b_deg": b, "c_deg": 0.0}


@st.composite
def cells(draw):
    """Return a complete cell without some of its keys, the keys left out, and its tool."""
    one = st.integers
    outputs = draw(st.lists(one(40, 4000), min_size=4, max_size=4, unique=True))
    number = draw(one(1, 30))
    data = {
        "robot": {"model": "KR 210 R2700 prime"},
        "frames": {
            "base": frame(draw(one(1350, 1450)) + 0.25, draw(one(-40, 40)) + 0.5, draw(one(500, 600)) + 0.75),
            "tool": frame(draw(one(180, 240)) + 0.5, 3.25, draw(one(180, 240)) + 0.25, -90.0),
            "tool_length_mm": draw(one(40, 60)) + 0.5,
        },
        "home": {"q_deg": [2.5, -87.5, 92.5, 1.5, -3.5, 4.5]},
        "clearance": {"z_mm": draw(one(60, 90)) + 0.5},
        "load": {
            "mass_kg": draw(one(10, 90)) + 0.125,
            "x_mm": 91.5,
            "y_mm": 2.5,
            "z_mm": 133.5,
            "jx_kgm2": 1.5,
            "jy_kgm2": 1.25,
            "jz_kgm2": 1.75,
        },
        "tool": {str(number): {"diameter_mm": 9.5, "teeth": 2, "length_mm": draw(one(70, 90)) + 0.25}},
        "spindle": {
            "max_rpm": 18500,
            "run_cw_output": outputs[0],
            "run_ccw_output": outputs[3],
            "speed_analog_output": 7,
            "flood_output": outputs[1],
            "stop_s": 6.5,
        },
        "controller": {"acc_cp_m_s2": 1.375, "rapid_m_s": 0.135, "ptp_percent": 13, "cdis_mm": 0.15},
        "tool_change": f"$OUT[{outputs[2]}]=FALSE\nHALT",
        "m_code": {
            "M3": "$ANOUT[{{ spindle.speed_analog_output }}]={{ '%.4f' % (rpm / spindle.max_rpm) }}\n"
            "$OUT[{{ spindle.run_cw_output }}]=TRUE",
            "M5": "$OUT[{{ spindle.run_cw_output }}]=FALSE\n$OUT[{{ spindle.run_ccw_output }}]=FALSE\n"
            "WAIT SEC {{ spindle.stop_s }}",
            "M4": "$ANOUT[{{ spindle.speed_analog_output }}]={{ '%.4f' % (rpm / spindle.max_rpm) }}\n"
            "$OUT[{{ spindle.run_ccw_output }}]=TRUE",
            "M7": "$OUT[{{ spindle.flood_output }}]=TRUE",
            "M8": "$OUT[{{ spindle.flood_output }}]=TRUE",
            "M9": "$OUT[{{ spindle.flood_output }}]=FALSE",
        },
    }
    paths = [(section,) for section in data] + [
        (section, key) for section in ("frames", "load", "spindle", "m_code", "tool") for key in data[section]
    ]
    dropped = draw(st.lists(st.sampled_from(paths), max_size=2, unique=True))
    for path in dropped:
        table = data
        for step in path[:-1]:
            table = table.get(step, {})
        table.pop(path[-1], None)
    based = draw(st.booleans())
    return data | ({"based_on": "demonstration"} if based else {"based_on": ""}), dropped, number, outputs


@given(made=cells())
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_every_value_of_the_program_was_stated(made):
    data, dropped, number, outputs = made
    with TemporaryDirectory() as folder:
        try:
            program = Made(Path(folder), PART.format(number), data=data)
        except Gcode2KrlError as error:
            assert dropped  # a complete cell is never refused
            check_remedies(error)
            assert not list(Path(folder).glob("*.src"))
            return
        text = program.src.read_text("ascii").replace("\r", "")
    cell, code = program.cell, re.sub(r"(?m);.*$", "", text)
    taken = {one.key for one in cell.taken_over}
    if not data["based_on"]:
        assert not taken
        assert switched(code) <= set(outputs)
    header = " ".join(line.strip("; ") for line in text.split("\n") if line.startswith(";"))
    assert all(f"{key} = " in header for key in taken)
    for key, output in (("run_cw_output", 0), ("flood_output", 1)):
        if f"spindle.{key}" not in taken and key in data.get("spindle", {}):
            assert cell.spindle.model_dump()[key] == outputs[output]
    check(
        code,
        r"\$BASE=\{(.*?)\}",
        list(data["frames"]["base"].values()) if stated(data, "frames", "base") else DEMONSTRATION["base"],
        "frames.base" in taken,
    )
    mass = float(re.search(r"\$LOAD=\{M ([\d.]+)", code)[1])
    assert mass == (data["load"]["mass_kg"] if stated(data, "load", "mass_kg") else DEMONSTRATION["M"])
    assert (mass == DEMONSTRATION["M"]) == ("load.mass_kg" in taken)
    tip = components(re.findall(r"\$TOOL=\{(.*?)\}", code)[-1])
    expected = cell.tool_matrix(number)
    assert abs(tip["X"] - expected[0, 3]) < 0.001
    if stated(data, "frames", "tool") and stated(data, "frames", "tool_length_mm") and data.get("tool"):
        longer = data["tool"][str(number)]["length_mm"] - data["frames"]["tool_length_mm"]
        tool = data["frames"]["tool"]
        turned = fr.rotation_from_abc([0.0, -3.141592653589793 / 2, 0.0])
        assert abs(tip["X"] - (tool["x_mm"] - longer * turned[0, 2])) < 0.002
        assert tip["Y"] == tool["y_mm"]


def check_remedies(error: Gcode2KrlError) -> None:
    assert all(issue.remedy for issue in error.issues if issue.severity == "error")


def stated(data, section, key) -> bool:
    return key in data.get(section, {})


def switched(code: str) -> set[int]:
    return {int(number) for number in re.findall(r"\$OUT\[(\d+)\]", code)}


def check(code: str, pattern: str, values: list[float], is_taken: bool) -> None:
    found = list(components(re.search(pattern, code)[1]).values())
    assert found == [float(value) for value in values]
    assert is_taken == (found == [float(value) for value in DEMONSTRATION["base"]])
