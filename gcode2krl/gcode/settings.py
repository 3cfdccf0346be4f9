"""Everything of a block before its motion, in the order of RS274/NGC. Compiled."""

import math

import numpy as np
from numba import njit

from gcode2krl import ascii_codes as ch
from gcode2krl.gcode import findings as f
from gcode2krl.gcode import vocabulary as v
from gcode2krl.gcode.reporting import event, note, report, report_unless
from gcode2krl.gcode.state import (
    DOUBT_CENTRE,
    DOUBT_DISTANCE,
    DOUBT_FEED,
    DOUBT_FEED_MODE,
    DOUBT_PLANE,
    DOUBT_SPEED,
    DOUBT_TOOL,
    DOUBT_UNIT,
    DOUBT_Z,
    EVENT_COOLANT,
    EVENT_M,
    EVENT_SPINDLE,
    EVENT_TOOL,
    IMPLIED_M5,
    NOTE_OVERRIDE,
)
from gcode2krl.units import MM_PER_INCH

_LARGEST_WHOLE = 99999
_WHOLE_SLACK = 1e-6


@njit(cache=True)
def whole(value):
    """Return a whole number 0…99999, or -1."""
    nearest = round(value)
    if abs(value - nearest) > _WHOLE_SLACK or nearest < 0 or nearest > _LARGEST_WHOLE:
        return -1
    return int(nearest)


@njit(cache=True)
def apply_settings(
    line, s, rows, counts, events, found, offset_known, tool_length, from_table, has, word, g, m_codes, used
):
    """Take over all modes and values of a block; ``used`` notes which words have been used."""
    if has[v.WORD_F] or has[v.WORD_S] or g[v.FEED_MODE] >= 0:  # so many arrays cost as much as a plain block
        _feed_and_speed(line, s, rows, counts, events, found, has, word, g, used)
    if has[v.WORD_T] or m_codes[0] >= 0:
        _tool_and_switches(
            line, s, rows, counts, events, found, tool_length, from_table, has, word, m_codes, used
        )
    _plane_and_unit(s, g)
    if g[v.LENGTH_OFFSET] == v.G43:
        _apply_length(line, s, counts, found, tool_length, has, word, used)
    elif g[v.LENGTH_OFFSET] == v.G49 and not (from_table and s.tool > 0):
        _set_length_offset(s, np.nan)
        s.offset_tool = -1
    if g[v.WORK_OFFSET] >= 0:
        _select_offset(line, s, counts, found, offset_known, g[v.WORK_OFFSET])
    if g[v.PATH_CONTROL] >= 0:
        _path_control(line, s, counts, found, has, word, g[v.PATH_CONTROL], used)
    _distance_modes(line, s, g)


@njit(cache=True)
def _plane_and_unit(s, g):
    if g[v.PLANE] >= 0:
        s.plane = g[v.PLANE] // v.TENFOLD
        s.doubt &= ~DOUBT_PLANE
    if g[v.UNIT] >= 0:
        s.unit_mm = MM_PER_INCH if g[v.UNIT] == v.G20 else 1.0
        s.unit_named = 1
        s.doubt &= ~DOUBT_UNIT


@njit(cache=True)
def _select_offset(line, s, counts, found, offset_known, code):
    """G54 to G59.3 are offsets 0 to 8; a G54 that the cell does not state is zero, which is no finding."""
    s.work_offset = (code - v.G54) // v.TENFOLD if code <= v.G59 else code - v.G59 + 5
    if not offset_known[s.work_offset] and s.work_offset > 0:
        report(found, counts, f.OFFSET_UNKNOWN, line, code, 0.0)


@njit(cache=True)
def _distance_modes(line, s, g):
    if g[v.DISTANCE] >= 0:
        s.absolute = 1 if g[v.DISTANCE] == v.G90 else 0
        s.distance_line = line
        s.doubt &= ~DOUBT_DISTANCE
    if g[v.CENTRE] >= 0:
        s.arc_absolute = 1 if g[v.CENTRE] == v.G90_1 else 0
        s.doubt &= ~DOUBT_CENTRE


@njit(cache=True)
def _feed_and_speed(line, s, rows, counts, events, found, has, word, g, used):
    if g[v.FEED_MODE] >= 0:
        s.feed_mode = g[v.FEED_MODE] // v.TENFOLD
        s.feed = 0.0  # as LinuxCNC: naming a feed mode drops the feed, even the same mode
        s.feed_mode_line = line
        s.doubt &= ~(DOUBT_FEED_MODE | DOUBT_FEED)
    if has[v.WORD_F]:
        used[v.WORD_F] = True
        if word[v.WORD_F] < 0.0:
            report(found, counts, f.NEGATIVE_FEED, line, word[v.WORD_F], 0.0)
            s.doubt |= DOUBT_FEED
        else:
            s.feed = word[v.WORD_F] if s.feed_mode == v.INVERSE_TIME else word[v.WORD_F] * s.unit_mm
            s.doubt &= ~DOUBT_FEED
    if has[v.WORD_S]:
        used[v.WORD_S] = True
        if word[v.WORD_S] < 0.0:
            report(found, counts, f.NEGATIVE_SPEED, line, word[v.WORD_S], 0.0)
            s.doubt |= DOUBT_SPEED
            return
        changed = s.rpm != word[v.WORD_S]
        s.rpm = word[v.WORD_S]
        s.doubt &= ~DOUBT_SPEED
        if changed and s.direction != 0:
            m = v.M4 if s.direction < 0 else v.M3
            event(s, rows, events, counts, EVENT_SPINDLE, line, s.rpm * s.direction, m)


@njit(cache=True)
def _tool_and_switches(
    line, s, rows, counts, events, found, tool_length, from_table, has, word, m_codes, used
):
    """T, tool change, spindle, coolant and all M-codes that do not stop the program."""
    if has[v.WORD_T]:
        used[v.WORD_T] = True
        tool = whole(word[v.WORD_T])
        if tool < 0:
            report(found, counts, f.BAD_INTEGER, line, v.WORD_T + ch.LETTER_A, 0.0)
            s.doubt |= DOUBT_TOOL
        else:
            s.selected_tool = tool
            s.doubt &= ~DOUBT_TOOL
    for m in m_codes:
        if m == v.M6:
            if s.selected_tool < 0:
                report_unless(s, DOUBT_TOOL, found, counts, f.TOOL_NOT_SELECTED, line, 0.0, 0.0)
            else:
                _change_tool(line, s, rows, counts, events, found, tool_length, from_table)
    for m in m_codes:
        if m >= 0 and m != v.M6 and not stops(m):
            _switch(line, s, rows, counts, events, has, word, m, used)


@njit(cache=True)
def _switch(line, s, rows, counts, events, has, word, m, used):
    """One M-code for spindle, coolant or overrides, or one that the cell maps to KRL."""
    if m >= v.M3 and m <= v.M5:
        s.direction = 1 if m == v.M3 else (-1 if m == v.M4 else 0)
        event(s, rows, events, counts, EVENT_SPINDLE, line, s.rpm * s.direction, m)
    elif m >= v.M7 and m <= v.M9:
        if m == v.M9:
            s.mist, s.flood = 0, 0
        elif m == v.M7:
            s.mist = 1
        else:
            s.flood = 1
        event(s, rows, events, counts, EVENT_COOLANT, line, m, s.mist + 2 * s.flood)
    elif m >= v.M48 and m <= v.M53:
        used[v.WORD_P] |= has[v.WORD_P]
        note(s, NOTE_OVERRIDE, line, m)
    else:
        p = word[v.WORD_P] if has[v.WORD_P] else np.nan
        used[v.WORD_P] |= has[v.WORD_P]
        used[v.WORD_Q] |= has[v.WORD_Q]
        event(s, rows, events, counts, EVENT_M, line, m, p)


@njit(cache=True)
def stops(m):
    """Tell whether an M-code stops or ends the program."""
    return m == v.M0 or m == v.M1 or m == v.M2 or m == v.M30 or m == v.M60


@njit(cache=True)
def _length_of(tool, tool_length):
    return tool_length[tool] if tool >= 0 and tool < len(tool_length) else np.nan


@njit(cache=True)
def _change_tool(line, s, rows, counts, events, found, tool_length, from_table):
    if s.direction != 0:  # a tool change stops the spindle, with or without M5
        s.direction = 0
        event(s, rows, events, counts, EVENT_SPINDLE, line, 0.0, IMPLIED_M5)
    s.tool = s.selected_tool
    event(s, rows, events, counts, EVENT_TOOL, line, s.tool, 0.0)
    length = _length_of(s.tool, tool_length)
    if s.tool > 0 and math.isnan(length):
        report(found, counts, f.TOOL_UNDECLARED, line, s.tool, 0.0)
        length = 0.0
    if from_table:  # as if G43 stood here
        _set_length_offset(s, length if s.tool > 0 else np.nan)
        s.offset_tool = s.tool if s.tool > 0 else -1


@njit(cache=True)
def _apply_length(line, s, counts, found, tool_length, has, word, used):
    """G43, with H or for the tool in the spindle."""
    tool = s.tool
    if has[v.WORD_H]:
        used[v.WORD_H] = True
        tool = whole(word[v.WORD_H])
        if tool < 0:
            report(found, counts, f.BAD_INTEGER, line, v.WORD_H + ch.LETTER_A, 0.0)
            s.doubt |= DOUBT_Z
            return
        if tool != s.tool and tool != 0:
            report(found, counts, f.H_DIFFERS, line, tool, s.tool)
        if tool == 0:
            tool = s.tool
    length = _length_of(tool, tool_length)
    if math.isnan(length):
        if tool > 0 and tool != s.tool:
            report(found, counts, f.TOOL_UNDECLARED, line, tool, 0.0)
        length = 0.0
    _set_length_offset(s, length)
    s.offset_tool = tool


@njit(cache=True)
def _set_length_offset(s, length):
    """G43/G49: the machine stands still, so the tip's coordinate moves by the difference."""
    old = 0.0 if math.isnan(s.length_offset) else s.length_offset
    new = 0.0 if math.isnan(length) else length
    if new != old:
        s.z -= new - old
        s.known_z = 0
    s.length_offset = length


@njit(cache=True)
def _path_control(line, s, counts, found, has, word, code, used):
    """G61, G61.1, and G64 with its tolerance P."""
    s.exact_stop = 1 if code != v.G64 else 0
    s.tolerance = np.nan
    if code != v.G64:
        return
    used[v.WORD_Q] |= has[v.WORD_Q]
    if has[v.WORD_P]:
        used[v.WORD_P] = True
        if word[v.WORD_P] < 0.0:
            report(found, counts, f.NEGATIVE_TOLERANCE, line, word[v.WORD_P], 0.0)
        else:
            s.tolerance = word[v.WORD_P] * s.unit_mm
