"""A five-axis program through the whole chain: A, B, C of the written program against scipy."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gcode2krl import Gcode2KrlError, load_cell, predict, read_gcode, set_targets, write_krl
from gcode2krl.cell.sections import Machine
from gcode2krl.cutting import history_of, remove
from gcode2krl.cutting.surface import dexels_to_mesh
from gcode2krl.pipeline import predict_toolpath
from gcode2krl.restart.material import restarted

EXAMPLE = Path(__file__).parents[1] / "examples" / "five_axis"
PART, CELL = EXAMPLE / "five_axis.nc", EXAMPLE / "cell.toml"
LIN = re.compile(r"^LIN \{X (\S+),Y (\S+),Z (\S+),A (\S+),B (\S+),C (\S+)\}", re.MULTILINE)


def frame_of(axis):
    """Return the frame turned by the smallest angle from z to an axis: rotation vector along z x axis."""
    across = np.cross([0.0, 0.0, 1.0], axis)
    size = np.linalg.norm(across)
    angle = np.arctan2(size, axis[2])
    return Rotation.from_rotvec(across / size * angle if size > 1e-12 else np.zeros(3))


def programmed():
    """Yield tip and axis of each block of the example, from its words and the chain of the table alone."""
    here = dict.fromkeys("XYZAC", 0.0)
    for line in PART.read_text().splitlines():
        if line.startswith("G49"):
            return
        words = dict(re.findall(r"([XYZAC])(-?[\d.]+)", line)) if not line.startswith("(") else {}
        if not words:
            continue
        here |= {letter: float(value) for letter, value in words.items()}
        table = Rotation.from_euler("x", -here["A"], degrees=True) * Rotation.from_euler(
            "z", -here["C"], degrees=True
        )
        yield np.array([here[letter] for letter in "XYZ"]), table.inv().apply([0.0, 0.0, 1.0])


def test_poses_of_the_written_program():
    cell = load_cell(CELL)
    targets = set_targets(read_gcode(PART, cell), cell)
    written = write_krl(targets, None, cell, name="PART")
    poses = np.array(
        [
            [float(value) for value in found]
            for found in LIN.findall(written.texts["PART.src"].decode("ascii"))
        ]
    )
    at = 0
    count = 0
    for tip, axis in programmed():
        want = frame_of(axis)
        near = np.flatnonzero(np.abs(poses[at:, :3] - tip).max(axis=1) < 0.00051)
        turned = Rotation.from_euler("ZYX", poses[at:, 3:][near], degrees=True)
        off_deg = np.degrees((want.inv() * turned).magnitude())
        assert off_deg.min() < 1e-3, (tip, off_deg)
        abc = want.as_euler("ZYX", degrees=True)
        k = at + near[np.argmin(off_deg)]
        np.testing.assert_allclose(poses[k, 3:], abc, atol=1e-3)
        at, count = k, count + 1
    assert count > 35


def test_between_blocks_the_tool_turns_as_the_table_does():
    """On the cone A stays and C turns evenly: every chord has the tilt of the cone's flank."""
    toolpath = read_gcode(PART, load_cell(CELL))
    on_cone = (toolpath.source_line >= 23) & (toolpath.source_line <= 46) & ~toolpath.rapid
    tilt_deg = np.degrees(np.arccos(toolpath.axis[on_cone, 2]))
    np.testing.assert_allclose(tilt_deg, 15.0, atol=1e-6)
    turn_deg = np.degrees(np.arctan2(toolpath.axis[on_cone, 0], -toolpath.axis[on_cone, 1]))
    steps = np.diff(np.unwrap(np.radians(turn_deg)))
    assert np.degrees(steps).max() < 8.0
    assert np.degrees(steps.sum()) == pytest.approx(352.5, abs=8.0)


def test_the_example_is_translated_with_forces(run, tmp_path):
    assert "not predicted" not in run(PART, "--cell", CELL, "-o", "part.src", code=0).err
    head = (tmp_path / "part.src").read_text().split(";ENDFOLD")[0]
    assert "material removal (rapids through stock" not in head
    assert run("verify", "part.src", PART, "--cell", CELL).code == 0


@pytest.fixture
def measured(tmp_path):
    """The cell of the example, with coefficients whose band lets a robot be moved by them."""
    cell = tmp_path / "measured.toml"
    cell.write_text(CELL.read_text() + '\n[material]\nmodel = "AW-2017A"\nrelative_band = 0.15\n')
    return cell


@pytest.mark.parametrize("asked", [["--pilot", "index"], ["--pilot", "values"], ["--compensate", "offline"]])
def test_a_turning_axis_has_a_pilot_force_and_a_correction(run, tmp_path, measured, asked):
    run(PART, "--cell", measured, "-o", "part.src", *asked, code=0)
    assert "$SEN_P" in (tmp_path / "part.src").read_text()
    checked = asked if asked[0] == "--compensate" else []
    assert run("verify", "part.src", PART, "--cell", measured, *checked).code == 0


def test_a_wide_band_refuses_the_correction_of_a_turning_axis_too(run, tmp_path):
    done = run(PART, "--cell", CELL, "-o", "part.src", "--compensate", "offline", code=1)
    assert "[compensation-unsure]" in done.err
    assert not (tmp_path / "part.src").exists()


def test_an_edited_correction_is_noticed(run, tmp_path, measured):
    """Verification reads back positions and orientations of the corrected targets."""
    run(PART, "--cell", measured, "-o", "part.src", "--compensate", "offline", "--pilot", "none")
    text = (tmp_path / "part.src").read_text()
    found = [match for match in LIN.finditer(text) if float(match[2]) > 30.0][5]
    for group, by in ((1, 0.05), (5, 0.2)):
        value = f"{float(found[group]) + by:.4f}"
        (tmp_path / "part.src").write_text(text[: found.start(group)] + value + text[found.end(group) :])
        run("verify", "part.src", PART, "--cell", measured, "--compensate", "offline", code=1)


def test_predict_has_forces_and_says_what_is_less_sure():
    cell = load_cell(CELL)
    prediction = predict(PART, cell)
    assert [issue.code for issue in prediction.issues if issue.code.startswith("axis-")] == ["axis-turns"]
    assert prediction.forces.relative_band == pytest.approx(np.hypot(cell.material.relative_band, 0.2))
    axis = Rotation.from_quat(prediction.motion.rotation).apply([0.0, 0.0, 1.0])
    assert np.degrees(np.arccos(axis[:, 2])).max() < 21.0
    line = prediction.toolpath.source_line[prediction.motion.move]
    force_N = np.linalg.norm(prediction.forces.force_base_N, axis=1)
    on_cone = (line > 24) & (line < 45)
    assert np.median(force_N[on_cone]) > 100.0
    # round the cone the force goes round with the tool, its size stays
    assert force_N[on_cone].std() < 0.1 * force_N[on_cone].mean()
    assert np.isfinite(prediction.deflection.deflection_base_mm[on_cone]).all()


def test_the_part_is_written_as_a_closed_mesh():
    cell = load_cell(CELL)
    prediction = predict(PART, cell)
    left = remove(prediction.toolpath, prediction.motion, cell, is_checked=False).material
    mesh = dexels_to_mesh(left)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(left.volume_mm3, rel=0.003)
    np.testing.assert_allclose(mesh.bounds[0], left.low_mm, atol=0.1)


@pytest.mark.parametrize("from_line", [18, 30])
def test_a_restart_goes_on_with_what_is_left(tmp_path, from_line):
    """Its forces are those of the whole program from there on, and so is the part that it leaves."""
    cell = load_cell(CELL)
    whole = predict(PART, cell)
    begun = restarted(read_gcode(PART, cell), from_line, cell)
    rest = predict_toolpath(begun, cell)
    left = [remove(one.toolpath, one.motion, cell, is_checked=False).material for one in (whole, rest)]
    assert left[1].volume_mm3 == pytest.approx(left[0].volume_mm3, rel=1e-4)
    met = [
        {i.line for i in one.issues if i.code in ("rapid-in-stock", "stock-untouched")}
        for one in (whole, rest)
    ]
    assert met[1] <= met[0]
    largest_N = []
    for one in (whole, rest):
        line = one.toolpath.source_line[one.motion.move]
        size_N = np.linalg.norm(one.forces.force_base_N, axis=1)
        largest_N.append([size_N[line == k].max(initial=0.0) for k in range(from_line + 1, 45)])
    np.testing.assert_allclose(largest_N[1], largest_N[0], rtol=0.03, atol=5.0)
    way_mm = begun.position_mm[1 : begun.restart.way_rows + 1]
    axis = begun.axis[1]
    np.testing.assert_allclose(np.cross(way_mm - way_mm[-1], axis), 0.0, atol=1e-9)
    np.testing.assert_array_equal(
        begun.axis[1 : begun.restart.way_rows + 1], np.broadcast_to(axis, way_mm.shape)
    )
    history = history_of(rest.toolpath, rest.motion, cell)
    assert history.volume_mm3() == pytest.approx(left[0].volume_mm3, rel=0.005)
    assert history.volume_mm3(-1) < 0.99 * history_of(whole.toolpath, whole.motion, cell).volume_mm3(-1)


def test_the_part_is_shown_with_its_error():
    cell = load_cell(CELL)
    prediction = predict(PART, cell)
    history = history_of(prediction.toolpath, prediction.motion, cell)
    left = remove(prediction.toolpath, prediction.motion, cell, is_checked=False).material
    assert history.volume_mm3() == pytest.approx(left.volume_mm3, rel=0.005)
    points, _ = history.surface()
    off_mm = history.error_mm(prediction.deflection.deflection_base_mm)
    line = prediction.toolpath.source_line[prediction.motion.move[history.left_by]]
    # the cone of 15 degrees widens downwards
    of_cone = (line > 24) & (line < 45) & (np.hypot(points[:, 0], points[:, 1]) < 35.0)
    of_cone &= np.abs(history.normal[:, 2] - np.sin(np.radians(15.0))) < 0.05
    assert of_cone.sum() > 500
    outward = (history.normal[of_cone, :2] * points[of_cone, :2]).sum(axis=1)
    assert (outward > 0.0).all()
    deflection_mm = prediction.deflection.deflection_base_mm[history.left_by[of_cone]]
    assert np.abs(off_mm[of_cone]).max() <= np.linalg.norm(deflection_mm, axis=1).max()
    assert off_mm[of_cone].mean() < -0.5  # the mill is drawn into the cone
    assert len(prediction.plot.part().axes) == 5  # three sides, the worst places and the scale


def test_a_tilted_tool_leaves_along_its_axis():
    cell = load_cell(CELL)
    toolpath = read_gcode(PART, cell)
    targets = set_targets(toolpath, cell)
    axis = Rotation.from_quat(targets.rotation).apply([0.0, 0.0, 1.0])
    added = np.flatnonzero((targets.move < 0) & ~targets.home)
    assert len(added)
    first = int(np.flatnonzero(targets.move >= 0)[0])
    way = targets.position_mm[first - 1] - targets.position_mm[first]
    np.testing.assert_allclose(way / np.linalg.norm(way), axis[first], atol=1e-9)
    assert targets.position_mm[first - 1, 2] == pytest.approx(cell.clearance_z_mm)


SET_UP = "G21 G90\nT1 M6\nS8000 M3\nG43.4 H1\nG0 X-60 Y-70 Z40 A20 C0\nG0 Z-12\nG1 X60 F1200\nG0 Z40\n"


def test_one_tilted_set_up_has_forces(tmp_path):
    """G49 and G28 Z0 behind it do not turn the tool: the retract is along its axis, HOME comes last."""
    part = tmp_path / "set_up.nc"
    part.write_text(SET_UP + "G49\nG91 G28 Z0\nM5\nM30\n")
    prediction = predict(part, load_cell(CELL))
    assert prediction.forces is not None
    axis = Rotation.from_quat(prediction.motion.rotation).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(axis, np.broadcast_to(axis[0], axis.shape), atol=1e-9)


LYING = "G21 G90\nT1 M6\nS1000 M3\nG43 H1\nG0 X0 Y0 Z5 A85 C0\nG1 X5 F500\nM30\n"


def test_a_lying_tool_is_refused_where_it_has_to_leave(tmp_path):
    part = tmp_path / "lying.nc"
    part.write_text(LYING)
    made_for = Machine(kind="head-head", axes=("C", "A"), signs=(1, 1), tcpm=True)
    cell = load_cell().model_copy(update={"machine": made_for})
    targets = set_targets(read_gcode(part, cell), cell)
    found = [issue for issue in targets.issues if issue.code == "tool-lies"]
    assert [issue.line for issue in found] == [5]
    with pytest.raises(Gcode2KrlError):
        write_krl(targets, None, cell, name="PART")


def test_the_example_is_what_its_maker_writes(tmp_path, monkeypatch):
    out = tmp_path / "again.nc"
    monkeypatch.setattr("sys.argv", ["make.py", str(out)])
    runpy.run_path(str(EXAMPLE / "make.py"), run_name="__main__")
    assert out.read_bytes() == PART.read_bytes()
