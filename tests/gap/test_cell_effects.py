"""Named causes in a cell file: the next prediction has them, what stood there stays."""

import tomllib
from dataclasses import replace

import pytest

from gcode2krl import load_cell
from gcode2krl.effects import Applied, from_cell, library
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gap.answer.result import apply_to_cell
from tests.gap.test_report import GAP

LIBRARY = library()
BACKLASH = Applied(LIBRARY["backlash"], "A2", {"gap_deg": 0.0212345678})
FRAME = Applied(
    LIBRARY["base_frame"],
    None,
    {"x_mm": 0.5, "y_mm": 0.0, "z_mm": -0.25, "a_deg": 0.0, "b_deg": 0.0, "c_deg": 0.01},
)
SLIP = Applied(LIBRARY["override"], None, {"percent": 50.0})


def with_causes(*causes):
    return replace(GAP, named=causes)


def effects(file):
    return tomllib.loads(file.read_text(encoding="utf-8"))["effects"]


def test_a_new_file_holds_the_causes_with_their_source(tmp_path):
    file = tmp_path / "cell.toml"
    assert apply_to_cell(with_causes(BACKLASH, FRAME), file, None, ["run-1", "run-2"]) == 2
    first, second = effects(file)
    assert first == {
        "name": "backlash",
        "target": "A2",
        "parameters": {"gap_deg": 0.0212346},
        "source": "diagnosed from run-1, run-2",
    }
    assert "target" not in second
    assert second["parameters"] == FRAME.values


def test_the_next_prediction_has_them(tmp_path):
    file = tmp_path / "cell.toml"
    apply_to_cell(with_causes(BACKLASH, FRAME), file, None, ["run-1"])
    found = from_cell(load_cell(file))
    assert [(one.effect.name, one.target) for one in found] == [("backlash", "A2"), ("base_frame", None)]
    assert found[0].values["gap_deg"] == pytest.approx(0.0212346)


def test_set_up_slips_are_put_right_and_not_modelled(tmp_path):
    file = tmp_path / "cell.toml"
    assert apply_to_cell(with_causes(SLIP), file, None, ["run-1"]) == 0
    assert effects(file) == []


def test_what_stood_there_stays_and_the_same_cause_is_replaced(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text(
        'name = "my cell"\n[[effects]]\nname = "backlash"\ntarget = "A2"\nparameters = { gap_deg = 0.05 }\n'
        '[[effects]]\nname = "backlash"\ntarget = "A3"\nparameters = { gap_deg = 0.01 }\n',
        encoding="utf-8",
    )
    apply_to_cell(with_causes(BACKLASH), file, None, ["run-1"])
    assert [(one["target"], one["parameters"]["gap_deg"]) for one in effects(file)] == [
        ("A3", 0.01),
        ("A2", 0.0212346),
    ]
    assert tomllib.loads(file.read_text(encoding="utf-8"))["name"] == "my cell"


def test_a_new_file_begins_from_another_and_leaves_that_alone(tmp_path):
    base, file = tmp_path / "base.toml", tmp_path / "cell.toml"
    base.write_text('name = "the old one"\n', encoding="utf-8")
    apply_to_cell(with_causes(BACKLASH), file, base, ["run-1"])
    assert tomllib.loads(file.read_text(encoding="utf-8"))["name"] == "the old one"
    assert base.read_text(encoding="utf-8") == 'name = "the old one"\n'


@pytest.mark.parametrize("text", ["effects = 3\n", 'controller = "no table"\n'])
def test_what_is_no_cell_is_an_error_and_not_written(tmp_path, text):
    file = tmp_path / "cell.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(NotUnderstoodError):
        apply_to_cell(with_causes(BACKLASH), file, None, ["run-1"])
    assert file.read_text(encoding="utf-8") == text
