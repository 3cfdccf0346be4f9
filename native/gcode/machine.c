/* The modal interpreter: words in, rows of straight moves out; one block at a time.

   The order of execution inside a block is RS274/NGC's: feed mode, F, S, T, tool change, spindle, coolant,
   dwell, plane, unit, length offset, work offset, path control, distance mode, machine moves, motion, stop.
   A block that was not understood is followed all the same, without further findings, so that the blocks
   after it are judged by their own faults. */

#include "gcode/machine.h"

#include "gcode/block_words.h"
#include "gcode/compensate.h"
#include "gcode/corners.h"
#include "gcode/cutter_settings.h"
#include "gcode/cycles.h"
#include "gcode/motion.h"
#include "gcode/offsets.h"
#include "gcode/polar.h"
#include "gcode/reporting.h"
#include "gcode/rotary.h"
#include "gcode/rows.h"
#include "gcode/program_turn.h"
#include "gcode/settings.h"
#include "gcode/siemens_cycles.h"

enum { ROWS_PER_BLOCK = 4, EVENTS_PER_BLOCK = 16 }; /* but for an arc or a cycle, and for messages */

/* --- the bulk of a CAM file ----------------------------------------------------------------------------- */

enum { X_NAMED = 1, Y_NAMED = 2, Z_NAMED = 4, F_NAMED = 8, ALL_AXES = X_NAMED | Y_NAMED | Z_NAMED };

/* Execute a block of nothing but X, Y, Z and F under G0 or G1.

   Returns false, with nothing done, where the block is anything else or needs a closer look. One function
   with many branches: a call for each word would cost more than the word. */
static inline bool plain_block(Machine *machine, const Words *words, int64_t from, int64_t to) {
    State *s = machine->state.at;
    const bool feeding = s->motion == V_MOTION_LINE;
    if ((!feeding && s->motion != V_MOTION_RAPID) || s->feed_mode != V_PER_MINUTE ||
        s->doubt | s->rotary_unknown | s->cutter_mode | s->corner | s->modal_call | s->turned_anew | s->zero_in_doubt)
        return false;
    double x = 0.0, y = 0.0, z = 0.0, feed = s->feed;
    int named = 0;
    for (int64_t k = from; k < to; k++) {
        const double value = AT(words->value, k);
        int bit = 0;
        switch (AT(words->letter, k)) {
        case 'X': x = value, bit = X_NAMED; break;
        case 'Y': y = value, bit = Y_NAMED; break;
        case 'Z': z = value, bit = Z_NAMED; break;
        case 'F': feed = value * s->unit_mm, bit = machine->rotary_axes ? 0 : F_NAMED; break;
        }
        if (bit == 0 || named & bit)
            return false;
        named |= bit;
    }
    const bool known = s->known_x && s->known_y && s->known_z;
    if (!(named & ALL_AXES) || feed < 0.0 || (feeding && (feed <= 0.0 || !known)))
        return false;
    const double *base_mm = s->base_mm;
    x = named & X_NAMED ? x * s->unit_mm + (s->absolute ? base_mm[0] : s->x) : s->x;
    y = named & Y_NAMED ? y * s->unit_mm + (s->absolute ? base_mm[1] : s->y) : s->y;
    z = named & Z_NAMED ? z * s->unit_mm + (s->absolute ? base_mm[2] : s->z) : s->z;
    const double largest_mm = greater(greater(fabs(x), fabs(y)), fabs(z));
    if (largest_mm > FAR_MM)
        return false;
    s->largest_mm = greater(s->largest_mm, largest_mm);
    s->x = x;
    s->y = y;
    s->z = z;
    s->feed = feed;
    if (s->absolute) {
        s->known_x |= (named & X_NAMED) != 0;
        s->known_y |= (named & Y_NAMED) != 0;
        s->known_z |= (named & Z_NAMED) != 0;
    }
    emit(machine, AT(words->line, from), feeding ? feed / U_S_PER_MIN : RAPID_MM_S, !feeding, false, NO_ARC);
    s->blocks++;
    return true;
}

/* --- any block ------------------------------------------------------------------------------------------ */

/* Tell whether a block has a word of any axis. */
static bool names_axis(const Block *b) {
    bool named = b->vector_named || b->has[V_WORD_X] || b->has[V_WORD_Y] || b->has[V_WORD_Z] || is_polar(b);
    for (int k = 0; k < OTHER_AXES_COUNT; k++)
        named = named || b->has[OTHER_AXES[k]];
    return named;
}

static bool names_motion(const Block *b) { return b->g[V_MOTION] >= 0 && b->g[V_MOTION] != V_G80; }

static bool is_arc(int32_t motion) { return motion == V_MOTION_ARC_CW || motion == V_MOTION_ARC_CCW; }

/* Tell whether a centre is named while an arc mode is in force: a full circle. */
static bool names_centre_alone(const Block *b) {
    return is_arc(b->state->motion) && (b->has[V_WORD_I] || b->has[V_WORD_J] || b->has[V_WORD_K]);
}

static void use_axes(Block *b) {
    b->used[V_WORD_X] = b->used[V_WORD_Y] = b->used[V_WORD_Z] = true;
    for (int k = 0; k < V_ROTARY_AXES; k++)
        b->used[V_WORD_A + k] = true;
}

static void use_arc_words(Block *b) {
    b->used[V_WORD_I] = b->used[V_WORD_J] = b->used[V_WORD_K] = true;
    b->used[V_WORD_R] = b->used[V_WORD_P] = true;
}

static void dwell(Block *b) {
    const double p = b->word[V_WORD_P];
    b->used[V_WORD_P] |= b->has[V_WORD_P];
    if (!b->has[V_WORD_P])
        report(b, F_DWELL_NO_P, (Says){0});
    else if (p < 0.0)
        report(b, F_DWELL_NEGATIVE, (Says){.a = p});
    else
        AT(b->machine->rows.dwell_s, b->counts->rows - 1) += p;
}

/* G28 and G30; G0 beside them with axis words is what many posts write, and leaves no doubt. */
static void home(Block *b, bool any_axis) {
    const int32_t special = b->g[V_NON_MODAL], motion_code = b->g[V_MOTION];
    const bool beside = names_motion(b);
    if (beside && (motion_code != V_G0 || !any_axis)) {
        report(b, F_TWO_AXIS_CODES, (Says){.a = special, .b = motion_code});
        b->state->doubt |= S_DOUBT_POSITION;
        return;
    }
    if (beside)
        note(b, S_NOTE_HOME, special);
    machine_home(b, any_axis);
}

static void set_home(State *s, double home_mm[3], double home_deg[3]) {
    for (int k = 0; k < V_ROTARY_AXES; k++)
        home_deg[k] = s->rotary_deg[k];
    tip_position(s, home_mm);
    home_mm[2] += length_offset_of(s);
}

/* An offset uses the axis words up: report another code that claims them too, and do neither. */
static void refuse_second_claim(Block *b) {
    const int32_t special = b->g[V_NON_MODAL];
    const bool by_length = b->g[V_LENGTH_OFFSET] == V_G43_1 || b->g[V_LENGTH_OFFSET] == V_G43_2;
    const bool by_special = special >= 0 && special != V_G4 && special != V_G53;
    if (!names_motion(b) && !(by_length && by_special))
        return;
    const int32_t other = names_motion(b) ? b->g[V_MOTION] : special;
    report(b, F_TWO_AXIS_CODES, (Says){.a = by_length ? b->g[V_LENGTH_OFFSET] : special, .b = other});
    b->state->doubt |= S_DOUBT_POSITION;
    b->g[V_NON_MODAL] = b->g[V_LENGTH_OFFSET] = -1;
    for (int index = 0; index < V_LETTERS; index++)
        b->used[index] = true;
}

/* G4, G28 and G30, G28.1 and G30.1, and what sets an offset. */
static void non_modal(Block *b, bool any_axis) {
    State *s = b->state;
    switch (b->g[V_NON_MODAL]) {
    case V_G4: dwell(b); break;
    case V_G28:
    case V_G30:
        use_axes(b);
        home(b, any_axis);
        break;
    case V_G28_1: set_home(s, s->home_28, s->home_28_deg); break;
    case V_G30_1: set_home(s, s->home_30, s->home_30_deg); break;
    default: offset_codes(b, any_axis);
    }
}

static void motion_mode(Block *b) {
    State *s = b->state;
    b->motion_before = s->motion;
    if (b->g[V_MOTION] < 0)
        return;
    if (b->g[V_MOTION] != V_G80)
        s->motion = b->g[V_MOTION] / V_TENFOLD;
    else
        s->motion = b->machine->g80_keeps_motion ? s->motion_beside_cycles : V_MOTION_CANCELLED;
    if (!is_cycle(s->motion))
        s->motion_beside_cycles = s->motion;
    s->motion_line = b->line;
    s->doubt &= ~S_DOUBT_MOTION;
}

static void report_unused(Block *b) {
    int32_t unused = 0;
    for (int index = 0; index < V_LETTERS; index++)
        if (b->has[index] && !b->used[index])
            unused |= 1 << index;
    if (unused)
        report_unless(b, S_DOUBT_MOTION, F_UNUSED_WORD,
                      (Says){unused, b->state->motion, b->state->motion_line});
}

/* M0, M1, M2, M30 and M60, at the end of their block; M60 stops as M0 does. */
static void stop(Block *b) {
    for (int k = 0; k < V_M_CODES; k++) {
        const int32_t m = b->m_codes[k];
        if (!stops(m))
            continue;
        event(b, S_EVENT_M, m == V_M60 ? V_M0 : m, NAN);
        if (m == V_M2 || m == V_M30) {
            end_compensation(b);
            b->state->ended = 1;
            b->state->end_line = b->line;
        }
    }
}

/* Execute a block whose words are sorted; return false where there is no room for its rows. */
static bool execute(Block *b) {
    if (b->modal || (b->cycle && b->cycle != V_CYCLE_BEHIND))
        return cycle_call(b);
    if ((b->turn && !turn_frame(b)) || !may_stay_turned(b))
        return true;
    const bool any_axis = names_axis(b), sets_offset = takes_axes(b, any_axis);
    if (sets_offset) {
        use_axes(b);
        refuse_second_claim(b);
        if (offsets_rotary(b))
            return true;
    }
    const int32_t special = b->g[V_NON_MODAL];
    apply_settings(b);
    for (int k = 0; k < OTHER_AXES_COUNT; k++)
        b->used[OTHER_AXES[k]] |= b->has[OTHER_AXES[k]] && !is_declared(b->machine, k);
    const bool homes = special == V_G28 || special == V_G30;
    non_modal(b, any_axis);
    if (b->g[V_SHIFT_STATE] >= 0)
        shift_by_code(b);
    motion_mode(b);
    b->state->in_cycles &= is_cycle(b->state->motion);
    const bool moves = !homes && !sets_offset && (any_axis || names_motion(b) || names_centre_alone(b));
    if (special == V_G53 && (!moves || b->state->motion == V_MOTION_CANCELLED)) {
        report_unless(b, S_DOUBT_MOTION, F_G53_NEEDS_RAPID_OR_FEED, (Says){0});
        b->state->doubt |= S_DOUBT_POSITION;
        return true;
    }
    if (moves) {
        const bool by_parameter = b->machine->programs == D_PROGRAMS_FANUC && b->state->distance_line == 0;
        if (by_parameter && b->state->distance_unnamed_line == 0)
            b->state->distance_unnamed_line = b->line;
        use_axes(b);
        if (is_arc(b->state->motion))
            use_arc_words(b);
        else if (is_cycle(b->state->motion))
            use_cycle_words(b);
        else
            use_vector(b);
        if (is_cycle(b->state->motion) && !may_cycle(b))
            return true;
        if (b->state->cutter_mode & S_CUTTER_ON)
            tell_other_diameter(b);
        if (b->state->turned_anew && !names_both(b))
            return true;
        if (!move(b) || !modal_cycle(b))
            return false;
    }
    if (b->cycle == V_CYCLE_BEHIND && !hole_behind(b))
        return false;
    const bool across = moves && (b->has[V_WORD_X] || b->has[V_WORD_Y] || names_centre_alone(b));
    b->state->cutter_idle = across ? 0 : b->state->cutter_idle + 1;
    report_unused(b);
    stop(b);
    return true;
}

/* Execute the block of words `from` to `to`; return false, with nothing done, where there is no room. */
static bool any_block(Machine *machine, const Words *words, int64_t from, int64_t to) {
    State *s = machine->state.at;
    Counts *counts = machine->counts.at;
    const State state_before = *s;
    const Counts counts_before = *counts;
    Block block = {.machine = machine, .state = s, .counts = counts, .line = AT(words->line, from)};
    int32_t doubt;
    const BlockKind kind = gather(&block, words, from, to, &doubt);
    if (counts->program_wanted) { /* as if the block had not begun */
        *s = state_before;
        *counts = counts_before;
        counts->program_wanted = 1;
        return false;
    }
    if (kind == LEFT_OUT)
        return true;
    const bool all_axes_in_doubt = (doubt & S_DOUBT_POSITION) == S_DOUBT_POSITION;
    if (block.g[V_MOTION] >= 0 && kind == FAULTY && all_axes_in_doubt)
        doubt &= ~S_DOUBT_MOTION; /* beside a code nobody knows the motion mode is named */
    counts->mute = kind == FAULTY;
    s->doubt |= doubt;
    const int8_t stops_exactly = s->exact_stop;
    s->exact_stop |= block.exact_once;
    const int32_t corner_line = s->corner ? s->corner_line : 0;
    const bool done = execute(&block);
    if (block.exact_once && block.g[V_PATH_CONTROL] < 0)
        s->exact_stop = stops_exactly;
    if (done)
        refuse_open_corner(&block, corner_line);
    counts->mute = 0;
    if (!done) { /* an arc or a cycle needs more room than there is: as if the block had not begun */
        const int64_t rows_wanted = counts->rows_wanted, events_wanted = counts->events_wanted;
        *s = state_before;
        *counts = counts_before;
        counts->rows_wanted = rows_wanted;
        counts->events_wanted = events_wanted;
        return false;
    }
    s->doubt |= doubt;
    s->blocks++;
    return true;
}

/* Tell whether there is room for what a block of so many words makes, but for an arc; else say how much. */
bool has_room(Machine *machine, int64_t words) {
    Counts *counts = machine->counts.at;
    counts->rows_wanted = counts->rows + ROWS_PER_BLOCK;
    counts->events_wanted = counts->events + EVENTS_PER_BLOCK + words; /* each may be a message */
    return counts->rows_wanted <= machine->rows.feed_mm_s.rows &&
           counts->events_wanted <= machine->events.rows;
}

/* Execute the block of words `from` to `to`; return false, with nothing done, where more room is wanted, or the
   whole program, as the block jumps. */
bool run_block(Machine *machine, const Words *words, int64_t from, int64_t to) {
    return has_room(machine, to - from) &&
           (plain_block(machine, words, from, to) || any_block(machine, words, from, to));
}

/* Execute blocks from a word on; return the word at which to go on, earlier where room is wanted, or the whole
   program. */
EXPORT int64_t gcode_run(Machine *machine, Bytes letter, Floats value, Floats extra, Ints32 line,
                         int64_t from) {
    const Words words = {letter, value, extra, line};
    if (!machine->state.at->offsets_taken)
        take_offsets(machine);
    machine->state.at->offsets_taken = 1;
    machine->counts.at->program_wanted = 0;
    while (from < letter.rows && !machine->state.at->ended) {
        int64_t to = from + 1;
        while (to < letter.rows && AT(line, to) == AT(line, from))
            to++;
        if (!has_room(machine, to - from))
            break;
        if (!plain_block(machine, &words, from, to) && !any_block(machine, &words, from, to))
            break;
        from = to;
    }
    return from;
}
