/* Rotary words, tool vectors and their feeds. What a machine makes of the angles is not known here. */

#include "gcode/rotary.h"

#include "gcode/reporting.h"

static const double MOST_DEG = 360000.0;   /* a thousand turns */
static const double NO_LENGTH_MM = 1e-6;   /* a shorter way is rounding: the rotary axes move alone */

/* Find where the rotary words lead: absolute in machine coordinates and under G90, else from here. */
static void rotary_target(const Block *b, bool by_machine, double to_deg[V_ROTARY_AXES]) {
    const State *s = b->state;
    const bool from_zero = s->absolute || (by_machine && b->g[V_NON_MODAL] == V_G53);
    for (int k = 0; k < V_ROTARY_AXES; k++) {
        to_deg[k] = s->rotary_deg[k];
        if (is_declared(b->machine, k) && b->has[V_WORD_A + k])
            to_deg[k] = b->word[V_WORD_A + k] + (from_zero ? 0.0 : s->rotary_deg[k]);
    }
}

/* Return the bits of the declared rotary letters that the block names. */
int32_t rotary_words(const Block *b) {
    int32_t bits = 0;
    for (int k = 0; k < V_ROTARY_AXES; k++)
        bits |= (is_declared(b->machine, k) && b->has[V_WORD_A + k]) << k;
    return bits;
}

/* Tell whether I, J and K are a tool vector. */
static bool takes_ijk(const State *s) { return s->length_code == V_G43_5; }

/* Tell whether tool vectors say how the tool stands: those of G43.5, or under TRAORI the last that was named. */
static bool is_by_vector(const State *s) { return takes_ijk(s) || (s->traori && s->has_vector); }

/* Find the tool vector of a block, a component that is left out being 0; return whether it names any. */
static bool named_vector(const Block *b, double vector[3]) {
    bool named = false;
    for (int k = 0; k < 3; k++) {
        const bool has = takes_ijk(b->state) ? b->has[V_WORD_I + k] : b->vector_named >> k & 1;
        vector[k] = !has ? 0.0 : takes_ijk(b->state) ? b->word[V_WORD_I + k] : b->vector[k];
        named = named || has;
    }
    return named;
}

/* I, J and K of a straight block are a tool vector under G43.5. */
void use_vector(Block *b) {
    if (takes_ijk(b->state))
        b->used[V_WORD_I] = b->used[V_WORD_J] = b->used[V_WORD_K] = true;
}

/* Tell whether a canned cycle may run, which moves along Z: no rotary words, and an upright tool where the tip
   is programmed; report it where it may not. */
bool may_cycle(Block *b) {
    const State *s = b->state;
    const int32_t named = rotary_words(b);
    const bool tilted = is_turned(s) && turn_mode(b->machine) != V_TURN_MACHINE;
    if (!named && !tilted && !s->rotary_unknown && !(is_by_vector(s) && s->has_vector))
        return true;
    report(b, F_CYCLE_TURNED, (Says){.a = s->motion * V_TENFOLD});
    b->state->doubt |= S_DOUBT_Z;
    return false;
}

/* Take a tool vector: a word that is left out is 0, as none of the three is where the tool stands as before. */
static bool take_vector(Block *b) {
    State *s = b->state;
    if (takes_ijk(s) && s->motion >= V_MOTION_ARC_CW) {
        report(b, F_VECTOR_ARC, (Says){0});
        return false;
    }
    double vector[3];
    if (!named_vector(b, vector))
        return true;
    const double size = sqrt(squared(vector[0]) + squared(vector[1]) + squared(vector[2]));
    if (!(size > 1e-6 && size < 1e6)) {
        report(b, F_VECTOR_ZERO, (Says){vector[0], vector[1], vector[2]});
        return false;
    }
    for (int k = 0; k < 3; k++)
        s->tool_vector[k] = vector[k];
    s->has_vector = 1;
    s->rotary_unknown = (int32_t)b->machine->rotary_axes; /* the machine turns its axes as it likes */
    return true;
}

/* Find where the rotary words or the tool vector of a block lead; return false where they must not. */
bool take_turn(Block *b, bool by_machine) {
    State *s = b->state;
    rotary_target(b, by_machine, b->turn_deg);
    if (!b->machine->rotary_axes)
        return true;
    const int32_t named = rotary_words(b);
    if (!by_machine && takes_ijk(s) && named) {
        report(b, F_VECTOR_AND_ANGLE, (Says){.a = named << V_WORD_A});
        return false;
    }
    if (!by_machine && (b->vector_named || (is_by_vector(s) && !named)))
        return take_vector(b);
    if (s->absolute || by_machine)
        s->rotary_unknown &= ~named;
    if (s->traori && named)
        s->has_vector = 0;
    if (!by_machine && s->rotary_unknown) {
        report(b, F_ROTARY_UNKNOWN, (Says){.a = s->rotary_unknown << V_WORD_A});
        s->rotary_unknown = 0;
    }
    for (int k = 0; k < V_ROTARY_AXES; k++)
        if (!(fabs(b->turn_deg[k]) <= MOST_DEG)) {
            report(b, F_TURN_TOO_FAR, (Says){.a = b->turn_deg[k]});
            b->turn_deg[k] = 0.0;
            s->doubt |= S_DOUBT_POSITION;
        }
    return true;
}

/* Turn where the rotary words lead, without a row. */
void follow_rotary(Block *b) {
    double to_deg[V_ROTARY_AXES];
    rotary_target(b, false, to_deg);
    stand_turned(b->state, to_deg);
}

/* G28 and G30: the named rotary axes, or all, go home. */
void rotary_home(Block *b, bool any_axis) {
    State *s = b->state;
    const double *home_deg = b->g[V_NON_MODAL] == V_G28 ? s->home_28_deg : s->home_30_deg;
    for (int k = 0; k < V_ROTARY_AXES; k++)
        if (is_declared(b->machine, k) && (b->has[V_WORD_A + k] || !any_axis)) {
            s->rotary_deg[k] = home_deg[k];
            s->rotary_unknown &= ~(1 << k);
        }
}

/* G43 to G49: note which is in force; return false where it needs a machine that is not declared. */
bool take_length_code(Block *b, int32_t code) {
    State *s = b->state;
    const bool of_tip = code == V_G43_4 || code == V_G43_5;
    if (of_tip && !b->machine->rotary_axes) {
        report(b, F_NO_MACHINE, (Says){.a = code});
        s->doubt |= S_DOUBT_POSITION;
        return false;
    }
    const bool had_tip = turn_mode(b->machine) != V_TURN_MACHINE;
    s->length_code = code;
    s->has_vector = 0;
    const bool has_tip = turn_mode(b->machine) != V_TURN_MACHINE;
    if (has_tip != had_tip && is_turned(s))
        s->known_x = s->known_y = s->known_z = 0; /* X, Y, Z mean something else from here on */
    return true;
}

/* TRAORI and TRAFOOF: X, Y, Z are the tip from here on, or the machine's axes again. */
void take_tip_code(Block *b) {
    State *s = b->state;
    const int8_t tip = b->tip == D_TIP_ON;
    if (!b->tip || tip == s->traori || !b->machine->rotary_axes)
        return;
    const bool had_tip = turn_mode(b->machine) != V_TURN_MACHINE;
    s->zero_in_doubt = s->base_mm[0] != 0.0 || s->base_mm[1] != 0.0 || s->base_mm[2] != 0.0 || s->rotated ? S_ZERO_DROPPED : 0;
    s->traori = tip;
    s->has_vector = 0;
    if (had_tip != (turn_mode(b->machine) != V_TURN_MACHINE) && is_turned(s))
        s->known_x = s->known_y = s->known_z = 0;
}

/* Return the way of the rotary axes where they move alone, else 0. */
static double turn_alone_deg(const Block *b, double length_mm) {
    const State *s = b->state;
    if (length_mm > NO_LENGTH_MM || is_by_vector(s))
        return 0.0;
    double sum = 0.0;
    for (int k = 0; k < V_ROTARY_AXES; k++)
        sum += squared(b->turn_deg[k] - s->rotary_deg[k]);
    return sqrt(sum);
}

/* Report rotary axes that move alone with a feed per revolution. */
void check_turn_feed(Block *b, double length_mm) {
    const State *s = b->state;
    if (s->feed_mode == V_PER_REVOLUTION && b->machine->rotary_axes && turn_alone_deg(b, length_mm) > 0.0)
        report_unless(b, S_DOUBT_FEED_MODE, F_TURN_PER_REV, (Says){.a = s->feed_mode_line});
}

/* Return the time that a chord of a feed move takes, NaN where the block asks for a speed: under G93 the
   block takes 1/F minutes; under G94 rotary axes alone move F degrees a minute (LinuxCNC), along the
   diagonal where they are several. */
double feed_time_s(const Block *b, double length_mm, int64_t chords) {
    const State *s = b->state;
    if (!b->machine->rotary_axes)
        return NAN;
    if (s->feed_mode == V_INVERSE_TIME)
        return b->has[V_WORD_F] && b->word[V_WORD_F] > 0.0
                   ? U_S_PER_MIN / b->word[V_WORD_F] / (double)chords
                   : NAN;
    const double turn_deg = turn_alone_deg(b, length_mm);
    return turn_deg > 0.0 && s->feed_word > 0.0 ? turn_deg / s->feed_word * U_S_PER_MIN : NAN;
}

/* Write the time of the row that was written last. */
void note_time(Block *b, double time_s) {
    if (b->machine->rotary_axes)
        AT(b->machine->rows.time_s, b->counts->rows - 1) = time_s;
}

/* X and Y of a machine move that names other axes do not lead home, also where turned axes have made them
   unknown: mark them in the row that was written last. */
void note_staying(Block *b) {
    if (!b->machine->rotary_axes)
        return;
    for (int axis = 0; axis < 2; axis++)
        if (!b->has[V_WORD_X + axis])
            CELL(b->machine->rows.known, b->counts->rows - 1, axis) = true;
}
