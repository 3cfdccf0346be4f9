"""Input arrays of the core: one type, contiguous, and errors that name the argument."""

import numpy as np
import pytest

from gcode2krl.compiled.inputs import contiguous, locked, shaped


def test_locked_is_a_view_and_leaves_the_array_itself_open():
    array = np.zeros(3)
    view = locked(array)
    with pytest.raises(ValueError, match="read-only"):
        view[0] = 1.0
    array[0] = 2.0
    assert view[0] == 2.0


@pytest.mark.parametrize("values", [[1, 2, 3], np.arange(6)[::2], np.zeros(3, dtype=np.float32)])
def test_contiguous_is_one_type_whatever_comes_in(values):
    found = contiguous(values)
    assert found.dtype == np.float64
    assert found.flags.c_contiguous
    assert found.tolist() == np.asarray(values).tolist()


def test_contiguous_does_not_copy_what_fits():
    array = np.zeros((4, 3))
    assert np.shares_memory(contiguous(array), array)


def test_shaped_takes_any_length_where_minus_one_stands():
    assert shaped("force", np.zeros((5, 3)), -1, 3).shape == (5, 3)


@pytest.mark.parametrize(
    ("shape", "wanted", "words"),
    [
        ((5, 2), (-1, 3), r"force has shape \(5, 2\), not \(n, 3\)"),
        ((3,), (-1, 3), r"force has shape \(3,\), not \(n, 3\)"),
        ((4, 3), (5, 3), r"force has shape \(4, 3\), not \(5, 3\)"),
    ],
)
def test_a_wrong_shape_is_named(shape, wanted, words):
    with pytest.raises(ValueError, match=words):
        shaped("force", np.zeros(shape), *wanted)
