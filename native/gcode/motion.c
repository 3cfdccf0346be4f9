/* The motion of a block: straight moves, arcs as chords, machine moves. */

#include "gcode/motion.h"

#include "gcode/arcs.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"
#include "gcode/settings.h"

static const double SLOWEST = 0.1; /* units/min, LinuxCNC's floor under inverse time */
enum { MOST_MISFITS = 10 };        /* arcs whose lines are kept */
enum { MOST_TURNS = 1000 };

static void stand_at(State *s, const double position_mm[3]) {
    s->x = position_mm[0];
    s->y = position_mm[1];
    s->z = position_mm[2];
}

static double largest_coordinate_mm(const State *s) {
    return larger(larger(fabs(s->x), fabs(s->y)), fabs(s->z));
}

static void note_unknown_start(Block *b) {
    State *s = b->state;
    if (!(s->known_x && s->known_y && s->known_z) && s->unknown_feed_line == 0)
        s->unknown_feed_line = b->line;
}

/* --- feed ----------------------------------------------------------------------------------------------- */

/* Find the speed of a feed move of the given whole length, or return the finding. */
static int feed_speed(const Block *b, double length_mm, double *mm_s) {
    const State *s = b->state;
    if (s->feed_mode == V_INVERSE_TIME) {
        if (!b->has[V_WORD_F])
            return F_NO_INVERSE_TIME;
        if (b->word[V_WORD_F] <= 0.0)
            return F_NO_FEED;
        *mm_s = larger(length_mm * b->word[V_WORD_F], SLOWEST * s->unit_mm) / U_S_PER_MIN;
        return F_OK;
    }
    if (s->feed <= 0.0)
        return F_NO_FEED;
    if (s->feed_mode == V_PER_REVOLUTION) {
        if (s->rpm <= 0.0)
            return F_FEED_PER_REV_STOPPED;
        *mm_s = s->feed * s->rpm / U_S_PER_MIN;
        return F_OK;
    }
    *mm_s = s->feed / U_S_PER_MIN;
    return F_OK;
}

/* Report what is wrong with the feed, once: the moves after it rest on it. */
static void report_speed(Block *b, int finding) {
    State *s = b->state;
    if (finding == F_NO_INVERSE_TIME) {
        report_unless(b, S_DOUBT_FEED_MODE, finding, (Says){.a = s->feed_mode_line});
    } else if (finding == F_FEED_PER_REV_STOPPED) {
        report_unless(b, S_DOUBT_SPEED | S_DOUBT_FEED_MODE, finding, (Says){.a = s->feed_mode_line});
        s->doubt |= S_DOUBT_SPEED;
    } else {
        const int32_t dropped = s->feed_mode != V_INVERSE_TIME ? s->feed_mode_line : 0;
        report_unless(b, S_DOUBT_FEED | S_DOUBT_FEED_MODE, finding, (Says){.a = dropped, .b = s->feed_mode});
        s->doubt |= S_DOUBT_FEED;
    }
}

/* --- straight moves ------------------------------------------------------------------------------------- */

/* Find where a block under G53 leads, the coordinates being the machine's. */
static void machine_target(const Block *b, double to_mm[3]) {
    const State *s = b->state;
    to_mm[0] = b->has[V_WORD_X] ? b->word[V_WORD_X] * s->unit_mm : s->x;
    to_mm[1] = b->has[V_WORD_Y] ? b->word[V_WORD_Y] * s->unit_mm : s->y;
    to_mm[2] = b->has[V_WORD_Z] ? b->word[V_WORD_Z] * s->unit_mm - length_offset_of(s) : s->z;
}

/* G0 and G1, also under G53. */
static void straight(Block *b, bool by_machine) {
    State *s = b->state;
    double to_mm[3], mm_s = RAPID_MM_S;
    if (by_machine)
        machine_target(b, to_mm);
    else
        target(b, to_mm);
    if (s->motion == V_MOTION_LINE) {
        note_unknown_start(b);
        const double dx = to_mm[0] - s->x, dy = to_mm[1] - s->y, dz = to_mm[2] - s->z;
        mm_s = 0.0;
        const int finding = feed_speed(b, sqrt(dx * dx + dy * dy + dz * dz), &mm_s);
        if (finding != F_OK)
            report_speed(b, finding);
    }
    stand_at(s, to_mm);
    if (by_machine) {
        s->known_x &= !b->has[V_WORD_X];
        s->known_y &= !b->has[V_WORD_Y];
        s->known_z &= !b->has[V_WORD_Z];
    } else {
        learn(b);
    }
    emit(b->machine, b->line, mm_s, s->motion == V_MOTION_RAPID, by_machine, NO_ARC);
}

/* G28 and G30: by way of the programmed point, then the named axes (or all) to the machine's home. */
void machine_home(Block *b, bool any_axis) {
    State *s = b->state;
    const bool *has = b->has;
    const double *home_mm = b->g[V_NON_MODAL] == V_G28 ? s->home_28 : s->home_30;
    double by_way_mm[3];
    target(b, by_way_mm);
    stand_at(s, by_way_mm);
    emit(b->machine, b->line, RAPID_MM_S, true, true, NO_ARC);
    if (has[V_WORD_X] || !any_axis) {
        s->x = home_mm[0];
        s->known_x = 0;
    }
    if (has[V_WORD_Y] || !any_axis) {
        s->y = home_mm[1];
        s->known_y = 0;
    }
    if (has[V_WORD_X] && has[V_WORD_Y])
        s->known_z = 0; /* the robot goes to HOME: the old height must not come back by itself */
    if (has[V_WORD_Z] || !any_axis) {
        s->z = home_mm[2] - length_offset_of(s);
        s->known_z = 0;
    }
    emit(b->machine, b->line, RAPID_MM_S, true, true, NO_ARC);
}

/* --- arcs: the centre ----------------------------------------------------------------------------------- */

/* An arc: its axes in the order u, v, w, its ends, its centre, and on what it rests that may be in doubt. */
typedef struct {
    int first, second, third;
    Point from, to, centre;
    double from_w, to_w, to_mm[3];
    double from_radius_mm, to_radius_mm;
    int32_t rests_on;
} Arc;

static Arc arc_of(const Block *b) {
    const State *s = b->state;
    const double here_mm[3] = {s->x, s->y, s->z};
    Arc arc = {.first = s->plane == V_PLANE_XY ? 0 : s->plane == V_PLANE_ZX ? 2 : 1};
    arc.second = (arc.first + 1) % 3;
    arc.third = (arc.first + 2) % 3;
    target(b, arc.to_mm);
    arc.from = (Point){here_mm[arc.first], here_mm[arc.second]};
    arc.to = (Point){arc.to_mm[arc.first], arc.to_mm[arc.second]};
    arc.from_w = here_mm[arc.third];
    arc.to_w = arc.to_mm[arc.third];
    arc.rests_on = S_DOUBT_X << arc.first | S_DOUBT_X << arc.second | S_DOUBT_UNIT | S_DOUBT_PLANE |
                   S_DOUBT_DISTANCE | S_DOUBT_CENTRE;
    return arc;
}

/* Tell whether the centre word along the arc's axis is 0 or missing; report it where it is not. */
static bool axis_word_is_harmless(Block *b, const Arc *arc) {
    const int index = V_WORD_I + arc->third, letter = CH_LETTER_I + arc->third;
    if (!b->has[index])
        return true;
    if (b->word[index] != 0.0) {
        const Says says = {.a = letter, .b = b->word[index], .c = b->state->plane};
        report_unless(b, S_DOUBT_PLANE, F_ARC_WRONG_OFFSET, says);
        return false;
    }
    if (!b->counts->mute)
        note(b, S_NOTE_CENTRE, letter);
    return true;
}

/* Find the centre of an arc with R; return false where there is none. */
static bool centre_by_radius(Block *b, Arc *arc) {
    const State *s = b->state;
    if (b->has[V_WORD_I + arc->first] || b->has[V_WORD_I + arc->second]) {
        report(b, F_ARC_BOTH_FORMATS, (Says){0});
        return false;
    }
    const double radius_mm = b->word[V_WORD_R] * s->unit_mm;
    const bool ccw = s->motion == V_MOTION_ARC_CCW;
    const int finding = centre_from_radius(arc->from, arc->to, radius_mm, ccw, &arc->centre);
    if (finding != F_OK)
        report_unless(b, arc->rests_on, finding,
                      (Says){.a = fabs(radius_mm), .b = distance(arc->to, arc->from)});
    return finding == F_OK;
}

/* Find the centre of an arc with I, J, K; return false where there is none. */
static bool centre_by_words(Block *b, Arc *arc) {
    const State *s = b->state;
    const bool has_u = b->has[V_WORD_I + arc->first], has_v = b->has[V_WORD_I + arc->second];
    if (!has_u && !has_v) {
        report(b, F_ARC_NO_CENTRE, (Says){.a = s->motion * V_TENFOLD, .b = s->motion_line});
        return false;
    }
    if (s->arc_absolute && !(has_u && has_v)) {
        report_unless(b, S_DOUBT_CENTRE, F_ARC_NEEDS_OFFSETS, (Says){0});
        return false;
    }
    const double u = has_u ? b->word[V_WORD_I + arc->first] * s->unit_mm : 0.0;
    const double v = has_v ? b->word[V_WORD_I + arc->second] * s->unit_mm : 0.0;
    const double *base_mm = work_offset_mm(b);
    arc->centre.u = u + (s->arc_absolute ? base_mm[arc->first] : arc->from.u);
    arc->centre.v = v + (s->arc_absolute ? base_mm[arc->second] : arc->from.v);
    return true;
}

/* --- arcs: what does not fit ---------------------------------------------------------------------------- */

/* Return the centre as the other of G90.1 and G91.1 would have it. */
static Point other_centre(const Block *b, const Arc *arc) {
    const double *base_mm = work_offset_mm(b);
    const Point base = {base_mm[arc->first], base_mm[arc->second]};
    const Point centre = arc->centre, from = arc->from;
    if (b->state->arc_absolute)
        return (Point){centre.u + (from.u - base.u), centre.v + (from.v - base.v)};
    return (Point){centre.u + (base.u - from.u), centre.v + (base.v - from.v)};
}

/* An arc from a position that was never programmed cannot fit: the cause is the first such move. */
static void report_unknown_start(Block *b) {
    State *s = b->state;
    if (s->unknown_reported)
        b->counts->consequences++;
    else
        report_at(b, (int32_t)least(b->line, s->unknown_feed_line), F_UNKNOWN_START,
                  (Says){.a = s->absolute ? 0 : s->distance_line});
    s->unknown_reported = 1;
}

static void report_misfit(Block *b, const Arc *arc) {
    State *s = b->state;
    if (b->counts->mute)
        return;
    const Point other = other_centre(b, arc);
    s->misfits++;
    s->misfits_other_centre +=
        radii_fit(distance(arc->from, other), distance(arc->to, other), s->unit_mm) != MISFIT;
    if (s->misfits > MOST_MISFITS)
        return;
    const int centre = s->arc_absolute ? V_G90_1 : V_G91_1;
    report(b, F_ARC_RADIUS_MISMATCH,
           (Says){arc->from_radius_mm, arc->to_radius_mm, s->unit_mm == 1.0 ? centre : -centre});
}

static void misfit(Block *b, const Arc *arc) {
    const State *s = b->state;
    const int8_t known[3] = {s->known_x, s->known_y, s->known_z};
    if (!(known[arc->first] && known[arc->second]))
        report_unknown_start(b);
    else if (!rests_on_doubt(b, arc->rests_on))
        report_misfit(b, arc);
}

/* Count an arc that is read as a spiral; the worst is kept. */
static void note_spiral(Block *b, const Arc *arc) {
    State *s = b->state;
    s->spirals++;
    if (s->spirals > 1 &&
        !(fabs(arc->from_radius_mm - arc->to_radius_mm) > fabs(s->spiral_start - s->spiral_end)))
        return;
    s->spiral_line = b->line;
    s->spiral_start = arc->from_radius_mm;
    s->spiral_end = arc->to_radius_mm;
    s->spiral_unit_mm = s->unit_mm;
}

/* --- arcs: the chords ----------------------------------------------------------------------------------- */

/* Write the rows of an arc; the last ends exactly where the block says. */
static void emit_chords(Block *b, const Arc *arc, double angle, double sweep, int64_t chords, double mm_s) {
    State *s = b->state;
    double at_mm[3];
    for (int64_t k = 1; k <= chords; k++) {
        const double part = (double)k / (double)chords;
        const double r = arc->from_radius_mm + (arc->to_radius_mm - arc->from_radius_mm) * part;
        at_mm[arc->first] = arc->centre.u + r * cos(angle + sweep * part);
        at_mm[arc->second] = arc->centre.v + r * sin(angle + sweep * part);
        at_mm[arc->third] = arc->from_w + (arc->to_w - arc->from_w) * part;
        stand_at(s, k == chords ? arc->to_mm : at_mm);
        emit(b->machine, b->line, mm_s, false, false, s->arcs);
    }
    s->arcs++;
}

/* Write an arc whose radii fit; return false, with nothing written, where there is no room for its rows. */
static bool chords(Block *b, const Arc *arc, int64_t turns, Fit fit) {
    const Machine *machine = b->machine;
    double angle, mm_s = 0.0;
    const bool ccw = b->state->motion == V_MOTION_ARC_CCW;
    const double sweep = sweep_angle(arc->from, arc->to, arc->centre, ccw, turns, &angle);
    const double radius_mm = larger(arc->from_radius_mm, arc->to_radius_mm);
    const int64_t count = chord_count(radius_mm, sweep, machine->chord_tolerance_mm);
    if (count > MOST_CHORDS) {
        report_unless(b, arc->rests_on, F_ARC_TOO_LONG, (Says){.a = radius_mm});
        return true;
    }
    if (b->counts->rows + count > machine->rows.feed_mm_s.rows) {
        b->counts->rows_wanted = b->counts->rows + count;
        return false;
    }
    const double along_mm = 0.5 * (arc->from_radius_mm + arc->to_radius_mm) * sweep;
    const int finding = feed_speed(b, hypot(along_mm, arc->to_w - arc->from_w), &mm_s);
    if (finding != F_OK) {
        report_speed(b, finding);
        return true;
    }
    if (fit != FITS)
        note_spiral(b, arc);
    learn(b);
    emit_chords(b, arc, angle, sweep, count, mm_s);
    return true;
}

/* Carry out G2 or G3; return false where there is no room for its rows. */
static bool arc_move(Block *b, Arc *arc) {
    if (!axis_word_is_harmless(b, arc))
        return true;
    if (!(b->has[V_WORD_R] ? centre_by_radius(b, arc) : centre_by_words(b, arc)))
        return true;
    const int32_t turns = b->has[V_WORD_P] ? whole(b->word[V_WORD_P]) : 1;
    if (turns < 1 || turns > MOST_TURNS) {
        report(b, F_ARC_TURNS, (Says){.a = b->word[V_WORD_P]});
        return true;
    }
    arc->from_radius_mm = distance(arc->from, arc->centre);
    arc->to_radius_mm = distance(arc->to, arc->centre);
    if (smaller(arc->from_radius_mm, arc->to_radius_mm) < SMALLEST_RADIUS_MM) {
        report_unless(b, arc->rests_on, F_ARC_ZERO_RADIUS, (Says){0});
        return true;
    }
    const Fit fit = radii_fit(arc->from_radius_mm, arc->to_radius_mm, b->state->unit_mm);
    if (fit != MISFIT)
        return chords(b, arc, turns, fit);
    misfit(b, arc);
    return true;
}

/* --- the motion of a block ------------------------------------------------------------------------------ */

static void check_distance(Block *b) {
    State *s = b->state;
    const double largest_mm = largest_coordinate_mm(s);
    s->largest_mm = larger(s->largest_mm, largest_mm);
    if (largest_mm <= FAR_MM)
        return;
    report_unless(b, S_DOUBT_POSITION | S_DOUBT_UNIT | S_DOUBT_DISTANCE, F_TOO_FAR, (Says){.a = largest_mm});
    stand_at(s, (double[3]){0.0, 0.0, 0.0});
    s->doubt |= S_DOUBT_POSITION;
}

/* Carry out the motion of a block; return false where there is no room for its rows. */
bool move(Block *b) {
    State *s = b->state;
    const int32_t special = b->g[V_NON_MODAL];
    if (s->doubt & S_DOUBT_MOTION) {
        follow(b);
        s->doubt |= S_DOUBT_Z; /* a cycle may end anywhere along the tool */
    } else if (s->motion == V_MOTION_CANCELLED) {
        report(b, F_NO_MOTION_MODE, (Says){.a = s->motion_line});
        s->doubt |= S_DOUBT_MOTION;
        follow(b);
    } else if (special == V_G53 && s->motion >= V_MOTION_ARC_CW) {
        report(b, F_G53_NEEDS_RAPID_OR_FEED, (Says){0});
        s->doubt |= S_DOUBT_POSITION;
    } else if (special == V_G53 && !s->absolute) {
        report_unless(b, S_DOUBT_DISTANCE, F_G53_INCREMENTAL, (Says){0});
        s->doubt |= S_DOUBT_POSITION;
    } else if (special == V_G4 && s->motion >= V_MOTION_ARC_CW) {
        report(b, F_DWELL_WITH_ARC, (Says){0});
        follow(b);
    } else if (s->motion <= V_MOTION_LINE) {
        straight(b, special == V_G53);
    } else {
        note_unknown_start(b);
        Arc arc = arc_of(b);
        if (!arc_move(b, &arc))
            return false;
        stand_at(s, arc.to_mm); /* also after a wrong arc, so that one mistake is one finding */
        learn(b);
    }
    check_distance(b);
    return true;
}
