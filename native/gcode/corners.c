/* Corners that a dialect has rounded or chamfered between two straight moves: RND=, CHF=, CHR=, ,R and ,C.

   The block that names the corner has led to its point; its row ends earlier once the next block is known, and the
   arc or the chamfer is put between; beside a compensated contour as an element of that. Which of the two blocks gives the corner its feed is a setting of the control
   (Sinumerik: MD20201, bit 0), so both have the same, and nothing stands between them. A corner longer than a
   move is an alarm on a Fanuc, and made smaller by a Sinumerik: it is refused. */

#include "gcode/corners.h"

#include "gcode/arc_motion.h"
#include "gcode/compensate.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"

static const double SLACK_MM = 1e-9;
/* A bend below one degree is no corner for a Fanuc. */
static const double SMALLEST_BEND_RAD = 1.0 * (PI / 180.0);

/* The corner in the plane: the bend, to the left above 0, what it takes of each move, and their lengths. */
typedef struct {
    int first, second, third;
    Point at, along_before, along_after;
    double before_mm, after_mm, bend_rad, taken_mm;
} Corner;

static Corner corner_of(const State *s, const double to_mm[3]) {
    const double at_mm[3] = {s->x, s->y, s->z}, *from_mm = s->corner_from_mm;
    Corner c = {.first = s->plane == V_PLANE_XY ? 0 : s->plane == V_PLANE_ZX ? 2 : 1};
    c.second = (c.first + 1) % 3;
    c.third = (c.first + 2) % 3;
    c.at = (Point){at_mm[c.first], at_mm[c.second]};
    const Point from = {from_mm[c.first], from_mm[c.second]}, to = {to_mm[c.first], to_mm[c.second]};
    c.before_mm = distance(from, c.at);
    c.after_mm = distance(c.at, to);
    c.along_before = (Point){(c.at.u - from.u) / c.before_mm, (c.at.v - from.v) / c.before_mm};
    c.along_after = (Point){(to.u - c.at.u) / c.after_mm, (to.v - c.at.v) / c.after_mm};
    const Point a = c.along_before, b = c.along_after;
    c.bend_rad = atan2(a.u * b.v - a.v * b.u, a.u * b.u + a.v * b.v);
    const double half_rad = 0.5 * fabs(c.bend_rad);
    c.taken_mm = s->corner == D_CORNER_ROUND    ? s->corner_mm * tan(half_rad)
                 : s->corner == D_CORNER_LENGTH ? 0.5 * s->corner_mm / cos(half_rad)
                                                : s->corner_mm;
    return c;
}

/* Keep the corner of a block that has led from a point to where the tool stands. */
void begin_corner(Block *b, const double from_mm[3], bool by_machine, double mm_s) {
    State *s = b->state;
    if (s->motion != V_MOTION_LINE || by_machine || s->feed_mode == V_INVERSE_TIME || b->machine->rotary_axes)
        return;
    s->corner = b->corner;
    s->corner_line = b->line;
    s->corner_mm = b->corner_value * s->unit_mm;
    s->corner_mm_s = mm_s;
    s->corner_rows = b->counts->rows;
    s->corner_events = b->counts->events;
    for (int axis = 0; axis < 3; axis++)
        s->corner_from_mm[axis] = from_mm[axis];
}

/* Tell whether a straight move to a point makes the corner behind the one before it. */
bool may_round(const Block *b, const double to_mm[3], bool by_machine, double mm_s) {
    const State *s = b->state;
    const Counts *counts = b->counts;
    const double at_mm[3] = {s->x, s->y, s->z};
    const bool next = counts->rows == s->corner_rows && counts->events == s->corner_events &&
                      AT(b->machine->rows.dwell_s, counts->rows - 1) == 0.0;
    if (compensates(s) && !s->cutter_led)
        return false;
    if (!next || s->motion != V_MOTION_LINE || by_machine || mm_s != s->corner_mm_s || b->g[V_PLANE] >= 0)
        return false;
    const Corner c = corner_of(s, to_mm);
    const double flat_mm = greater(fabs(to_mm[c.third] - at_mm[c.third]), fabs(at_mm[c.third] - s->corner_from_mm[c.third]));
    return flat_mm <= SLACK_MM && fabs(c.bend_rad) >= SMALLEST_BEND_RAD &&
           c.taken_mm <= lesser(c.before_mm, c.after_mm) + SLACK_MM;
}

/* Write the corner before the move to a point; return false, with nothing done, where there is no room. */
bool round_corner(Block *b, const double to_mm[3]) {
    State *s = b->state;
    const Corner c = corner_of(s, to_mm);
    const int32_t line = b->line;
    const int side = c.bend_rad > 0.0 ? 1 : -1;
    const double radius_mm = s->corner_mm;
    const bool round = s->corner == D_CORNER_ROUND;
    const Point from = {c.at.u - c.taken_mm * c.along_before.u, c.at.v - c.taken_mm * c.along_before.v};
    const Point to = {c.at.u + c.taken_mm * c.along_after.u, c.at.v + c.taken_mm * c.along_after.v};
    const int64_t chords = round ? chord_count(radius_mm, c.bend_rad, b->machine->chord_tolerance_mm) : 1;
    Arc arc = {.first = c.first, .second = c.second, .third = c.third, .from = from, .to = to};
    double at_mm[3] = {s->x, s->y, s->z}, tip_mm[3];
    arc.from_w = arc.to_w = at_mm[c.third];
    for (int axis = 0; axis < 3; axis++)
        arc.to_mm[axis] = at_mm[axis];
    arc.to_mm[c.first] = to.u;
    arc.to_mm[c.second] = to.v;
    arc.centre = (Point){from.u - side * radius_mm * c.along_before.v, from.v + side * radius_mm * c.along_before.u};
    arc.from_radius_mm = arc.to_radius_mm = radius_mm;
    b->line = s->corner_line;
    if (compensates(s)) {
        const bool done = compensated_corner(b, &arc, round ? c.bend_rad : 0.0, s->corner_mm_s);
        b->line = line;
        s->corner *= !done;
        return done;
    }
    b->counts->rows_wanted = b->counts->rows + chords + 1;
    if (b->counts->rows_wanted > b->machine->rows.feed_mm_s.rows) {
        b->line = line;
        return false;
    }
    at_mm[c.first] = from.u;
    at_mm[c.second] = from.v;
    stand_at(s, at_mm);
    tip_position(s, tip_mm);
    for (int axis = 0; axis < 3; axis++)
        CELL(b->machine->rows.position_mm, b->counts->rows - 1, axis) = tip_mm[axis];
    if (round) {
        emit_chords(b, &arc, atan2(from.v - arc.centre.v, from.u - arc.centre.u), c.bend_rad, chords, s->corner_mm_s);
    } else {
        stand_at(s, arc.to_mm);
        emit(b->machine, b->line, s->corner_mm_s, false, false, NO_ARC);
    }
    b->line = line;
    s->corner = 0;
    return true;
}

/* Refuse a corner of this block that is none, and the one of the block before that this one has not made. */
void refuse_open_corner(Block *b, int32_t before_line) {
    State *s = b->state;
    const int32_t rests_on = S_DOUBT_ALL;
    if (before_line && s->corner && s->corner_line == before_line) {
        if (!rests_on_doubt(b, rests_on))
            report_at(b, before_line, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_CORNER});
        s->corner = 0;
    }
    if (b->corner && !(s->corner && s->corner_line == b->line))
        report_unless(b, rests_on, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_CORNER});
}
