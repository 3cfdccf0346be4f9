"""What the tests for slips share, on signals whose gap is known."""

import numpy as np
import pytest

from gcode2krl.errors import input_error
from gcode2krl.gap.compare.interpolation import rms_length
from gcode2krl.gap.compare.links import FORCE
from gcode2krl.gap.compare.slips import best_of, rms_before, rms_left, slip_if_explained
from gcode2krl.gap.thresholds import THRESHOLDS
from tests.gap.synthetic import applied

GAP = np.array([[3.0, 4.0], [0.0, 0.0]])


class KnownTrace:
    """A signal whose model is zero; a tool diameter of so many mm takes that share of the gap."""

    link, factor, unit = FORCE, 10.0, "N"
    measured = GAP
    residual = GAP

    def sample(self, effects):
        share = sum(effect["offset_mm"] for effect in effects)
        if share > 1.0:
            raise input_error("cell-key", "no such cutter", "")
        return share * GAP


def _taking(share):
    return applied(f"tool_diameter:offset_mm={share}")[0]


def test_the_rms_is_that_of_the_length_of_rows():
    assert rms_length([GAP]) == pytest.approx(np.sqrt(12.5))
    assert rms_length([GAP[:1], GAP[1:]]) == rms_length([GAP])
    assert rms_before([KnownTrace()]) == pytest.approx(np.sqrt(12.5))
    assert rms_left([KnownTrace()], _taking(0.5)) == pytest.approx(0.5 * np.sqrt(12.5))


def test_the_best_leaves_least_and_what_cannot_be_simulated_is_left_out():
    best, left = best_of([KnownTrace()], [_taking(0.2), _taking(2.0), _taking(0.8)])
    assert best["offset_mm"] == 0.8
    assert left == pytest.approx(0.2 * np.sqrt(12.5))
    best, left = best_of([KnownTrace()], [_taking(2.0)])
    assert (best["offset_mm"], left) == (2.0, np.inf)


@pytest.mark.parametrize("beyond", [-1e-3, 1e-3])
def test_a_slip_takes_nine_tenths_of_the_power(beyond):
    left = np.sqrt(1.0 - THRESHOLDS.compare.explained_share) * np.sqrt(12.5) * (1.0 + beyond)
    slips = slip_if_explained([KnownTrace()], _taking(0.7), left, "words")
    assert len(slips) == (beyond < 0.0)
    for slip in slips:
        assert (slip.link, slip.unit, slip.final, slip.alike) == (FORCE, "N", False, ())
        assert slip.rms_before == pytest.approx(10.0 * np.sqrt(12.5))
        assert slip.rms_after == pytest.approx(10.0 * left)
