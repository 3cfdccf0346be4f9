"""How the kernels of the material removal are compiled."""

from typing import Any

from numba import njit

_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}

kernel: Any = njit(**_OPTIONS)
"""For functions that only use arrays passed to them: compiled without numba's reference counts, which would
cost more than these short functions themselves. They cannot make arrays."""

inlined: Any = njit(**_OPTIONS, inline="always")
"""The same for functions with one caller: compiled as a part of it, once."""
