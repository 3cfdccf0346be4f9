"""Qualities made of one number a pose."""

import numpy as np

from gcode2krl.pose.quality import Judge, Quality


def quality_of_margin(margin):
    """Return poses of a margin that hit nothing; below 0 they are out of reach."""
    return Quality(margin >= 0.0, np.zeros(margin.shape, dtype=bool), np.maximum(margin, 0.0))


def judge_by(margin, bending=None):
    """Return a judge by functions of rows and choices."""
    return Judge(lambda rows, choice: quality_of_margin(margin(rows, choice)), bending)
