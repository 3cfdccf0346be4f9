"""Samples that pass the stages in blocks are the tables of `predict`; memory does not grow by them."""

import tracemalloc
from contextlib import closing
from dataclasses import fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from gcode2krl import load_cell, read_gcode, robot, set_targets
from gcode2krl.blockwise import Loads, follower_of, plan_course
from gcode2krl.chain import Plan, collect, forecast_of, foresee, prepare
from gcode2krl.cli.main import main
from gcode2krl.compiled.threads import THREADS_VARIABLE
from gcode2krl.krc4.course import Course
from gcode2krl.pipeline import plan_motion, predict_toolpath, solve_joints
from gcode2krl.tables import joined, lengths, rows_of
from tests.cells import over_demonstration

REPOSITORY = Path(__file__).parents[1]
GOLDEN = REPOSITORY / "tests" / "golden" / "programs"
POST = {"name": "post", "frame": "base", "box_mm": [[300.0, 0.0, 0.0], [340.0, 40.0, 300.0]]}
BYTES_A_LINE = 1500.0
"""Of Python's and numpy's memory, most that a line of G-code may add to the peak of a translation."""


@pytest.fixture(scope="module")
def part():
    cell = load_cell(GOLDEN / "everything.toml")
    toolpath = read_gcode(GOLDEN / "everything.nc", cell)
    return toolpath, set_targets(toolpath, cell), cell


def same(one, other):
    for spec in fields(one):
        if "tail" in spec.metadata:
            assert np.array_equal(getattr(one, spec.name), getattr(other, spec.name), equal_nan=True), (
                spec.name
            )


def test_lengths_are_those_of_numpy_to_the_bit():
    vectors = np.random.default_rng(3).normal(size=(10_000, 3)) * [1e3, 1.0, 1e-3]
    assert (lengths(vectors) == np.linalg.norm(vectors, axis=1)).all()


@pytest.mark.parametrize("rows", [pytest.param(1, marks=pytest.mark.slow), 23, 1000])
def test_motion_joints_forces_and_deflection_in_blocks_are_those_as_a_whole(part, rows):
    toolpath, targets, cell = part
    whole = predict_toolpath(toolpath, cell, targets=targets)
    planned = plan_course(targets, cell, cell.controller.cycle_s)
    follower = follower_of(planned.course, cell)
    loads = Loads(toolpath, cell, planned.outlook, planned.course.dt_s)
    angles = []

    def samples():
        for motion, ends in planned.course.blocks(rows):
            angles.append(follower.take(motion, ends))
            yield motion, *angles[-1], ends

    with closing(loads.along(samples())) as along:
        blocks = list(along)
    same(joined(*(block.motion for block in blocks)), whole.motion)
    same(joined(*(block.forces for block in blocks)), whole.forces)
    bent_mm = np.concatenate([block.deflection.deflection_base_mm for block in blocks])
    np.testing.assert_allclose(bent_mm, whole.deflection.deflection_base_mm, rtol=0, atol=1e-10)
    q_rad, qd_rad_s = (np.concatenate(columns) for columns in zip(*angles, strict=True))
    # a product of matrices is rounded by how many rows it has
    np.testing.assert_allclose(q_rad, whole.joints.q_rad, rtol=0, atol=1e-12)
    np.testing.assert_allclose(qd_rad_s, whole.joints.qd_rad_s, rtol=0, atol=1e-9)
    outcome = loads.outcome()
    assert outcome.force_issues == whole.forces.issues
    assert outcome.deflection_issues == whole.deflection.issues
    assert planned.issues == whole.motion.issues


def test_joints_that_are_remembered_are_those_that_were_solved(part):
    _, targets, cell = part
    planned = plan_course(targets, cell, cell.controller.cycle_s)
    fresh, again = follower_of(planned.course, cell), planned.follower.again()
    for motion, ends in planned.course.blocks():
        for solved, known in zip(fresh.take(motion, ends), again.take(motion, ends), strict=True):
            assert np.array_equal(solved, known, equal_nan=True)


def test_a_forecast_says_what_the_prediction_says(part):
    plan = Plan.of(*part)
    whole = forecast_of(collect(plan))
    passed = foresee(plan)
    assert passed.issues == whole.issues
    assert passed.loads == whole.loads
    assert (passed.time_s, passed.path_mm) == (whole.time_s, whole.path_mm)
    same(passed.pilot, whole.pilot)


def test_any_number_of_threads_gives_the_same_forecast(part, monkeypatch):
    plan = Plan.of(*part)
    whole = Course.blocks
    monkeypatch.setattr(Course, "blocks", lambda course: whole(course, 50))
    passed = []
    for threads in "125":
        monkeypatch.setenv(THREADS_VARIABLE, threads)
        passed.append(foresee(plan))
    for other in passed[1:]:
        assert (other.issues, other.loads) == (passed[0].issues, passed[0].loads)
        same(other.pilot, passed[0].pilot)


def test_a_plan_is_told_once_and_keeps_what_its_stages_ask_for(part):
    """Joints of a plan are those a program is written with; judged once more only the findings grow."""
    toolpath, targets, cell = part
    plan = prepare(toolpath, cell)
    same(plan.targets, targets)
    assert plan.targets.issues == targets.issues
    ptp = np.flatnonzero(targets.ptp)
    alone = robot.ptp_joints(targets, cell)
    for name in ("q_rad", "status", "turn"):
        assert np.array_equal(getattr(plan.joints, name)[ptp], getattr(alone, name)[ptp]), name
    again = Plan.of(toolpath, replace(targets, issues=()), cell).judged()
    assert set(again.targets.issues) <= set(targets.issues)
    assert again.joints.issues == plan.joints.issues


def test_clearances_are_those_of_the_motion_whatever_becomes_of_its_findings(part):
    toolpath, targets, cell = part
    near = over_demonstration({"obstacle": [POST]})
    prediction = collect(Plan.of(toolpath, targets, near), forces=False)
    kept = plan_course(targets, near, near.controller.cycle_s, keeps=True).samples()
    same(kept.clearance, prediction.clearance)
    same(kept.joints(near), prediction.joints)
    assert len(prediction.clearance) == len(replace(prediction.motion, issues=()))
    assert collect(Plan.of(toolpath, targets, cell), forces=False).clearance is None


def test_rows_of_a_table_joined_are_the_table(part):
    _, targets, cell = part
    motion = plan_motion(targets, cell)
    borders = [0, 1, 500, 501, len(motion)]
    same(joined(*(rows_of(motion, start, end) for start, end in pairwise(borders))), motion)
    assert len(solve_joints(motion, cell)) == len(motion)


def peak_bytes(part, folder):
    tracemalloc.start()
    try:
        main([str(part), "-o", str(folder / "part.src"), "-q"])
    except SystemExit:
        pass
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    return peak


def raster(folder, lines):
    """Write a raster with a wave, so that no line is like the one before."""
    x = np.abs(np.arange(lines) * 0.4 % 160.0 - 80.0)
    y, z = np.floor(np.arange(lines) * 0.4 / 80.0) * 0.5, -1.0 + 0.5 * np.sin(x / 5.0)
    head = [
        "G21 G90 G17 G94 G54 G64",
        "T13 M6",
        "G43 H13",
        "S12000 M3",
        "G0 X0 Y0 Z5",
        "G1 Z-1 F1000",
        "F3000",
    ]
    body = [f"X{a:.3f} Y{b:.3f} Z{c:.3f}" for a, b, c in zip(x, y, z, strict=True)]
    file = folder / f"raster_{lines}.nc"
    file.write_text("\n".join([*head, "F3000", *body, "G0 Z20", "M5", "M30", ""]), encoding="ascii")
    return file


@pytest.mark.slow
def test_the_memory_of_a_translation_grows_by_little_a_line(tmp_path):
    few, many = 75_000, 150_000  # from here on the blocks are full, and only tables grow
    peaks = [peak_bytes(raster(tmp_path, lines), tmp_path) for lines in (2_000, few, many)]
    assert (tmp_path / "part.src").stat().st_size > 60 * many
    assert (peaks[2] - peaks[1]) / (many - few) < BYTES_A_LINE
