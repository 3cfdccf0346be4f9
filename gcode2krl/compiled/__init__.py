"""What the compiled kernels and the long columns share: the cache of kernels, chunks, threads."""
