/* The words of a dialect's block become those of the core: tables in gcode2krl/gcode/dialects.py. */

#include "gcode/dialect_words.h"

#include "gcode/cutter_settings.h"
#include "gcode/cycles.h"
#include "gcode/reporting.h"
#include "gcode/rotary.h"
#include "gcode/rows.h"
#include "gcode/settings.h"
#include "gcode/tool_lengths.h"

static const double OFFSET_SLACK_MM = 1e-3; /* rounding of an offset in three decimals */
static const double LEAST = 0.001, LEAST_INCH = 0.0001, TURNS = -1.0, FULL_TURN_DEG = 360.0;

static bool refuse(Block *b, int reason, double code) {
    report(b, F_DIALECT_CODE, (Says){.a = reason, .b = code});
    return false;
}

static bool refuse_statement(Block *b, int reason) {
    report(b, F_DIALECT_STATEMENT, (Says){.a = reason});
    return false;
}

static bool in_inches(const Block *b) {
    return b->g[V_UNIT] >= 0 ? b->g[V_UNIT] == V_G20 : b->state->unit_mm != 1.0;
}

static bool in_cycle(const Block *b) {
    const bool named = b->g[V_MOTION] >= 0;
    return b->g[V_NON_MODAL] != V_G4 && is_cycle(named ? b->g[V_MOTION] / V_TENFOLD : b->state->motion);
}

static bool names_axis(const Block *b) {
    return b->vector_named || b->has[V_WORD_X] || b->has[V_WORD_Y] || b->has[V_WORD_Z];
}

static bool changes_tool(const Block *b) {
    for (int k = 0; k < V_M_CODES; k++)
        if (b->m_codes[k] == V_M6)
            return true;
    return false;
}

/* TRANS and ATRANS are G52 with other axis words. */
static void take_shift(Block *b, uint8_t c) {
    if (b->shift || b->g[V_NON_MODAL] >= 0)
        refuse_statement(b, DR_REASON_SHIFT_BESIDE);
    b->shift = c;
    b->g[V_NON_MODAL] = V_G52;
}

/* TRAORI and TRAFOOF, where the cell declares a machine; without one they say nothing. */
static void take_tip(Block *b, uint8_t c) {
    if (c == D_OTHER_TIP)
        refuse_statement(b, DR_REASON_OTHER_TIP);
    else if (!b->machine->rotary_axes)
        note(b, S_NOTE_STATEMENT, 0);
    if (c != D_OTHER_TIP)
        b->tip = c;
}

/* Take A3, B3 or C3, the component `axis` of the tool vector. */
bool take_component(Block *b, int axis, double value) {
    const bool repeated = b->vector_named >> axis & 1;
    b->next_word = 0;
    b->vector_named |= 1 << axis;
    b->vector[axis] = value;
    if (repeated)
        report(b, F_REPEATED_WORD, (Says){.a = 'A' + axis});
    return !repeated;
}

/* Take the corner to the next block; of a Fanuc's size without a point its parameters decide. */
static void take_corner(Block *b, uint8_t c, double value) {
    const bool pointless = b->next_word == D_NEXT_POINTLESS, counts = b->next_word && !pointless;
    b->next_word = 0;
    if (pointless && b->machine->points == D_POINT_REQUIRED)
        report(b, F_NO_POINT, (Says){.a = c == D_CORNER_ROUND ? V_WORD_R + 'A' : 'C', .b = value});
    else if (counts || b->corner || !(value > 0.0))
        refuse_statement(b, DR_REASON_CORNER);
    b->corner = c;
    b->corner_value = value * (pointless && b->machine->points == D_THOUSANDTHS ? in_inches(b) ? LEAST_INCH : LEAST : 1.0);
}

/* Take I1=, J1= or K1=, the coordinate `axis` of a point on the arc. */
bool take_via(Block *b, int axis, double value) {
    const bool repeated = b->via_named >> axis & 1;
    b->next_word = 0;
    b->via_named |= 1 << axis;
    b->via[axis] = value;
    if (repeated)
        report(b, F_REPEATED_WORD, (Says){.a = 'I' + axis});
    return !repeated;
}

/* Take CIP or CT: an arc whose direction is found when it is carried out. */
static void take_named_arc(Block *b, uint8_t c) {
    if (b->next_word || b->named_arc || b->g[V_MOTION] >= 0)
        refuse_statement(b, DR_REASON_NAMED_ARC);
    b->named_arc = c;
    b->g[V_MOTION] = V_MOTION_ARC_CCW * V_TENFOLD;
}

/* Take ROT, AROT, or the angle of one; MIRROR, AMIRROR. */
static void take_turn_of_frame(Block *b, uint8_t c, double value) {
    const bool mirrors = c == D_MIRROR_SET || c == D_MIRROR_ADD;
    if (b->next_word || (c == D_TURN_DEG ? !b->turn || b->turn_stated : b->turn != 0))
        refuse_statement(b, mirrors ? DR_REASON_MIRROR : DR_REASON_TURN);
    b->next_word = 0;
    if (c == D_TURN_DEG)
        b->turn_stated = true, b->turned_deg = value;
    else
        b->turn = c;
}

/* Take MCALL, a cycle, or an argument of it. */
static void take_call(Block *b, uint8_t c, double value) {
    if (c == D_MODAL && !b->modal && !b->cycle)
        b->modal = true;
    else if (c == D_CYCLE && !b->cycle)
        b->cycle = (int32_t)value;
    else if (c == D_ARGUMENT && b->arguments < V_CYCLE_ARGUMENTS)
        b->argument[b->arguments++] = value;
    else
        refuse_statement(b, c == D_ARGUMENT ? DR_REASON_HEIGHTS : DR_REASON_CYCLE_BESIDE);
}

/* Take KONT and NORM: how a Sinumerik leads in. */
static void take_approach(Block *b, bool along_contour) {
    if (along_contour)
        b->state->cutter_ways |= S_WAY_KONT;
    else
        b->state->cutter_ways &= ~S_WAY_KONT;
    note(b, S_NOTE_STATEMENT, 0);
}

/* Take what the scanner has marked: the next word, or something that says nothing. */
void take_dialect_mark(Block *b, uint8_t c, double value) {
    if (c >= D_CORNER_ROUND && c <= D_CORNER_LENGTH)
        take_corner(b, c, value);
    else if (c == D_TURN_SET || c == D_TURN_ADD || c == D_TURN_DEG || c == D_MIRROR_SET || c == D_MIRROR_ADD)
        take_turn_of_frame(b, c, value);
    else if (c == D_ARC_VIA || c == D_ARC_TANGENT)
        take_named_arc(b, c);
    else if (c >= D_CYCLE && c <= D_MODAL)
        take_call(b, c, value);
    else if (c == D_SHIFT_SET || c == D_SHIFT_ADD)
        take_shift(b, c);
    else if (c == D_TIP_ON || c == D_TIP_OFF || c == D_OTHER_TIP)
        take_tip(b, c);
    else if (b->next_word == D_NEXT_VECTOR || b->next_word == D_NEXT_VIA) /* A3=AC(1) */
        refuse_statement(b, DR_REASON_VALUES);
    else if (c == D_LABEL)
        return; /* it alone keeps its line among the words, for jumps to it */
    else if (c == D_APPROACH_CONTOUR || c == D_APPROACH_NORMAL)
        take_approach(b, c == D_APPROACH_CONTOUR);
    else if (c == D_SKIPPED)
        note(b, S_NOTE_STATEMENT, 0);
    else
        b->next_word = c;
}

/* Keep what has been said of the word of a letter before it. */
void say_of_word(Block *b, int index) {
    const int32_t bit = 1 << index;
    switch (b->next_word) {
    case D_NEXT_POINTLESS: b->pointless |= bit; break;
    case D_NEXT_ABSOLUTE: b->absolute |= bit; break;
    case D_NEXT_SHORTEST: b->shortest |= bit; break;
    case D_NEXT_FORWARD: b->forward |= bit; break;
    case D_NEXT_BACKWARD: b->backward |= bit; break;
    default: b->incremental |= bit;
    }
    b->next_word = 0;
}

/* Return the core's code for a G number, both ten times; below 0 where it has none. */
int32_t core_code(Block *b, int64_t written, bool *good) {
    const int32_t code = written < b->machine->core_g.rows ? AT(b->machine->core_g, written) : D_CODE_UNKNOWN;
    *good = true;
    if (code == D_CODE_HARMLESS) {
        note(b, S_NOTE_CODE, (int32_t)written);
        b->harmless = (int32_t)written;
    } else if (code == D_CODE_TURN || (code == D_CODE_TURN_OFF && b->state->turned_deg != 0.0)) {
        *good = b->turn == 0 || refuse(b, DR_REASON_TURN, (double)written);
        b->turn = code == D_CODE_TURN ? D_TURN_SET : D_TURN_OFF;
    } else if (code == D_CODE_MIRROR || code == D_CODE_MIRROR_OFF) {
        *good = b->turn == 0 || refuse(b, DR_REASON_MIRROR, (double)written);
        b->turn = code == D_CODE_MIRROR ? D_MIRROR_SET : D_MIRROR_OFF;
    } else if (code == D_CODE_TURN_OFF) {
        note(b, S_NOTE_CODE, (int32_t)written);
    } else if (code == D_CODE_OFFSET) {
        *good = b->g[V_WORK_OFFSET] < 0;
        if (!*good)
            report(b, F_SAME_GROUP_G, (Says){.a = b->g[V_WORK_OFFSET], .b = (double)written});
        b->g[V_WORK_OFFSET] = V_G59;
        b->offset_code = (int32_t)written;
    } else if (code == D_CODE_NO_OFFSET) {
        b->state->zero_in_doubt = S_ZERO_OFF;
    } else if (code == D_CODE_CORNER_ARC) {
        b->state->cutter_ways &= ~S_WAY_MEETING;
        note(b, S_NOTE_CODE, (int32_t)written);
    } else if (code == D_CODE_CORNER_MEETING) {
        b->state->cutter_ways |= S_WAY_MEETING;
        note(b, S_NOTE_CODE, (int32_t)written);
    } else if (code == D_CODE_EXACT) {
        b->exact_once = true;
    } else if (code <= D_CODE_REFUSED) {
        *good = refuse(b, D_CODE_REFUSED - code, (double)written);
    }
    return code;
}

/* --- numbers without a point ---------------------------------------------------------------------------- */

/* Tell whether a word of a block is a length, an angle, a time, or a feed other than in mm/min. */
static bool goes_by_point(const Block *b, int index) {
    if (b->harmless && (index == V_WORD_P || index == V_WORD_Q || index == V_WORD_R))
        return false;
    const int32_t mode = b->g[V_FEED_MODE] >= 0 ? b->g[V_FEED_MODE] / V_TENFOLD : b->state->feed_mode;
    return index != V_WORD_F || mode != V_PER_MINUTE || in_inches(b);
}

/* Tell whether it hangs on the control's parameters what a number without a point is, whatever the others are. */
static bool is_unsure(const Block *b, int index) {
    const int32_t length = b->g[V_LENGTH_OFFSET] >= 0 ? b->g[V_LENGTH_OFFSET] : b->state->length_code;
    const bool in_vector = length == V_G43_5 && index >= V_WORD_I && index <= V_WORD_K;
    const bool angle = index == V_WORD_R && b->turn && b->machine->points == D_THOUSANDTHS;
    return index == V_WORD_F || angle || (index == V_WORD_Q && in_cycle(b)) || in_vector;
}

/* Return the least increment of a word: of an angle and a time it is the same in inches. */
static double increment(const Block *b, int index) {
    const bool length = index >= V_WORD_A + V_ROTARY_AXES && b->g[V_NON_MODAL] != V_G4;
    return length && in_inches(b) ? LEAST_INCH : LEAST;
}

static bool read_pointless(Block *b) {
    for (int index = 0; index < V_LETTERS; index++) {
        if (!(b->pointless & 1 << index) || !goes_by_point(b, index))
            continue;
        if (b->machine->points == D_POINT_REQUIRED || is_unsure(b, index)) {
            report(b, F_NO_POINT, (Says){.a = index + 'A', .b = b->word[index]});
            return false;
        }
        if (b->machine->points == D_THOUSANDTHS)
            b->word[index] *= increment(b, index);
    }
    return true;
}

/* --- dwells and lengths --------------------------------------------------------------------------------- */

static bool is_whole(double value) { return value == rint(value); }

/* G4 gets its seconds as P, whatever its letter and unit are. */
static bool read_dwell(Block *b) {
    int letter = -1, letters = 0;
    for (int index = 0; index < V_LETTERS; index++)
        if (b->has[index] && !isnan(AT(b->machine->dwell_by_letter, index))) {
            letter = index;
            letters++;
        }
    if (letters == 0)
        return true;
    const double unit_s = AT(b->machine->dwell_by_letter, letter), value = b->word[letter];
    if (letters > 1 || (letter == b->machine->whole_dwell_letter && !is_whole(value)))
        return refuse_statement(b, DR_REASON_TWICE);
    if (unit_s == TURNS && !(b->state->rpm > 0.0))
        return refuse_statement(b, DR_REASON_STILL);
    b->has[letter] = false;
    b->has[V_WORD_P] = true;
    b->word[V_WORD_P] = unit_s == TURNS ? value * U_S_PER_MIN / b->state->rpm : value * unit_s;
    return true;
}

/* D0 ends the tool's length and D1 begins it. */
static bool read_edge(Block *b) {
    const State *s = b->state;
    if (!b->has[V_WORD_D])
        return true;
    b->has[V_WORD_D] = false;
    if (b->word[V_WORD_D] != 0.0 && b->word[V_WORD_D] != 1.0)
        return refuse_statement(b, DR_REASON_EDGE);
    if (b->word[V_WORD_D] == 1.0 && !isnan(s->length_offset) && s->offset_tool == s->tool && !changes_tool(b))
        return true; /* it is in force */
    b->g[V_LENGTH_OFFSET] = b->word[V_WORD_D] == 0.0 ? V_G49 : V_G43;
    return true;
}

/* G10 L10 and L11 are length and wear of a tool's length, L12 and L13 of its radius or diameter: what is set has to be
   that of the cell, as the robot's $TOOL is. */
static bool read_tool_offset(Block *b, double l) {
    enum { LENGTH = 10, SIZE = 12 };
    const Machine *m = b->machine;
    const int32_t tool = whole(b->word[V_WORD_P]);
    const double value_mm = b->word[V_WORD_R] * (in_inches(b) ? U_MM_PER_INCH : 1.0);
    const bool size = l >= SIZE, wear = l != LENGTH && l != SIZE;
    const double of_radius_mm = m->d_holds == D_D_IS_DIAMETER ? value_mm : 2.0 * value_mm;
    const double known_mm = size ? diameter_of(m, tool) : length_of(m, tool), given_mm = size ? of_radius_mm : value_mm;
    const bool states = m->d_holds != D_D_IS_TOOL || !size;
    if (tool == NOT_WHOLE || !b->has[V_WORD_R] || !states ||
        (wear || (size && m->d_holds == D_D_IS_WEAR) ? value_mm != 0.0 : !(fabs(known_mm - given_mm) <= OFFSET_SLACK_MM)))
        return refuse(b, DR_REASON_TOOL_OFFSET, V_G10);
    note(b, S_NOTE_CODE, V_G10);
    b->g[V_NON_MODAL] = -1;
    b->has[V_WORD_L] = b->has[V_WORD_P] = b->has[V_WORD_R] = false;
    return true;
}

/* G10 of a Fanuc sets a work offset as LinuxCNC does, where it is absolute; its other uses are the control's own. */
static bool read_g10(Block *b) {
    enum { FIRST_OF_TOOL = 10, LAST_OF_TOOL = 13 };
    const double p = b->word[V_WORD_P], l = b->word[V_WORD_L];
    const int32_t counts = 1 << V_WORD_P | 1 << V_WORD_L;
    const bool absolute = b->g[V_DISTANCE] >= 0 ? b->g[V_DISTANCE] == V_G90 : b->state->absolute != 0;
    const bool offset = b->has[V_WORD_L] && b->word[V_WORD_L] == V_L_OFFSET && b->has[V_WORD_P] && is_whole(p) && p >= 1.0 && p <= 6.0;
    b->pointless &= ~counts;
    if (absolute && b->has[V_WORD_L] && is_whole(l) && l >= FIRST_OF_TOOL && l <= LAST_OF_TOOL && b->has[V_WORD_P] && !names_axis(b))
        return (b->pointless == 0 || read_pointless(b)) && read_tool_offset(b, l);
    return (offset && absolute && !b->has[V_WORD_R]) || refuse(b, DR_REASON_G10, V_G10);
}

/* G505 to G599, and G54.1 with P, are work offsets of the cell as G54 is. */
static bool read_offset(Block *b) {
    enum { G505 = 5050 };
    const double p = b->word[V_WORD_P];
    if (b->offset_code >= G505) {
        b->offset = S_FIRST_G505 + (b->offset_code - G505) / V_TENFOLD;
        return true;
    }
    if (!b->has[V_WORD_P] || !is_whole(p) || p < 1.0 || p > S_FURTHER_OFFSETS) /* what follows goes on in the first offset */
        return refuse(b, DR_REASON_OFFSET, b->offset_code);
    b->offset = S_FIRST_G54_1 + (int32_t)p - 1;
    b->has[V_WORD_P] = false;
    b->pointless &= ~(1 << V_WORD_P);
    return true;
}

/* Dwells and repeats of a drilling cycle. */
static bool read_cycle(Block *b) {
    if (!in_cycle(b))
        return true;
    if (b->has[V_WORD_P] && b->machine->whole_dwell_letter == V_WORD_P && !is_whole(b->word[V_WORD_P]))
        return refuse_statement(b, DR_REASON_TWICE);
    b->word[V_WORD_P] *= b->machine->cycle_dwell_s;
    const bool stored = (b->has[V_WORD_K] && b->word[V_WORD_K] == 0.0) || (b->has[V_WORD_L] && b->word[V_WORD_L] == 0.0);
    if (b->machine->repeats_by_k && stored && (b->has[V_WORD_X] || b->has[V_WORD_Y]))
        return refuse_statement(b, DR_REASON_STORED);
    if (!b->machine->repeats_by_k || !b->has[V_WORD_K])
        return true;
    b->has[V_WORD_K] = false;
    b->pointless &= ~(1 << V_WORD_K); /* a count */
    b->has[V_WORD_L] = true;
    b->word[V_WORD_L] = b->word[V_WORD_K];
    return true;
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
    const double unit_mm = in_inches(b) ? U_MM_PER_INCH : 1.0;
    double programmed_mm[3];
    programmed_of(b, here_mm, programmed_mm);
    const double from_base = programmed_mm[axis] / unit_mm;
    const bool absolute = is_absolute_here(b), differs = absolute ? b->incremental & 1 << index : b->absolute & 1 << index;
    if (!differs)
        return true;
    if (!known[axis]) {
        report_unless(b, S_DOUBT_X << axis, F_COUNTED_FROM_UNKNOWN, (Says){.a = index + 'A'});
        return false;
    }
    b->word[index] += absolute ? from_base : -from_base;
    return true;
}

/* Return the angle from 0 to below 360 degrees that leads to the same place. */
static double within_turn(double deg) { return deg - FULL_TURN_DEG * floor(deg / FULL_TURN_DEG); }

/* C=AC(5), C=IC(5), and C=DC(5), C=ACP(5), C=ACN(5), which say by which way, become what the mode in force says. */
static bool count_turn(Block *b, int k) {
    const State *s = b->state;
    const int index = V_WORD_A + k;
    const int32_t bit = 1 << index, by_way = b->shortest | b->forward | b->backward;
    const bool absolute = is_absolute_here(b) || b->g[V_NON_MODAL] == V_G53, counts = (by_way | (absolute ? b->incremental : b->absolute)) & bit;
    if (!counts || !is_declared(b->machine, k))
        return true;
    const bool known = !(s->rotary_unknown >> k & 1);
    if (!known && !(absolute && by_way & bit)) {
        report(b, F_COUNTED_FROM_UNKNOWN, (Says){.a = index + 'A'});
        return false;
    }
    const double here = s->rotary_deg[k];
    double way = by_way & bit ? within_turn(b->word[index] - here) : b->word[index];
    if (b->backward & bit && way > 0.0)
        way -= FULL_TURN_DEG;
    if (b->shortest & bit && way > FULL_TURN_DEG / 2.0)
        way -= FULL_TURN_DEG;
    if (by_way & bit && known)
        b->word[index] = way + (absolute ? here : 0.0);
    else if (!(by_way & bit))
        b->word[index] += absolute ? here : -here;
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
        b->word[index] -= programmed_mm[axis] / (in_inches(b) ? U_MM_PER_INCH : 1.0);
}

/* A tool vector is that of the tip's transformation, in straight blocks and in place of rotary words; the shift of the
   zero may not outlive a change of what X, Y, Z are. */
static bool read_vector(Block *b) {
    const State *s = b->state;
    const bool tip = b->tip ? b->tip == D_TIP_ON : s->traori != 0;
    const bool shifted = s->shift_mm[0] != 0.0 || s->shift_mm[1] != 0.0 || s->shift_mm[2] != 0.0;
    if (b->tip && tip != (s->traori != 0) && shifted && b->machine->rotary_axes)
        return refuse_statement(b, DR_REASON_SHIFT_AND_TIP);
    if (!b->vector_named)
        return true;
    const int32_t motion = b->g[V_MOTION] >= 0 ? b->g[V_MOTION] / V_TENFOLD : s->motion;
    if (!b->machine->rotary_axes) {
        report(b, F_VECTOR_NO_MACHINE, (Says){0});
        return false;
    }
    if (!tip || (b->g[V_NON_MODAL] >= 0 && b->g[V_NON_MODAL] != V_G4))
        return refuse_statement(b, DR_REASON_NO_TIP);
    if (rotary_words(b))
        return refuse_statement(b, DR_REASON_VECTOR_AND_ANGLE);
    return motion <= V_MOTION_LINE || refuse_statement(b, DR_REASON_VECTOR_ARC);
}

/* Tell whether a block changes what its coordinates are counted from: zero, tool, or both for this block. */
static bool moves_zero(const Block *b) {
    if (b->g[V_WORK_OFFSET] >= 0 || b->g[V_LENGTH_OFFSET] >= 0 || b->g[V_NON_MODAL] >= 0)
        return true;
    return changes_tool(b);
}

/* --- all ------------------------------------------------------------------------------------------------ */

/* A control may drop its work offset where the transformation is switched; report the first block that needs it. */
static bool is_zero_sure(Block *b) {
    if (b->g[V_WORK_OFFSET] >= 0 || b->g[V_NON_MODAL] == V_G53)
        return true;
    const bool off = b->state->zero_in_doubt == S_ZERO_OFF;
    b->state->zero_in_doubt = 0;
    return refuse_statement(b, off ? DR_REASON_NO_OFFSET : DR_REASON_ZERO_AND_TIP);
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

/* Keep the D that G41 and G42 take; alone it says nothing to this robot. */
static void leave_out_idle_words(Block *b) {
    if (b->machine->d_holds && b->has[V_WORD_D])
        b->state->cutter_d = whole(b->word[V_WORD_D]);
    for (int index = 0; index < V_LETTERS; index++)
        b->has[index] = b->has[index] && !(b->machine->idle_letters & 1 << index);
}

/* Make the words of a block those of the core; return false, with a finding, where that cannot be. */
bool to_core_words(Block *b) {
    leave_out_idle_words(b);
    bool good = !b->offset_code || read_offset(b);
    good = read_cycle(b) && good;
    if (b->g[V_NON_MODAL] == V_G10 && b->machine->programs == D_PROGRAMS_FANUC)
        good = read_g10(b) && good;
    if (b->pointless)
        good = read_pointless(b) && good;
    if (b->g[V_NON_MODAL] == V_G4)
        good = read_dwell(b) && good;
    if (b->machine->length_by_d)
        good = read_edge(b) && good;
    if ((b->incremental | b->absolute) && moves_zero(b))
        good = refuse_statement(b, DR_REASON_MOVED);
    else if (b->incremental | b->absolute)
        for (int axis = 0; axis < 3; axis++) {
            good = count_axis(b, axis) && good;
            count_centre(b, axis);
        }
    if (good && b->incremental | b->absolute | b->shortest | b->forward | b->backward)
        for (int k = 0; k < V_ROTARY_AXES; k++)
            good = count_turn(b, k) && good;
    if (b->vector_named | b->tip)
        good = read_vector(b) && good;
    if (b->state->zero_in_doubt && names_axis(b))
        good = is_zero_sure(b) && good;
    if ((b->has[V_WORD_RADIUS] || b->has[V_WORD_ANGLE]) && b->machine->programs != D_PROGRAMS_LINUXCNC)
        good = refuse_statement(b, DR_REASON_POLAR);
    if (b->via_named && b->named_arc != D_ARC_VIA)
        good = refuse_statement(b, DR_REASON_NAMED_ARC);
    if (b->harmless)
        good = use_harmless_words(b) && good;
    return good;
}
