"""The modal interpreter: words in, rows of straight moves out. Compiled; one block at a time.

The order of execution inside a block is RS274/NGC's: feed mode, F, S, T, tool change, spindle, coolant,
dwell, plane, unit, length offset, work offset, path control, distance mode, machine moves, motion, stop.
A block that was not understood is followed all the same, without further findings, so that the blocks after
it are judged by their own faults.
"""

import math

import numpy as np
from numba import njit

from gcode2krl import ascii_codes as ch
from gcode2krl.gcode import findings as f
from gcode2krl.gcode import vocabulary as v
from gcode2krl.gcode.block_words import FAULTY, NOTHING, gather
from gcode2krl.gcode.motion import FAR_MM, machine_home, move
from gcode2krl.gcode.reporting import EVENTS, MUTE, ROWS, event, note, report, report_unless
from gcode2krl.gcode.rows import emit
from gcode2krl.gcode.settings import apply_settings, stops
from gcode2krl.gcode.state import (
    DOUBT_MOTION,
    DOUBT_POSITION,
    EVENT_M,
    NOTE_HOME,
)
from gcode2krl.units import S_PER_MIN

ROWS_PER_BLOCK, EVENTS_PER_BLOCK = 4, 16
_X_NAMED, _Y_NAMED, _Z_NAMED, _F_NAMED = 1, 2, 4, 8
_ALL_AXES = _X_NAMED | _Y_NAMED | _Z_NAMED


@njit(cache=True, nogil=True)
def run(words, start, state, rows, counts, events, found, options, offsets, offset_known, tool_length):
    """Execute blocks from word ``start`` on; return the word at which to go on.

    ``words`` = letter, value, extra, line; ``counts`` as in `report`; ``options`` (3,) = chord tolerance in
    mm, block delete, tool lengths from the table. Stops early where a buffer is nearly full.
    """
    letter, line = words[0], words[3]
    s = state[0]
    has = np.zeros(v.LETTERS, dtype=np.bool_)
    word = np.zeros(v.LETTERS)
    g_in_group = np.empty(v.GROUPS, dtype=np.int64)
    m_codes = np.empty(v.M_CODES, dtype=np.int64)
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
        if g_in_group[v.MOTION] >= 0 and kind == FAULTY and doubt & DOUBT_POSITION == DOUBT_POSITION:
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
        if (c >= ch.LETTER_I and c <= ch.LETTER_K) or c == ch.LETTER_R:
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

    Returns False, with nothing done, where the block is anything else or needs a closer look. One function
    with many branches: a call for each word would cost more than the word.
    """
    straight = s.motion == v.MOTION_RAPID or s.motion == v.MOTION_LINE
    if not straight or s.feed_mode != v.PER_MINUTE or s.doubt:
        return False
    x, y, z, feed = 0.0, 0.0, 0.0, s.feed
    named = 0
    for k in range(i, j):
        c = letter[k]
        bit = 0
        if c == ch.LETTER_X:
            x, bit = value[k], _X_NAMED
        elif c == ch.LETTER_Y:
            y, bit = value[k], _Y_NAMED
        elif c == ch.LETTER_Z:
            z, bit = value[k], _Z_NAMED
        elif c == ch.LETTER_F:
            feed, bit = value[k] * s.unit_mm, _F_NAMED
        if bit == 0 or named & bit:
            return False
        named |= bit
    known = s.known_x and s.known_y and s.known_z
    feeding = s.motion == v.MOTION_LINE
    if named & _ALL_AXES == 0 or feed < 0.0 or (feeding and (feed <= 0.0 or not known)):
        return False
    base_x, base_y, base_z = offsets[s.work_offset]
    x = x * s.unit_mm + (base_x if s.absolute else s.x) if named & _X_NAMED else s.x
    y = y * s.unit_mm + (base_y if s.absolute else s.y) if named & _Y_NAMED else s.y
    z = z * s.unit_mm + (base_z if s.absolute else s.z) if named & _Z_NAMED else s.z
    largest = max(abs(x), abs(y), abs(z))
    if largest > FAR_MM:
        return False
    s.largest_mm = max(s.largest_mm, largest)
    s.x, s.y, s.z, s.feed = x, y, z, feed
    if s.absolute:
        s.known_x |= (named & _X_NAMED) != 0
        s.known_y |= (named & _Y_NAMED) != 0
        s.known_z |= (named & _Z_NAMED) != 0
    emit(s, rows, counts[ROWS], line[i], feed / S_PER_MIN if feeding else np.inf, not feeding, False, -1)
    counts[ROWS] += 1
    s.blocks += 1
    return True


@njit(cache=True)
def _block(
    line, s, rows, counts, events, found, options, offsets, offset_known, tool_length, has, word, g, m_codes
):
    """Execute one block; return False only where the row buffer is too small for it."""
    from_table = options[2] != 0.0
    used = np.zeros(v.LETTERS, dtype=np.bool_)
    apply_settings(
        line,
        s,
        rows,
        counts,
        events,
        found,
        offset_known,
        tool_length,
        from_table,
        has,
        word,
        g,
        m_codes,
        used,
    )
    for index in v.OTHER_AXES:
        used[index] |= has[index]
    special = g[v.NON_MODAL]
    homes = special == v.G28 or special == v.G30
    axes = _names_axis(has)
    _non_modal(line, s, rows, counts, found, offsets, has, word, g[v.MOTION], special, axes, used)
    if g[v.MOTION] >= 0:
        s.motion = v.MOTION_CANCELLED if g[v.MOTION] == v.G80 else g[v.MOTION] // v.TENFOLD
        s.motion_line = line
        s.doubt &= ~DOUBT_MOTION
    moving = not homes and (axes or _names_motion(g) or _names_centre_alone(s, has))
    if special == v.G53 and (not moving or s.motion == v.MOTION_CANCELLED):
        report_unless(s, DOUBT_MOTION, found, counts, f.G53_NEEDS_RAPID_OR_FEED, line, 0.0, 0.0)
        s.doubt |= DOUBT_POSITION
        return True
    if moving:
        _use_motion_words(s, used)
        if not move(line, s, rows, counts, found, options, offsets, has, word, special):
            return False
    _report_unused(line, s, counts, found, has, used)
    _stop(line, s, rows, counts, events, m_codes)
    return True


@njit(cache=True)
def _names_axis(has):
    """Tell whether a block has a word of any axis."""
    named = has[v.WORD_X] or has[v.WORD_Y] or has[v.WORD_Z]
    for index in v.OTHER_AXES:
        named = named or has[index]
    return named


@njit(cache=True)
def _names_motion(g):
    return g[v.MOTION] >= 0 and g[v.MOTION] != v.G80


@njit(cache=True)
def _names_centre_alone(s, has):
    """Tell whether a centre is named while an arc mode is in force: a full circle."""
    return s.motion >= v.MOTION_ARC_CW and (has[v.WORD_I] or has[v.WORD_J] or has[v.WORD_K])


@njit(cache=True)
def _non_modal(line, s, rows, counts, found, offsets, has, word, motion_code, special, axes, used):
    """G4, G28 and G30, G28.1 and G30.1."""
    if special == v.G4:
        _dwell(line, s, rows, counts, found, has, word, used)
    elif special == v.G28 or special == v.G30:
        used[v.WORD_X], used[v.WORD_Y], used[v.WORD_Z] = True, True, True
        _home(line, s, rows, counts, found, offsets, has, word, motion_code, special, axes)
    elif special == v.G28_1 or special == v.G30_1:
        home = s.home_28 if special == v.G28_1 else s.home_30
        offset = 0.0 if math.isnan(s.length_offset) else s.length_offset
        home[0], home[1], home[2] = s.x, s.y, s.z + offset


@njit(cache=True)
def _use_motion_words(s, used):
    used[v.WORD_X], used[v.WORD_Y], used[v.WORD_Z] = True, True, True
    if s.motion >= v.MOTION_ARC_CW:
        for index in (v.WORD_I, v.WORD_J, v.WORD_K, v.WORD_R, v.WORD_P):
            used[index] = True


@njit(cache=True)
def _report_unused(line, s, counts, found, has, used):
    unused = 0
    for index in range(v.LETTERS):
        if has[index] and not used[index]:
            unused |= 1 << index
    if unused:
        report_unless(s, DOUBT_MOTION, found, counts, f.UNUSED_WORD, line, unused, s.motion, s.motion_line)


@njit(cache=True)
def _stop(line, s, rows, counts, events, m_codes):
    """M0, M1, M2, M30 and M60, at the end of their block; M60 stops as M0 does."""
    for m in m_codes:
        if stops(m):
            event(s, rows, events, counts, EVENT_M, line, v.M0 if m == v.M60 else m, np.nan)
            if m == v.M2 or m == v.M30:
                s.ended = 1
                s.end_line = line


@njit(cache=True)
def _dwell(line, s, rows, counts, found, has, word, used):
    used[v.WORD_P] |= has[v.WORD_P]
    if not has[v.WORD_P]:
        report(found, counts, f.DWELL_NO_P, line, 0.0, 0.0)
    elif word[v.WORD_P] < 0.0:
        report(found, counts, f.DWELL_NEGATIVE, line, word[v.WORD_P], 0.0)
    elif counts[ROWS] > 0:
        rows[counts[ROWS] - 1].dwell += word[v.WORD_P]


@njit(cache=True)
def _home(line, s, rows, counts, found, offsets, has, word, motion_code, special, any_axis):
    """G28 and G30; G0 beside them with axis words is what many posts write, and leaves no doubt."""
    beside = motion_code >= 0 and motion_code != v.G80
    if beside and (motion_code != v.G0 or not any_axis):
        report(found, counts, f.TWO_AXIS_CODES, line, special, motion_code)
        s.doubt |= DOUBT_POSITION
        return
    if beside:
        note(s, NOTE_HOME, line, special)
    machine_home(line, s, rows, counts, offsets, has, word, special, any_axis)
