"""Both ends of the predicted motion are exact stops of the program."""

from dataclasses import replace

import numpy as np
import pytest

from gcode2krl import write_krl
from gcode2krl.errors import RefusedError
from tests.krl.conftest import verified
from tests.krl.replay import read_program


def ends(targets):
    """Rows of the first and the last programmed position."""
    return np.flatnonzero(targets.move >= 0)[[0, -1]]


def test_the_ends_of_the_predicted_motion_are_exact_stops(make):
    made = make(data={"clearance": {"z_mm": 60.0}})
    motions = read_program(made.src).motions
    first, last = ends(made.targets)
    assert motions[first].kind == motions[first + 1].kind == motions[last].kind == "LIN"
    assert not motions[first].blend
    assert not motions[last].blend
    assert motions[last + 1].values["Z"] == 60.0
    assert made.targets.cdis_mm[[first, last]].tolist() == [0.0, 0.0]


def test_verify_refuses_a_program_that_blends_over_its_first_position(make):
    made = make()
    motion = read_program(made.src).motions[ends(made.targets)[0]]
    lines = made.src.read_bytes().split(b"\r\n")
    lines[motion.line - 1] += b" C_DIS"
    made.src.write_bytes(b"\r\n".join(lines))
    report = verified(made.src, made.toolpath, made.cell)
    found = [issue for issue in report.issues if issue.code == "verify-start"]
    assert [(issue.severity, issue.line) for issue in found] == [("error", motion.line)]
    assert "translate again" in found[0].remedy


def test_targets_that_blend_over_their_first_position_are_not_written(make, tmp_path):
    """As a prediction has them that was saved by an older version."""
    made = make()
    cdis = made.targets.cdis_mm.copy()
    cdis[ends(made.targets)[0]] = 0.1
    with pytest.raises(RefusedError, match="verify-start"):
        write_krl(replace(made.targets, cdis_mm=cdis), tmp_path / "old.src", made.cell)
    assert not (tmp_path / "old.src").exists()
