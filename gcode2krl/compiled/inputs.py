"""Arrays for compiled code: contiguous floats of the wanted shape, and read-only for what numba compiles.

numba compiles a kernel anew for another element type, another order in memory, and for an array that may be
written to. So every input of such a kernel is read-only, whatever table it came from. The core in C takes any
contiguous array, and more quickly one that may be written to.
"""

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


def contiguous(values: ArrayLike) -> Floats:
    """Return the values contiguous and read-only; a copy only where they are not floats in this order."""
    return locked(np.ascontiguousarray(values, dtype=np.float64))


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
    array: Floats = np.ascontiguousarray(values, dtype=np.float64)
    if array.ndim == len(shape):
        for found, length in zip(array.shape, shape, strict=True):
            if found != length and length != -1:
                break
        else:
            return array
    wanted = ", ".join("n" if length == -1 else str(length) for length in shape)
    raise ValueError(f"{name} has shape {array.shape}, not ({wanted})")


def read_only(name: str, values: ArrayLike, *shape: int) -> Floats:
    """Return the values of an argument contiguous and read-only, in the wanted shape.

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
    return locked(shaped(name, values, *shape))
