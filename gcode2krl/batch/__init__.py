"""Many parts: processes or a cluster that translate them, and a cache in which nothing is computed twice."""
