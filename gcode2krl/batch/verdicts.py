"""What became of a part, by its exit code."""

VERDICTS = ("written", "refused", "not understood")
