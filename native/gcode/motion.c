/* The motion of a block: straight moves, arcs as chords, machine moves. */

#include "gcode/motion.h"

#include "gcode/arc_motion.h"
#include "gcode/compensate.h"
#include "gcode/corners.h"
#include "gcode/cutter_settings.h"
#include "gcode/cycles.h"
#include "gcode/feed.h"
#include "gcode/polar.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"
#include "gcode/settings.h"

static double largest_coordinate_mm(const State *s) {
    return greater(greater(fabs(s->x), fabs(s->y)), fabs(s->z));
}

static void note_unknown_start(Block *b) {
    State *s = b->state;
    if (!(s->known_x && s->known_y && s->known_z) && s->unknown_feed_line == 0)
        s->unknown_feed_line = b->line;
}

/* --- straight moves ------------------------------------------------------------------------------------- */

/* Find where a block under G53 leads, the coordinates being the machine's. */
static void machine_target(const Block *b, double to_mm[3]) {
    const State *s = b->state;
    tip_position(s, to_mm);
    for (int axis = 0; axis < 3; axis++)
        if (b->has[V_WORD_X + axis])
            to_mm[axis] = b->word[V_WORD_X + axis] * s->unit_mm - (axis == 2 ? length_offset_of(s) : 0.0);
    unrotate(s, to_mm);
}

/* Forget the axes that a block has moved in machine coordinates; a rotation mixes X and Y. */
static void forget(Block *b) {
    State *s = b->state;
    const bool mixed = s->rotated && (b->has[V_WORD_X] || b->has[V_WORD_Y]);
    s->known_x &= !(b->has[V_WORD_X] || mixed);
    s->known_y &= !(b->has[V_WORD_Y] || mixed);
    s->known_z &= !b->has[V_WORD_Z];
}

/* G0 and G1, also under G53; return false where there is no room for the rows. */
static bool straight(Block *b, bool by_machine) {
    State *s = b->state;
    double to_mm[3], mm_s = RAPID_MM_S, time_s = NAN;
    if (!take_turn(b, by_machine))
        return true;
    if (by_machine)
        machine_target(b, to_mm);
    else
        target(b, to_mm);
    if (s->motion == V_MOTION_LINE) {
        note_unknown_start(b);
        const double dx = to_mm[0] - s->x, dy = to_mm[1] - s->y, dz = to_mm[2] - s->z;
        mm_s = 0.0;
        const double length_mm = sqrt(dx * dx + dy * dy + dz * dz);
        const int finding = feed_speed(b, length_mm, &mm_s);
        time_s = feed_time_s(b, length_mm, 1);
        check_turn_feed(b, length_mm);
        if (finding != F_OK)
            report_speed(b, finding);
    }
    if (s->cutter_mode & S_CUTTER_BESIDE && b->machine->lead && !by_machine && !lead_out(b, to_mm, mm_s))
        return false;
    s->cutter_mode &= ~S_CUTTER_BESIDE;
    if (s->corner && may_round(b, to_mm, by_machine, mm_s) && !round_corner(b, to_mm))
        return false;
    const double from_mm[3] = {s->x, s->y, s->z};
    const bool from_known = s->known_x && s->known_y && s->known_z;
    if (compensates(s)) {
        learn(b);
        const bool done = compensated_line(b, to_mm, mm_s);
        stand_at(s, to_mm);
        if (done && b->corner && from_known)
            begin_corner(b, from_mm, by_machine, mm_s);
        return done;
    }
    stand_at(s, to_mm);
    stand_turned(s, b->turn_deg);
    if (by_machine)
        forget(b);
    else
        learn(b);
    emit(b->machine, b->line, mm_s, s->motion == V_MOTION_RAPID, by_machine, NO_ARC);
    note_time(b, time_s);
    if (by_machine)
        note_staying(b);
    if (b->corner && from_known)
        begin_corner(b, from_mm, by_machine, mm_s);
    return true;
}

/* G28 and G30: by way of the programmed point, then the named axes (or all) to the machine's home. */
void machine_home(Block *b, bool any_axis) {
    State *s = b->state;
    const bool *has = b->has;
    const double *stored_mm = b->g[V_NON_MODAL] == V_G28 ? s->home_28 : s->home_30;
    double home_mm[3] = {stored_mm[0], stored_mm[1], stored_mm[2] - length_offset_of(s)}, by_way_mm[3];
    unrotate(s, home_mm);
    if (!take_turn(b, true))
        return;
    target(b, by_way_mm);
    stand_at(s, by_way_mm);
    stand_turned(s, b->turn_deg);
    emit(b->machine, b->line, RAPID_MM_S, true, true, NO_ARC);
    if (any_axis)
        note_staying(b);
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
        s->z = home_mm[2];
        s->known_z = 0;
    }
    rotary_home(b, any_axis);
    emit(b->machine, b->line, RAPID_MM_S, true, true, NO_ARC);
    if (any_axis)
        note_staying(b);
}

/* --- the motion of a block ------------------------------------------------------------------------------ */

static void check_distance(Block *b) {
    State *s = b->state;
    const double largest_mm = largest_coordinate_mm(s);
    s->largest_mm = greater(s->largest_mm, largest_mm);
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
    if (is_polar(b) && !polar_is_sound(b)) {
        s->doubt |= S_DOUBT_X | S_DOUBT_Y;
    } else if (s->doubt & S_DOUBT_MOTION) {
        follow(b);
        s->doubt |= S_DOUBT_Z; /* a cycle may end anywhere along the tool */
    } else if (s->motion == V_MOTION_CANCELLED) {
        report(b, F_NO_MOTION_MODE, (Says){.a = s->motion_line});
        s->doubt |= S_DOUBT_MOTION;
        follow(b);
    } else if (special == V_G53 && s->motion > V_MOTION_LINE) {
        report(b, F_G53_NEEDS_RAPID_OR_FEED, (Says){0});
        s->doubt |= S_DOUBT_POSITION;
    } else if (special == V_G53 && !s->absolute) {
        report_unless(b, S_DOUBT_DISTANCE, F_G53_INCREMENTAL, (Says){0});
        s->doubt |= S_DOUBT_POSITION;
    } else if (special == V_G4 && s->motion > V_MOTION_LINE) {
        report(b, F_DWELL_WITH_ARC, (Says){0});
        follow(b);
    } else if (special == V_G53 && compensates(s)) {
        refuse_under_compensation(b, V_G53);
        s->doubt |= S_DOUBT_POSITION;
    } else if (s->cutter_mode & S_CUTTER_ON && rotary_words(b)) {
        report(b, F_CUTTER_TURNED, (Says){.a = s->cutter_code});
        s->doubt |= S_DOUBT_POSITION;
    } else if (s->motion <= V_MOTION_LINE) {
        if (!straight(b, special == V_G53))
            return false;
    } else if (is_cycle(s->motion) && s->cutter_mode & S_CUTTER_ON) {
        refuse_under_compensation(b, s->motion * V_TENFOLD);
        follow(b);
        s->doubt |= S_DOUBT_Z;
    } else if (is_cycle(s->motion)) {
        if (!cycle_move(b))
            return false;
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
