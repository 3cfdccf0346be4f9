/* The words of a dialect's block become those of the core: tables in gcode2krl/gcode/dialects.py. */

#include "gcode/dialect_words.h"

#include "gcode/cycles.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"

static const double LEAST_MM = 0.001, LEAST_INCH = 0.0001, TURNS = -1.0;

static bool refuse(Block *b, int reason, double code) {
    report(b, F_DIALECT_CODE, (Says){.a = reason, .b = code});
    return false;
}

/* Take what the scanner has marked: the next word, a frame, or something that says nothing. */
void take_dialect_mark(Block *b, uint8_t c, double value) {
    if (c == D_SKIPPED)
        note(b, S_NOTE_STATEMENT, 0);
    else if (c == D_FRAME)
        b->frame = (int32_t)value;
    else
        b->next_word = c;
}

/* Keep what has been said of the word of a letter before it. */
void say_of_word(Block *b, int index) {
    if (b->next_word == D_NEXT_POINTLESS)
        b->pointless |= 1 << index;
    else if (b->next_word == D_NEXT_ABSOLUTE)
        b->absolute |= 1 << index;
    else
        b->incremental |= 1 << index;
    b->next_word = 0;
}

/* Return the core's code for a G number, both ten times; below 0 where it has none. */
int32_t core_code(Block *b, int64_t written, bool *good) {
    const int32_t code = written < b->machine->core_g.rows ? AT(b->machine->core_g, written) : D_CODE_UNKNOWN;
    *good = true;
    if (code == D_CODE_HARMLESS) {
        note(b, S_NOTE_CODE, (int32_t)written);
        b->harmless = (int32_t)written;
    } else if (code == D_CODE_EXACT) {
        b->exact_once = true;
    } else if (code <= D_CODE_REFUSED) {
        *good = refuse(b, D_CODE_REFUSED - code, (double)written);
    }
    return code;
}

/* --- numbers without a point ---------------------------------------------------------------------------- */

/* Tell whether a word of a block is a length, an angle, or a feed per turn or in inches. */
static bool goes_by_point(const Block *b, int index) {
    const State *s = b->state;
    if (b->harmless && (index == V_WORD_P || index == V_WORD_Q || index == V_WORD_R))
        return false;
    if (index != V_WORD_F)
        return true;
    const int32_t mode = b->g[V_FEED_MODE] >= 0 ? b->g[V_FEED_MODE] / V_TENFOLD : s->feed_mode;
    const bool inches = b->g[V_UNIT] >= 0 ? b->g[V_UNIT] == V_G20 : s->unit_mm != 1.0;
    return mode == V_PER_REVOLUTION || (mode == V_PER_MINUTE && inches);
}

static bool read_pointless(Block *b) {
    const bool inches = b->g[V_UNIT] >= 0 ? b->g[V_UNIT] == V_G20 : b->state->unit_mm != 1.0;
    for (int index = 0; index < V_LETTERS; index++) {
        if (!(b->pointless & 1 << index) || !goes_by_point(b, index))
            continue;
        if (b->machine->points == D_POINT_REQUIRED) {
            report(b, F_NO_POINT, (Says){.a = index + CH_LETTER_A, .b = b->word[index]});
            return false;
        }
        b->word[index] *= inches && index != V_WORD_F ? LEAST_INCH : LEAST_MM;
    }
    return true;
}

/* --- dwells and lengths --------------------------------------------------------------------------------- */

/* G4 gets its seconds as P, whatever its letter and unit are. */
static bool read_dwell(Block *b) {
    for (int index = 0; index < V_LETTERS; index++) {
        const double unit_s = AT(b->machine->dwell_by_letter, index);
        if (!b->has[index] || isnan(unit_s))
            continue;
        const double value = b->word[index];
        double seconds = value * unit_s;
        if (unit_s == TURNS && b->state->rpm > 0.0)
            seconds = value * U_S_PER_MIN / b->state->rpm;
        else if (unit_s == TURNS)
            seconds = 0.0;
        b->has[index] = false;
        b->has[V_WORD_P] = true;
        b->word[V_WORD_P] = seconds;
        return true;
    }
    return true;
}

/* D0 ends the tool's length and D1 begins it. */
static bool read_edge(Block *b) {
    const int d = CH_LETTER_A + 3 - CH_LETTER_A;
    if (!b->has[d])
        return true;
    b->has[d] = false;
    if (b->word[d] != 0.0 && b->word[d] != 1.0) {
        report(b, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_EDGE});
        return false;
    }
    b->g[V_LENGTH_OFFSET] = b->word[d] == 0.0 ? V_G49 : V_G43;
    return true;
}

/* Dwells and repeats of a drilling cycle. */
static void read_cycle(Block *b) {
    const bool named = b->g[V_MOTION] >= 0;
    if (!is_cycle(named ? b->g[V_MOTION] / V_TENFOLD : b->state->motion) || b->g[V_NON_MODAL] == V_G4)
        return;
    b->word[V_WORD_P] *= b->machine->cycle_dwell_s;
    if (!b->machine->repeats_by_k || !b->has[V_WORD_K])
        return;
    b->has[V_WORD_K] = false;
    b->pointless &= ~(1 << V_WORD_K); /* a count */
    b->has[V_WORD_L] = true;
    b->word[V_WORD_L] = b->word[V_WORD_K];
}

/* --- coordinates that say for themselves how they count ------------------------------------------------- */

static bool is_absolute_here(const Block *b) {
    return b->g[V_DISTANCE] >= 0 ? b->g[V_DISTANCE] == V_G90 : b->state->absolute != 0;
}

/* X=IC(5) under G90 and X=AC(5) under G91 become what the mode in force says. */
static bool count_axis(Block *b, int axis) {
    const State *s = b->state;
    const int index = V_WORD_X + axis;
    const double here_mm[3] = {s->x, s->y, s->z};
    const bool known[3] = {s->known_x != 0, s->known_y != 0, s->known_z != 0};
    const double unit_mm = b->g[V_UNIT] < 0 ? s->unit_mm : b->g[V_UNIT] == V_G20 ? U_MM_PER_INCH : 1.0;
    double programmed_mm[3];
    programmed_of(b, here_mm, programmed_mm);
    const double from_base = programmed_mm[axis] / unit_mm;
    const bool absolute = is_absolute_here(b), differs = absolute ? b->incremental & 1 << index : b->absolute & 1 << index;
    if (!differs)
        return true;
    if (!known[axis]) {
        report_unless(b, S_DOUBT_X << axis, F_COUNTED_FROM_UNKNOWN, (Says){.a = index + CH_LETTER_A});
        return false;
    }
    b->word[index] += absolute ? from_base : -from_base;
    return true;
}

/* I=AC(5) is a centre in the coordinates of the part. */
static void count_centre(Block *b, int axis) {
    const State *s = b->state;
    const double here_mm[3] = {s->x, s->y, s->z};
    const int index = V_WORD_I + axis;
    double programmed_mm[3];
    programmed_of(b, here_mm, programmed_mm);
    if (b->absolute & 1 << index)
        b->word[index] -= programmed_mm[axis] / s->unit_mm;
}

/* --- all ------------------------------------------------------------------------------------------------ */

static bool names_axis(const Block *b) {
    return b->has[V_WORD_X] || b->has[V_WORD_Y] || b->has[V_WORD_Z];
}

/* Codes that say nothing keep their own words; beside axis words nobody knows whose they are. */
static bool use_harmless_words(Block *b) {
    static const int OWN[] = {V_WORD_P, V_WORD_Q, V_WORD_R, V_WORD_I, V_WORD_J, V_WORD_K, V_WORD_H};
    if (names_axis(b) && b->g[V_MOTION] < 0 && b->g[V_NON_MODAL] < 0)
        return refuse(b, DR_REASON_BESIDE, b->harmless);
    if (!names_axis(b))
        for (size_t k = 0; k < sizeof OWN / sizeof *OWN; k++)
            b->used[OWN[k]] |= b->has[OWN[k]];
    return true;
}

/* Make the words of a block those of the core; return false, with a finding, where that cannot be. */
bool to_core_words(Block *b) {
    bool good = true;
    read_cycle(b);
    if (b->pointless)
        good = read_pointless(b);
    if (b->g[V_NON_MODAL] == V_G4)
        good = read_dwell(b) && good;
    if (b->machine->length_by_d)
        good = read_edge(b) && good;
    if (b->incremental | b->absolute)
        for (int axis = 0; axis < 3; axis++) {
            good = count_axis(b, axis) && good;
            count_centre(b, axis);
        }
    if (b->harmless)
        good = use_harmless_words(b) && good;
    if (b->frame) {
        report(b, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_SHIFT});
        good = false;
    }
    return good;
}
