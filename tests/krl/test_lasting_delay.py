"""Cuts of long motions cost time only where the motions after them are later too."""

import numpy as np

from gcode2krl.krl.announce import lasting


def test_one_end_at_a_standstill_is_no_time_lost():
    assert lasting(np.array([0.0, 0.0, -0.168, 0.0, 0.0])).max() == 0.0


def test_a_delay_that_stays_is_found_where_it_begins():
    assert np.flatnonzero(lasting(np.array([0.0, 0.0, 0.02, 0.02, 0.02])) > 0.006)[0] == 2
    assert lasting(np.array([0.0, 0.02])).max() == 0.02, "the last one counts"
