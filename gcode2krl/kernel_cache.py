"""Compiled kernels: quickly loaded, and never older than the code they were made from.

numba notices a change of the file a kernel stands in, but not of a file whose functions it calls. After an
edit or a pull in a checkout an old kernel would go on moving the robot; so what is older than the newest
source of its folder is thrown away and compiled again.
"""

import contextlib
import gc
import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

_LINEAR_ALGEBRA = "scipy.linalg.cython_blas"
_ARRAY_FUNCTIONS = "numba.np.arraymath"


def drop_stale(folder: Path) -> int:
    """Delete the compiled kernels of a folder that are older than one of its sources; return how many."""
    kernels = [*(folder / "__pycache__").glob("*.nb[ic]")]
    if not kernels:
        return 0
    newest = max(source.stat().st_mtime for source in folder.glob("*.py"))
    stale = [kernel for kernel in kernels if kernel.stat().st_mtime < newest]
    for kernel in stale:
        with contextlib.suppress(OSError):  # another process may have been quicker
            kernel.unlink()
    return len(stale)


def load_numba() -> None:
    """Import what numba needs for its first kernel, but not SciPy's linear algebra, which takes 0.2 s.

    numba's array functions import that only to know whether it is there, for the sake of ``np.correlate``
    and ``np.convolve``, which then are plain loops. A kernel with ``np.dot`` or ``np.linalg`` asks again when
    it is compiled, and finds it.
    """
    if _ARRAY_FUNCTIONS in sys.modules or _LINEAR_ALGEBRA in sys.modules:
        return
    with _without_garbage_collection():
        sys.modules[_LINEAR_ALGEBRA] = None  # type: ignore[assignment]
        try:
            importlib.import_module(_ARRAY_FUNCTIONS)
        finally:
            del sys.modules[_LINEAR_ALGEBRA]


@contextlib.contextmanager
def _without_garbage_collection() -> Iterator[None]:
    """Thousands of functions and no garbage: collecting while they are imported finds nothing, slowly."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
