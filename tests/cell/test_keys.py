"""A mistyped key of a cell is answered with the key that is meant."""

import pytest

from gcode2krl import load_cell
from gcode2krl.cell import Cell, resolve_cell
from gcode2krl.cell.loading import meant_key
from gcode2krl.errors import NotUnderstoodError


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("clearance = {z = 100.0}", "clearance.z_mm"),
        ("[tool.1]\ndiameter = 6.0", "tool.1.diameter_mm"),
        ("[controler]\nrapid_m_s = 1.0", "controller"),
        ("[limits]\nforce_n = 300.0", "limits.force_N"),
        ("[pilot]\ntolerance = 3.0", "pilot.tolerance_N"),
        ("[program]\ntool_lenght = 'g43'", "program.tool_length"),
        ("[online.link]\nrobot_adress = '1.2.3.4'", "online.link.robot_address"),
        ("[[guard_inputs]]\nnumbr = 3", "guard_inputs.0.number"),
    ],
)
def test_the_remedy_names_the_nearest_key(tmp_path, text, meant):
    file = tmp_path / "cell.toml"
    file.write_text(f'based_on = "demonstration"\n{text}\n', "utf-8")
    with pytest.raises(NotUnderstoodError) as raised:
        load_cell(file)
    unknown = [issue for issue in raised.value.issues if "there is no such key" in issue.message]
    assert [issue.remedy.split("?")[0] for issue in unknown] == [f"did you mean {meant}"]


@pytest.mark.parametrize("place", [("xyzzy",), ("defaultss",), ("tool", "1", "qqqqqq"), ("a", "b", "c")])
def test_what_is_near_to_nothing_is_answered_with_nothing(place):
    assert meant_key(Cell, place) == ""


def test_a_long_text_is_not_quoted_whole():
    with pytest.raises(NotUnderstoodError) as error:
        resolve_cell({"online": {"link": {"address": "a" * 5000}}})
    assert len(str(error.value)) < 300
