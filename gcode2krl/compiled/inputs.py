"""Arrays for the compiled core, contiguous and of the wanted shape, and views that cannot be written to."""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gcode2krl.arrays import Floats

Array = TypeVar("Array", bound=NDArray[Any])


def locked(array: Array) -> Array:
    """Return a view that cannot be written to."""
    view = array.view()
    view.flags.writeable = False
    return view


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """Return the different values (k,) of a column (n,), in order; quick where all are the same.

    Numbers without NaN. Unlike numpy's it does not load `numpy.ma`, which takes longer than most columns.
    """
    if not len(values) or (values == values[0]).all():
        return values[:1]
    ordered = np.sort(values)
    result: NDArray[Any] = ordered[np.append(True, ordered[1:] != ordered[:-1])]
    return result


def contiguous(values: ArrayLike) -> Floats:
    """Return the values contiguous; a copy only where they are not floats in this order."""
    return np.ascontiguousarray(values, dtype=np.float64)


def shaped(name: str, values: ArrayLike, *shape: int) -> Floats:
    """Return the values of an argument contiguous, in the wanted shape; a copy only where they are not.

    Parameters
    ----------
    name : str
        The argument's name, for the error.
    values : array_like
        The numbers.
    *shape : int
        The wanted shape, -1 for any length.

    Raises
    ------
    ValueError
        If the shape is another one.
    """
    array = contiguous(values)
    if array.ndim == len(shape):
        for size, length in zip(array.shape, shape, strict=True):
            if size != length and length != -1:
                break
        else:
            return array
    wanted = ", ".join("n" if length == -1 else str(length) for length in shape)
    raise ValueError(f"{name} has shape {array.shape}, not ({wanted})")
