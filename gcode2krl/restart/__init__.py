"""A program that begins at a later G-code line: where it may begin, and the material as cut so far."""
