"""What stages share that work on long columns: the compiled core, its inputs, chunks, threads."""

MATRIX_VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""In the environment: how many threads libraries for matrices use, which they read as they are loaded."""
