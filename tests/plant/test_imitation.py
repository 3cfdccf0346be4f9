"""What could stand in for an effect: exact where it is the same thing, absent where it is not."""

import numpy as np
import pytest

from tests.plant import kinds


def stand_ins(tmp_path, effect: str, kind: str = "single", seed: int = 8) -> tuple[dict, dict]:
    label = kinds.draw_case(kind, seed, tmp_path / "case", effect, "same" if kind == "single" else None)
    entry = label["effects"][0]
    return entry, {s["effect"]: s["left_over"] for s in entry["stand_ins"]}


def test_mastering_of_a1_is_a_turn_of_the_base(tmp_path):
    entry, found = stand_ins(tmp_path, "mastering@A1")
    assert found["base_frame"] < 0.02 * entry["ratio"]
    assert entry["stand_ins"][0]["effect"] == "base_frame"


def test_an_offset_of_the_force_stands_in_for_a_weight(tmp_path):
    _, found = stand_ins(tmp_path, "tool_weight")
    assert found["force_offset"] < 1e-3


def test_nothing_stands_in_for_what_swings(tmp_path):
    entry, found = stand_ins(tmp_path, "open:floor_sways", "open")
    assert entry["ratio"] > 0.0
    assert all(left > 0.9 * entry["ratio"] for left in found.values())


def test_left_over_is_in_units_of_the_noise(tmp_path):
    """A drift along one line leaves to an offset its spread over the runs, and nothing to itself."""
    entry, found = stand_ins(tmp_path, "tracker_drift")
    assert found["tracker_drift"] < 1e-4  # the tracker's clock is off by up to 2 ms
    share = entry["signals"]["tcp"]["constant_share"]
    offset = entry["ratio"] * np.sqrt(1.0 - share)
    assert found.get("tool_frame", offset) == pytest.approx(offset, rel=1e-3)
