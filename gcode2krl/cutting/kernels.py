"""How the kernels of the material removal are compiled."""

from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
"""For functions that only use arrays they are given: without numba's reference counts, which would cost more
than these short functions do. They cannot make arrays."""
