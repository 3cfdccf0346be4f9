"""The search for a clock over all offsets at once: against the share at each of them."""

import numpy as np
import pytest

from gcode2krl.runs.matching import _shares, explained

GENERATOR = np.random.default_rng(1)
REFERENCE = np.cumsum(GENERATOR.standard_normal((200, 3)), axis=0)
MEASURED = np.cumsum(GENERATOR.standard_normal((260, 2)), axis=0)


@pytest.mark.parametrize("every", [1, 3])
def test_shares_are_those_of_the_chosen_rows(every):
    inside = (np.arange(260) >= 30) & (np.arange(260) < 240)
    found = _shares(REFERENCE, MEASURED, inside, every, least=175)
    for step, share in enumerate(found):
        both = np.flatnonzero(inside[step : step + 200])
        if len(both) < 175:
            assert share == -1.0
            continue
        chosen = both[::every]
        assert share == pytest.approx(explained(REFERENCE[chosen], MEASURED[step + chosen]), abs=1e-9)
    assert np.any(found == -1.0)
    assert np.any(found > 0.0)


def test_what_stands_still_is_explained_by_nothing():
    still = np.zeros((260, 2))
    still[:100] = 0.3
    found = _shares(REFERENCE[:50], still, np.ones(260, dtype=bool), 1, least=10)
    assert found[0] == 0.0
    assert found[80] > 0.0
