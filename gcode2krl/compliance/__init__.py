"""Joints and Forces to Deflection: the elastic chain of Haehn & Weigold 2020, and its identification."""
