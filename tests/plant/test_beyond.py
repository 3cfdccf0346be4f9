"""What normal mismatch could do of a change goes, and no more than its bounds let it."""

import numpy as np
import pytest

from tests.plant import kinds
from tests.plant.beyond import left_by_mismatch
from tests.plant.instruments import Instruments

HOW = Instruments(tracker_mm=0.01, force_N=1.0)
TIME_s = np.linspace(0.0, 10.0, 500)
PLACE_mm = np.stack([1500.0 + 50.0 * TIME_s, 100.0 * np.sin(TIME_s), 800.0 + 0.0 * TIME_s], axis=1)
TABLES = {"tracker": {"t_s": TIME_s, **{f"{a}_mm": PLACE_mm[:, i] for i, a in enumerate("xyz")}}}


def left(change_mm):
    return left_by_mismatch([{"tcp": (TIME_s, change_mm)}], [TABLES], "tcp", HOW)


def test_a_shift_within_its_bound_goes():
    assert left(np.tile([0.03, 0.0, -0.03], (500, 1))) == pytest.approx(0.0, abs=1e-6)


def test_of_a_larger_shift_the_bound_goes():
    """0.3 mm less 0.04 mm and what a turn of 0.03 mrad at 1.5-2 m adds."""
    change = np.tile([0.0, 0.3, 0.0], (500, 1))
    assert 0.15 / 3**0.5 / 0.01 < left(change) < 0.26 / 3**0.5 / 0.01


def test_a_late_tracker_goes_up_to_its_clock():
    velocity = np.gradient(PLACE_mm, TIME_s, axis=0)
    assert left(0.0015 * velocity) == pytest.approx(0.0, abs=0.02)
    assert left(0.01 * velocity) > 10.0


def test_what_mismatch_has_no_form_for_stays():
    change = np.zeros((500, 3))
    change[:, 2] = 0.2 * np.sin(20.0 * TIME_s)
    assert left(change) == pytest.approx(0.2 / 6**0.5 / 0.01, rel=0.05)


def test_without_a_law_there_is_no_figure():
    assert left_by_mismatch([{}], [{}], "scan", HOW) is None


@pytest.mark.parametrize(("effect", "share"), [("backlash@A2", 0.5), ("force_scale@tangential", 0.2)])
def test_a_label_states_it_and_it_is_less_than_the_ratio(tmp_path, effect, share):
    entry = kinds.draw_case("single", 8, tmp_path / "case", effect, "same")["effects"][0]
    assert share * entry["ratio"] < entry["left_by_mismatch"] < entry["ratio"]
