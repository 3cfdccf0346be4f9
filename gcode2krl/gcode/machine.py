"""The modal interpreter: words in, rows of straight moves out. Compiled; one block at a time.

The order of execution inside a block is RS274/NGC's: feed mode, F, S, T, tool change, spindle, coolant,
dwell, plane, unit, length offset, work offset, path control, distance mode, machine moves, motion, stop.
A block that was not understood is followed all the same, without further findings, so that the blocks after
it are judged by their own faults.
"""

import math

import numpy as np
from numba import njit

from gcode2krl.gcode import findings as f
from gcode2krl.gcode.block_words import FAULTY, NOTHING, OTHER_AXES, gather
from gcode2krl.gcode.motion import machine_home, move
from gcode2krl.gcode.reporting import EVENTS, MUTE, ROWS, event, note, report, report_unless
from gcode2krl.gcode.rows import emit
from gcode2krl.gcode.settings import apply_settings, stops
from gcode2krl.gcode.state import (
    CANCELLED,
    DOUBT_MOTION,
    DOUBT_POSITION,
    EVENT_M,
    GROUPS,
    NOTE_HOME,
)

ROWS_PER_BLOCK, EVENTS_PER_BLOCK = 4, 16
_FAR_MM = 1e6
_I, _J, _K, _P, _R, _X, _Y, _Z = (ord(c) - 65 for c in "IJKPRXYZ")


@njit(cache=True, nogil=True)
def run(words, start, state, rows, counts, events, found, options, offsets, offset_known, tool_length):
    """Execute blocks from word ``start`` on; return the word at which to go on.

    ``words`` = letter, value, extra, line; ``counts`` as in `report`; ``options`` (3,) = chord tolerance in
    mm, block delete, tool lengths from the table. Stops early where a buffer is nearly full.
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
        if counts[ROWS] + ROWS_PER_BLOCK > len(rows) or counts[EVENTS] + EVENTS_PER_BLOCK > len(events):
            break
        if _plain_block(letter, words[1], line, i, j, s, rows, counts, offsets):
            i = j
            continue
        arc = _has_arc_word(letter, i, j)
        if arc:
            before[0] = state[0]
            _copy(counts, used_before)
        kind, doubt = gather(
            words,
            i,
            j,
            s,
            rows,
            counts,
            events,
            found,
            options[1] != 0.0,
            has,
            word,
            g_in_group,
            m_codes,
        )
        if kind == NOTHING:
            i = j
            continue
        if g_in_group[1] >= 0 and kind == FAULTY and doubt & DOUBT_POSITION == DOUBT_POSITION:
            doubt &= ~DOUBT_MOTION  # beside a code nobody knows the motion mode is named
        counts[MUTE] = kind == FAULTY
        s.doubt |= doubt
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
        counts[MUTE] = 0
        if arc and not done:  # an arc needs more rows than are left: as if the block had not begun
            state[0] = before[0]
            _copy(used_before, counts)
            break
        s.doubt |= doubt
        s.blocks += 1
        i = j
    return i


@njit(cache=True)
def _has_arc_word(letter, i, j):
    """Tell whether I, J, K or R is among the words: only such a block can need many rows."""
    for k in range(i, j):
        c = letter[k]
        if (c >= 73 and c <= 75) or c == 82:
            return True
    return False


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
    if s.motion > 1 or s.motion < 0 or s.feed_mode != 94 or s.doubt:
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
    speed = feed / 60.0 if s.motion == 1 else np.inf
    emit(s, rows, counts[ROWS], line[i], speed, s.motion == 0, False, -1)
    counts[ROWS] += 1
    s.blocks += 1
    return True


@njit(cache=True)
def _block(
    line, s, rows, counts, events, found, options, offsets, offset_known, tool_length, has, word, g, m_codes
):
    """Execute one block; return False only where the row buffer is too small for it."""
    used = np.zeros(26, dtype=np.bool_)
    apply_settings(
        line, s, rows, counts, events, found, offset_known, tool_length, options[2] != 0.0,
        has, word, g, m_codes, used,
    )  # fmt: skip
    axes = has[_X] or has[_Y] or has[_Z]
    for index in OTHER_AXES:
        if has[index]:
            axes, used[index] = True, True
    special = g[0]
    homes = special == 280 or special == 300
    named = g[1] >= 0 and g[1] != 800 and not homes
    if special == 40:
        _dwell(line, s, rows, counts, found, has, word, used)
    elif homes:
        used[_X], used[_Y], used[_Z] = True, True, True
        _home(line, s, rows, counts, found, offsets, has, word, g[1], special, axes)
        axes = False
    elif special == 281 or special == 301:
        home = s.home_28 if special == 281 else s.home_30
        offset = 0.0 if math.isnan(s.length_offset) else s.length_offset
        home[0], home[1], home[2] = s.x, s.y, s.z + offset
    if g[1] >= 0:
        s.motion = CANCELLED if g[1] == 800 else g[1] // 10
        s.motion_line = line
        s.doubt &= ~DOUBT_MOTION
    centre_alone = not named and s.motion > 1 and not homes and (has[_I] or has[_J] or has[_K])
    moving = axes or named or centre_alone
    if special == 530 and (not moving or s.motion == CANCELLED):
        report_unless(s, DOUBT_MOTION, found, counts, f.G53_NEEDS_RAPID_OR_FEED, line, 0.0, 0.0)
        s.doubt |= DOUBT_POSITION
        return True
    if moving:
        used[_X], used[_Y], used[_Z] = True, True, True
        if s.motion > 1:
            for index in (_I, _J, _K, _R, _P):
                used[index] = True
        if not move(line, s, rows, counts, found, options, offsets, has, word, special):
            return False
    unused = 0
    for index in range(26):
        if has[index] and not used[index]:
            unused |= 1 << index
    if unused:
        report_unless(s, DOUBT_MOTION, found, counts, f.UNUSED_WORD, line, unused, s.motion, s.motion_line)
    for m in m_codes:
        if stops(m):
            event(s, rows, events, counts, EVENT_M, line, 0 if m == 60 else m, np.nan)
            if m == 2 or m == 30:
                s.ended = 1
                s.end_line = line
    return True


@njit(cache=True)
def _dwell(line, s, rows, counts, found, has, word, used):
    used[_P] |= has[_P]
    if not has[_P]:
        report(found, counts, f.DWELL_NO_P, line, 0.0, 0.0)
    elif word[_P] < 0.0:
        report(found, counts, f.DWELL_NEGATIVE, line, word[_P], 0.0)
    elif counts[ROWS] > 0:
        rows[counts[ROWS] - 1].dwell += word[_P]


@njit(cache=True)
def _home(line, s, rows, counts, found, offsets, has, word, motion_code, special, any_axis):
    """G28 and G30; G0 beside them with axis words is what many posts write, and leaves no doubt."""
    beside = motion_code >= 0 and motion_code != 800
    if beside and (motion_code != 0 or not any_axis):
        report(found, counts, f.TWO_AXIS_CODES, line, special, motion_code)
        s.doubt |= DOUBT_POSITION
        return
    if beside:
        note(s, NOTE_HOME, line, special)
    machine_home(line, s, rows, counts, offsets, has, word, special, any_axis)
