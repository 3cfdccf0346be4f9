"""Rows of straight moves, and where the axis words of a block lead. Compiled."""

import math

import numpy as np
from numba import njit

from gcode2krl.gcode.state import DOUBT_DISTANCE, DOUBT_UNIT, DOUBT_X, DOUBT_Y, DOUBT_Z
from gcode2krl.gcode.vocabulary import WORD_X, WORD_Y, WORD_Z
from gcode2krl.units import S_PER_MIN

ROW = np.dtype(
    [
        ("x", "f8"),
        ("y", "f8"),
        ("z", "f8"),
        ("feed", "f8"),
        ("spindle", "f8"),
        ("tolerance", "f8"),
        ("dwell", "f8"),
        ("length_offset", "f8"),
        ("offset_tool", "i4"),
        ("tool", "i4"),
        ("line", "i4"),
        ("arc", "i4"),
        ("rapid", "i1"),
        ("exact_stop", "i1"),
        ("machine", "i1"),
        ("known_x", "i1"),
        ("known_y", "i1"),
        ("known_z", "i1"),
    ]
)


@njit(cache=True)
def emit(s, rows, count, line, feed, rapid, machine, arc):
    """Write row number ``count``: it ends at the state's position."""
    row = rows[count]
    row.x, row.y, row.z = s.x, s.y, s.z
    row.feed = feed
    row.spindle = s.rpm * s.direction * 2.0 * math.pi / S_PER_MIN
    row.tolerance = s.tolerance
    row.dwell = 0.0
    row.length_offset = s.length_offset
    row.offset_tool = s.offset_tool
    row.tool = s.tool
    row.line = line
    row.arc = arc
    row.rapid = rapid
    row.exact_stop = s.exact_stop
    row.machine = machine
    row.known_x, row.known_y, row.known_z = s.known_x, s.known_y, s.known_z


@njit(cache=True)
def target(s, offsets, has, word):
    """Return the tip position the axis words ask for; axes not named stay."""
    x, y, z = s.x, s.y, s.z
    base_x, base_y, base_z = offsets[s.work_offset]
    if has[WORD_X]:
        x = word[WORD_X] * s.unit_mm + (base_x if s.absolute else x)
    if has[WORD_Y]:
        y = word[WORD_Y] * s.unit_mm + (base_y if s.absolute else y)
    if has[WORD_Z]:
        z = word[WORD_Z] * s.unit_mm + (base_z if s.absolute else z)
    return x, y, z


@njit(cache=True)
def learn(s, has):
    """Note which axes have been programmed: in absolute mode always, else if they were known before."""
    if s.absolute:
        s.known_x |= has[WORD_X]
        s.known_y |= has[WORD_Y]
        s.known_z |= has[WORD_Z]
    if s.doubt == 0:
        return
    named = has[WORD_X] * DOUBT_X + has[WORD_Y] * DOUBT_Y + has[WORD_Z] * DOUBT_Z
    if s.doubt & (DOUBT_UNIT | DOUBT_DISTANCE):
        s.doubt |= named
    elif s.absolute:
        s.doubt &= ~named


@njit(cache=True)
def follow(s, offsets, has, word):
    """Go where the axis words lead, without a row: after an error the next block starts there."""
    s.x, s.y, s.z = target(s, offsets, has, word)
    learn(s, has)
