"""The motion of a block: straight moves, arcs as chords, machine moves. Compiled."""

import math

import numpy as np
from numba import njit

from gcode2krl.gcode import findings as f
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
    CANCELLED,
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

_FAR_MM = 1e6
_SLOWEST = 0.1  # units/min, LinuxCNC's floor under inverse time
_MOST_MISFITS = 10  # arcs whose lines are kept
_F, _I, _J, _K, _P, _R, _X, _Y, _Z = (ord(c) - 65 for c in "FIJKPRXYZ")


@njit(cache=True)
def move(line, s, rows, counts, found, options, offsets, has, word, special):
    """Carry out the motion of a block; return False where the row buffer is too small for it."""
    if s.doubt & DOUBT_MOTION:
        follow(s, offsets, has, word)
        s.doubt |= DOUBT_Z  # a cycle may end anywhere along the tool
    elif s.motion == CANCELLED:
        report(found, counts, f.NO_MOTION_MODE, line, s.motion_line, 0.0)
        s.doubt |= DOUBT_MOTION
        follow(s, offsets, has, word)
    elif special == 530 and s.motion > 1:
        report(found, counts, f.G53_NEEDS_RAPID_OR_FEED, line, 0.0, 0.0)
        s.doubt |= DOUBT_POSITION
    elif special == 530 and not s.absolute:
        report_unless(s, DOUBT_DISTANCE, found, counts, f.G53_INCREMENTAL, line, 0.0, 0.0)
        s.doubt |= DOUBT_POSITION
    elif special == 40 and s.motion > 1:
        report(found, counts, f.DWELL_WITH_ARC, line, 0.0, 0.0)
        follow(s, offsets, has, word)
    elif s.motion <= 1:
        _straight(line, s, rows, counts, found, offsets, has, word, special == 530)
    else:
        _note_unknown_start(s, line)
        end = target(s, offsets, has, word)
        if not _arc(line, s, rows, counts, found, options, offsets, has, word):
            return False
        s.x, s.y, s.z = end  # also after a wrong arc, so that one mistake is one finding
        learn(s, has)
    largest = max(abs(s.x), abs(s.y), abs(s.z))
    s.largest_mm = max(s.largest_mm, largest)
    if largest > _FAR_MM:
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
    emit(s, rows, counts[ROWS], line, np.inf, 1, 1, -1)
    counts[ROWS] += 1


@njit(cache=True)
def _note_unknown_start(s, line):
    if not (s.known_x and s.known_y and s.known_z) and s.unknown_feed_line == 0:
        s.unknown_feed_line = line


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
def _report_speed(s, found, counts, finding, line):
    """Report what is wrong with the feed, once: the moves after it rest on it."""
    if finding == f.NO_INVERSE_TIME:
        report_unless(s, DOUBT_FEED_MODE, found, counts, finding, line, s.feed_mode_line, 0.0)
    elif finding == f.FEED_PER_REV_STOPPED:
        report_unless(s, DOUBT_SPEED | DOUBT_FEED_MODE, found, counts, finding, line, s.feed_mode_line, 0.0)
        s.doubt |= DOUBT_SPEED
    else:
        dropped = s.feed_mode_line if s.feed_mode != 93 else 0
        report_unless(s, DOUBT_FEED | DOUBT_FEED_MODE, found, counts, finding, line, dropped, s.feed_mode)
        s.doubt |= DOUBT_FEED


@njit(cache=True)
def _straight(line, s, rows, counts, found, offsets, has, word, machine):
    """G0 and G1, also under G53."""
    if machine:
        offset = 0.0 if math.isnan(s.length_offset) else s.length_offset
        x = word[_X] * s.unit_mm if has[_X] else s.x
        y = word[_Y] * s.unit_mm if has[_Y] else s.y
        z = word[_Z] * s.unit_mm - offset if has[_Z] else s.z
    else:
        x, y, z = target(s, offsets, has, word)
    speed = np.inf
    if s.motion == 1:
        _note_unknown_start(s, line)
        length = math.sqrt((x - s.x) ** 2 + (y - s.y) ** 2 + (z - s.z) ** 2)
        finding, speed = _feed_speed(s, has, word, length)
        if finding != f.OK:
            _report_speed(s, found, counts, finding, line)
    s.x, s.y, s.z = x, y, z
    if machine:
        s.known_x &= not has[_X]
        s.known_y &= not has[_Y]
        s.known_z &= not has[_Z]
    else:
        learn(s, has)
    emit(s, rows, counts[ROWS], line, speed, s.motion == 0, machine, -1)
    counts[ROWS] += 1


@njit(cache=True)
def _arc(line, s, rows, counts, found, options, offsets, has, word):
    """G2 and G3 as chords; return False where the row buffer is too small."""
    ccw = s.motion == 3
    start = (s.x, s.y, s.z)
    end = target(s, offsets, has, word)
    first = 0 if s.plane == 17 else (2 if s.plane == 18 else 1)  # index of u
    second = (first + 1) % 3
    third = (first + 2) % 3
    in_doubt = (
        (DOUBT_X << first) | (DOUBT_X << second) | DOUBT_UNIT | DOUBT_PLANE | DOUBT_DISTANCE | DOUBT_CENTRE
    )
    u0, v0, w0 = start[first], start[second], start[third]
    u1, v1, w1 = end[first], end[second], end[third]
    has_u, has_v = has[_I + first], has[_I + second]
    if has[_I + third]:
        value = word[_I + third]
        if value != 0.0:
            report_unless(s, DOUBT_PLANE, found, counts, f.ARC_WRONG_OFFSET, line, 73 + third, value, s.plane)
            return True
        if not counts[MUTE]:
            note(s, NOTE_CENTRE, line, 73 + third)
    if has[_R]:
        if has_u or has_v:
            report(found, counts, f.ARC_BOTH_FORMATS, line, 0.0, 0.0)
            return True
        finding, cu, cv = centre_from_radius(u0, v0, u1, v1, word[_R] * s.unit_mm, ccw)
        if finding != f.OK:
            radius, chord = abs(word[_R]) * s.unit_mm, math.hypot(u1 - u0, v1 - v0)
            report_unless(s, in_doubt, found, counts, finding, line, radius, chord)
            return True
    else:
        if not has_u and not has_v:
            report(found, counts, f.ARC_NO_CENTRE, line, s.motion * 10, s.motion_line)
            return True
        if s.arc_absolute and not (has_u and has_v):
            report_unless(s, DOUBT_CENTRE, found, counts, f.ARC_NEEDS_OFFSETS, line, 0.0, 0.0)
            return True
        i = word[_I + first] * s.unit_mm if has_u else 0.0
        j = word[_I + second] * s.unit_mm if has_v else 0.0
        cu = i + (offsets[s.work_offset, first] if s.arc_absolute else u0)
        cv = j + (offsets[s.work_offset, second] if s.arc_absolute else v0)
    turns = 1
    if has[_P]:
        turns = whole(word[_P])
        if turns < 1 or turns > 1000:
            report(found, counts, f.ARC_TURNS, line, word[_P], 0.0)
            return True
    r0 = math.hypot(u0 - cu, v0 - cv)
    r1 = math.hypot(u1 - cu, v1 - cv)
    if r0 < SMALLEST_RADIUS_MM or r1 < SMALLEST_RADIUS_MM:
        report_unless(s, in_doubt, found, counts, f.ARC_ZERO_RADIUS, line, 0.0, 0.0)
        return True
    fit = radii_fit(r0, r1, s.unit_mm)
    if fit == MISFIT:
        known = (s.known_x, s.known_y, s.known_z)
        if not (known[first] and known[second]):
            _report_unknown_start(s, counts, found, line)
        elif not rests_on_doubt(s, counts, in_doubt):
            cu += u0 - offsets[s.work_offset, first] if s.arc_absolute else offsets[s.work_offset, first] - u0
            cv += (
                v0 - offsets[s.work_offset, second] if s.arc_absolute else offsets[s.work_offset, second] - v0
            )
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
        emit(s, rows, counts[ROWS], line, speed, 0, 0, s.arcs)
        counts[ROWS] += 1
    s.arcs += 1
    return True


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
        centre = 901 if s.arc_absolute else 911
        report(found, counts, f.ARC_RADIUS_MISMATCH, line, r0, r1, centre if s.unit_mm == 1.0 else -centre)


@njit(cache=True)
def _note_spiral(s, line, r0, r1):
    """Count an arc that is read as a spiral; the worst is kept."""
    s.spirals += 1
    if s.spirals == 1 or abs(r0 - r1) > abs(s.spiral_start - s.spiral_end):
        s.spiral_line, s.spiral_start, s.spiral_end, s.spiral_unit_mm = line, r0, r1, s.unit_mm
