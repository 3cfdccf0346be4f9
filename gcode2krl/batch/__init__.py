"""Many parts: processes or a cluster that translate them, and a cache in which nothing is computed twice."""

VERDICTS = ("written", "refused", "not understood")
"""What became of a part, by its exit code."""
