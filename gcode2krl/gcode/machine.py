"""The modal interpreter: words in, rows of straight moves out. Compiled; one block at a time.

The order of execution inside a block is RS274/NGC's: feed mode, F, S, T, tool change, spindle, coolant,
dwell, plane, unit, length offset, work offset, path control, distance mode, machine moves, motion, stop.
"""

import math

import numpy as np
from numba import njit

from gcode2krl.gcode import findings as f
from gcode2krl.gcode.arcs import (
    RADIUS_TOLERANCE_MM,
    SMALLEST_RADIUS_MM,
    centre_from_radius,
    chord_count,
    sweep_angle,
)
from gcode2krl.gcode.state import (
    CANCELLED,
    EVENT_COOLANT,
    EVENT_M,
    EVENT_SPINDLE,
    EVENT_TEXT,
    EVENT_TOOL,
    GROUP_OF_G,
    GROUPS,
    IMPLIED_M5,
    UNKNOWN_GROUP,
    UNSUPPORTED_GROUP,
)

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
EVENT = np.dtype([("row", "i8"), ("kind", "i4"), ("line", "i4"), ("a", "f8"), ("b", "f8"), ("dwell", "f8")])
FOUND = np.dtype([("number", "i4"), ("line", "i4"), ("a", "f8"), ("b", "f8")])

ROWS_PER_BLOCK, EVENTS_PER_BLOCK = 4, 16
_FAR_MM = 1e6
_SLOWEST = 0.1  # units/min, LinuxCNC's floor under inverse time
_A, _D, _F, _H, _I, _J, _K, _L, _P, _Q, _R, _S, _T, _X, _Y, _Z = (ord(c) - 65 for c in "ADFHIJKLPQRSTXYZ")
_OTHER_AXES = tuple(ord(c) - 65 for c in "ABCUVWE")


@njit(cache=True, nogil=True)
def run(words, start, state, rows, counts, events, found, options, offsets, offset_known, tool_length):
    """Execute blocks from word ``start`` on; return the word at which to go on.

    ``words`` = letter, value, extra, line; ``counts`` (6,) = rows in the buffer, events, findings, marks,
    dropped findings, rows handed over before; ``options`` (2,) = chord tolerance in mm, block delete. Stops
    early where a buffer is nearly full.
    """
    letter, line = words[0], words[3]
    s = state[0]
    has = np.zeros(26, dtype=np.bool_)
    word = np.zeros(26)
    g_in_group = np.empty(GROUPS, dtype=np.int64)
    m_codes = np.empty(4, dtype=np.int64)
    n = len(letter)
    before = np.empty_like(state)
    used_before = np.empty_like(counts)
    i = start
    while i < n and not s.ended:
        j = i
        while j < n and line[j] == line[i]:
            j += 1
        if counts[0] + ROWS_PER_BLOCK > len(rows) or counts[1] + EVENTS_PER_BLOCK > len(events):
            break
        if _plain_block(letter, words[1], line, i, j, s, rows, counts, offsets):
            i = j
            continue
        before[0] = state[0]
        _copy(counts, used_before)
        if not _gather(words, i, j, s, rows, counts, events, found, options, has, word, g_in_group, m_codes):
            i = j
            continue
        done = _block(
            line[i],
            s,
            rows,
            counts,
            events,
            found,
            options,
            offsets,
            offset_known,
            tool_length,
            has,
            word,
            g_in_group,
            m_codes,
        )
        if not done:  # an arc needs more rows than are left: as if the block had not begun
            state[0] = before[0]
            _copy(used_before, counts)
            break
        s.blocks += 1
        i = j
    return i


@njit(cache=True)
def _copy(source, target):
    """Copy numbers; an assignment to ``target[:]`` would take seconds to compile."""
    for k in range(len(source)):
        target[k] = source[k]


@njit(cache=True)
def _plain_block(letter, value, line, i, j, s, rows, counts, offsets):
    """Execute a block of nothing but X, Y, Z and F under G0 or G1: the bulk of a CAM file.

    Returns False, with nothing done, where the block is anything else or needs a closer look.
    """
    if s.motion > 1 or s.motion < 0 or s.feed_mode != 94:
        return False
    x, y, z, feed = 0.0, 0.0, 0.0, s.feed
    named = 0
    for k in range(i, j):
        c = letter[k]
        bit = 0
        if c == 88:
            x, bit = value[k], 1
        elif c == 89:
            y, bit = value[k], 2
        elif c == 90:
            z, bit = value[k], 4
        elif c == 70:
            feed, bit = value[k] * s.unit_mm, 8
        if bit == 0 or named & bit:
            return False
        named |= bit
    known = s.known_x and s.known_y and s.known_z
    if named & 7 == 0 or feed < 0.0 or (s.motion == 1 and (feed <= 0.0 or not known)):
        return False
    base_x, base_y, base_z = offsets[s.work_offset]
    x = x * s.unit_mm + (base_x if s.absolute else s.x) if named & 1 else s.x
    y = y * s.unit_mm + (base_y if s.absolute else s.y) if named & 2 else s.y
    z = z * s.unit_mm + (base_z if s.absolute else s.z) if named & 4 else s.z
    largest = max(abs(x), abs(y), abs(z))
    if largest > _FAR_MM:
        return False
    s.largest_mm = max(s.largest_mm, largest)
    s.x, s.y, s.z, s.feed = x, y, z, feed
    if s.absolute:
        s.known_x |= named & 1
        s.known_y |= (named >> 1) & 1
        s.known_z |= (named >> 2) & 1
    _emit(s, rows, counts, line[i], feed / 60.0 if s.motion == 1 else np.inf, s.motion == 0, False, -1)
    s.blocks += 1
    return True


@njit(cache=True)
def _report(found, counts, number, line, a, b):
    warning = number == f.TOOL_UNDECLARED or number == f.H_DIFFERS or number == f.OFFSET_UNKNOWN
    room = len(found) // 2 if warning else len(found)  # warnings never crowd out an error
    if counts[2] < room:
        row = found[counts[2]]
        row.number, row.line, row.a, row.b = number, line, a, b
        counts[2] += 1
    else:
        counts[4] += 1


@njit(cache=True)
def _event(s, rows, events, counts, kind, line, a, b):
    row = events[counts[1]]
    row.row, row.kind, row.line, row.a, row.b = counts[5] + counts[0] - 1, kind, line, a, b
    row.dwell = rows[counts[0] - 1].dwell
    counts[1] += 1


@njit(cache=True)
def _gather(words, i, j, s, rows, counts, events, found, options, has, word, g_in_group, m_codes):
    """Sort the words of a block into ``has``/``word``, G-codes by group, M-codes; False: skip the block."""
    letter, value, extra, line = words
    at = line[i]
    has[:] = False
    g_in_group[:] = -1
    m_codes[:] = -1
    m_count = 0
    good = True
    used = False
    for k in range(i, j):
        c = letter[k]
        if c == 47:  # /
            if options[1] != 0.0:
                return False
        elif c == 37:  # %
            if j - i > 1:
                _report(found, counts, f.BAD_CHARACTER, at, c, 0.0)
                return False
            s.tape_marks += 1
            if s.tape_marks == 2 or (s.tape_marks == 1 and s.blocks > 0):
                s.ended = 1
                s.end_line = at
            return False
        elif c == 40:
            _event(s, rows, events, counts, EVENT_TEXT, at, value[k], 0.0)
        elif c == 33:
            what = extra[counts[3]] if counts[3] < len(extra) else 0.0
            counts[3] += 1
            _report(found, counts, int(value[k]), at, what, 0.0)
            good = False
        elif c == 71:  # G
            code = round(value[k] * 10)
            if (
                code < 0
                or code > 999
                or abs(value[k] * 10 - code) > 1e-6
                or GROUP_OF_G[code] == UNKNOWN_GROUP
            ):
                _report(found, counts, f.UNKNOWN_G, at, value[k] * 10, 0.0)
                good = False
            elif GROUP_OF_G[code] == UNSUPPORTED_GROUP:
                _report(found, counts, f.UNSUPPORTED_G, at, code, 0.0)
                good = False
            else:
                group = GROUP_OF_G[code]
                before = g_in_group[group]
                if group == 1 and (before == 800 or (code == 800 and before >= 0)):
                    g_in_group[group] = max(0, min(before, code))  # header lines say G0 … G80
                elif before >= 0:
                    _report(found, counts, f.SAME_GROUP_G, at, before, code)
                    good = False
                else:
                    g_in_group[group] = code
            used = True
        elif c == 77:  # M
            code = round(value[k])
            if abs(value[k] - code) > 1e-6 or code < 0 or code > 9999:
                _report(found, counts, f.BAD_M, at, value[k], 0.0)
                good = False
            elif (
                code == 19
                or (code >= 48 and code <= 53)
                or (code >= 60 and code <= 73)
                or code == 98
                or code == 99
            ):
                _report(found, counts, f.UNSUPPORTED_M, at, code * 10, 0.0)
                good = False
            elif m_count == 4:
                _report(found, counts, f.TOO_MANY_M, at, 0.0, 0.0)
                good = False
            else:
                for other in m_codes[:m_count]:
                    if _m_group(other) == _m_group(code) and _m_group(code) > 0:
                        _report(found, counts, f.SAME_GROUP_M, at, other * 10, code * 10)
                        good = False
                m_codes[m_count] = code
                m_count += 1
            used = True
        else:
            index = c - 65
            if has[index]:
                _report(found, counts, f.REPEATED_WORD, at, c, 0.0)
                good = False
            has[index] = True
            word[index] = value[k]
            used = True
    for index in _OTHER_AXES:
        if has[index]:
            _report(found, counts, f.UNKNOWN_LETTER if index == 4 else f.ROTARY_WORD, at, index + 65, 0.0)
            good = False
    return good and used


@njit(cache=True)
def _m_group(code):
    if code == 0 or code == 1 or code == 2 or code == 30:
        return 4
    if code == 6:
        return 6
    if code >= 3 and code <= 5:
        return 7
    if code >= 7 and code <= 9:
        return 8
    return 0


@njit(cache=True)
def _whole(value):
    """Return a whole number 0…99999, or -1."""
    nearest = round(value)
    if abs(value - nearest) > 1e-6 or nearest < 0 or nearest > 99999:
        return -1
    return int(nearest)


@njit(cache=True)
def _length_of(tool, tool_length):
    return tool_length[tool] if tool >= 0 and tool < len(tool_length) else np.nan


@njit(cache=True)
def _emit(s, rows, counts, line, feed, rapid, machine, arc):
    """Append a row that ends at the state's position."""
    row = rows[counts[0]]
    row.x, row.y, row.z = s.x, s.y, s.z
    row.feed = feed
    row.spindle = s.rpm * s.direction * 2.0 * math.pi / 60.0
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
    counts[0] += 1


@njit(cache=True)
def _feed_speed(s, has, word, length_mm):
    """Return (finding, speed in mm/s) of a feed move of the given whole length."""
    if s.feed_mode == 93:
        if not has[_F]:
            return f.NO_INVERSE_TIME, 0.0
        if word[_F] <= 0.0:
            return f.NO_FEED, 0.0
        return f.OK, max(length_mm * word[_F], _SLOWEST * s.unit_mm) / 60.0
    if s.feed <= 0.0:
        return f.NO_FEED, 0.0
    if s.feed_mode == 95:
        if s.rpm <= 0.0:
            return f.FEED_PER_REV_STOPPED, 0.0
        return f.OK, s.feed * s.rpm / 60.0
    return f.OK, s.feed / 60.0


@njit(cache=True)
def _settings(line, s, rows, counts, events, found, offset_known, tool_length, has, word, g, m_codes, used):
    """Everything of a block before its motion; return False where the block is wrong."""
    if g[5] >= 0:
        s.feed_mode = g[5] // 10
        s.feed = 0.0  # as LinuxCNC: naming a feed mode drops the feed, even the same mode
    if has[_F]:
        used[_F] = True
        if word[_F] < 0.0:
            _report(found, counts, f.NEGATIVE_FEED, line, word[_F], 0.0)
            return False
        s.feed = word[_F] if s.feed_mode == 93 else word[_F] * s.unit_mm
    if has[_S]:
        used[_S] = True
        if word[_S] < 0.0:
            _report(found, counts, f.NEGATIVE_SPEED, line, word[_S], 0.0)
            return False
        changed = s.rpm != word[_S]
        s.rpm = word[_S]
        if changed and s.direction != 0:
            _event(
                s, rows, events, counts, EVENT_SPINDLE, line, s.rpm * s.direction, 4 if s.direction < 0 else 3
            )
    if has[_T]:
        used[_T] = True
        tool = _whole(word[_T])
        if tool < 0:
            _report(found, counts, f.BAD_INTEGER, line, _T + 65, 0.0)
            return False
        s.selected_tool = tool
    for m in m_codes:
        if m == 6:
            if s.selected_tool < 0:
                _report(found, counts, f.TOOL_NOT_SELECTED, line, 0.0, 0.0)
                return False
            if s.direction != 0:  # a tool change stops the spindle, with or without M5
                s.direction = 0
                _event(s, rows, events, counts, EVENT_SPINDLE, line, 0.0, IMPLIED_M5)
            s.tool = s.selected_tool
            _event(s, rows, events, counts, EVENT_TOOL, line, s.tool, 0.0)
            if s.tool > 0 and math.isnan(_length_of(s.tool, tool_length)):
                _report(found, counts, f.TOOL_UNDECLARED, line, s.tool, 0.0)
    for m in m_codes:
        if m >= 3 and m <= 5:
            direction = 1 if m == 3 else (-1 if m == 4 else 0)
            s.direction = direction
            _event(s, rows, events, counts, EVENT_SPINDLE, line, s.rpm * direction, m)
        elif m >= 7 and m <= 9:
            if m == 9:
                s.mist, s.flood = 0, 0
            elif m == 7:
                s.mist = 1
            else:
                s.flood = 1
            _event(s, rows, events, counts, EVENT_COOLANT, line, m, s.mist + 2 * s.flood)
        elif m >= 0 and m != 6 and m != 0 and m != 1 and m != 2 and m != 30:
            p = word[_P] if has[_P] else np.nan
            used[_P] |= has[_P]
            used[_Q] |= has[_Q]
            _event(s, rows, events, counts, EVENT_M, line, m, p)
    if g[2] >= 0:
        s.plane = g[2] // 10
    if g[6] >= 0:
        s.unit_mm = 25.4 if g[6] == 200 else 1.0
        s.unit_named = 1
    if g[8] == 430:
        tool = s.tool
        if has[_H]:
            used[_H] = True
            tool = _whole(word[_H])
            if tool < 0:
                _report(found, counts, f.BAD_INTEGER, line, _H + 65, 0.0)
                return False
            if tool != s.tool and tool != 0:
                _report(found, counts, f.H_DIFFERS, line, tool, s.tool)
        length = _length_of(tool, tool_length)
        if math.isnan(length):
            if tool > 0 and tool != s.tool:
                _report(found, counts, f.TOOL_UNDECLARED, line, tool, 0.0)
            length = 0.0
        _set_length_offset(s, length)
        s.offset_tool = tool
    elif g[8] == 490:
        _set_length_offset(s, np.nan)
        s.offset_tool = -1
    if g[10] >= 0:
        code = g[10]
        s.work_offset = (code - 540) // 10 if code <= 590 else code - 585
        if not offset_known[s.work_offset] and s.work_offset > 0:
            _report(found, counts, f.OFFSET_UNKNOWN, line, code, 0.0)
    if g[11] >= 0:
        s.exact_stop = 1 if g[11] != 640 else 0
        s.tolerance = np.nan
        if g[11] == 640:
            used[_Q] |= has[_Q]
            if has[_P]:
                used[_P] = True
                if word[_P] < 0.0:
                    _report(found, counts, f.NEGATIVE_TOLERANCE, line, word[_P], 0.0)
                    return False
                s.tolerance = word[_P] * s.unit_mm
    if g[3] >= 0:
        s.absolute = 1 if g[3] == 900 else 0
    if g[4] >= 0:
        s.arc_absolute = 1 if g[4] == 901 else 0
    return True


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
def _block(
    line, s, rows, counts, events, found, options, offsets, offset_known, tool_length, has, word, g, m_codes
):
    """Execute one block; return False only where the row buffer is too small for it."""
    used = np.zeros(26, dtype=np.bool_)
    if not _settings(
        line, s, rows, counts, events, found, offset_known, tool_length, has, word, g, m_codes, used
    ):
        return True
    axes = has[_X] or has[_Y] or has[_Z]
    special = g[0]
    if special == 40:
        used[_P] |= has[_P]
        if not has[_P]:
            _report(found, counts, f.DWELL_NO_P, line, 0.0, 0.0)
        elif word[_P] < 0.0:
            _report(found, counts, f.DWELL_NEGATIVE, line, word[_P], 0.0)
        elif counts[0] > 0:
            rows[counts[0] - 1].dwell += word[_P]
    elif special == 280 or special == 300:
        if g[1] >= 0 and g[1] != 800 and axes:
            _report(found, counts, f.TWO_AXIS_CODES, line, special, g[1])
            return True
        used[_X] |= has[_X]
        used[_Y] |= has[_Y]
        used[_Z] |= has[_Z]
        _machine_home(line, s, rows, counts, offsets, has, word, special)
        axes = False
    elif special == 281 or special == 301:
        home = s.home_28 if special == 281 else s.home_30
        offset = 0.0 if math.isnan(s.length_offset) else s.length_offset
        home[0], home[1], home[2] = s.x, s.y, s.z + offset
    if g[1] >= 0:
        s.motion = CANCELLED if g[1] == 800 else g[1] // 10
    motion = s.motion
    arc_words = has[_I] or has[_J] or has[_K] or has[_R]
    named = g[1] >= 0 and g[1] != 800 and special != 280 and special != 300
    moving = axes or (named and (motion <= 1 or arc_words))
    if special == 530 and (not moving or motion == CANCELLED):
        _report(found, counts, f.G53_NEEDS_RAPID_OR_FEED, line, 0.0, 0.0)
        return True
    if special == 40 and moving and motion > 1:
        _report(found, counts, f.DWELL_WITH_ARC, line, 0.0, 0.0)
        return True
    if moving:
        used[_X], used[_Y], used[_Z] = True, True, True
        if motion == CANCELLED:
            _report(found, counts, f.NO_MOTION_MODE, line, 0.0, 0.0)
            return True
        if special == 530:
            if motion > 1:
                _report(found, counts, f.G53_NEEDS_RAPID_OR_FEED, line, 0.0, 0.0)
                return True
            if not s.absolute:
                _report(found, counts, f.G53_INCREMENTAL, line, 0.0, 0.0)
                return True
        if motion <= 1:
            _straight(line, s, rows, counts, found, offsets, has, word, motion, special == 530)
        else:
            for index in (_I, _J, _K, _R, _P):
                used[index] = True
            if not (s.known_x and s.known_y and s.known_z) and s.unknown_feed_line == 0:
                s.unknown_feed_line = line
            end = _target(s, offsets, has, word)
            if not _arc(line, s, rows, counts, found, options, offsets, has, word, motion):
                return False
            s.x, s.y, s.z = end  # also after a wrong arc, so that one mistake is one finding
            _learn(s, has)
        s.largest_mm = max(s.largest_mm, abs(s.x), abs(s.y), abs(s.z))
        if abs(s.x) > _FAR_MM or abs(s.y) > _FAR_MM or abs(s.z) > _FAR_MM:
            _report(found, counts, f.TOO_FAR, line, max(abs(s.x), abs(s.y), abs(s.z)), 0.0)
            s.x, s.y, s.z = 0.0, 0.0, 0.0
    for index in range(26):
        if has[index] and not used[index]:
            _report(found, counts, f.UNUSED_WORD, line, index + 65, 0.0)
    for m in m_codes:
        if m == 0 or m == 1 or m == 2 or m == 30:
            _event(s, rows, events, counts, EVENT_M, line, m, np.nan)
            if m >= 2:
                s.ended = 1
                s.end_line = line
    return True


@njit(cache=True)
def _target(s, offsets, has, word):
    """Return the tip position the axis words ask for; axes not named stay."""
    x, y, z = s.x, s.y, s.z
    base_x, base_y, base_z = offsets[s.work_offset]
    if has[_X]:
        x = word[_X] * s.unit_mm + (base_x if s.absolute else x)
    if has[_Y]:
        y = word[_Y] * s.unit_mm + (base_y if s.absolute else y)
    if has[_Z]:
        z = word[_Z] * s.unit_mm + (base_z if s.absolute else z)
    return x, y, z


@njit(cache=True)
def _learn(s, has):
    """Note which axes have been programmed: in absolute mode always, else if they were known before."""
    if s.absolute:
        s.known_x |= has[_X]
        s.known_y |= has[_Y]
        s.known_z |= has[_Z]


@njit(cache=True)
def _machine_home(line, s, rows, counts, offsets, has, word, code):
    """G28/G30: by way of the programmed point, then the named axes (or all) to the machine's home."""
    any_axis = has[_X] or has[_Y] or has[_Z]
    s.x, s.y, s.z = _target(s, offsets, has, word)
    _emit(s, rows, counts, line, np.inf, 1, 1, -1)
    home = s.home_28 if code == 280 else s.home_30
    offset = 0.0 if math.isnan(s.length_offset) else s.length_offset
    if has[_X] or not any_axis:
        s.x = home[0]
        s.known_x = 0
    if has[_Y] or not any_axis:
        s.y = home[1]
        s.known_y = 0
    if has[_X] and has[_Y]:
        s.known_z = 0  # the robot goes to HOME: the old height must not come back by itself
    if has[_Z] or not any_axis:
        s.z = home[2] - offset
        s.known_z = 0
    _emit(s, rows, counts, line, np.inf, 1, 1, -1)


@njit(cache=True)
def _straight(line, s, rows, counts, found, offsets, has, word, motion, machine):
    """G0 and G1, also under G53."""
    if machine:
        offset = 0.0 if math.isnan(s.length_offset) else s.length_offset
        x = word[_X] * s.unit_mm if has[_X] else s.x
        y = word[_Y] * s.unit_mm if has[_Y] else s.y
        z = word[_Z] * s.unit_mm - offset if has[_Z] else s.z
    else:
        x, y, z = _target(s, offsets, has, word)
    speed = np.inf
    if motion == 1:
        if not (s.known_x and s.known_y and s.known_z) and s.unknown_feed_line == 0:
            s.unknown_feed_line = line
        length = math.sqrt((x - s.x) ** 2 + (y - s.y) ** 2 + (z - s.z) ** 2)
        finding, speed = _feed_speed(s, has, word, length)
        if finding != f.OK:
            _report(found, counts, finding, line, 0.0, 0.0)
    s.x, s.y, s.z = x, y, z
    if machine:
        s.known_x &= not has[_X]
        s.known_y &= not has[_Y]
        s.known_z &= not has[_Z]
    else:
        _learn(s, has)
    _emit(s, rows, counts, line, speed, motion == 0, machine, -1)


@njit(cache=True)
def _arc(line, s, rows, counts, found, options, offsets, has, word, motion):
    """G2 and G3 as chords; return False where the row buffer is too small."""
    ccw = motion == 3
    g10 = motion * 10
    start = (s.x, s.y, s.z)
    end = _target(s, offsets, has, word)
    first = 0 if s.plane == 17 else (2 if s.plane == 18 else 1)  # index of u
    second = (first + 1) % 3
    third = (first + 2) % 3
    u0, v0, w0 = start[first], start[second], start[third]
    u1, v1, w1 = end[first], end[second], end[third]
    has_u, has_v, has_w = has[_I + first], has[_I + second], has[_I + third]
    if has[_R]:
        if has_u or has_v or has_w:
            _report(found, counts, f.ARC_BOTH_FORMATS, line, 0.0, 0.0)
            return True
        finding, cu, cv = centre_from_radius(u0, v0, u1, v1, word[_R] * s.unit_mm, ccw)
        if finding != f.OK:
            _report(found, counts, finding, line, abs(word[_R]) * s.unit_mm, math.hypot(u1 - u0, v1 - v0))
            return True
    else:
        if has_w:
            _report(found, counts, f.ARC_WRONG_OFFSET, line, 73 + third, 0.0)
            return True
        if not has_u and not has_v:
            _report(found, counts, f.ARC_NO_CENTRE, line, g10, 0.0)
            return True
        cu = word[_I + first] * s.unit_mm if has_u else 0.0
        cv = word[_I + second] * s.unit_mm if has_v else 0.0
        if s.arc_absolute:
            if not (has_u and has_v):
                _report(found, counts, f.ARC_NEEDS_OFFSETS, line, 0.0, 0.0)
                return True
            cu += offsets[s.work_offset, first]
            cv += offsets[s.work_offset, second]
        else:
            cu += u0
            cv += v0
    turns = 1
    if has[_P]:
        turns = _whole(word[_P])
        if turns < 1 or turns > 1000:
            _report(found, counts, f.ARC_TURNS, line, word[_P], 0.0)
            return True
    r0 = math.hypot(u0 - cu, v0 - cv)
    r1 = math.hypot(u1 - cu, v1 - cv)
    if r0 < SMALLEST_RADIUS_MM or r1 < SMALLEST_RADIUS_MM:
        _report(found, counts, f.ARC_ZERO_RADIUS, line, 0.0, 0.0)
        return True
    if abs(r0 - r1) > RADIUS_TOLERANCE_MM:
        _report(found, counts, f.ARC_RADIUS_MISMATCH, line, r0, r1)
        return True
    angle, sweep = sweep_angle(u0, v0, u1, v1, cu, cv, ccw, turns)
    chords = chord_count(max(r0, r1), sweep, options[0])
    if counts[0] + chords > len(rows):
        return False
    length = math.hypot(0.5 * (r0 + r1) * sweep, w1 - w0)
    finding, speed = _feed_speed(s, has, word, length)
    if finding != f.OK:
        _report(found, counts, finding, line, 0.0, 0.0)
        return True
    _learn(s, has)
    point = np.empty(3)
    for k in range(1, chords + 1):
        part = k / chords
        r = r0 + (r1 - r0) * part
        point[first] = cu + r * math.cos(angle + sweep * part)
        point[second] = cv + r * math.sin(angle + sweep * part)
        point[third] = w0 + (w1 - w0) * part
        s.x, s.y, s.z = point[0], point[1], point[2]
        if k == chords:
            s.x, s.y, s.z = end
        _emit(s, rows, counts, line, speed, 0, 0, s.arcs)
    s.arcs += 1
    return True
