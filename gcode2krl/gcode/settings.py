"""Everything of a block before its motion, in the order of RS274/NGC. Compiled."""

import math

import numpy as np
from numba import njit

from gcode2krl.gcode import findings as f
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

_F, _H, _P, _Q, _S, _T = (ord(c) - 65 for c in "FHPQST")


@njit(cache=True)
def whole(value):
    """Return a whole number 0…99999, or -1."""
    nearest = round(value)
    if abs(value - nearest) > 1e-6 or nearest < 0 or nearest > 99999:
        return -1
    return int(nearest)


@njit(cache=True)
def apply_settings(
    line, s, rows, counts, events, found, offset_known, tool_length, from_table, has, word, g, m_codes, used
):
    """Take over all modes and values of a block; ``used`` notes which words have been used."""
    if has[_F] or has[_S] or g[5] >= 0:  # a call with so many arrays costs as much as a plain block
        _feed_and_speed(line, s, rows, counts, events, found, has, word, g, used)
    if has[_T] or m_codes[0] >= 0:
        _tool_and_switches(
            line, s, rows, counts, events, found, tool_length, from_table, has, word, m_codes, used
        )
    if g[2] >= 0:
        s.plane = g[2] // 10
        s.doubt &= ~DOUBT_PLANE
    if g[6] >= 0:
        s.unit_mm = 25.4 if g[6] == 200 else 1.0
        s.unit_named = 1
        s.doubt &= ~DOUBT_UNIT
    if g[8] == 430:
        _apply_length(line, s, counts, found, tool_length, has, word, used)
    elif g[8] == 490 and not (from_table and s.tool > 0):
        _set_length_offset(s, np.nan)
        s.offset_tool = -1
    if g[10] >= 0:
        code = g[10]
        s.work_offset = (code - 540) // 10 if code <= 590 else code - 585
        if not offset_known[s.work_offset] and s.work_offset > 0:
            report(found, counts, f.OFFSET_UNKNOWN, line, code, 0.0)
    if g[11] >= 0:
        _path_control(line, s, counts, found, has, word, g[11], used)
    if g[3] >= 0:
        s.absolute = 1 if g[3] == 900 else 0
        s.distance_line = line
        s.doubt &= ~DOUBT_DISTANCE
    if g[4] >= 0:
        s.arc_absolute = 1 if g[4] == 901 else 0
        s.doubt &= ~DOUBT_CENTRE


@njit(cache=True)
def _feed_and_speed(line, s, rows, counts, events, found, has, word, g, used):
    if g[5] >= 0:
        s.feed_mode = g[5] // 10
        s.feed = 0.0  # as LinuxCNC: naming a feed mode drops the feed, even the same mode
        s.feed_mode_line = line
        s.doubt &= ~(DOUBT_FEED_MODE | DOUBT_FEED)
    if has[_F]:
        used[_F] = True
        if word[_F] < 0.0:
            report(found, counts, f.NEGATIVE_FEED, line, word[_F], 0.0)
            s.doubt |= DOUBT_FEED
        else:
            s.feed = word[_F] if s.feed_mode == 93 else word[_F] * s.unit_mm
            s.doubt &= ~DOUBT_FEED
    if has[_S]:
        used[_S] = True
        if word[_S] < 0.0:
            report(found, counts, f.NEGATIVE_SPEED, line, word[_S], 0.0)
            s.doubt |= DOUBT_SPEED
            return
        changed = s.rpm != word[_S]
        s.rpm = word[_S]
        s.doubt &= ~DOUBT_SPEED
        if changed and s.direction != 0:
            m = 4 if s.direction < 0 else 3
            event(s, rows, events, counts, EVENT_SPINDLE, line, s.rpm * s.direction, m)


@njit(cache=True)
def _tool_and_switches(
    line, s, rows, counts, events, found, tool_length, from_table, has, word, m_codes, used
):
    """T, tool change, spindle, coolant and all M-codes that do not stop the program."""
    if has[_T]:
        used[_T] = True
        tool = whole(word[_T])
        if tool < 0:
            report(found, counts, f.BAD_INTEGER, line, _T + 65, 0.0)
            s.doubt |= DOUBT_TOOL
        else:
            s.selected_tool = tool
            s.doubt &= ~DOUBT_TOOL
    for m in m_codes:
        if m == 6:
            if s.selected_tool < 0:
                report_unless(s, DOUBT_TOOL, found, counts, f.TOOL_NOT_SELECTED, line, 0.0, 0.0)
            else:
                _change_tool(line, s, rows, counts, events, found, tool_length, from_table)
    for m in m_codes:
        if m >= 3 and m <= 5:
            direction = 1 if m == 3 else (-1 if m == 4 else 0)
            s.direction = direction
            event(s, rows, events, counts, EVENT_SPINDLE, line, s.rpm * direction, m)
        elif m >= 7 and m <= 9:
            if m == 9:
                s.mist, s.flood = 0, 0
            elif m == 7:
                s.mist = 1
            else:
                s.flood = 1
            event(s, rows, events, counts, EVENT_COOLANT, line, m, s.mist + 2 * s.flood)
        elif m >= 48 and m <= 53:
            used[_P] |= has[_P]
            note(s, NOTE_OVERRIDE, line, m)
        elif m >= 0 and m != 6 and not stops(m):
            p = word[_P] if has[_P] else np.nan
            used[_P] |= has[_P]
            used[_Q] |= has[_Q]
            event(s, rows, events, counts, EVENT_M, line, m, p)


@njit(cache=True)
def stops(m):
    """Tell whether an M-code stops or ends the program."""
    return m == 0 or m == 1 or m == 2 or m == 30 or m == 60


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
    if has[_H]:
        used[_H] = True
        tool = whole(word[_H])
        if tool < 0:
            report(found, counts, f.BAD_INTEGER, line, _H + 65, 0.0)
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
    s.exact_stop = 1 if code != 640 else 0
    s.tolerance = np.nan
    if code != 640:
        return
    used[_Q] |= has[_Q]
    if has[_P]:
        used[_P] = True
        if word[_P] < 0.0:
            report(found, counts, f.NEGATIVE_TOLERANCE, line, word[_P], 0.0)
        else:
            s.tolerance = word[_P] * s.unit_mm
