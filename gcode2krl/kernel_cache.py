"""Compiled kernels on disk must never be older than the code they were made from.

numba notices a change of the file a kernel stands in, but not of a file whose functions it calls. After an
edit or a pull in a checkout an old kernel would go on moving the robot; so what is older than the newest
source of its folder is thrown away and compiled again.
"""

import contextlib
from pathlib import Path


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
