"""The joined table: every sample with its line, tool, move, load and place."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from gcode2krl import Gcode2KrlError, predict
from gcode2krl.prediction.bundle import pass_numbers
from tests.conftest import ROOT


def test_a_row_is_a_sample_with_what_every_stage_says_of_it(prediction):
    samples, motion = prediction.samples(), prediction.motion
    assert len(samples) == len(motion)
    frame = samples.to_polars()
    for row in (0, 1234, len(motion) - 1):
        named = frame.row(row, named=True)
        move = int(motion.move[row])
        assert named["source_line"] == prediction.toolpath.source_line[move]
        assert named["tool"] == motion.tool[row]
        assert named["position_z_mm"] == motion.position_mm[row, 2]
        assert named["q3_rad"] == prediction.joints.q_rad[row, 2]
        assert named["force_N"] == pytest.approx(np.linalg.norm(prediction.forces.force_base_N[row]))
        assert named["deflection_mm"] == pytest.approx(
            np.linalg.norm(prediction.deflection.deflection_base_mm[row])
        )
        assert named["cutting"] == bool(prediction.forces.a_p_mm[row] > 0)
    assert len(set(frame.columns)) == len(frame.columns)


def test_the_kind_of_a_move_is_that_of_its_line(prediction):
    text = (ROOT / "examples" / "test_piece.nc").read_text(encoding="ascii").splitlines()
    frame = prediction.samples().to_polars().group_by("source_line").agg(pl.col("kind").first())
    codes = {"G0": "rapid", "G1": "line", "G2": "arc", "G3": "arc"}
    seen = set()
    for line, kind in frame.rows():
        word = text[line - 1].split()[0]
        if word in codes:
            assert kind == codes[word], text[line - 1]
            seen.add(kind)
    assert seen == {"rapid", "line", "arc"}


def test_passes_are_counted_by_tool_and_rapid():
    rapid = np.array([1, 0, 0, 1, 1, 0, 0, 0, 1], dtype=bool)
    tool = np.array([1, 1, 1, 1, 2, 2, 2, 3, 3], dtype=np.int32)
    assert pass_numbers(rapid, tool).tolist() == [0, 1, 1, 0, 0, 2, 2, 3, 0]


def test_a_stage_that_did_not_run_has_no_columns(prediction):
    bare = replace(prediction, joints=None, forces=None, deflection=None)
    columns = bare.samples().columns()
    assert "q1_rad" not in columns
    assert "force_N" not in columns
    assert "speed_mm_s" in columns
    with pytest.raises(Gcode2KrlError, match="no motion"):
        replace(bare, motion=None).samples()


def test_what_effects_add_is_there():
    loose = predict(ROOT / "examples" / "test_piece.nc", effects=["backlash:target=A2,gap_deg=0.02"])
    assert {"q2_act_rad", "q2_load_rad", "force_meas_x_N"} <= set(loose.samples().columns())
