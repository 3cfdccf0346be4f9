"""What a compensation gains, against figures by hand."""

import numpy as np
import pytest

from gcode2krl.online.outcome import MATTERS_MM, gain_of


def test_a_case_by_hand():
    before = np.array([1.0, 1.0, 1.0, 1.0, 0.2, 9.0])
    after = np.array([0.1, 0.1, 0.1, 1.0 + 0.5 * MATTERS_MM, 0.5, 0.0])
    line = np.array([7, 7, 8, 8, 9, 9], dtype=np.int32)
    counts = np.array([True, True, True, True, True, False])
    gain = gain_of(before, after, counts, line, 0.012)
    assert gain.rms_mm == pytest.approx(np.sqrt((3 * 0.01 + (1.0 + 0.5 * MATTERS_MM) ** 2 + 0.25) / 5))
    assert gain.rms_less_percent == pytest.approx(100.0 * (1.0 - gain.rms_mm / np.sqrt(4.04 / 5)))
    assert (gain.better_share, gain.worse_share) == (0.6, 0.2)
    assert gain.worst_line == 8
    assert gain.worse == ((9, pytest.approx(0.3), pytest.approx(0.012)),)
    assert gain.as_dict()["worse"] == [
        {"line": 9, "excess_mm": pytest.approx(0.3), "time_s": pytest.approx(0.012)}
    ]


def test_the_worst_lines_stand_first_and_are_few():
    line = np.arange(1, 21, dtype=np.int32)
    gain = gain_of(np.ones(20), 1.0 + 0.02 * line, np.ones(20, dtype=bool), line, 0.004)
    assert [each.line for each in gain.worse] == [20, 19, 18, 17, 16]
    assert gain.worse_share == 1.0


def test_nothing_judged_is_no_gain():
    assert (
        gain_of(np.ones(3), np.ones(3), np.zeros(3, dtype=bool), np.zeros(3, dtype=np.int32), 0.012) is None
    )


def test_without_any_deviation_there_is_no_percentage():
    gain = gain_of(np.zeros(3), np.zeros(3), np.ones(3, dtype=bool), np.ones(3, dtype=np.int32), 0.012)
    assert gain.rms_less_percent is None
    assert gain.better_share == gain.worse_share == 0.0
