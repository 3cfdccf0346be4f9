"""Differences of motions, whatever the chunks that they are compared in."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import load_cell, read_gcode, set_targets
from gcode2krl.compiled.chunks import chunk_borders
from gcode2krl.errors import MOST_PLACES
from gcode2krl.krl import differences, rules
from gcode2krl.krl.composition import TextLayout, compose
from gcode2krl.krl.differences import differences_of
from gcode2krl.krl.read import read_texts
from gcode2krl.robot import ptp_joints


@pytest.fixture(scope="module")
def case():
    cell = load_cell()
    targets = set_targets(read_gcode("examples/raster_finish.nc", cell), cell)
    joints = ptp_joints(targets, cell)
    files = compose(targets, joints, cell, "PART", TextLayout())
    texts = {name: b"".join(pieces) for name, pieces in files.items()}
    return read_texts(texts, "PART.src"), targets, joints, cell


def damaged(program, seed):
    """The program with wrong and missing numbers at random places."""
    random = np.random.default_rng(seed)
    changed = {}
    for name in ("pose", "speed_mm_s", "cdis_mm", "wait_s"):
        values = np.array(getattr(program, name))
        rows = random.integers(0, len(values), 200)
        values[rows] += random.choice([1e-4, 1e-3, 1.0, np.nan], size=(200, *values.shape[1:]))
        changed[name] = values
    return replace(program, **changed)


@pytest.mark.parametrize(
    ("seed", "rows"), [(0, 7), (0, 1000), *(pytest.param(1, n, marks=pytest.mark.slow) for n in (1, 7, 1000))]
)
def test_the_chunks_do_not_matter(case, seed, rows, monkeypatch):
    program, targets, joints, cell = case
    program = damaged(program, seed)
    whole = differences_of(program, targets, joints, cell, len(targets)), rules.rule_issues(program, cell)
    for module in (differences, rules):
        monkeypatch.setattr(module, "chunk_borders", lambda count: chunk_borders(count, rows))
    parts = differences_of(program, targets, joints, cell, len(targets)), rules.rule_issues(program, cell)
    assert repr(parts) == repr(whole)
    assert {issue.code for issue in whole[0].issues} >= {"verify-position", "verify-speed", "verify-wait"}
    assert {issue.code for issue in whole[1]} >= {"krl-incomplete", "krl-velocity"}


def test_what_is_furthest_off_and_how_far(case):
    program, targets, joints, cell = case
    pose = np.array(program.pose)
    lin = np.flatnonzero(~targets.ptp)[[3, 40, 500]]
    pose[lin, 1] += [0.5, 2.0, 1.0]
    found = differences_of(replace(program, pose=pose), targets, joints, cell, len(targets))
    assert [row for row, _ in found.worst[:3]] == [lin[1], lin[2], lin[0]]
    assert [off for _, off in found.worst[:3]] == pytest.approx([2.0, 1.0, 0.5], abs=1e-3)
    assert found.largest[0] == found.worst[0][1]
    assert [issue.line for issue in found.issues] == program.line[np.sort(lin)].tolist()
    assert "2.0000 mm off" in found.issues[1].message


def test_a_missing_number_comes_first_and_has_no_size(case):
    program, targets, joints, cell = case
    pose = np.array(program.pose)
    row = np.flatnonzero(~targets.ptp)[100]
    pose[row, 0] = np.nan
    found = differences_of(replace(program, pose=pose), targets, joints, cell, len(targets))
    assert found.worst[0][0] == row
    assert np.isnan(found.largest[0])
    assert [issue.message.partition(" (")[0] for issue in found.issues] == ["X, Y or Z is missing"]


def test_of_each_kind_only_the_first_places_are_listed(case):
    program, targets, joints, cell = case
    wrong = replace(program, wait_s=program.wait_s + 1.0)
    found = differences_of(wrong, targets, joints, cell, len(targets))
    assert len(targets) > MOST_PLACES
    assert [issue.line for issue in found.issues] == program.line[:MOST_PLACES].tolist()


def test_nothing_to_compare(case):
    program, targets, joints, cell = case
    found = differences_of(program, targets, joints, cell, 0)
    assert (found.largest, found.worst, found.issues) == ((0.0, 0.0, 0.0), (), ())
