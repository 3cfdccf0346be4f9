"""Collisions: whether arm, spindle and tool hit what stands in the cell, along every way they go."""
