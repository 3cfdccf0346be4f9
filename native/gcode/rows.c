/* Rows of straight moves, those of an arc among them, and where the axis words of a block lead. */

#include "gcode/rows.h"

#include "gcode/polar.h"

/* Find the tip position that the axis words ask for; axes not named stay. */
void target(const Block *block, double to_mm[3]) {
    const State *s = block->state;
    const double here_mm[3] = {s->x, s->y, s->z};
    const double *base_mm = work_offset_mm(block);
    for (int axis = 0; axis < 3; axis++) {
        to_mm[axis] = here_mm[axis];
        if (block->has[V_WORD_X + axis])
            to_mm[axis] = block->word[V_WORD_X + axis] * s->unit_mm + (s->absolute ? base_mm : here_mm)[axis];
    }
    if (is_polar(block)) {
        programmed_of(block, to_mm, to_mm);
        polar_point(block, to_mm);
        tip_of(block, to_mm, to_mm);
    }
}

/* Note which axes have been programmed: in absolute mode always, else if they were known before. */
void learn(Block *block) {
    State *s = block->state;
    const bool *has = block->has;
    if (is_polar(block))
        learn_polar(s, block);
    if (s->absolute) {
        s->known_x |= has[V_WORD_X];
        s->known_y |= has[V_WORD_Y];
        s->known_z |= has[V_WORD_Z];
    }
    if (s->doubt == 0)
        return;
    const int32_t named =
        has[V_WORD_X] * S_DOUBT_X + has[V_WORD_Y] * S_DOUBT_Y + has[V_WORD_Z] * S_DOUBT_Z;
    if (s->doubt & (S_DOUBT_UNIT | S_DOUBT_DISTANCE))
        s->doubt |= named;
    else if (s->absolute)
        s->doubt &= ~named;
}

/* Go where the axis words lead, without a row: after an error the next block starts there. */
void follow(Block *block) {
    double to_mm[3];
    target(block, to_mm);
    block->state->x = to_mm[0];
    block->state->y = to_mm[1];
    block->state->z = to_mm[2];
    follow_rotary(block);
    learn(block);
}

/* Write the rows of an arc; the last ends exactly where the block says. */
void emit_chords(Block *b, const Arc *arc, double angle, double sweep, int64_t chords, double mm_s) {
    State *s = b->state;
    const double from_deg[3] = {s->rotary_deg[0], s->rotary_deg[1], s->rotary_deg[2]};
    const double time_s = compensates(s) ? NAN : feed_time_s(b, INFINITY, chords);
    double at_mm[3];
    for (int64_t k = 1; k <= chords; k++) {
        const double part = (double)k / (double)chords;
        const double r = arc->from_radius_mm + (arc->to_radius_mm - arc->from_radius_mm) * part;
        at_mm[arc->first] = arc->centre.u + r * cos(angle + sweep * part);
        at_mm[arc->second] = arc->centre.v + r * sin(angle + sweep * part);
        at_mm[arc->third] = arc->from_w + (arc->to_w - arc->from_w) * part;
        stand_at(s, k == chords ? arc->to_mm : at_mm);
        stand_turned_between(s, from_deg, b->turn_deg, part);
        emit(b->machine, b->line, mm_s, false, false, s->arcs);
        note_time(b, time_s);
    }
    const double side = sweep < 0.0 ? -1.0 : 1.0, radius_mm = distance(arc->to, arc->centre);
    s->arc_end[0] = -side * (arc->to.v - arc->centre.v) / radius_mm;
    s->arc_end[1] = side * (arc->to.u - arc->centre.u) / radius_mm;
    s->arc_end_rows = b->counts->rows;
    s->arcs++;
}
