"""The compiled core: its library, found and loaded once, and how its functions are called.

The core is C (``native/`` in the source tree), compiled when the package is built. A function is declared
once, beside the Python that calls it::

    _lines = core_function("krl_lines", FLOATS, OUT_BYTES, INT, returns=INT)

An array goes in as a view: its address, its rows and the numbers in a row. It has to be contiguous and of the
declared type; one that is written to has to be writeable. What many functions take together is a record of
arrays and numbers, in C a struct of the same fields (`StructOf`). A call releases the interpreter's lock.
"""

import ctypes
import os
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Final, get_type_hints

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gcode2krl import arrays
from gcode2krl.errors import InstallationError, Issue

_SUFFIX: Final = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
_BUILT: Final = Path(__file__).parent / "built"
_NATIVE: Final = Path(__file__).parents[2] / "native"
BUILD_VARIABLE = "GCODE2KRL_CORE"
"""In the environment: ``checked`` takes the build that checks every index, ``plain`` the plain one."""

INT, FLOAT = ctypes.c_int64, ctypes.c_double


class ArrayView(ctypes.Structure):
    """What C sees of an array."""

    _fields_ = (("at", ctypes.c_void_p), ("rows", ctypes.c_int64), ("columns", ctypes.c_int64))


class ArrayOf:
    """An argument that is an array of a type; ctypes calls `from_param` with what is passed."""

    def __init__(self, dtype: DTypeLike, *, written: bool = False) -> None:
        """Take the type of the numbers, and whether the function writes to them."""
        self.dtype = np.dtype(dtype)
        self.written = written

    def from_param(self, array: NDArray[Any]) -> ArrayView:
        """Return the view; it holds no reference, so the array has to outlive the call."""
        flags = array.flags
        if array.dtype != self.dtype or not flags.c_contiguous or (self.written and not flags.writeable):
            raise TypeError(f"the core takes a contiguous array of {self.dtype}, not {_described(array)}")
        rows = len(array)
        if flags.writeable and array.size:  # the quick way, which is open to such arrays only
            buffer: Any = array  # not known as one to the checker of types
            address = ctypes.addressof(ctypes.c_char.from_buffer(buffer))
        else:
            address = array.ctypes.data
        return ArrayView(address, rows, array.size // rows if rows else 1)


def _described(array: NDArray[Any]) -> str:
    order = "contiguous" if array.flags.c_contiguous else "not contiguous"
    return f"{array.dtype} {array.shape}, {order}, {'' if array.flags.writeable else 'not '}writeable"


FLOATS, INTS, INTS32 = ArrayOf(np.float64), ArrayOf(np.int64), ArrayOf(np.int32)
BYTES, BOOLS, FLOATS32 = ArrayOf(np.uint8), ArrayOf(np.bool_), ArrayOf(np.float32)
OUT_FLOATS, OUT_INTS, OUT_INTS32, OUT_BYTES, OUT_BOOLS, OUT_FLOATS32 = (
    ArrayOf(array.dtype, written=True) for array in (FLOATS, INTS, INTS32, BYTES, BOOLS, FLOATS32)
)


class Struct(ctypes.Structure):
    """What C sees of a record: views and numbers. Assigned by name, its arrays are checked and kept alive."""

    declared: ClassVar[dict[str, Any]] = {}

    def __init__(self, **values: Any) -> None:
        """Take the values of some fields; the others are 0."""
        super().__init__()
        for name, value in values.items():
            setattr(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        kind = self.declared[name]
        self.__dict__[f"_{name}"] = value  # what a view shows has to live as long as the view
        super().__setattr__(name, kind.from_param(value) if isinstance(kind, ArrayOf) else value)


class StructOf:
    """An argument that is a record with fields of these types; C gets a pointer to a struct of the same.

    A call makes the struct, which is passed as it is, field after field changed between calls; instead of it
    any object with these attributes may be passed. ``native/constants.py`` writes the struct into
    ``constants.h``.
    """

    def __init__(self, **fields: Any) -> None:
        """Take the type of each field: an array, INT, FLOAT or another struct."""
        self.fields = fields
        parts = [(name, _in_struct(kind)) for name, kind in fields.items()]
        self.struct = type("Struct", (Struct,), {"_fields_": parts, "declared": fields})

    @classmethod
    def record(cls, record: type, written: Iterable[str] = ()) -> "StructOf":
        """Return the struct of a named tuple, from the types of its fields; ``written`` are written to."""
        kinds = {name: _KINDS[kind] for name, kind in get_type_hints(record).items()}
        changed = {name: ArrayOf(kinds[name].dtype, written=True) for name in written}
        return cls(**kinds | changed)

    def __call__(self, **values: Any) -> Struct:
        """Return the struct with the values of some fields; the others are 0."""
        made: Struct = self.struct(**values)
        return made

    def from_param(self, record: Any) -> Any:
        """Return a pointer to the struct, or to one of a record's fields, which has to outlive the call."""
        is_struct = isinstance(record, self.struct)
        return ctypes.byref(record if is_struct else self(**{n: getattr(record, n) for n in self.fields}))


def _in_struct(kind: Any) -> Any:
    """Return the type of a field for ctypes."""
    return ArrayView if isinstance(kind, ArrayOf) else kind.struct if isinstance(kind, StructOf) else kind


_KINDS: Final[dict[Any, Any]] = {
    arrays.Floats: FLOATS,
    arrays.Ints: INTS,
    arrays.Ints32: INTS32,
    arrays.Bools: BOOLS,
    NDArray[np.float32]: FLOATS32,
    float: FLOAT,
    int: INT,
}
"""Type of a field of a record: what C gets."""


def core_function(name: str, *arguments: Any, returns: Any = None) -> Callable[..., Any]:
    """Return a function of the core, declared by the types of its arguments and of what it returns."""
    function = getattr(_library(), name)
    function.argtypes = arguments
    function.restype = returns
    return function  # type: ignore[no-any-return]


@cache
def _library() -> ctypes.CDLL:
    """Load the core that fits this processor.

    Raises
    ------
    InstallationError
        If there is none, or in a source tree one of other sources.
    """
    wanted = os.environ.get(BUILD_VARIABLE, "")
    core = _loaded("core_checked" if wanted == "checked" else "core")
    _refuse_other_sources(core)
    return _loaded("core_wide") if not wanted and core.core_is_wide() else core


def _loaded(name: str) -> ctypes.CDLL:
    path = _BUILT / f"{name}{_SUFFIX}"
    if not path.exists():
        raise _wrong_installation(f"the compiled core {path.name} is missing from {_BUILT}")
    return ctypes.CDLL(str(path))


def _refuse_other_sources(core: ctypes.CDLL) -> None:
    """In a source tree compare what the core was built from with what is there."""
    if not (_NATIVE / "core.h").exists():
        return
    if _built_from(core) != sources_digest():
        raise _wrong_installation("the compiled core is older than its sources")


def core_digest() -> str:
    """Return the digest of the sources that the core was built from."""
    return _built_from(_library())


def _built_from(core: ctypes.CDLL) -> str:
    core.core_sources.restype = ctypes.c_char_p
    return str(core.core_sources().decode())


def sources_digest() -> str:
    """Return the digest of the sources in a source tree, as `native/build.py` writes it into the core.

    A number of a Python module is compiled in: a core of another one would read a program otherwise.
    """
    import hashlib

    digest = hashlib.sha256()
    for path in _sources():
        digest.update(path.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()[:16]


def _sources() -> list[Path]:
    """Return the C files, and the modules and the table of which `native/constants.py` makes their header."""
    import re

    maker = _NATIVE / "constants.py"
    named = set(re.findall(r'"(gcode2krl(?:\.\w+)+)"', maker.read_text(encoding="utf-8")))
    modules = (_NATIVE.parent / f"{name.replace('.', '/')}.py" for name in named)
    files = (
        *_NATIVE.rglob("*.c"),
        *_NATIVE.rglob("*.h"),
        *modules,
        *_NATIVE.parent.glob("gcode2krl/gcode/*.toml"),
    )
    return sorted([maker, *(file for file in files if file.name != "constants.h")])


def _wrong_installation(message: str) -> InstallationError:
    remedy = "run python native/build.py" if (_NATIVE / "core.h").exists() else "install the package anew"
    return InstallationError(Issue("error", "core-missing", 0, message, remedy))
