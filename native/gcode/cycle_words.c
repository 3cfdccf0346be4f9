/* What the words of a canned cycle say, and what is wrong with them; in LinuxCNC's order. */

#include "gcode/cycle_words.h"

#include "gcode/feed.h"
#include "gcode/motion.h"
#include "gcode/polar.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"

static const double CLEARANCE_MM = 0.254; /* LinuxCNC's, 0.010 inch */
static const double SAME_HEIGHT = 1e-9;  /* heights closer than this differ by rounding: unit, work offset */

static bool pecks_in(int32_t motion) { return motion == V_CYCLE_CHIP || motion == V_CYCLE_PECK; }
static bool taps(int32_t motion) { return motion == V_CYCLE_TAP || motion == V_CYCLE_TAP_LEFT; }

static bool needs_dwell(int32_t motion) {
    return motion == V_CYCLE_DWELL || motion == V_CYCLE_BORE_STOP || motion == V_CYCLE_BORE;
}

/* Note which words the cycle in force uses. */
void use_cycle_words(Block *b) {
    const int32_t motion = b->state->motion;
    b->used[V_WORD_R] = true;
    b->used[V_WORD_L] |= motion != V_CYCLE_TAP_LEFT; /* as LinuxCNC */
    b->used[V_WORD_Q] |= pecks_in(motion);
    b->used[V_WORD_D] |= pecks_in(motion);
    b->used[V_WORD_P] |= needs_dwell(motion) || taps(motion);
}

/* --- where the cycle is --------------------------------------------------------------------------------- */

/* Find the axes of a cycle, where the tool stands, and the height to which G98 leads back. */
Cycle cycle_of(const Block *b) {
    const State *s = b->state;
    const int8_t known[3] = {s->known_x, s->known_y, s->known_z};
    const double tip_mm[3] = {s->x, s->y, s->z};
    double here_mm[3];
    Cycle c = {.motion = s->motion, .first = s->plane == V_PLANE_XY ? 0 : s->plane == V_PLANE_ZX ? 2 : 1};
    c.second = (c.first + 1) % 3;
    c.third = (c.first + 2) % 3;
    programmed_of(b, tip_mm, here_mm);
    c.u_mm = here_mm[c.first];
    c.v_mm = here_mm[c.second];
    c.height = here_mm[c.third] / s->unit_mm;
    c.height_known = known[c.third];
    c.level = s->in_cycles ? s->cycle_level_mm / s->unit_mm : c.height;
    c.level_known = s->in_cycles ? s->cycle_level_known : c.height_known;
    c.rests_on = S_DOUBT_X << c.third | S_DOUBT_UNIT | S_DOUBT_PLANE | S_DOUBT_DISTANCE;
    return c;
}

/* Find the holes across the tool: the first, and the step to each further one. */
static void place_holes(const Block *b, Cycle *c) {
    const State *s = b->state;
    const bool has_u = b->has[V_WORD_X + c->first], has_v = b->has[V_WORD_X + c->second];
    const double u_mm = b->word[V_WORD_X + c->first] * s->unit_mm;
    const double v_mm = b->word[V_WORD_X + c->second] * s->unit_mm;
    c->u_from_mm = has_u && s->absolute ? u_mm : c->u_mm;
    c->v_from_mm = has_v && s->absolute ? v_mm : c->v_mm;
    c->u_step_mm = has_u && !s->absolute ? u_mm : 0.0;
    c->v_step_mm = has_v && !s->absolute ? v_mm : 0.0;
}

/* Note the axes across the tool as programmed. */
void learn_across(Block *b, const Cycle *c) {
    State *s = b->state;
    int8_t *known[3] = {&s->known_x, &s->known_y, &s->known_z};
    const int across[2] = {c->first, c->second};
    if (is_polar(b))
        learn_polar(s, b);
    for (int k = 0; k < 2; k++)
        if (s->absolute && b->has[V_WORD_X + across[k]])
            *known[across[k]] = 1;
}

/* --- findings ------------------------------------------------------------------------------------------- */

static bool fails(Block *b, int32_t doubt, int32_t number, Says says) {
    report_unless(b, doubt, number, says);
    return false;
}

/* The conditions that no word of the block decides. */
static bool may_begin(Block *b, Cycle *c) {
    State *s = b->state;
    const double code = s->motion * V_TENFOLD;
    if (!b->has[V_WORD_X] && !b->has[V_WORD_Y] && !b->has[V_WORD_Z] && !is_polar(b))
        return fails(b, 0, FC_NO_AXES, (Says){.a = code});
    if (s->feed_mode == V_INVERSE_TIME)
        return fails(b, S_DOUBT_FEED_MODE, FC_INVERSE_TIME, (Says){.a = code, .b = s->feed_mode_line});
    const int finding = feed_speed(b, 0.0, &c->mm_s);
    if (finding != F_OK)
        report_speed(b, finding);
    if (s->in_cycles && (s->cycle_plane != s->plane || s->cycle_unit_mm != s->unit_mm))
        return fails(b, S_DOUBT_PLANE | S_DOUBT_UNIT, FC_MODES_CHANGED, (Says){.a = s->cycle_line});
    return finding == F_OK;
}

/* R and the depth: of this block, else those of the cycles before. */
static bool take_heights(Block *b, Cycle *c) {
    State *s = b->state;
    const bool goes_on = b->motion_before == s->motion;
    const int bottom = V_WORD_X + c->third;
    const double code = s->motion * V_TENFOLD;
    if (!b->has[V_WORD_R] && !goes_on)
        return fails(b, 0, FC_NO_R, (Says){.a = code, .b = 'X' + c->third});
    if (!b->has[bottom] && !goes_on)
        return fails(b, S_DOUBT_PLANE, FC_NO_DEPTH, 
                     (Says){.a = code, .b = 'X' + c->third, .c = s->plane});
    if (!(b->has[V_WORD_R] && b->has[bottom]) && s->cycle_absolute != s->absolute)
        return fails(b, S_DOUBT_DISTANCE, FC_DISTANCE_CHANGED,
                     (Says){.a = s->cycle_line, .b = 'X' + c->third, .c = most(0, s->distance_line)});
    const double r = b->has[V_WORD_R] ? b->word[V_WORD_R] : s->cycle_r;
    const double depth = b->has[bottom] ? b->word[bottom] : s->cycle_depth;
    c->r = s->absolute ? r : r + c->level;
    c->bottom = s->absolute ? depth : c->r + depth;
    c->r_known = s->absolute || c->level_known;
    c->height = fabs(c->height - c->r) < SAME_HEIGHT ? c->r : c->height;
    c->level = fabs(c->level - c->r) < SAME_HEIGHT ? c->r : c->level;
    c->clear = s->retract == V_G98 ? greater(c->level, c->r) : c->r;
    s->cycle_r = r;
    s->cycle_depth = depth;
    if (c->r < c->bottom)
        return fails(b, c->rests_on, FC_R_BELOW_DEPTH,
                     (Says){.a = c->r, .b = 'X' + c->third, .c = c->bottom});
    return true;
}

static bool take_repeats(Block *b, Cycle *c) {
    c->repeats = b->has[V_WORD_L] ? whole(b->word[V_WORD_L]) : 1;
    const bool stores = c->repeats == 0 && b->machine->repeats_by_k; /* a Fanuc keeps the words and drills nothing */
    return c->repeats > 0 || stores || fails(b, 0, FC_REPEATS, (Says){.a = b->word[V_WORD_L]});
}

static bool take_dwell(Block *b, Cycle *c) {
    State *s = b->state;
    if (!needs_dwell(s->motion) && !taps(s->motion))
        return true;
    if (!b->has[V_WORD_P] && needs_dwell(s->motion) && b->motion_before != s->motion) {
        const bool none_holds = !s->in_cycles || s->cycle_p == 0.0 || s->motion == V_CYCLE_BORE_STOP;
        if (b->machine->programs != D_PROGRAMS_FANUC || !none_holds)
            return fails(b, 0, FC_NO_DWELL, (Says){.a = s->motion * V_TENFOLD});
        s->cycle_p = 0.0; /* a Fanuc does not dwell then */
    }
    c->dwell_s = b->has[V_WORD_P] ? b->word[V_WORD_P] : s->cycle_p;
    s->cycle_p = c->dwell_s;
    return c->dwell_s >= 0.0 || fails(b, 0, FC_DWELL_NEGATIVE, (Says){.a = c->dwell_s});
}

static bool take_peck(Block *b, Cycle *c) {
    State *s = b->state;
    if (!pecks_in(s->motion))
        return true;
    if (!b->has[V_WORD_Q] && b->motion_before != s->motion)
        return fails(b, 0, FC_NO_PECK, (Says){.a = s->motion * V_TENFOLD});
    c->peck = b->has[V_WORD_Q] ? b->word[V_WORD_Q] : s->cycle_q;
    s->cycle_q = c->peck;
    if (!(c->peck > 0.0))
        return fails(b, 0, FC_PECK_NOT_POSITIVE, (Says){.a = c->peck});
    c->clearance = b->has[V_WORD_D] ? b->word[V_WORD_D] : CLEARANCE_MM / s->unit_mm;
    return c->clearance >= 0.0 || fails(b, 0, FC_CLEARANCE_NEGATIVE, (Says){.a = c->clearance});
}

/* Tapping and boring with a stop need a turning spindle; a tap turns with its thread. */
static bool spindle_turns(Block *b) {
    const State *s = b->state;
    const double code = s->motion * V_TENFOLD;
    if (!taps(s->motion) && s->motion != V_CYCLE_BORE_STOP)
        return true;
    if (s->direction == 0)
        return fails(b, S_DOUBT_ALL, FC_SPINDLE_OFF, (Says){.a = code});
    const int32_t with_thread = s->motion == V_CYCLE_TAP ? 1 : -1;
    if (taps(s->motion) && s->direction != with_thread)
        return fails(b, S_DOUBT_ALL, FC_SPINDLE_DIRECTION,
                     (Says){code, s->direction > 0 ? V_M3 : V_M4, with_thread > 0 ? V_M3 : V_M4});
    return true;
}

/* No coordinate on the way may be beyond what a part has. */
static bool is_near(Block *b, const Cycle *c) {
    const State *s = b->state;
    const double above = greater(fabs(c->level), fabs(c->height));
    const double along = greater(greater(fabs(c->r), fabs(c->bottom)), above);
    const double last_u_mm = c->u_from_mm + c->u_step_mm * (double)c->repeats;
    const double last_v_mm = c->v_from_mm + c->v_step_mm * (double)c->repeats;
    const double across_mm = greater(fabs(last_u_mm), fabs(last_v_mm));
    const double largest_mm = greater(along * s->unit_mm, across_mm);
    return largest_mm <= FAR_MM || fails(b, S_DOUBT_ALL, F_TOO_FAR, (Says){.a = largest_mm});
}

/* Take all words of a cycle; return false, with a finding, where it cannot be carried out. */
bool cycle_words(Block *b, Cycle *c) {
    if (!may_begin(b, c) || !take_repeats(b, c) || !take_heights(b, c))
        return false;
    place_holes(b, c);
    return take_dwell(b, c) && take_peck(b, c) && spindle_turns(b) && is_near(b, c);
}

/* Keep what holds for the cycles that follow. */
void remember_cycle(Block *b, const Cycle *c) {
    State *s = b->state;
    if (s->retract_line == 0 && s->retract_unnamed_line == 0 && c->level > c->r)
        s->retract_unnamed_line = b->line;
    s->in_cycles = 1;
    s->cycle_level_mm = c->level * s->unit_mm;
    s->cycle_level_known = c->level_known;
    s->cycle_plane = s->plane;
    s->cycle_unit_mm = s->unit_mm;
    s->cycle_absolute = s->absolute;
    s->cycle_line = b->line;
    if (s->doubt == 0)
        return;
    const int32_t across = b->has[V_WORD_X + c->first] * (S_DOUBT_X << c->first) |
                           b->has[V_WORD_X + c->second] * (S_DOUBT_X << c->second);
    if (s->absolute && !(s->doubt & (S_DOUBT_UNIT | S_DOUBT_DISTANCE)))
        s->doubt &= ~(across | (c->clear == c->r ? S_DOUBT_X << c->third : 0));
}
