/* Canned cycles as straight moves.

   Where a cycle goes is worked out in programmed coordinates, and the depths in programmed units, as rounding may
   decide on a peck more or less. "Along" is the axis of the tool, "across" the plane in force. */

#include "gcode/cycles.h"

#include "gcode/feed.h"
#include "gcode/motion.h"
#include "gcode/polar.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"

enum { MOST_CYCLE_ROWS = 1000000, ROWS_AROUND = 5, ROWS_PER_PECK = 3, EVENTS_PER_HOLE = 4 };

/* --- moves ---------------------------------------------------------------------------------------------- */

/* Write the row to a depth over the hole at hand. */
void go_along(Block *b, const Cycle *c, double along, bool known, double mm_s) {
    State *s = b->state;
    double at_mm[3];
    int8_t *known_axis[3] = {&s->known_x, &s->known_y, &s->known_z};
    at_mm[c->first] = c->u_mm;
    at_mm[c->second] = c->v_mm;
    at_mm[c->third] = along * s->unit_mm;
    tip_of(b, at_mm, at_mm);
    stand_at(s, at_mm);
    *known_axis[c->third] = known;
    emit(b->machine, b->line, mm_s, isinf(mm_s), false, NO_ARC);
}

static void feed_to(Block *b, const Cycle *c, double along) { go_along(b, c, along, c->r_known, c->mm_s); }

static void rapid_to(Block *b, const Cycle *c, double along) {
    go_along(b, c, along, along == c->clear && c->clear != c->r ? c->level_known : c->r_known, RAPID_MM_S);
}

void wait_here(Block *b, double seconds) {
    AT(b->machine->rows.dwell_s, b->counts->rows - 1) += seconds;
}

/* Turn the spindle in a cycle: 1 = M3, -1 = M4, 0 = M5. */
void turn_spindle(Block *b, const Cycle *c, int32_t direction) {
    State *s = b->state;
    const int m = direction > 0 ? V_M3 : direction < 0 ? V_M4 : V_M5;
    s->direction = direction;
    event(b, S_EVENT_SPINDLE, s->rpm * direction, m + S_OF_CYCLE * c->motion);
}

/* --- what is done in a hole ----------------------------------------------------------------------------- */

/* Return how many pecks end above the bottom. */
static int64_t pecks(const Cycle *c) {
    int64_t count = 0;
    if (c->motion != V_CYCLE_CHIP && c->motion != V_CYCLE_PECK)
        return 0;
    for (double depth = c->r - c->peck; depth > c->bottom; depth -= c->peck)
        if (++count > MOST_CYCLE_ROWS)
            break; /* also where a peck is too small to change the depth */
    return count;
}

/* Drill in pecks: G83 leaves the hole after each, G73 breaks the chip. */
static void peck(Block *b, const Cycle *c) {
    for (double depth = c->r - c->peck; depth > c->bottom; depth -= c->peck) {
        feed_to(b, c, depth);
        if (c->motion == V_CYCLE_PECK)
            go_along(b, c, c->r, c->r_known, RAPID_MM_S);
        go_along(b, c, depth + c->clearance, c->r_known, RAPID_MM_S);
    }
}

/* Leave the hole at feed: LinuxCNC up to where the cycle ends, a Fanuc and a Sinumerik up to R and on at rapid speed. */
static bool feeds_to_r(const Block *b) {
    return b->machine->programs == D_PROGRAMS_FANUC || b->machine->programs == D_PROGRAMS_SINUMERIK;
}

static void leave_at_feed(Block *b, const Cycle *c) {
    if (feeds_to_r(b))
        feed_to(b, c, c->r);
    else
        go_along(b, c, c->clear, c->clear != c->r ? c->level_known : c->r_known, c->mm_s);
}

static void rise_from_r(Block *b, const Cycle *c) {
    if (feeds_to_r(b) && c->clear > c->r)
        rapid_to(b, c, c->clear);
}

/* Tap: the spindle reverses at the bottom, and again above the hole. */
static void tap(Block *b, const Cycle *c) {
    const int32_t direction = b->state->direction;
    turn_spindle(b, c, 0);
    turn_spindle(b, c, -direction);
    wait_here(b, c->dwell_s);
    leave_at_feed(b, c);
    turn_spindle(b, c, 0);
    turn_spindle(b, c, direction);
    rise_from_r(b, c);
}

/* Leave the hole with the spindle at rest, so that the tool draws no groove. */
static void leave_at_rest(Block *b, const Cycle *c) {
    const int32_t direction = b->state->direction;
    wait_here(b, c->dwell_s);
    turn_spindle(b, c, 0);
    rapid_to(b, c, c->clear);
    turn_spindle(b, c, direction);
}

/* Go from the retract plane to the bottom and to where the cycle ends. */
static void hole(Block *b, const Cycle *c) {
    if (c->motion == V_CYCLE_CHIP || c->motion == V_CYCLE_PECK)
        peck(b, c);
    feed_to(b, c, c->bottom);
    switch (c->motion) {
    case V_CYCLE_TAP_LEFT:
    case V_CYCLE_TAP: tap(b, c); break;
    case V_CYCLE_REAM:
        feed_to(b, c, c->r);
        rapid_to(b, c, c->clear);
        break;
    case V_CYCLE_BORE_STOP: leave_at_rest(b, c); break;
    case V_CYCLE_BORE:
        wait_here(b, c->dwell_s);
        leave_at_feed(b, c);
        rise_from_r(b, c);
        break;
    default:
        wait_here(b, c->dwell_s);
        rapid_to(b, c, c->clear);
    }
}

/* Stand over the next hole; polar words lead there from the hole before, in G17. */
static void next_hole(const Block *b, Cycle *c, bool first) {
    double at_mm[2] = {first ? c->u_from_mm : c->u_mm, first ? c->v_from_mm : c->v_mm};
    if (is_polar(b))
        polar_point(b, at_mm);
    c->u_mm = at_mm[0] + c->u_step_mm;
    c->v_mm = at_mm[1] + c->v_step_mm;
}

/* Go to each hole in turn, at the height at which the tool stands before the first. */
static void holes(Block *b, Cycle *c) {
    if (c->repeats == 0)
        return;
    double height = c->height;
    if (c->level < c->r) { /* the tool first rises where it stands; from nowhere it does so over the hole */
        go_along(b, c, c->r, c->r_known && c->level_known, RAPID_MM_S);
        height = c->r;
    }
    for (int64_t k = 0; k < c->repeats; k++) {
        next_hole(b, c, k == 0);
        learn_across(b, c);
        if (k == 0 && height > c->r) {
            go_along(b, c, height, c->height_known, RAPID_MM_S);
            go_along(b, c, c->r, c->r_known, RAPID_MM_S);
        } else {
            rapid_to(b, c, c->clear);
            if (c->clear > c->r)
                go_along(b, c, c->r, c->r_known, RAPID_MM_S);
        }
        hole(b, c);
    }
}

/* --- the block ------------------------------------------------------------------------------------------ */

/* Tell whether there is room for so many rows and events; else say how much is wanted. */
bool has_cycle_room(Block *b, int64_t rows, int64_t events) {
    Counts *counts = b->counts;
    counts->rows_wanted = counts->rows + rows;
    counts->events_wanted = counts->events + events;
    return counts->rows_wanted <= b->machine->rows.feed_mm_s.rows &&
           counts->events_wanted <= b->machine->events.rows;
}

/* A refused cycle may end anywhere along the tool, and those that follow it rest on it. */
static void refuse(Block *b, const Cycle *c) {
    follow(b);
    b->state->doubt |= S_DOUBT_MOTION | S_DOUBT_X << c->third;
}

/* Drill where the tool stands, between heights that the cycle states; return false where there is no room. */
bool drill_here(Block *b, const Cycle *c) {
    State *s = b->state;
    const int8_t exact_stop = s->exact_stop;
    if (!has_cycle_room(b, ROWS_AROUND, 0))
        return false;
    s->exact_stop = 1; /* as for all cycles */
    rapid_to(b, c, c->r);
    hole(b, c);
    s->exact_stop = exact_stop;
    return true;
}

/* Carry out a canned cycle; return false where there is no room for its rows. */
bool cycle_move(Block *b) {
    State *s = b->state;
    Cycle cycle = cycle_of(b);
    if (!cycle_words(b, &cycle)) {
        refuse(b, &cycle);
        return true;
    }
    const int64_t rows_a_hole = ROWS_AROUND + ROWS_PER_PECK * pecks(&cycle);
    const int64_t rows = 1 + cycle.repeats * rows_a_hole;
    if (rows > MOST_CYCLE_ROWS) {
        report_unless(b, cycle.rests_on, FC_TOO_LONG, (Says){.a = s->motion * V_TENFOLD});
        refuse(b, &cycle);
        return true;
    }
    if (!has_cycle_room(b, rows, cycle.repeats * EVENTS_PER_HOLE))
        return false;
    const int8_t exact_stop = s->exact_stop;
    s->exact_stop = 1; /* a rounded corner would be a hole that is not deep enough */
    holes(b, &cycle);
    s->exact_stop = exact_stop;
    remember_cycle(b, &cycle);
    return true;
}
