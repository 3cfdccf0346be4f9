"""The motion of a block: straight moves, arcs as chords, machine moves. Compiled."""

import math

import numpy as np
from numba import njit

from gcode2krl import ascii_codes as ch
from gcode2krl.gcode import findings as f
from gcode2krl.gcode import vocabulary as v
from gcode2krl.gcode.arcs import (
    FITS,
    MISFIT,
    SMALLEST_RADIUS_MM,
    centre_from_radius,
    chord_count,
    radii_fit,
    sweep_angle,
)
from gcode2krl.gcode.reporting import CONSEQUENCES, MUTE, ROWS, note, report, report_unless, rests_on_doubt
from gcode2krl.gcode.rows import emit, follow, learn, target
from gcode2krl.gcode.settings import whole
from gcode2krl.gcode.state import (
    DOUBT_CENTRE,
    DOUBT_DISTANCE,
    DOUBT_FEED,
    DOUBT_FEED_MODE,
    DOUBT_MOTION,
    DOUBT_PLANE,
    DOUBT_POSITION,
    DOUBT_SPEED,
    DOUBT_UNIT,
    DOUBT_X,
    DOUBT_Z,
    NOTE_CENTRE,
)
from gcode2krl.units import S_PER_MIN

FAR_MM = 1e6
"""No coordinate of a part is larger."""
_SLOWEST = 0.1  # units/min, LinuxCNC's floor under inverse time
_MOST_MISFITS = 10  # arcs whose lines are kept
_MOST_TURNS = 1000


@njit(cache=True)
def move(line, s, rows, counts, found, options, offsets, has, word, special):
    """Carry out the motion of a block; return False where the row buffer is too small for it."""
    if s.doubt & DOUBT_MOTION:
        follow(s, offsets, has, word)
        s.doubt |= DOUBT_Z  # a cycle may end anywhere along the tool
    elif s.motion == v.MOTION_CANCELLED:
        report(found, counts, f.NO_MOTION_MODE, line, s.motion_line, 0.0)
        s.doubt |= DOUBT_MOTION
        follow(s, offsets, has, word)
    elif special == v.G53 and s.motion >= v.MOTION_ARC_CW:
        report(found, counts, f.G53_NEEDS_RAPID_OR_FEED, line, 0.0, 0.0)
        s.doubt |= DOUBT_POSITION
    elif special == v.G53 and not s.absolute:
        report_unless(s, DOUBT_DISTANCE, found, counts, f.G53_INCREMENTAL, line, 0.0, 0.0)
        s.doubt |= DOUBT_POSITION
    elif special == v.G4 and s.motion >= v.MOTION_ARC_CW:
        report(found, counts, f.DWELL_WITH_ARC, line, 0.0, 0.0)
        follow(s, offsets, has, word)
    elif s.motion <= v.MOTION_LINE:
        _straight(line, s, rows, counts, found, offsets, has, word, special == v.G53)
    else:
        _note_unknown_start(s, line)
        end = target(s, offsets, has, word)
        if not _arc(line, s, rows, counts, found, options, offsets, has, word):
            return False
        s.x, s.y, s.z = end  # also after a wrong arc, so that one mistake is one finding
        learn(s, has)
    largest = max(abs(s.x), abs(s.y), abs(s.z))
    s.largest_mm = max(s.largest_mm, largest)
    if largest > FAR_MM:
        in_doubt = DOUBT_POSITION | DOUBT_UNIT | DOUBT_DISTANCE
        report_unless(s, in_doubt, found, counts, f.TOO_FAR, line, largest, 0.0)
        s.x, s.y, s.z = 0.0, 0.0, 0.0
        s.doubt |= DOUBT_POSITION
    return True


@njit(cache=True)
def machine_home(line, s, rows, counts, offsets, has, word, code, any_axis):
    """G28/G30: by way of the programmed point, then the named axes (or all) to the machine's home."""
    s.x, s.y, s.z = target(s, offsets, has, word)
    emit(s, rows, counts[ROWS], line, np.inf, 1, 1, -1)
    counts[ROWS] += 1
    home = s.home_28 if code == v.G28 else s.home_30
    offset = 0.0 if math.isnan(s.length_offset) else s.length_offset
    if has[v.WORD_X] or not any_axis:
        s.x = home[0]
        s.known_x = 0
    if has[v.WORD_Y] or not any_axis:
        s.y = home[1]
        s.known_y = 0
    if has[v.WORD_X] and has[v.WORD_Y]:
        s.known_z = 0  # the robot goes to HOME: the old height must not come back by itself
    if has[v.WORD_Z] or not any_axis:
        s.z = home[2] - offset
        s.known_z = 0
    emit(s, rows, counts[ROWS], line, np.inf, 1, 1, -1)
    counts[ROWS] += 1


@njit(cache=True)
def _note_unknown_start(s, line):
    if not (s.known_x and s.known_y and s.known_z) and s.unknown_feed_line == 0:
        s.unknown_feed_line = line


@njit(cache=True)
def _feed_speed(s, has, word, length_mm):
    """Return (finding, speed in mm/s) of a feed move of the given whole length."""
    if s.feed_mode == v.INVERSE_TIME:
        if not has[v.WORD_F]:
            return f.NO_INVERSE_TIME, 0.0
        if word[v.WORD_F] <= 0.0:
            return f.NO_FEED, 0.0
        return f.OK, max(length_mm * word[v.WORD_F], _SLOWEST * s.unit_mm) / S_PER_MIN
    if s.feed <= 0.0:
        return f.NO_FEED, 0.0
    if s.feed_mode == v.PER_REVOLUTION:
        if s.rpm <= 0.0:
            return f.FEED_PER_REV_STOPPED, 0.0
        return f.OK, s.feed * s.rpm / S_PER_MIN
    return f.OK, s.feed / S_PER_MIN


@njit(cache=True)
def _report_speed(s, found, counts, finding, line):
    """Report what is wrong with the feed, once: the moves after it rest on it."""
    if finding == f.NO_INVERSE_TIME:
        report_unless(s, DOUBT_FEED_MODE, found, counts, finding, line, s.feed_mode_line, 0.0)
    elif finding == f.FEED_PER_REV_STOPPED:
        report_unless(s, DOUBT_SPEED | DOUBT_FEED_MODE, found, counts, finding, line, s.feed_mode_line, 0.0)
        s.doubt |= DOUBT_SPEED
    else:
        dropped = s.feed_mode_line if s.feed_mode != v.INVERSE_TIME else 0
        report_unless(s, DOUBT_FEED | DOUBT_FEED_MODE, found, counts, finding, line, dropped, s.feed_mode)
        s.doubt |= DOUBT_FEED


@njit(cache=True)
def _straight(line, s, rows, counts, found, offsets, has, word, machine):
    """G0 and G1, also under G53."""
    if machine:
        offset = 0.0 if math.isnan(s.length_offset) else s.length_offset
        x = word[v.WORD_X] * s.unit_mm if has[v.WORD_X] else s.x
        y = word[v.WORD_Y] * s.unit_mm if has[v.WORD_Y] else s.y
        z = word[v.WORD_Z] * s.unit_mm - offset if has[v.WORD_Z] else s.z
    else:
        x, y, z = target(s, offsets, has, word)
    speed = np.inf
    if s.motion == v.MOTION_LINE:
        _note_unknown_start(s, line)
        length = math.sqrt((x - s.x) ** 2 + (y - s.y) ** 2 + (z - s.z) ** 2)
        finding, speed = _feed_speed(s, has, word, length)
        if finding != f.OK:
            _report_speed(s, found, counts, finding, line)
    s.x, s.y, s.z = x, y, z
    if machine:
        s.known_x &= not has[v.WORD_X]
        s.known_y &= not has[v.WORD_Y]
        s.known_z &= not has[v.WORD_Z]
    else:
        learn(s, has)
    emit(s, rows, counts[ROWS], line, speed, s.motion == v.MOTION_RAPID, machine, -1)
    counts[ROWS] += 1


@njit(cache=True)
def _arc(line, s, rows, counts, found, options, offsets, has, word):
    """G2 and G3 as chords; return False where the row buffer is too small."""
    ccw = s.motion == v.MOTION_ARC_CCW
    start = (s.x, s.y, s.z)
    end = target(s, offsets, has, word)
    first = _first_axis(s.plane)
    second, third = (first + 1) % 3, (first + 2) % 3
    in_doubt = (
        (DOUBT_X << first) | (DOUBT_X << second) | DOUBT_UNIT | DOUBT_PLANE | DOUBT_DISTANCE | DOUBT_CENTRE
    )
    u0, v0, w0 = start[first], start[second], start[third]
    u1, v1, w1 = end[first], end[second], end[third]
    if not _axis_word_is_harmless(line, s, counts, found, has, word, third):
        return True
    if has[v.WORD_R]:
        good, cu, cv = _centre_by_radius(
            line, s, counts, found, has, word, first, second, u0, v0, u1, v1, in_doubt
        )
    else:
        good, cu, cv = _centre_by_words(line, s, counts, found, offsets, has, word, first, second, u0, v0)
    if not good:
        return True
    turns = whole(word[v.WORD_P]) if has[v.WORD_P] else 1
    if turns < 1 or turns > _MOST_TURNS:
        report(found, counts, f.ARC_TURNS, line, word[v.WORD_P], 0.0)
        return True
    r0 = math.hypot(u0 - cu, v0 - cv)
    r1 = math.hypot(u1 - cu, v1 - cv)
    if min(r0, r1) < SMALLEST_RADIUS_MM:
        report_unless(s, in_doubt, found, counts, f.ARC_ZERO_RADIUS, line, 0.0, 0.0)
        return True
    fit = radii_fit(r0, r1, s.unit_mm)
    if fit == MISFIT:
        known = (s.known_x, s.known_y, s.known_z)
        if not (known[first] and known[second]):
            _report_unknown_start(s, counts, found, line)
        elif not rests_on_doubt(s, counts, in_doubt):
            cu, cv = _other_centre(s, offsets, first, second, u0, v0, cu, cv)
            other = radii_fit(math.hypot(u0 - cu, v0 - cv), math.hypot(u1 - cu, v1 - cv), s.unit_mm) != MISFIT
            _report_misfit(s, counts, found, line, r0, r1, other)
        return True
    angle, sweep = sweep_angle(u0, v0, u1, v1, cu, cv, ccw, turns)
    chords = chord_count(max(r0, r1), sweep, options[0])
    if counts[ROWS] + chords > len(rows):
        return False
    length = math.hypot(0.5 * (r0 + r1) * sweep, w1 - w0)
    finding, speed = _feed_speed(s, has, word, length)
    if finding != f.OK:
        _report_speed(s, found, counts, finding, line)
        return True
    if fit != FITS:
        _note_spiral(s, line, r0, r1)
    learn(s, has)
    axes, centre, radii, along = (first, second, third), (cu, cv), (r0, r1), (w0, w1)
    _emit_chords(line, s, rows, counts, axes, centre, radii, along, angle, sweep, chords, end, speed)
    return True


@njit(cache=True)
def _emit_chords(line, s, rows, counts, axes, centre, radii, along, angle, sweep, chords, end, speed):
    """Write the rows of an arc; the last ends exactly where the block says."""
    r0, w0 = radii[0], along[0]
    point = np.empty(3)
    for k in range(1, chords + 1):
        part = k / chords
        r = r0 + (radii[1] - r0) * part
        point[axes[0]] = centre[0] + r * math.cos(angle + sweep * part)
        point[axes[1]] = centre[1] + r * math.sin(angle + sweep * part)
        point[axes[2]] = w0 + (along[1] - w0) * part
        s.x, s.y, s.z = point[0], point[1], point[2]
        if k == chords:
            s.x, s.y, s.z = end
        emit(s, rows, counts[ROWS], line, speed, 0, 0, s.arcs)
        counts[ROWS] += 1
    s.arcs += 1


@njit(cache=True)
def _first_axis(plane):
    """Return the number of the axis u of a plane; v and w follow in turn."""
    if plane == v.PLANE_XY:
        return 0
    return 2 if plane == v.PLANE_ZX else 1


@njit(cache=True)
def _axis_word_is_harmless(line, s, counts, found, has, word, third):
    """Tell whether the centre word along the arc's axis is 0 or missing; report it where it is not."""
    if not has[v.WORD_I + third]:
        return True
    value, letter = word[v.WORD_I + third], ch.LETTER_I + third
    if value != 0.0:
        report_unless(s, DOUBT_PLANE, found, counts, f.ARC_WRONG_OFFSET, line, letter, value, s.plane)
        return False
    if not counts[MUTE]:
        note(s, NOTE_CENTRE, line, letter)
    return True


@njit(cache=True)
def _centre_by_radius(line, s, counts, found, has, word, first, second, u0, v0, u1, v1, in_doubt):
    """Return (True where there is one, u, v) of the centre of an arc with R."""
    if has[v.WORD_I + first] or has[v.WORD_I + second]:
        report(found, counts, f.ARC_BOTH_FORMATS, line, 0.0, 0.0)
        return False, 0.0, 0.0
    radius = word[v.WORD_R] * s.unit_mm
    finding, cu, cv = centre_from_radius(u0, v0, u1, v1, radius, s.motion == v.MOTION_ARC_CCW)
    if finding != f.OK:
        report_unless(s, in_doubt, found, counts, finding, line, abs(radius), math.hypot(u1 - u0, v1 - v0))
    return finding == f.OK, cu, cv


@njit(cache=True)
def _centre_by_words(line, s, counts, found, offsets, has, word, first, second, u0, v0):
    """Return (True where there is one, u, v) of the centre of an arc with I, J, K."""
    has_u, has_v = has[v.WORD_I + first], has[v.WORD_I + second]
    if not has_u and not has_v:
        report(found, counts, f.ARC_NO_CENTRE, line, s.motion * v.TENFOLD, s.motion_line)
        return False, 0.0, 0.0
    if s.arc_absolute and not (has_u and has_v):
        report_unless(s, DOUBT_CENTRE, found, counts, f.ARC_NEEDS_OFFSETS, line, 0.0, 0.0)
        return False, 0.0, 0.0
    i = word[v.WORD_I + first] * s.unit_mm if has_u else 0.0
    j = word[v.WORD_I + second] * s.unit_mm if has_v else 0.0
    base = offsets[s.work_offset]
    return True, i + (base[first] if s.arc_absolute else u0), j + (base[second] if s.arc_absolute else v0)


@njit(cache=True)
def _other_centre(s, offsets, first, second, u0, v0, cu, cv):
    """Return (u, v) of the centre as the other of G90.1 and G91.1 would have it."""
    base = offsets[s.work_offset]
    if s.arc_absolute:
        return cu + (u0 - base[first]), cv + (v0 - base[second])
    return cu + (base[first] - u0), cv + (base[second] - v0)


@njit(cache=True)
def _report_unknown_start(s, counts, found, line):
    """An arc from a position that was never programmed cannot fit: the cause is the first such move."""
    if s.unknown_reported:
        counts[CONSEQUENCES] += 1
    else:
        incremental_line = 0 if s.absolute else s.distance_line
        report(found, counts, f.UNKNOWN_START, min(line, s.unknown_feed_line), incremental_line, 0.0)
    s.unknown_reported = 1


@njit(cache=True)
def _report_misfit(s, counts, found, line, r0, r1, other_centre_fits):
    if counts[MUTE]:
        return
    s.misfits += 1
    s.misfits_other_centre += other_centre_fits
    if s.misfits <= _MOST_MISFITS:
        centre = v.G90_1 if s.arc_absolute else v.G91_1
        report(found, counts, f.ARC_RADIUS_MISMATCH, line, r0, r1, centre if s.unit_mm == 1.0 else -centre)


@njit(cache=True)
def _note_spiral(s, line, r0, r1):
    """Count an arc that is read as a spiral; the worst is kept."""
    s.spirals += 1
    if s.spirals == 1 or abs(r0 - r1) > abs(s.spiral_start - s.spiral_end):
        s.spiral_line, s.spiral_start, s.spiral_end, s.spiral_unit_mm = line, r0, r1, s.unit_mm
