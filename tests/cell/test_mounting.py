"""A robot that hangs: kinematics in its foot, KRL in $WORLD, and gravity downwards."""

import numpy as np
import pytest

from gcode2krl import frames as fr
from gcode2krl import load_cell, read_gcode, set_targets, solve_joints
from gcode2krl.cell.sections import Frame
from gcode2krl.units import DEG_PER_RAD
from tests.conftest import ROOT

FOLDER = ROOT / "examples" / "cells"


@pytest.fixture(scope="module")
def hanging():
    return load_cell(FOLDER / "upside_down.toml")


def as_frame(matrix):
    abc_deg = fr.abc_from_rotation(matrix[:3, :3]) * DEG_PER_RAD
    keys = ("x_mm", "y_mm", "z_mm", "a_deg", "b_deg", "c_deg")
    numbers = np.round([*matrix[:3, 3], *abc_deg], 6) + 0.0
    return Frame(**dict(zip(keys, map(float, numbers), strict=True)))


def joints_of(cell):
    toolpath = read_gcode(FOLDER / "part.nc", cell)
    return solve_joints(set_targets(toolpath, cell), cell).q_rad


def test_the_joints_are_those_of_an_upright_robot_with_the_work_overhead(hanging):
    """$BASE in the foot by hand: 2600 - 350 above it, the other way round about X, Y mirrored."""
    by_hand = Frame(x_mm=1400.0, y_mm=100.0, z_mm=2250.0, a_deg=0.0, b_deg=0.0, c_deg=180.0)
    frames = hanging.frames.model_copy(update={"robroot": None, "base": by_hand})
    upright = hanging.model_copy(update={"frames": frames})
    np.testing.assert_allclose(hanging.base_matrix(), upright.base_matrix(), atol=1e-9)
    np.testing.assert_allclose(joints_of(hanging), joints_of(upright), atol=1e-9)


def test_the_program_states_the_base_as_the_controller_has_it(hanging, run, tmp_path):
    assert run(FOLDER / "part.nc", "--cell", FOLDER / "upside_down.toml", "-o", "part.src").code == 0
    numbered = (tmp_path / "part.src").read_text(encoding="ascii")
    robroot, base = hanging.frames.robroot, hanging.frames.base
    assert base.z_mm == 350.0
    for variable, frame in (("$ROBROOT", robroot), ("BASE_DATA[1]", base)):
        inverse = as_frame(fr.invert(frame.matrix()))
        line = numbered.split(f"GK_DIFF=GK_INV:{variable}")[0].rstrip("\n").split("\n")[-1]
        assert f"X {inverse.x_mm:.3f},Y {inverse.y_mm:.3f},Z {inverse.z_mm:.3f}" in line, variable

    text = (FOLDER / "upside_down.toml").read_text(encoding="utf-8")
    (tmp_path / "cell.toml").write_text(text.replace("base_data = 1", ""), encoding="utf-8")
    assert run(FOLDER / "part.nc", "--cell", "cell.toml", "-o", "part.src").code == 0
    by_value = (tmp_path / "part.src").read_text(encoding="ascii")
    assert "$BASE={X 1400.000,Y -100.000,Z 350.000,A 0.0000,B 0.0000,C 0.0000}" in by_value


def test_weight_pulls_downwards_in_the_world(hanging):
    down = hanging.base_in_world()[:3, :3].T @ [0.0, 0.0, -1.0]
    np.testing.assert_allclose(down, [0.0, 0.0, -1.0], atol=1e-12)  # its $BASE is level
    in_the_foot = hanging.base_matrix()[:3, :3] @ down
    np.testing.assert_allclose(in_the_foot, [0.0, 0.0, 1.0], atol=1e-12)


def test_a_robroot_of_zero_changes_nothing(hanging):
    zero = Frame(x_mm=0.0, y_mm=0.0, z_mm=0.0, a_deg=0.0, b_deg=0.0, c_deg=0.0)
    with_zero = hanging.model_copy(update={"frames": hanging.frames.model_copy(update={"robroot": zero})})
    without = hanging.model_copy(update={"frames": hanging.frames.model_copy(update={"robroot": None})})
    np.testing.assert_array_equal(with_zero.base_matrix(), without.base_matrix())
