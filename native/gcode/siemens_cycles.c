/* CYCLE81 to CYCLE86 and CYCLE89 of a Sinumerik, at once or behind each move (MCALL).

   All begin with RTP, RFP, SDIS, DP, DPR, DTB: rapid to RFP + SDIS, feed to the depth, rapid to RTP. DP is absolute,
   DPR counts from RFP down; DTB is a dwell at the depth in seconds, below 0 in turns of the spindle (SINUMERIK 840D,
   Programming Guide Cycles, chapter 2; the strokes of CYCLE83 are those of the control's own CYCLE83.SPF). Newer controls have _GMODE, _DMODE and _AMODE behind, whose digits say which of
   two arguments counts (SINUMERIK 840D sl, Programming Manual Job Planning, external programming of cycles). */

#include "gcode/siemens_cycles.h"

#include "gcode/compensate.h"
#include "gcode/cutter_settings.h"
#include "gcode/cycles.h"
#include "gcode/feed.h"
#include "gcode/motion.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"
#include "gcode/siemens_patterns.h"

enum { RTP, RFP, SDIS, DP, DPR, DTB };
enum { FDEP = 5, FDPR, DAM, PECK_DTB, DTS, FRF, VARI, PECK_AXN, MDEP, VRT, DTD, DIS1 };               /* CYCLE83 */
enum { SDAC = 6, MPIT, PIT, POSS, SST, SST1, TAP_AXN, PITA, TECHNO, TAP_VARI, TAP_DAM, TAP_VRT };     /* CYCLE84 */
enum { FFR = 6, RFF };                                                                                /* CYCLE85 */
enum { SDIR = 6, RPA, RPO, RPAP };                                                                    /* CYCLE86 */
enum { BY_ARGUMENTS, INCREMENTAL, ABSOLUTE, SECONDS = 1, TURNS };                                     /* of _AMODE */
enum { AXIS_OF_G17 = 3, ROWS_OF_PECK = 4, ROWS_OF_CYCLE = 6, EVENTS_OF_CYCLE = 8, MOST_PECKS = 100000 };
static const double SAME_DEPTH = 1e-9, CHIP_MM = 1.0;
static const double LEAST_ADVANCE_MM = 0.6, MOST_ADVANCE_MM = 7.0, ADVANCES = 50.0, ADVANCE_FROM_MM = 30.0;

/* The way of CYCLE83 in programmed units: strokes, and what lies between them. */
typedef struct {
    double first, degression, factor, least, stated_back, first_share, dwell_s, start_dwell_s, last_dwell_s;
    bool leaves; /* the hole behind each stroke; else the chip is broken */
} Pecks;

static bool refuse(Block *b, int reason) {
    report(b, F_DIALECT_STATEMENT, (Says){.a = reason});
    return false;
}

static bool is_stated(const Block *b, int k) { return k < b->arguments && !isnan(b->argument[k]); }

static double or_zero(const Block *b, int k) { return is_stated(b, k) ? b->argument[k] : 0.0; }

/* --- modes of newer controls ---------------------------------------------------------------------------- */

/* Return the place of _GMODE among the arguments of a cycle; _DMODE and _AMODE follow. */
static int first_mode(int32_t cycle) {
    switch (cycle) {
    case V_CYCLE_PECK: return DIS1 + 1;
    case V_CYCLE_TAP: return TAP_VRT + 4;
    case V_CYCLE_REAM: return RFF + 1;
    case V_CYCLE_BORE_STOP: return RPAP + 2;
    default: return DTB + 1;
    }
}

/* Return the digit of _AMODE at a place, 0 = units. */
static int digit_of_mode(const Block *b, int place) {
    int64_t mode = (int64_t)or_zero(b, first_mode(b->cycle) + 2);
    for (int k = 0; k < place; k++)
        mode /= 10;
    return (int)(mode % 10);
}

/* Tell whether the modes say nothing but what is read: the depth of the tip, in G17. */
static bool are_modes_plain(const Block *b) {
    enum { MOST_MODE = 19999 }; /* the digits before these are not sure */
    const int first = first_mode(b->cycle);
    const double of_tip = or_zero(b, first), plane = or_zero(b, first + 1), amode = or_zero(b, first + 2);
    const bool in_plane = plane == 0.0 || fmod(plane, 10.0) == 0.0 || (fmod(plane, 10.0) == 1.0 && b->state->plane == V_PLANE_XY);
    return of_tip == 0.0 && plane >= 0.0 && in_plane && amode >= 0.0 && amode <= MOST_MODE && amode == floor(amode);
}

/* Find a depth below RFP that is stated absolutely or as a distance, as a digit of _AMODE says; NaN where that is not
   sure. */
static double depth_below(const Block *b, int absolute, int relative, int digit) {
    const double by_absolute = or_zero(b, RFP) - or_zero(b, absolute), by_relative = or_zero(b, relative);
    const bool both = digit == BY_ARGUMENTS && is_stated(b, absolute) && is_stated(b, relative);
    const bool r = is_stated(b, relative) && !(both && by_relative == 0.0); /* 0 is what is left out */
    const bool a = is_stated(b, absolute) && !(both && r && by_absolute == 0.0);
    if (digit > ABSOLUTE || !(digit == ABSOLUTE ? a : digit == INCREMENTAL ? r : a || r))
        return NAN;
    if (digit == BY_ARGUMENTS && a && r && fabs(by_absolute - by_relative) > SAME_DEPTH)
        return NAN;
    return digit == ABSOLUTE || (digit == BY_ARGUMENTS && !r) ? by_absolute : by_relative;
}

/* Return the seconds of a dwell, below 0 turns of the spindle unless a digit of _AMODE says so; NaN where it is none. */
static double dwell_of(const Block *b, int k, int digit) {
    const double value = or_zero(b, k);
    const bool turns = digit == TURNS || (digit == BY_ARGUMENTS && value < 0.0);
    if (digit > TURNS || (digit != BY_ARGUMENTS && value < 0.0) || (turns && value != 0.0 && !(b->state->rpm > 0.0)))
        return NAN;
    return turns && value != 0.0 ? fabs(value) * U_S_PER_MIN / b->state->rpm : value;
}

static bool is_tool_axis(const Block *b, int k) {
    const double axis = or_zero(b, k);
    return axis == 0.0 || (axis == AXIS_OF_G17 && b->state->plane == V_PLANE_XY);
}

/* --- what the arguments say ----------------------------------------------------------------------------- */

/* Find heights and dwell of the cycle of a block, in programmed units; return false where they are not as they are read. */
static bool take_heights(Block *b, Cycle *c) {
    if (!are_modes_plain(b))
        return false;
    const double reference = or_zero(b, RFP), depth = depth_below(b, DP, DPR, digit_of_mode(b, 0));
    const bool pecks = b->cycle == V_CYCLE_PECK;
    c->r = reference + or_zero(b, SDIS);
    c->bottom = reference - depth;
    c->clear = c->level = or_zero(b, RTP);
    c->r_known = c->level_known = true;
    c->dwell_s = pecks || b->cycle == V_CYCLE_DRILL ? 0.0 : dwell_of(b, DTB, digit_of_mode(b, 1));
    const bool idle = b->cycle != V_CYCLE_DRILL || or_zero(b, DTB) == 0.0;
    const double largest_mm = greater(greater(fabs(c->r), fabs(c->bottom)), fabs(c->clear)) * b->state->unit_mm;
    return is_stated(b, RTP) && is_stated(b, RFP) && depth > 0.0 && largest_mm <= FAR_MM && or_zero(b, SDIS) >= 0.0 &&
           c->clear >= c->r && idle && c->dwell_s >= 0.0;
}

/* Find the strokes of CYCLE83: DAM is what each is less than the one before, or below 0 its share of that. */
static bool take_pecks(const Block *b, const Cycle *c, Pecks *p) {
    const double depth = or_zero(b, RFP) - c->bottom, share = or_zero(b, FRF), last = dwell_of(b, DTD, BY_ARGUMENTS);
    const double first = depth_below(b, FDEP, FDPR, digit_of_mode(b, 3));
    p->leaves = or_zero(b, VARI) != 0.0;
    p->stated_back = or_zero(b, p->leaves ? DIS1 : VRT);
    p->first = isnan(first) ? first : lesser(first, depth);
    p->degression = or_zero(b, DAM);
    p->factor = p->degression < 0.0 ? -p->degression : 1.0;
    p->least = p->degression < 0.0 ? or_zero(b, MDEP) : p->first;
    p->first_share = share;
    p->dwell_s = dwell_of(b, PECK_DTB, digit_of_mode(b, 1));
    p->start_dwell_s = dwell_of(b, DTS, digit_of_mode(b, 2));
    p->last_dwell_s = or_zero(b, DTD) == 0.0 ? p->dwell_s : last;
    return p->first > 0.0 && p->factor <= 1.0 && p->stated_back >= 0.0 && share > 0.0 && share <= 1.0 &&
           or_zero(b, MDEP) >= 0.0 && is_tool_axis(b, PECK_AXN) &&
           p->dwell_s >= 0.0 && p->start_dwell_s >= 0.0 && p->last_dwell_s >= 0.0;
}

/* Return the next stroke where a rest is left; `nominal` is what the one before would have been, then this one. No
   stroke is less than the degression, or the least: the last two of these are alike. */
static double next_stroke(const Pecks *p, double *nominal, double rest) {
    const double degression = p->degression;
    if (degression > 0.0) {
        *nominal = greater(*nominal - degression, degression);
        if (rest <= *nominal)
            return rest;
        return rest <= 2.0 * degression ? 0.5 * rest : lesser(*nominal, rest - degression);
    }
    *nominal = greater(*nominal * p->factor, p->least);
    if (*nominal > rest + SAME_DEPTH)
        return rest;
    return rest - *nominal >= p->least - SAME_DEPTH ? *nominal : 0.5 * rest;
}

/* Return how far above a depth the tool goes back in, or back to break the chip. */
static double back_of(const Block *b, const Pecks *p, double depth) {
    const double unit_mm = b->state->unit_mm;
    const double advance_mm = depth * unit_mm <= ADVANCE_FROM_MM ? LEAST_ADVANCE_MM : lesser(depth * unit_mm / ADVANCES, MOST_ADVANCE_MM);
    return p->stated_back > 0.0 ? p->stated_back : (p->leaves ? advance_mm : CHIP_MM) / unit_mm;
}

/* Return how many strokes make a hole, MOST_PECKS for more. */
static int64_t strokes_of(const Pecks *p, double depth) {
    int64_t strokes = 1;
    for (double nominal = p->first, done = nominal; depth - done > SAME_DEPTH && strokes < MOST_PECKS; strokes++)
        done += next_stroke(p, &nominal, depth - done);
    return strokes;
}

static bool are_pecks_read(const Block *b, const Cycle *c) {
    Pecks p;
    const double way = or_zero(b, VARI);
    return (way == 0.0 || way == 1.0) && take_pecks(b, c, &p) && strokes_of(&p, or_zero(b, RFP) - c->bottom) < MOST_PECKS;
}

static bool is_tap_read(const Block *b) {
    const double then = or_zero(b, SDAC);
    return or_zero(b, PIT) != 0.0 && !is_stated(b, MPIT) && or_zero(b, SST) > 0.0 && or_zero(b, SST1) >= 0.0 &&
           (then == V_M3 || then == V_M4 || then == V_M5) && or_zero(b, PITA) <= 1.0 && or_zero(b, TAP_VARI) == 0.0 &&
           is_tool_axis(b, TAP_AXN);
}

static bool is_ream_read(const Block *b) {
    return or_zero(b, FFR) > 0.0 && or_zero(b, RFF) > 0.0 && b->state->feed_mode == V_PER_MINUTE;
}

/* A spindle that is turned to an angle, by which the tool could move aside, is not there. */
static bool is_bore_read(const Block *b) {
    const double direction = or_zero(b, SDIR);
    return or_zero(b, RPA) == 0.0 && or_zero(b, RPO) == 0.0 && or_zero(b, RPAP) == 0.0 && (direction == V_M3 || direction == V_M4);
}

/* Take the arguments of the cycle of a block; return false, with a finding, where they are not as they are read. */
static bool take_arguments(Block *b, Cycle *c) {
    if (!take_heights(b, c))
        return refuse(b, DR_REASON_HEIGHTS);
    switch (b->cycle) {
    case V_CYCLE_PECK: return are_pecks_read(b, c) || refuse(b, DR_REASON_PECKS);
    case V_CYCLE_TAP: return is_tap_read(b) || refuse(b, DR_REASON_PITCH);
    case V_CYCLE_REAM: return is_ream_read(b) || refuse(b, DR_REASON_REAM);
    case V_CYCLE_BORE_STOP: return is_bore_read(b) || refuse(b, DR_REASON_BORE);
    default: return true;
    }
}

/* --- holes ---------------------------------------------------------------------------------------------- */

/* CYCLE83: leave the hole behind each stroke, or go back a little with the feed to break the chip. */
static bool deep_hole(Block *b, const Cycle *c) {
    Pecks p;
    take_pecks(b, c, &p);
    const double slow_mm_s = c->mm_s * p.first_share, reference = or_zero(b, RFP);
    double nominal = p.first, below = nominal;
    const int64_t strokes = strokes_of(&p, reference - c->bottom);
    if (!has_cycle_room(b, ROWS_OF_CYCLE + ROWS_OF_PECK * strokes, EVENTS_OF_CYCLE))
        return false;
    go_along(b, c, c->r, true, RAPID_MM_S);
    for (int64_t k = 0; k < strokes; k++) {
        const bool last = k == strokes - 1;
        const double at = last ? c->bottom : reference - below;
        go_along(b, c, at, true, k == 0 ? slow_mm_s : c->mm_s);
        wait_here(b, last ? p.last_dwell_s : p.dwell_s);
        if (last)
            break;
        if (p.leaves) {
            go_along(b, c, c->r, true, RAPID_MM_S);
            wait_here(b, p.start_dwell_s);
            go_along(b, c, lesser(at + back_of(b, &p, below), c->r), true, RAPID_MM_S);
        } else {
            go_along(b, c, lesser(at + back_of(b, &p, below), c->r), true, c->mm_s);
        }
        below += next_stroke(&p, &nominal, at - c->bottom);
    }
    go_along(b, c, c->clear, true, RAPID_MM_S);
    return true;
}

/* CYCLE84: tap at SST turns and the pitch PIT, below 0 a left thread; out at SST1; the spindle then turns as SDAC says. */
static bool tapped_hole(Block *b, Cycle *c) {
    State *s = b->state;
    const double rpm = s->rpm, in_rpm = or_zero(b, SST), pitch_mm = or_zero(b, PIT) * s->unit_mm, then = or_zero(b, SDAC);
    const double out_rpm = or_zero(b, SST1) == 0.0 ? in_rpm : or_zero(b, SST1);
    const int32_t direction = pitch_mm < 0.0 ? -1 : 1;
    if (!has_cycle_room(b, ROWS_OF_CYCLE, EVENTS_OF_CYCLE))
        return false;
    go_along(b, c, c->r, true, RAPID_MM_S);
    s->rpm = in_rpm;
    turn_spindle(b, c, direction);
    go_along(b, c, c->bottom, true, in_rpm * fabs(pitch_mm) / U_S_PER_MIN);
    wait_here(b, c->dwell_s);
    turn_spindle(b, c, 0);
    s->rpm = out_rpm;
    turn_spindle(b, c, -direction);
    go_along(b, c, c->r, true, out_rpm * fabs(pitch_mm) / U_S_PER_MIN);
    turn_spindle(b, c, 0);
    s->rpm = rpm;
    if (then != V_M5)
        turn_spindle(b, c, then == V_M4 ? -1 : 1);
    go_along(b, c, c->clear, true, RAPID_MM_S);
    return true;
}

/* CYCLE85: ream at the feed FFR, and out of the hole at RFF, per minute. */
static bool reamed_hole(Block *b, const Cycle *c) {
    const double in_mm_s = or_zero(b, FFR) * b->state->unit_mm / U_S_PER_MIN;
    const double out_mm_s = or_zero(b, RFF) * b->state->unit_mm / U_S_PER_MIN;
    if (!has_cycle_room(b, ROWS_OF_CYCLE, EVENTS_OF_CYCLE))
        return false;
    go_along(b, c, c->r, true, RAPID_MM_S);
    go_along(b, c, c->bottom, true, in_mm_s);
    wait_here(b, c->dwell_s);
    go_along(b, c, c->r, true, out_mm_s);
    go_along(b, c, c->clear, true, RAPID_MM_S);
    return true;
}

/* CYCLE86: bore, and leave with the spindle at rest. */
static bool bored_hole(Block *b, const Cycle *c) {
    if (!has_cycle_room(b, ROWS_OF_CYCLE, EVENTS_OF_CYCLE))
        return false;
    go_along(b, c, c->r, true, RAPID_MM_S);
    turn_spindle(b, c, or_zero(b, SDIR) == V_M4 ? -1 : 1);
    go_along(b, c, c->bottom, true, c->mm_s);
    wait_here(b, c->dwell_s);
    turn_spindle(b, c, 0);
    go_along(b, c, c->clear, true, RAPID_MM_S);
    return true;
}

/* Make the hole of a cycle where the tool stands; return false where there is no room for its rows. */
static bool hole_of(Block *b, Cycle *c) {
    switch (c->motion) {
    case V_CYCLE_PECK: return deep_hole(b, c);
    case V_CYCLE_TAP: return tapped_hole(b, c);
    case V_CYCLE_REAM: return reamed_hole(b, c);
    case V_CYCLE_BORE_STOP: return bored_hole(b, c);
    default: return drill_here(b, c);
    }
}

/* Drill where the tool stands, with the feed in force or a stated one. */
static bool drill(Block *b, double mm_s) {
    State *s = b->state;
    Cycle c = cycle_of(b);
    const int8_t exact_stop = s->exact_stop;
    if (s->cutter_mode & S_CUTTER_ON) {
        refuse_under_compensation(b, s->cutter_code);
        return true;
    }
    if (s->zero_in_doubt)
        return !refuse(b, s->zero_in_doubt == S_ZERO_OFF ? DR_REASON_NO_OFFSET : DR_REASON_ZERO_AND_TIP);
    c.motion = b->cycle;
    if (!take_arguments(b, &c))
        return true;
    const bool own_feed = c.motion == V_CYCLE_TAP || c.motion == V_CYCLE_REAM;
    c.mm_s = mm_s;
    const int finding = own_feed || mm_s > 0.0 ? F_OK : s->feed_mode == V_INVERSE_TIME ? F_NO_INVERSE_TIME : feed_speed(b, 0.0, &c.mm_s);
    if (finding != F_OK) {
        report_speed(b, finding);
        return true;
    }
    s->exact_stop = 1; /* a rounded corner would be a hole that is not deep enough */
    const bool done = hole_of(b, &c);
    s->exact_stop = exact_stop;
    return done;
}

/* --- blocks --------------------------------------------------------------------------------------------- */

static bool stands_alone(const Block *b) {
    for (int index = 0; index < V_LETTERS; index++)
        if (b->has[index])
            return false;
    for (int group = 0; group < V_GROUPS; group++)
        if (b->g[group] >= 0)
            return false;
    return b->m_codes[0] < 0 && !b->corner && !b->tip;
}

/* CYCLE800: the plane of the tool stays that of the part where no axis turns and nothing shifts; a retract would be lost. */
static bool swivel(Block *b) {
    enum { RETRACT = 0, FIRST_OF_FRAME = 4, BEHIND_FRAME = 13 };
    bool plain = or_zero(b, RETRACT) == 0.0 && !b->modal;
    for (int k = FIRST_OF_FRAME; k < BEHIND_FRAME; k++)
        plain = plain && or_zero(b, k) == 0.0;
    if (plain)
        note(b, S_NOTE_STATEMENT, 0);
    return plain || !refuse(b, DR_REASON_TILTED);
}

/* Carry out a block with a cycle or MCALL: drill, or keep what is drilled behind each move that follows. */
bool cycle_call(Block *b) {
    State *s = b->state;
    Cycle c = cycle_of(b);
    if (!stands_alone(b) || !(b->modal || b->cycle))
        return !refuse(b, DR_REASON_CYCLE_BESIDE);
    if (b->cycle == V_CYCLE_SWIVEL)
        return swivel(b);
    if (is_pattern(b->cycle))
        return drill_pattern(b);
    if (!b->modal)
        return drill(b, 0.0);
    s->modal_call = 0;
    if (!b->cycle || !take_arguments(b, &c))
        return true;
    s->modal_call = b->cycle;
    s->modal_unit_mm = s->unit_mm;
    s->modal_arguments = b->arguments;
    for (int k = 0; k < b->arguments; k++)
        s->modal_argument[k] = b->argument[k];
    return true;
}

/* Drill behind the move of the block; return false where there is no room. */
bool hole_behind(Block *b) {
    enum { OWN = 2 };
    const double kind = b->argument[0], mm_s = b->argument[1] * b->state->unit_mm / U_S_PER_MIN;
    b->arguments -= OWN;
    for (int k = 0; k < b->arguments; k++)
        b->argument[k] = b->argument[k + OWN];
    b->cycle = (int32_t)kind;
    if (b->arguments < OWN || !(mm_s > 0.0) || !(kind == V_CYCLE_PECK || kind == V_CYCLE_TAP || kind == V_CYCLE_REAM))
        return !refuse(b, DR_REASON_HOLE);
    return drill(b, mm_s);
}

/* Drill behind a move under MCALL; return false where there is no room. */
bool modal_cycle(Block *b) {
    State *s = b->state;
    if (!s->modal_call)
        return true;
    if (b->g[V_NON_MODAL] == V_G53)
        return !refuse(b, DR_REASON_MODAL_ZERO);
    const double unit_mm = s->unit_mm;
    b->cycle = s->modal_call;
    b->arguments = s->modal_arguments;
    for (int k = 0; k < b->arguments; k++)
        b->argument[k] = s->modal_argument[k];
    s->unit_mm = s->modal_unit_mm;
    const bool done = drill(b, 0.0);
    s->unit_mm = unit_mm;
    return done;
}
