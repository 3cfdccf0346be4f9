"""Compiled kernels: quickly loaded, and never older than the code they were made from.

numba notices a change of the file a kernel stands in, but not of a file whose functions it calls or whose
numbers it uses. After an edit or a pull in a checkout, or another version installed over the old one, an old
kernel would still be used. So a package whose kernels use other files names these; a digest of them is kept
beside its kernels, and where it differs the kernels are deleted and compiled again.
"""

import contextlib
import gc
import importlib
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

_LINEAR_ALGEBRA = "scipy.linalg.cython_blas"
_ARRAY_FUNCTIONS = "numba.np.arraymath"
_DIGEST = "kernels.sha256"


def drop_stale(folder: Path, *used: str) -> int:
    """Delete the compiled kernels of a folder if one of the files they use has changed; return how many.

    ``used`` are the files, relative to the folder, that kernels in other files of the folder use.
    """
    import hashlib

    load_numba()
    digest = hashlib.sha256(b"\0".join((folder / name).read_bytes() for name in used)).hexdigest()
    for cache in cache_folders(folder):
        with contextlib.suppress(OSError):  # not writable: numba takes the next folder, too
            return _renew(cache, digest)
    return 0


def cache_folders(folder: Path) -> Sequence[Path]:
    """Return where numba may keep a folder's kernels; it takes the first that it can write to.

    That is the folder named by NUMBA_CACHE_DIR, ``__pycache__``, or the user's cache where the package is
    installed for all users.
    """
    config, caching, appdirs = (
        importlib.import_module(f"numba.{name}") for name in ("core.config", "core.caching", "misc.appdirs")
    )
    below = caching._CacheLocator.get_suitable_cache_subpath(str(folder / "any.py"))
    named = [Path(config.CACHE_DIR) / below] if config.CACHE_DIR else []
    of_user = Path(appdirs.AppDirs(appname="numba", appauthor=False).user_cache_dir) / below
    return [*named, folder / "__pycache__", of_user]


def _renew(cache: Path, digest: str) -> int:
    """Delete the kernels in a cache that were made from other sources; raise OSError if it is read-only."""
    cache.mkdir(parents=True, exist_ok=True)
    if not os.access(cache, os.W_OK):
        raise PermissionError(cache)
    record = cache / _DIGEST
    if record.exists() and record.read_text(encoding="ascii") == digest:
        return 0
    kernels = list(cache.glob("*.nb[ic]"))
    for kernel in kernels:
        kernel.unlink(missing_ok=True)  # another process may have deleted it already
    fresh = cache / f"{_DIGEST}.{os.getpid()}"
    fresh.write_text(digest, encoding="ascii")
    fresh.replace(record)  # written last: after an interruption the next process starts again
    return len(kernels)


def load_numba() -> None:
    """Import what numba needs for its first kernel, but not SciPy's linear algebra, which takes 0.2 s.

    numba's array functions import that only to know whether it is there, for the sake of ``np.correlate``
    and ``np.convolve``, which then are plain loops. A kernel with ``np.dot`` or ``np.linalg`` looks for it
    again when it is compiled, and finds it.
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
    """Switch garbage collection off: importing thousands of functions leaves nothing to collect."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
