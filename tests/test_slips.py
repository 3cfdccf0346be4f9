"""Slips in a cell file or a program that once passed silently: each is reported, similar sound ones are
not."""

import datetime
import io
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import cut, plan_motion
from gcode2krl.cell import load_cell
from gcode2krl.cell.confirmation import future_confirmation
from gcode2krl.cli.main import _run
from gcode2krl.cutting.tool_use import plunge_limit_mm
from gcode2krl.errors import NotUnderstoodError
from gcode2krl.gcode import read_stream
from gcode2krl.pipeline import predict_toolpath
from gcode2krl.program import check_toolpath
from tests.cells import over_demonstration

HEAD = "G21 G90 G17 G54\nT9 M6\nS8000 M3\nG0 X0 Y0\nG43 Z5 H9\n"
SLOT = "G1 Z-4 F600\nX60\nG0 Z30\nM5\nM30\n"
T9 = {"diameter_mm": 12.0, "teeth": 3, "length_mm": 100.0}
PLACE = dict(
    zip(("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg"), (1500.0, 0, 800.0, 0, 0, 0), strict=True)
)


IN_KN = {"Ktc": 0.8, "Krc": 0.17, "Kte": 0.03, "Kre": 0.03}
SWITCHES = {"M3": "$OUT[1]=TRUE", "M4": "$OUT[2]=TRUE", "M5": "$OUT[1]=FALSE\n$OUT[2]=FALSE"}


def cell_with(**more):
    return over_demonstration({"tool": {"9": {**T9, **more.pop("tool", {})}}, **more})


def refusal(**more):
    with pytest.raises(NotUnderstoodError) as refused:
        cell_with(**more)
    return str(refused.value)


def toolpath_of(text, cell):
    return read_stream(io.BytesIO(text.encode()), "part.nc", cell)


def lines_of(code, text, cell, *, forces=True):
    """Return the lines of a finding of the whole pipeline."""
    found = predict_toolpath(toolpath_of(text, cell), cell, forces=forces).issues
    return [issue.line for issue in found if issue.code == code]


def cell_warnings(cell, code, text=HEAD + SLOT):
    return [issue.message for issue in check_toolpath(toolpath_of(text, cell), cell) if issue.code == code]


def test_a_number_of_the_controllers_table_needs_its_frame_in_the_same_file():
    words = refusal(frames={"base_data": 3})
    assert "frame-split" in words
    assert "frames.base_data is stated here, and frames.base" in words
    assert "demonstration" in words
    assert cell_with(frames={"base_data": 3, "base": PLACE}).frames.base_data == 3
    assert cell_with().frames.base_data is None


def test_a_pair_of_one_file_holds_through_based_on(tmp_path: Path):
    frame = ", ".join(f"{key} = {float(value)}" for key, value in PLACE.items())
    pair = f"base_data = 3\nbase = {{ {frame} }}\n"
    (tmp_path / "shop.toml").write_text(f'based_on = "demonstration"\n[frames]\n{pair}', encoding="utf-8")
    own = tmp_path / "cell.toml"
    own.write_text('based_on = "shop.toml"\n', encoding="utf-8")
    assert load_cell(own).frames.base_data == 3
    own.write_text(f'based_on = "shop.toml"\n[frames]\nbase = {{ {frame} }}\n', encoding="utf-8")
    with pytest.raises(NotUnderstoodError, match=r"frames\.base is stated here, and frames\.base_data"):
        load_cell(own)


@pytest.mark.parametrize(
    ("tool", "words"),
    [
        ({"kind": "ball", "corner_radius_mm": 1.0}, "half its diameter, 6"),
        ({"length_mm": 80.0, "stick_out_mm": 120.0}, "stick_out_mm 120 is more than length_mm 80"),
    ],
)
def test_sizes_of_a_tool_that_contradict_each_other_are_refused(tool, words):
    assert words in refusal(tool=tool)


@pytest.mark.parametrize(
    "tool",
    [
        {"kind": "ball"},
        {"kind": "ball", "corner_radius_mm": 6.0},
        {"kind": "ball", "diameter_mm": 3.175, "corner_radius_mm": 1.58},
        {"length_mm": 80.0, "stick_out_mm": 80.0},
    ],
)
def test_sizes_of_a_tool_that_fit_are_taken(tool):
    assert cell_with(tool=tool).tool[9].diameter_mm > 0.0


@pytest.mark.parametrize(
    ("stated", "code", "key"),
    [
        ({"tool": {"corner_radius_mm": 5.0}}, "cell-doubtful", "corner_radius_mm"),
        ({"tool": {"helix_deg": 0.52}}, "cell-doubtful", "helix_deg"),
        ({"spindle": {"start_s": 0.05}}, "spindle-wait", "spindle.start_s"),
        ({"spindle": {"stop_s": 0.0}}, "spindle-wait", "spindle.stop_s"),
        ({"material": {"linear_edge": IN_KN}}, "cell-doubtful", "Ktc"),
        ({"material": {"kienzle": {"kc11": 0.7, "mc": 0.25}}}, "cell-doubtful", "kc11"),
    ],
)
def test_doubtful_values_of_what_the_program_uses_are_said(stated, code, key):
    (message,) = cell_warnings(cell_with(**stated), code)
    assert key in message


@pytest.mark.parametrize(
    ("stated", "code"),
    [
        ({"tool": {"kind": "bull-nose", "corner_radius_mm": 5.0}}, "cell-doubtful"),
        ({"tool": {"helix_deg": 0.0}}, "cell-doubtful"),
        ({"spindle": {"start_s": 0.05, "at_speed_input": 9}}, "spindle-wait"),
        ({"spindle": {"start_s": 0.05}, "m_code": SWITCHES}, "spindle-wait"),
        ({"material": {"kienzle": {"kc11": 31.25, "mc": 0.5}}}, "cell-doubtful"),
    ],
)
def test_values_that_are_usual_or_unused_are_not(stated, code):
    assert not cell_warnings(cell_with(**stated), code)


def test_a_spin_in_radians_is_refused():
    assert "frames.spin" in refusal(frames={"spin": 1.5708})
    assert cell_with(frames={"spin": 90.0}).frames.spin == 90.0


@pytest.mark.parametrize("day", ["2026-13-45", "2026-02-30", "2026-00-01"])
def test_a_confirmation_on_no_day_is_refused(day):
    assert f"{day} is not a date" in refusal(verified={"by": "somebody", "date": day})


def test_a_confirmation_in_the_future_is_a_warning_from_the_second_day_on():
    cell = cell_with(verified={"by": "somebody", "date": "2026-03-01"})
    assert not future_confirmation(cell, datetime.date(2026, 2, 28))
    (warning,) = future_confirmation(cell, datetime.date(2026, 2, 27))
    assert (warning.severity, warning.code) == ("warning", "verified-future")
    assert "2026-03-01" in warning.message
    assert not future_confirmation(cell_with())


def test_the_day_is_said_and_not_written(tmp_path: Path, capfd, monkeypatch):
    part, cell, output = (tmp_path / name for name in ("part.nc", "cell.toml", "out.src"))
    part.write_text(HEAD + SLOT, encoding="utf-8")
    tool = "[tool.9]\ndiameter_mm = 12.0\nteeth = 3\nlength_mm = 100.0\n"
    confirmed = 'verified = { by = "x", date = "2126-01-15" }\n'
    cell.write_text(f'based_on = "demonstration"\n{confirmed}{tool}', encoding="utf-8")
    command = ["translate", str(part), "--cell", str(cell), "-o", str(output)]
    assert _run(command) == 0
    assert "verified-future" in capfd.readouterr().err
    before = output.read_bytes(), output.with_suffix(".dat").read_bytes()
    monkeypatch.setattr("gcode2krl.chain.future_confirmation", lambda cell: ())
    assert _run(command) == 0
    assert "verified-future" not in capfd.readouterr().err
    assert (output.read_bytes(), output.with_suffix(".dat").read_bytes()) == before


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("G1 Z-4 F6000\nX60 F1200\nG0 Z30\nM5\nM30\n", [6]),
        (SLOT, []),
        ("G1 X8 Z-1 F6000\nX60 F1200\nG0 Z30\nM5\nM30\n", []),
    ],
)
def test_a_plunge_with_the_feed_of_a_cut_is_said(body, expected):
    assert lines_of("plunge-fast", HEAD + body, cell_with()) == expected


def test_a_plunge_in_air_or_in_wood_may_be_faster():
    air = "G1 Z-4 F6000\nG0 Z30\nM5\nM30\n"
    beside = {"stock": {"box_mm": [[20.0, 20.0, -20.0], [80.0, 80.0, 0.0]]}}
    assert not lines_of("plunge-fast", HEAD + air, cell_with(**beside))
    wood = cell_with(material={"kienzle": {"kc11": 31.25, "mc": 0.5}})
    assert not lines_of("plunge-fast", HEAD + "G1 Z-4 F6000\nX60 F1200\nG0 Z30\nM5\nM30\n", wood)
    assert plunge_limit_mm(wood.tool[9], wood.material) == pytest.approx(3 * 0.015 * 12.0)


def test_a_drill_that_cuts_sideways_is_said_once_and_one_that_drills_is_not():
    drill = cell_with(tool={"kind": "drill", "diameter_mm": 8.0, "teeth": 2, "point_deg": 118.0})
    assert lines_of("drill-sideways", HEAD + "G1 Z-4 F600\nX60\nY10\nG0 Z30\nM5\nM30\n", drill) == [7]
    holes = "G1 Z-4 F600\nG0 Z5\nX20\nG1 Z-4\nG0 Z30\nM5\nM30\n"
    assert not lines_of("drill-sideways", HEAD + holes, drill)
    assert not lines_of("drill-sideways", HEAD + SLOT, cell_with())


@pytest.mark.parametrize(
    ("feed", "stated", "expected"),
    [
        (12000, {}, [7]),
        (6000, {}, []),
        (12000, {"material": {"kienzle": {"kc11": 31.25, "mc": 0.5}}}, []),
        (12000, {"tool": {"kind": "bull-nose", "corner_radius_mm": 2.0}}, []),
    ],
)
def test_a_feed_per_tooth_for_wood_is_too_much_in_metal(feed, stated, expected):
    body = f"G1 Z-4 F600\nX60 F{feed}\nG0 Z30\nM5\nM30\n"
    cell = cell_with(**stated)
    assert lines_of("feed-per-tooth", HEAD + body, cell) == expected


def test_forces_do_not_depend_on_what_is_said_of_the_tool():
    cell = cell_with()
    toolpath = toolpath_of(HEAD + SLOT, cell)
    forces = cut(toolpath, plan_motion(toolpath, cell), cell)
    assert np.isfinite(forces.force_base_N).all()
    assert {issue.code for issue in forces.issues if issue.severity == "warning"} == set()
