"""The one shape check of all tables."""

import numpy as np
import pytest

from gcode2krl.tables import Joints


def _joints(rows, **changes):
    columns = {
        "q_rad": np.zeros((rows, 6)),
        "qd_rad_s": np.zeros((rows, 6)),
        "limit_margin_rad": np.zeros(rows),
        "sigma_min": np.zeros(rows),
        "status": np.zeros(rows),
        "turn": np.zeros(rows),
    }
    return Joints(**{**columns, **changes})


def test_columns_are_read_only_and_have_their_type():
    joints = _joints(3)
    assert len(joints) == 3
    assert joints.status.dtype == np.int32
    with pytest.raises(ValueError, match="read-only"):
        joints.q_rad[0, 0] = 1.0


def test_the_callers_array_stays_writable():
    own = np.zeros((2, 6))
    _joints(2, q_rad=own)
    own[0, 0] = 1.0


@pytest.mark.parametrize("changes", [{"sigma_min": np.zeros(2)}, {"qd_rad_s": np.zeros((3, 5))}])
def test_a_wrong_shape_is_named(changes):
    with pytest.raises(ValueError, match=r"Joints\.(sigma_min|qd_rad_s): shape"):
        _joints(3, **changes)
