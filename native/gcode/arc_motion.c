/* G2 and G3: the centre from R or from I, J, K, and the chords that replace the arc. */

#include "gcode/arc_motion.h"

#include "gcode/compensate.h"
#include "gcode/feed.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"

enum { MOST_MISFITS = 10 };        /* arcs whose lines are kept */
enum { MOST_TURNS = 1000 };

/* --- the centre ---------------------------------------------------------------------------------------- */

Arc arc_of(const Block *b) {
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
    const int index = V_WORD_I + arc->third, letter = 'I' + arc->third;
    if (!b->has[index])
        return true;
    const bool plane_named = b->has[V_WORD_X + arc->second] || b->has[V_WORD_I + arc->second] ||
                             !b->has[V_WORD_X + arc->third];
    if (b->word[index] != 0.0 || !plane_named) { /* X Z I K name the plane of G18, under G17 it is missing */
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

/* Find the direction in the plane in which the last row ends; return false where it has none, or another frame. */
static bool direction_before(const Block *b, const Arc *arc, Point *along) {
    const State *s = b->state;
    const Rows *rows = &b->machine->rows;
    const int64_t last = b->counts->rows - 1;
    if (compensates(s))
        return contour_direction(s, along);
    if (s->rotated || last < 1 || AT(rows->machine, last))
        return false;
    if (s->arc_end_rows == b->counts->rows) {
        *along = (Point){s->arc_end[0], s->arc_end[1]};
        return true;
    }
    const Point to = {CELL(rows->position_mm, last, arc->first), CELL(rows->position_mm, last, arc->second)};
    const Point from = {CELL(rows->position_mm, last - 1, arc->first), CELL(rows->position_mm, last - 1, arc->second)};
    const double length_mm = distance(from, to);
    *along = (Point){(to.u - from.u) / length_mm, (to.v - from.v) / length_mm};
    return AT(rows->arc, last) == NO_ARC && length_mm > SMALLEST_RADIUS_MM && distance(to, arc->from) < SMALLEST_RADIUS_MM;
}

/* CT: the arc that leaves the way of the row before at its end. */
static bool centre_by_tangent(const Block *b, Arc *arc) {
    const Point way = {arc->to.u - arc->from.u, arc->to.v - arc->from.v};
    Point along;
    if (!direction_before(b, arc, &along))
        return false;
    const double aside_mm = along.u * way.v - along.v * way.u, radius_mm = 0.5 * (squared(way.u) + squared(way.v)) / aside_mm;
    arc->centre = (Point){arc->from.u - radius_mm * along.v, arc->from.v + radius_mm * along.u};
    b->state->motion = aside_mm > 0.0 ? V_MOTION_ARC_CCW : V_MOTION_ARC_CW;
    return fabs(aside_mm) > SMALLEST_RADIUS_MM;
}

/* CIP: the circle through the start, a point and the end, by way of the point. */
static bool centre_by_point(const Block *b, Arc *arc) {
    State *s = b->state;
    const double *base_mm = work_offset_mm(b), here_mm[3] = {s->x, s->y, s->z};
    double via_mm[3];
    for (int axis = 0; axis < 3; axis++)
        via_mm[axis] = b->via_named >> axis & 1 ? b->via[axis] * s->unit_mm + (s->absolute ? base_mm : here_mm)[axis] : here_mm[axis];
    const bool named = b->via_named >> arc->first & b->via_named >> arc->second & 1;
    const Point p = {via_mm[arc->first] - arc->from.u, via_mm[arc->second] - arc->from.v};
    const Point q = {arc->to.u - arc->from.u, arc->to.v - arc->from.v};
    const double twice_mm2 = 2.0 * (p.u * q.v - p.v * q.u), pp = squared(p.u) + squared(p.v), qq = squared(q.u) + squared(q.v);
    arc->centre = (Point){arc->from.u + (q.v * pp - p.v * qq) / twice_mm2, arc->from.v + (p.u * qq - q.u * pp) / twice_mm2};
    s->motion = twice_mm2 > 0.0 ? V_MOTION_ARC_CCW : V_MOTION_ARC_CW;
    return named && fabs(twice_mm2) > squared(SMALLEST_RADIUS_MM) && arc->to_w == arc->from_w && via_mm[arc->third] == arc->from_w;
}

/* Find the centre of CIP or CT; return false, after a report, where there is none. */
static bool centre_by_name(Block *b, Arc *arc) {
    const bool words = b->has[V_WORD_I] || b->has[V_WORD_J] || b->has[V_WORD_K] || b->has[V_WORD_R] || b->has[V_WORD_P];
    if (!words && (b->named_arc == D_ARC_VIA ? centre_by_point(b, arc) : centre_by_tangent(b, arc)))
        return true;
    report_unless(b, arc->rests_on, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_NAMED_ARC});
    return false;
}

/* --- what does not fit --------------------------------------------------------------------------------- */

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
                  (Says){.a = s->absolute ? 0 : most(0, s->distance_line)});
    s->unknown_reported = 1;
}

static bool would_fit(const Block *b, const Arc *arc, Point centre) {
    return radii_fit(distance(arc->from, centre), distance(arc->to, centre), b->state->unit_mm) != MISFIT;
}

static void report_misfit(Block *b, const Arc *arc) {
    State *s = b->state;
    if (b->counts->mute)
        return;
    const Point other = other_centre(b, arc);
    s->misfits++;
    const Point centre = arc->centre, from = arc->from;
    const Point reversed = {2.0 * from.u - centre.u, 2.0 * from.v - centre.v};
    const Point exchanged = {from.u + (centre.v - from.v), from.v + (centre.u - from.u)};
    s->misfits_other_centre += would_fit(b, arc, other);
    s->misfits_reversed += !s->arc_absolute && would_fit(b, arc, reversed);
    s->misfits_exchanged += !s->arc_absolute && would_fit(b, arc, exchanged);
    if (s->misfits > MOST_MISFITS)
        return;
    const int mode = s->arc_absolute ? V_G90_1 : V_G91_1;
    report(b, F_ARC_RADIUS_MISMATCH,
           (Says){arc->from_radius_mm, arc->to_radius_mm, s->unit_mm == 1.0 ? mode : -mode});
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

/* --- the chords ---------------------------------------------------------------------------------------- */

/* Write an arc whose radii fit; return false, with nothing written, where there is no room for its rows. */
static bool chords(Block *b, const Arc *arc, int64_t turns, Fit fit) {
    const Machine *machine = b->machine;
    double angle, mm_s = 0.0;
    const bool ccw = b->state->motion == V_MOTION_ARC_CCW;
    const double sweep = sweep_angle(arc->from, arc->to, arc->centre, ccw, turns, &angle);
    const double radius_mm = greater(arc->from_radius_mm, arc->to_radius_mm);
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
    if (compensates(b->state))
        return compensated_arc(b, arc, ccw, turns, mm_s);
    emit_chords(b, arc, angle, sweep, count, mm_s);
    return true;
}

/* Tell whether an arc that LinuxCNC refuses as one of radius zero is smaller as a whole than its chords may be off. */
static bool is_small(const Block *b, const Arc *arc) {
    const State *s = b->state;
    const double size_mm = 2.0 * greater(arc->from_radius_mm, arc->to_radius_mm);
    const bool plain = s->feed_mode != V_INVERSE_TIME && !compensates(s) && !b->machine->rotary_axes;
    const bool refused = lesser(arc->from_radius_mm, arc->to_radius_mm) < SMALLEST_RADIUS_MM;
    return plain && refused && size_mm > 0.0 && size_mm <= b->machine->chord_tolerance_mm;
}

/* Write such an arc as a straight move to its end; return false where there is no room for it. */
static bool small_arc(Block *b, const Arc *arc) {
    double mm_s = 0.0;
    const int finding = feed_speed(b, hypot(distance(arc->from, arc->to), arc->to_w - arc->from_w), &mm_s);
    if (finding != F_OK) {
        report_speed(b, finding);
        return true;
    }
    if (b->counts->rows + 1 > b->machine->rows.feed_mm_s.rows) {
        b->counts->rows_wanted = b->counts->rows + 1;
        return false;
    }
    note(b, S_NOTE_SMALL_ARC, 0);
    learn(b);
    stand_at(b->state, arc->to_mm);
    emit(b->machine, b->line, mm_s, false, false, NO_ARC);
    return true;
}

/* Carry out G2 or G3; return false where there is no room for its rows. */
bool arc_move(Block *b, Arc *arc) {
    if (b->state->cutter_mode & S_CUTTER_BESIDE) {
        report_unless(b, S_DOUBT_POSITION, F_CUTTER_EXIT_ARC, (Says){0});
        b->state->cutter_mode &= ~S_CUTTER_BESIDE;
        return true;
    }
    if (!take_turn(b, false) || !axis_word_is_harmless(b, arc))
        return true;
    if (!(b->named_arc         ? centre_by_name(b, arc)
          : b->has[V_WORD_R] ? centre_by_radius(b, arc)
                             : centre_by_words(b, arc)))
        return true;
    const int32_t turns = b->has[V_WORD_P] ? whole(b->word[V_WORD_P]) : 1;
    if (turns < 1 || turns > MOST_TURNS) {
        report(b, F_ARC_TURNS, (Says){.a = b->word[V_WORD_P]});
        return true;
    }
    arc->from_radius_mm = distance(arc->from, arc->centre);
    arc->to_radius_mm = distance(arc->to, arc->centre);
    if (is_small(b, arc))
        return small_arc(b, arc);
    if (lesser(arc->from_radius_mm, arc->to_radius_mm) < SMALLEST_RADIUS_MM) {
        report_unless(b, arc->rests_on, F_ARC_ZERO_RADIUS, (Says){0});
        return true;
    }
    const Fit fit = radii_fit(arc->from_radius_mm, arc->to_radius_mm, b->state->unit_mm);
    if (fit != MISFIT)
        return chords(b, arc, turns, fit);
    misfit(b, arc);
    return true;
}
