"""Long columns in temporary files instead of memory, wherever in the package they are made.

numpy asks the core for the memory of its arrays (NEP 49); a long one is given pages of a file without a name,
which vanishes with the array, whatever ends the process. The system takes such pages where it needs memory;
on Linux they are given back before they add up, so that a program of ten million lines costs little more than
one of a million. On Windows, and where the disk is full, the columns stay in memory.
"""

import contextlib
import ctypes
import mmap
import tempfile
import threading
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar
from weakref import WeakSet

import numpy as np
from numpy.typing import NDArray

from gcode2krl.compiled.core import INT, core_function

LONG_BYTES = 8 << 20
"""A column of a million numbers: shorter ones cost less in memory than they would in a file."""
MOST_RESIDENT_BYTES = 224 << 20
"""Pages of files beyond this are given back; it holds the field and what a stage works on."""
_LOOKS_EVERY_S = 0.02
_REGIONS = 16
_NOTED: "WeakSet[mmap.mmap]" = WeakSet()
_SET_HANDLER = 304
"""Place of PyDataMem_SetHandler in numpy's table of functions, part of its binary interface."""
_HANDLER_NAME = b"mem_handler"
Result = TypeVar("Result")

_handler = core_function("long_columns_handler", ctypes.c_char_p, INT, returns=ctypes.c_void_p)
_let_go = core_function("long_columns_let_go")
_count = core_function("long_columns_count", returns=INT)


@contextlib.contextmanager
def long_columns_on_disk(least_bytes: int | None = None) -> Iterator[bool]:
    """Let long columns that this thread makes lie in files; yields whether they do."""
    at = _handler(tempfile.gettempdir().encode(), LONG_BYTES if least_bytes is None else least_bytes)
    if not at or _set_handler() is None:
        yield False
        return
    done = threading.Event()
    watch = threading.Thread(target=_give_back_pages, args=(done,), daemon=True)
    before = _set_handler()(_capsule(at))
    watch.start()
    try:
        yield True
    finally:
        _set_handler()(before)
        done.set()
        watch.join()


def by_regions(rows: NDArray[Any], work: Callable[[NDArray[Any]], Result]) -> list[Result]:
    """Return ``work(part)`` of parts of rising rows of long columns that are far apart.

    The system may map a file in pieces of megabytes: a look at 2000 rows then makes all between resident,
    which the next look of `_give_back_pages` comes too late for. So the pages go after each part.
    """
    if not columns_on_disk():
        return [work(rows)]
    made = []
    for part in np.array_split(rows, min(_REGIONS, max(len(rows), 1))):
        made.append(work(part))
        _let_go()
    return made


def columns_on_disk() -> int:
    """Return how many columns lie in files now."""
    return int(_count())


def note_mapped(mapped: mmap.mmap) -> None:
    """Let the pages of a file that is mapped be given back like those of columns."""
    _NOTED.add(mapped)


def _give_back_pages(done: threading.Event) -> None:
    """Look at the resident pages of files until all is done, and let go of them where they are many."""
    resident = Path("/proc/self/statm")
    if not resident.exists():
        return  # there the system does it
    while not done.wait(_LOOKS_EVERY_S):
        if int(resident.read_text().split()[2]) * mmap.PAGESIZE > MOST_RESIDENT_BYTES:
            _let_go()
            for mapped in list(_NOTED):
                mapped.madvise(mmap.MADV_DONTNEED)


@cache
def _set_handler() -> Any:
    """Return numpy's function that exchanges the handler of this thread, None where it is not found."""
    core = getattr(np, "_core", None) or np.core
    table_of = ctypes.pythonapi.PyCapsule_GetPointer
    table_of.restype, table_of.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
    try:
        functions = table_of(core._multiarray_umath._ARRAY_API, None)
    except (AttributeError, ValueError):
        return None
    table = ctypes.cast(functions, ctypes.POINTER(ctypes.c_void_p))
    return ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object)(table[_SET_HANDLER])


@cache
def _capsule(handler: int) -> Any:
    """Return the handler as numpy takes it."""
    made = ctypes.pythonapi.PyCapsule_New
    made.restype = ctypes.py_object
    made.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    return made(handler, _HANDLER_NAME, None)
