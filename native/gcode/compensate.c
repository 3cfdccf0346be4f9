/* Cutter radius compensation: a filter between the motion of a block and its rows.

   Controls other than LinuxCNC lead in otherwise, and a Fanuc goes around an outside corner in straight moves
   (D_LEAD_…; Fanuc, Operator's Manual, cutter compensation: types A, B and C by parameter 5003; Siemens, Programming
   Manual, Fundamentals: NORM, G450 and G451; Function Manual, Basic Functions, W1: very pointed outside corners).

   The state's x, y, z stay the programmed point; the rows get the centre of the tool, a radius to the side.
   At an outside corner an arc is put in. At an inside corner the element before ends early, where the tool
   touches both: it has been written already and is *held*, its rows are written again. Moves along the tool,
   events and dwells after it stay behind it. What the path is: LinuxCNC, interp_convert.cc, interp_queue.cc. */

#include "gcode/compensate.h"

#include "gcode/offset_path.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"

/* A move that is shorter in the plane is one along the tool. */
static const double STANDING_MM = 1e-9;
/* Rounding may let an element end this far before its start. */
static const double SLACK_MM = 1e-7;
/* An entry arc whose end is this near to square to the way there (cosine) has no centre: LinuxCNC's bound. */
static const double SMALLEST_COSINE = 1e-4;
/* The same for controls whose corners are exact; what rounding makes of a smooth one. */
static const double EXACT_CORNER_RAD = 1e-6;
/* Beyond this bend G451 goes around by an arc: MD20210 as delivered. */
static const double MOST_MEETING_RAD = 100.0 * (PI / 180.0);
/* Blocks without a move in the plane between two moves: behind more a control may not see the corner. */
enum { MOST_IDLE = 1, ROWS_OF_CORNER = 4, NO_ROWS = -1 };

/* What a block adds to the path of the tool. */
typedef struct {
    Piece piece;             /* a line, or an arc; `at` is its start where the element before does not move it */
    Point along, normal, to; /* direction at its start; from the programmed point to the tool, and the tool, at its end */
    Point skew; /* of a spiral: from a centre at which the start would have the radius of the end, to its own */
    double to_w, mm_s;
} Element;

/* --- places --------------------------------------------------------------------------------------------- */

static int first_axis(const State *s) {
    return s->plane == V_PLANE_XY ? 0 : s->plane == V_PLANE_ZX ? 2 : 1;
}

static Point in_plane(const State *s, const double mm[3]) {
    const int first = first_axis(s);
    return (Point){mm[first], mm[(first + 1) % 3]};
}

static double along_tool(const State *s, const double mm[3]) { return mm[(first_axis(s) + 2) % 3]; }

static void in_space(const State *s, Point at, double w, double mm[3]) {
    const int first = first_axis(s);
    mm[first] = at.u;
    mm[(first + 1) % 3] = at.v;
    mm[(first + 2) % 3] = w;
}

static Point point_of(const double pair[2]) { return (Point){pair[0], pair[1]}; }

static void set_point(double pair[2], Point point) {
    pair[0] = point.u;
    pair[1] = point.v;
}

/* --- what cannot be done -------------------------------------------------------------------------------- */

/* Report the first fault of a contour; the path begins anew with the next move, further faults rest on it. */
static void fault(Block *b, int number, double a) {
    State *s = b->state;
    const int32_t rests_on = S_DOUBT_POSITION | S_DOUBT_UNIT | S_DOUBT_PLANE | S_DOUBT_DISTANCE |
                             S_DOUBT_CENTRE | S_DOUBT_TOOL;
    if (!s->cutter_failed)
        report_unless(b, rests_on, number, (Says){.a = a, .b = s->cutter_radius_mm});
    else if (!b->counts->mute)
        b->counts->consequences++;
    s->cutter_failed = 1;
    s->cutter_entered = 0;
}

/* --- rows ----------------------------------------------------------------------------------------------- */

static void emit_at(Block *b, Point at, double w, double mm_s) {
    State *s = b->state;
    const double programmed_mm[3] = {s->x, s->y, s->z};
    double tool_mm[3];
    in_space(s, at, w, tool_mm);
    stand_at(s, tool_mm);
    emit(b->machine, b->line, mm_s, isinf(mm_s), false, NO_ARC);
    stand_at(s, programmed_mm);
}

static int64_t chords_of(const Block *b, double radius_mm, double sweep_rad) {
    return chord_count(radius_mm, sweep_rad, b->machine->chord_tolerance_mm);
}

/* Write an arc of the tool, above 0 counterclockwise. */
static void emit_arc(Block *b, Point centre, Point from, Point to, double from_w, double to_w, double swept_rad,
                     double mm_s) {
    State *s = b->state;
    const double programmed_mm[3] = {s->x, s->y, s->z};
    const int first = first_axis(s);
    Arc arc = {.first = first, .second = (first + 1) % 3, .third = (first + 2) % 3};
    arc.from = from;
    arc.to = to;
    arc.centre = centre;
    arc.from_w = from_w;
    arc.to_w = to_w;
    arc.from_radius_mm = distance(from, centre);
    arc.to_radius_mm = distance(to, centre);
    in_space(s, to, to_w, arc.to_mm);
    const double radius_mm = greater(arc.from_radius_mm, arc.to_radius_mm);
    const double angle = atan2(from.v - centre.v, from.u - centre.u);
    emit_chords(b, &arc, angle, swept_rad, chords_of(b, radius_mm, swept_rad), mm_s);
    stand_at(s, programmed_mm);
}

/* Tell whether there is room for a block's rows; else say how many it wants. */
static bool has_room_for(Block *b, int64_t rows) {
    b->counts->rows_wanted = b->counts->rows + rows;
    return b->counts->rows_wanted <= b->machine->rows.feed_mm_s.rows;
}

/* --- the element that is held --------------------------------------------------------------------------- */

/* Where the tool stands at the end of the held element, before that is moved. */
static Point tool_at(const State *s) {
    const double programmed_mm[3] = {s->x, s->y, s->z};
    return plus(in_plane(s, programmed_mm), s->cutter_radius_mm, point_of(s->cutter_normal));
}

static Point held_direction(const State *s) { return quarter(point_of(s->cutter_normal), -s->cutter_side); }

static Piece held_piece(const State *s) {
    const Point at = tool_at(s), centre = point_of(s->held_centre);
    return (Piece){s->held_turn, at, held_direction(s), centre, distance(at, centre)};
}

/* Hold an element from now on; its rows begin at `first_row`. */
static void hold(Block *b, const Element *element, Point from, double from_w, double sweep_rad, int64_t first_row) {
    State *s = b->state;
    s->held_turn = element->piece.turn;
    s->held_line = b->line;
    s->held_sweep = sweep_rad;
    s->held_w[0] = from_w;
    s->held_w[1] = element->to_w;
    s->held_rows[0] = first_row;
    s->held_rows[1] = b->counts->rows;
    s->held_events = b->counts->events;
    set_point(s->held_from, from);
    set_point(s->held_along, element->piece.along);
    set_point(s->held_centre, element->piece.centre);
    set_point(s->cutter_normal, element->normal);
}

/* Take `fewer` rows away from the end of the held arc; what stands behind it moves up. */
static void shorten_held(Block *b, int64_t fewer) {
    State *s = b->state;
    Counts *counts = b->counts;
    const Rows *rows = &b->machine->rows;
    const int64_t last = s->held_rows[1] - 1;
    AT(rows->dwell_s, last - fewer) = AT(rows->dwell_s, last);
    for (int64_t row = last + 1; row < counts->rows; row++)
        copy_row(b->machine, row, row - fewer);
    for (int64_t k = s->held_events; k < counts->events; k++)
        if (AT(b->machine->events, k).row >= last)
            AT(b->machine->events, k).row -= fewer;
    counts->rows -= fewer;
    s->cutter_rows_removed += fewer;
    s->held_rows[1] -= fewer;
}

/* Write the rows of the held arc again, which now ends at a point after so many rad. */
static void rewrite_arc(Block *b, Point end, double sweep_rad) {
    State *s = b->state;
    const Rows *rows = &b->machine->rows;
    const Point from = point_of(s->held_from), centre = point_of(s->held_centre);
    const double from_mm = distance(from, centre), to_mm = distance(end, centre);
    const int64_t most_chords = s->held_rows[1] - s->held_rows[0];
    const int64_t chords = least(most_chords, chords_of(b, greater(from_mm, to_mm), sweep_rad));
    const double angle = atan2(from.v - centre.v, from.u - centre.u);
    if (chords < most_chords)
        shorten_held(b, most_chords - chords);
    for (int64_t k = 1; k <= chords; k++) {
        const double part = (double)k / (double)chords, r = from_mm + (to_mm - from_mm) * part;
        const double at = angle + s->held_turn * sweep_rad * part;
        const Point chord_end = {centre.u + r * cos(at), centre.v + r * sin(at)};
        const double w = s->held_w[0] + (s->held_w[1] - s->held_w[0]) * part;
        in_space(s, k == chords ? end : chord_end, w, &CELL(rows->position_mm, s->held_rows[0] + k - 1, 0));
    }
}

/* End the held element at a point; return false, after a report, where that lies before its start. */
static bool end_held(Block *b, Point end) {
    State *s = b->state;
    const int first = first_axis(s), second = (first + 1) % 3;
    const Floats position_mm = b->machine->rows.position_mm;
    const Point at = tool_at(s);
    double left = dot(point_of(s->held_along), minus(end, point_of(s->held_from)));
    if (s->held_turn != 0)
        left = s->held_sweep - angle_past(point_of(s->held_centre), -s->held_turn, at, end);
    if (left < -SLACK_MM) {
        fault(b, F_CUTTER_SHORT, s->held_line);
        return false;
    }
    if (end.u == at.u && end.v == at.v)
        return true;
    if (s->held_turn != 0)
        rewrite_arc(b, end, left);
    for (int64_t row = s->held_turn != 0 ? s->held_rows[1] : s->held_rows[0]; row < b->counts->rows; row++) {
        CELL(position_mm, row, first) = end.u;
        CELL(position_mm, row, second) = end.v;
    }
    return true;
}

/* G40, or the end of the program: nothing follows that could move the end of the held element. */
void end_compensation(Block *b) {
    State *s = b->state;
    if (compensates(s) && s->cutter_entered) {
        end_held(b, tool_at(s));
        s->cutter_mode |= S_CUTTER_BESIDE;
        s->corner_rows = NO_ROWS; /* the move that leads out makes no corner */
    }
    s->cutter_mode &= ~S_CUTTER_ON;
}

/* G40 alone on a control that takes the offset off at once. */
void shift_back(Block *b, double mm_s) {
    State *s = b->state;
    const double programmed_mm[3] = {s->x, s->y, s->z};
    emit_at(b, in_plane(s, programmed_mm), along_tool(s, programmed_mm), mm_s);
    s->cutter_mode &= ~S_CUTTER_BESIDE;
}

/* A tool change between G40 and the move that leads back: the program goes on from where the tool stands. */
void stand_beside(State *s) {
    if (!(s->cutter_mode & S_CUTTER_BESIDE))
        return;
    const double here_mm[3] = {s->x, s->y, s->z};
    double at_mm[3];
    in_space(s, tool_at(s), along_tool(s, here_mm), at_mm);
    stand_at(s, at_mm);
    s->cutter_mode &= ~S_CUTTER_BESIDE;
}

/* Find the direction in which a compensated contour has come to its programmed point; return false where none has begun. */
bool contour_direction(const State *s, Point *along) {
    *along = held_direction(s);
    return s->cutter_entered;
}

/* --- corners -------------------------------------------------------------------------------------------- */

/* Go around an outside corner as a Fanuc does: along both moves to where they meet, or, where the path turns by more
   than a right angle, a radius beyond each. */
static void square_corner(Block *b, Point from, Point before, Point to, Point after, double w, double mm_s) {
    const double cosine = dot(before, after), radius_mm = b->state->cutter_radius_mm;
    if (cosine >= 0.0) {
        emit_at(b, plus(from, radius_mm * fabs(cross(before, after)) / (1.0 + cosine), before), w, mm_s);
        return;
    }
    emit_at(b, plus(from, radius_mm, before), w, mm_s);
    emit_at(b, plus(to, -radius_mm, after), w, mm_s);
}

/* Go along a piece from one of its points to another, forwards or back. */
static void go_on(Block *b, const Piece *piece, Point from, Point to, double w, double mm_s) {
    const Point a = minus(from, piece->centre), c = minus(to, piece->centre);
    if (piece->turn == 0)
        emit_at(b, to, w, mm_s);
    else
        emit_arc(b, piece->centre, from, to, w, w, atan2(cross(a, c), dot(a, c)), mm_s);
}

/* G451: along the element before to where its path meets that of the next one, and along that to its start. */
static void go_to_meeting(Block *b, const Element *next, double w) {
    const Piece before = held_piece(b->state);
    Point meeting;
    if (!meeting_point(&before, &next->piece, -b->state->cutter_side, &meeting)) {
        fault(b, F_DIALECT_STATEMENT, DR_REASON_NO_MEETING);
        return;
    }
    go_on(b, &before, before.at, meeting, w, next->mm_s);
    go_on(b, &next->piece, meeting, next->piece.at, w, next->mm_s);
}

/* Go around an outside corner: an arc about the programmed point, or a rapid move. */
static void go_around(Block *b, const Element *next) {
    State *s = b->state;
    const double programmed_mm[3] = {s->x, s->y, s->z}, w = along_tool(s, programmed_mm);
    const Point corner = in_plane(s, programmed_mm), from = tool_at(s);
    double angle;
    if (b->machine->square_corners) {
        square_corner(b, from, held_direction(s), next->piece.at, next->along, w, next->mm_s);
        if (next->piece.turn != 0)
            emit_at(b, next->piece.at, w, next->mm_s);
        return;
    }
    const double bend_rad = fabs(atan2(cross(held_direction(s), next->along), dot(held_direction(s), next->along)));
    if (s->cutter_ways & S_WAY_MEETING && bend_rad <= MOST_MEETING_RAD) {
        go_to_meeting(b, next, w);
        return;
    }
    if (isinf(next->mm_s)) {
        emit_at(b, next->piece.at, w, next->mm_s);
        return;
    }
    const double swept_rad = sweep_angle(from, next->piece.at, corner, s->cutter_side < 0, 1, &angle);
    emit_arc(b, corner, from, next->piece.at, w, w, swept_rad, next->mm_s);
}

/* Lead the tool from the held element to the next one, which begins at `from`; return false after a fault. */
static bool join(Block *b, const Element *next, Point *from) {
    State *s = b->state;
    const Piece before = held_piece(s);
    const int turn = next->piece.turn != 0 ? next->piece.turn : before.turn;
    const bool tool_outside = turn != 0 && turn != s->cutter_side;
    const double smallest_rad = b->machine->lead ? EXACT_CORNER_RAD : SMALLEST_CORNER_RAD;
    const Corner corner = corner_between(held_direction(s), next->along, s->cutter_side, tool_outside, smallest_rad);
    *from = before.at;
    if (b->machine->lead && (corner != SMOOTH || !s->cutter_led) && s->cutter_idle > MOST_IDLE) {
        fault(b, F_DIALECT_STATEMENT, DR_REASON_LOOK_AHEAD);
        return false;
    }
    if (b->machine->lead && !s->cutter_led) {
        s->cutter_led = 1;
        if (corner != OUTSIDE || b->machine->lead == D_LEAD_TO_CONTOUR) {
            *from = next->piece.at;
            return end_held(b, *from);
        }
    }
    switch (corner) {
    case SMOOTH: return end_held(b, before.at);
    case OUTSIDE:
        if (!end_held(b, before.at))
            return false;
        go_around(b, next);
        *from = next->piece.at;
        return true;
    case INSIDE: break;
    }
    Piece after = next->piece;
    const Point skew = before.turn == 0 ? next->skew : (Point){0.0, 0.0};
    after.centre = minus(after.centre, skew);
    if (!meeting_point(&before, &after, s->cutter_side, from)) {
        *from = before.at;
        if (corner_between(held_direction(s), next->along, s->cutter_side, tool_outside, SMALLEST_CORNER_RAD) == SMOOTH)
            return end_held(b, before.at);
        fault(b, F_CUTTER_CORNER, 0.0);
        return false;
    }
    *from = plus(*from, 1.0, skew);
    return end_held(b, *from);
}

/* The straight move behind G40, where it leads around the corner of the contour's end; return false where there is no
   room for its rows, and with a finding where it does not lead away. */
bool lead_out(Block *b, const double to_mm[3], double mm_s) {
    State *s = b->state;
    const double here_mm[3] = {s->x, s->y, s->z}, w = along_tool(s, here_mm);
    const Point here = in_plane(s, here_mm), way = minus(in_plane(s, to_mm), here);
    if (hypot(way.u, way.v) <= STANDING_MM) {
        report(b, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_LEAD_OUT});
        return true;
    }
    const Point before = held_direction(s), after = unit(way), end = tool_at(s);
    const Point begin = plus(here, s->cutter_radius_mm, quarter(after, s->cutter_side));
    if (b->machine->lead != D_LEAD_BY_CORNER || corner_between(before, after, s->cutter_side, false, EXACT_CORNER_RAD) != OUTSIDE)
        return true;
    if (!has_room_for(b, ROWS_OF_CORNER))
        return false;
    square_corner(b, end, before, begin, after, w, mm_s);
    emit_at(b, begin, w, mm_s);
    return true;
}

/* --- lines and arcs ------------------------------------------------------------------------------------- */

/* Shift the tool beside the first element behind G41 alone, where the control does so at once; tell whether it does. */
static bool shift_beside(Block *b, Point at, double w) {
    State *s = b->state;
    const int32_t line = b->line;
    if (s->cutter_entered || s->cutter_shift_mm_s == 0.0)
        return false;
    if (s->cutter_idle > MOST_IDLE)
        fault(b, F_DIALECT_STATEMENT, DR_REASON_SHIFT_ALONE);
    b->line = s->cutter_line;
    emit_at(b, at, w, s->cutter_shift_mm_s);
    b->line = line;
    s->cutter_shift_mm_s = 0.0;
    s->cutter_led = 1;
    return true;
}

static bool is_too_short(Block *b, double left) {
    if (left >= -SLACK_MM)
        return false;
    fault(b, F_CUTTER_SHORT, b->line);
    return true;
}

/* Write a straight move of the tool to a programmed point; return false where there is no room for its rows. */
bool compensated_line(Block *b, const double to_mm[3], double mm_s) {
    State *s = b->state;
    const double here_mm[3] = {s->x, s->y, s->z}, radius_mm = s->cutter_radius_mm;
    const double from_w = along_tool(s, here_mm), to_w = along_tool(s, to_mm);
    const Point here = in_plane(s, here_mm), to = in_plane(s, to_mm), way = minus(to, here);
    const double length_mm = hypot(way.u, way.v);
    if (!s->cutter_entered && !b->machine->lead && length_mm <= radius_mm) {
        fault(b, F_CUTTER_ENTRY, length_mm);
        emit_at(b, to, to_w, mm_s);
        return true;
    }
    if (!has_room_for(b, chords_of(b, radius_mm, 2.0 * PI) + ROWS_OF_CORNER))
        return false;
    if (length_mm <= STANDING_MM) {
        emit_at(b, s->cutter_entered ? tool_at(s) : to, to_w, mm_s);
        return true;
    }
    Element line = {.piece.along = unit(way), .to_w = to_w, .mm_s = mm_s};
    line.along = line.piece.along;
    line.normal = quarter(line.along, s->cutter_side);
    line.piece.at = plus(here, radius_mm, line.normal);
    line.to = plus(to, radius_mm, line.normal);
    Point from = here;
    if (shift_beside(b, line.piece.at, from_w)) {
        from = line.piece.at;
    } else if (s->cutter_entered) {
        if (!join(b, &line, &from) || is_too_short(b, dot(line.along, minus(line.to, from)))) {
            emit_at(b, to, to_w, mm_s);
            return true;
        }
    }
    const int64_t first_row = b->counts->rows;
    emit_at(b, line.to, to_w, mm_s);
    if (!s->cutter_entered && !s->cutter_led)
        line.piece.along = (Point){0.0, 0.0}; /* an entry is longer than the radius: it cannot be turned around */
    hold(b, &line, from, from_w, 0.0, first_row);
    s->cutter_entered = 1;
    return true;
}

/* Describe the path of the tool along an arc; return false, after a report, where it does not fit inside. */
static bool arc_element(Block *b, const Arc *arc, int turn, Element *element) {
    const State *s = b->state;
    const bool inside = turn == s->cutter_side;
    const double radius_mm = s->cutter_radius_mm, towards = inside ? -1.0 : 1.0;
    const Point start_radius = unit(minus(arc->from, arc->centre)), end_radius = unit(minus(arc->to, arc->centre));
    const double least_mm = s->cutter_entered ? arc->to_radius_mm : arc->from_radius_mm;
    if (inside && least_mm <= radius_mm) {
        fault(b, F_CUTTER_ARC, least_mm);
        return false;
    }
    element->piece.turn = turn;
    element->piece.centre = arc->centre;
    element->piece.radius_mm = arc->to_radius_mm + towards * radius_mm;
    element->piece.at = plus(arc->from, towards * radius_mm, start_radius);
    element->skew = minus(arc->centre, plus(arc->from, -arc->to_radius_mm, start_radius));
    element->along = quarter(start_radius, turn);
    element->normal = (Point){towards * end_radius.u, towards * end_radius.v};
    element->to = plus(arc->to, radius_mm, element->normal);
    element->to_w = arc->to_w;
    return true;
}

/* Find the arc by which the tool comes from the arc's start, where it stands, to touch the arc at its end. */
static bool entry_arc(Block *b, const Arc *arc, Element *element) {
    const Point back = minus(arc->from, element->to), inwards = unit(minus(arc->centre, arc->to));
    const double length_mm = hypot(back.u, back.v), cosine = dot(back, inwards) / length_mm;
    if (distance(arc->from, arc->to) <= b->state->cutter_radius_mm || !(cosine >= SMALLEST_COSINE)) {
        fault(b, F_CUTTER_ENTRY_ARC, 0.0);
        return false;
    }
    element->piece.radius_mm = 0.5 * length_mm / cosine;
    element->piece.centre = plus(element->to, element->piece.radius_mm, inwards);
    return true;
}

/* Write an arc of the tool along a programmed one; return false where there is no room for its rows. */
bool compensated_arc(Block *b, const Arc *arc, bool ccw, int64_t turns, double mm_s) {
    State *s = b->state;
    const bool entered = s->cutter_entered, shifted = !entered && s->cutter_shift_mm_s != 0.0;
    const double larger_mm = greater(arc->from_radius_mm, arc->to_radius_mm) + s->cutter_radius_mm;
    double angle;
    if (!entered && b->machine->lead && !shifted) {
        fault(b, F_DIALECT_STATEMENT, DR_REASON_ENTRY_ARC);
        return true;
    }
    double sweep_rad = fabs(sweep_angle(arc->from, arc->to, arc->centre, ccw, turns, &angle));
    Element element = {.mm_s = mm_s};
    Point from = arc->from;
    if (!arc_element(b, arc, ccw ? 1 : -1, &element) || (!entered && !shifted && !entry_arc(b, arc, &element)))
        return true;
    if (!entered && !shifted)
        sweep_rad = fabs(sweep_angle(from, element.to, element.piece.centre, ccw, turns, &angle));
    const double most_mm = greater(larger_mm, element.piece.radius_mm);
    const int64_t chords = chords_of(b, most_mm, sweep_rad + 1.0) + chords_of(b, s->cutter_radius_mm, 2.0 * PI) + ROWS_OF_CORNER;
    if (chords > MOST_CHORDS) {
        report(b, F_ARC_TOO_LONG, (Says){.a = most_mm});
        return true;
    }
    if (!has_room_for(b, chords))
        return false;
    if (entered && !join(b, &element, &from))
        return true;
    if (shift_beside(b, element.piece.at, arc->from_w))
        from = element.piece.at;
    if (entered)
        sweep_rad -= angle_past(arc->centre, element.piece.turn, element.piece.at, from);
    if (is_too_short(b, sweep_rad))
        return true;
    const int64_t first_row = b->counts->rows;
    emit_arc(b, element.piece.centre, from, element.to, arc->from_w, arc->to_w, element.piece.turn * sweep_rad, mm_s);
    hold(b, &element, from, arc->from_w, sweep_rad, first_row);
    s->cutter_entered = 1;
    return true;
}

/* Make the corner between two straight moves of the contour: the one before ends where it begins, and an arc (bend 0: a
   chamfer) leads to where the next begins. Return false, with nothing done, where there is no room for the rows of both. */
bool compensated_corner(Block *b, const Arc *arc, double bend_rad, double mm_s) {
    State *s = b->state;
    const int64_t around = chords_of(b, s->cutter_radius_mm, 2.0 * PI) + ROWS_OF_CORNER;
    const int64_t along = bend_rad == 0.0 ? 1 : chords_of(b, arc->from_radius_mm + s->cutter_radius_mm, 2.0 * PI);
    double from_mm[3];
    if (!has_room_for(b, along + 2 * around))
        return false;
    if (!end_held(b, plus(arc->from, s->cutter_radius_mm, point_of(s->cutter_normal))))
        return true;
    in_space(s, arc->from, arc->from_w, from_mm);
    stand_at(s, from_mm);
    if (bend_rad == 0.0)
        compensated_line(b, arc->to_mm, mm_s);
    else
        compensated_arc(b, arc, bend_rad > 0.0, 1, mm_s);
    stand_at(s, arc->to_mm);
    return true;
}
