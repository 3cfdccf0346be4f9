"""Memory that arrays leave behind goes back to the system."""

import ctypes
import sys
from functools import cache
from typing import Any


@cache
def _trim() -> Any:
    """Return the function of the C library that does it, None where free memory goes back by itself."""
    if not sys.platform.startswith("linux"):
        return None
    return getattr(ctypes.CDLL(None), "malloc_trim", None)


def give_back() -> None:
    """Give memory that is free back to the system; glibc keeps it between arrays that are still in use."""
    trim = _trim()
    if trim is not None:
        trim(ctypes.c_size_t(0))
