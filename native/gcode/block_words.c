/* The words of one block, sorted: values by letter, G-codes by modal group, M-codes. */

#include "gcode/block_words.h"

#include "gcode/dialect_words.h"
#include "gcode/reporting.h"
#include "gcode/rotary.h"
#include "gcode/saved_modes.h"

/* A code this far from a whole number is one that a post has rounded. */
static const double CODE_SLACK = 1e-6;

/* Whether a word is understood, and where it is not what is then in doubt. */
typedef struct {
    bool good;
    int32_t doubt;
} Taken;
static const Taken UNDERSTOOD = {true, 0}, WITHOUT_DOUBT = {false, 0};

/* --- G-codes -------------------------------------------------------------------------------------------- */

static inline Taken faulty(int32_t doubt) { return (Taken){false, doubt}; }

static Taken take_g(Block *b, double value) {
    const double tenfold = value * V_TENFOLD;
    const int64_t written = (int64_t)rint(tenfold);
    bool read = true;
    const bool no_code = written < 0 || written > D_MOST_CODES || fabs(tenfold - (double)written) > CODE_SLACK;
    const int32_t code = no_code ? D_CODE_UNKNOWN : core_code(b, written, &read);
    if (code == D_CODE_CALL) {
        b->counts->program_wanted = 1;
        return WITHOUT_DOUBT;
    }
    if (code < D_CODE_UNKNOWN)
        return read ? UNDERSTOOD : faulty(S_DOUBT_MOTION | S_DOUBT_POSITION);
    const bool outside = code < 0;
    const int32_t group = outside ? S_UNKNOWN_GROUP : AT(b->machine->group_of_g, code);
    if (group == S_UNKNOWN_GROUP) {
        report(b, F_UNKNOWN_G, (Says){.a = tenfold});
        return faulty(AT(b->machine->doubt_of_g, V_LARGEST_G));
    }
    if (code == V_G70 || code == V_G71) {
        b->unit_again = code;
        return UNDERSTOOD;
    }
    if (group == S_UNSUPPORTED_GROUP) {
        report(b, F_UNSUPPORTED_G, (Says){.a = (double)code});
        return faulty(AT(b->machine->doubt_of_g, code));
    }
    int32_t *of_group = &b->g[group];
    if (*of_group < 0) {
        *of_group = (int32_t)code;
    } else if (group == V_MOTION && (*of_group == V_G80 || code == V_G80)) { /* header lines say G0 … G80 */
        *of_group = (int32_t)(code == V_G80 ? *of_group : code);
    } else {
        report(b, F_SAME_GROUP_G, (Says){.a = *of_group, .b = (double)code});
        return faulty(AT(b->machine->doubt_of_group, group));
    }
    return UNDERSTOOD;
}

/* --- M-codes -------------------------------------------------------------------------------------------- */

static bool is_unsupported_m(const Block *b, int64_t code) {
    return code == V_M19 || (b->machine->has_m61_to_m73 && code == V_M66);
}

/* Tell whether an M-code jumps: native/gcode/execute.c does that. */
static bool is_of_program(const Machine *machine, int64_t code) {
    return code == V_M98 || code == V_M99 || (code == V_M97 && machine->programs == D_PROGRAMS_FANUC);
}

/* Say that the program has to be read as a whole; return false, with a finding, in a dialect without that. */
static bool want_program(Block *b, bool is_there) {
    if (is_there)
        b->counts->program_wanted = 1;
    else
        report(b, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_PROGRAM});
    return is_there;
}

/* Return the modal group of an M-code, 0 for none. */
static int m_group(const Machine *machine, int64_t code) {
    if (code == V_M0 || code == V_M1 || code == V_M2 || code == V_M30 || code == V_M60)
        return V_M_STOP;
    if (is_own_m(machine, code))
        return code == V_M61 ? V_M_TOOL_CHANGE : code < V_M70 ? V_M_IO : V_M_SPINDLE;
    if (code == V_M6)
        return V_M_TOOL_CHANGE;
    if (code >= V_M3 && code <= V_M5)
        return V_M_SPINDLE;
    if (code >= V_M7 && code <= V_M9)
        return V_M_COOLANT;
    return code >= V_M48 && code <= V_M53 ? V_M_OVERRIDE : 0;
}

static Taken take_m(Block *b, double value) {
    const int64_t written = (int64_t)rint(value), code = written == b->machine->end_m ? V_M30 : written;
    if (fabs(value - (double)written) > CODE_SLACK || code < 0 || code > V_LARGEST_M) {
        report(b, F_BAD_M, (Says){.a = value});
        return WITHOUT_DOUBT;
    }
    if (is_unsupported_m(b, code)) {
        report(b, F_UNSUPPORTED_M, (Says){.a = (double)(code * V_TENFOLD)});
        return faulty(0);
    }
    if (is_of_program(b->machine, code)) {
        const bool is_there = b->machine->programs == D_PROGRAMS_LINUXCNC || b->machine->programs == D_PROGRAMS_FANUC;
        return want_program(b, is_there) ? WITHOUT_DOUBT : faulty(S_DOUBT_ALL);
    }
    const int group = m_group(b->machine, code);
    bool good = true;
    int count = 0;
    while (count < V_M_CODES && b->m_codes[count] >= 0)
        count++;
    if (count == V_M_CODES) {
        report(b, F_TOO_MANY_M, (Says){0});
        return WITHOUT_DOUBT;
    }
    for (int k = 0; k < count; k++)
        if (group > 0 && m_group(b->machine, b->m_codes[k]) == group) {
            report(b, F_SAME_GROUP_M,
                   (Says){.a = b->m_codes[k] * V_TENFOLD, .b = (double)(code * V_TENFOLD)});
            good = false;
        }
    b->m_codes[count] = (int32_t)code;
    return good ? UNDERSTOOD : WITHOUT_DOUBT;
}

/* Tell whether a block has M67 or M68, whose E is the number of an output. */
static bool sets_output(const Block *b) {
    for (int k = 0; b->machine->has_m61_to_m73 && k < V_M_CODES; k++)
        if (b->m_codes[k] == V_M67 || b->m_codes[k] == V_M68)
            return true;
    return false;
}

/* --- all words of a block ------------------------------------------------------------------------------- */

/* Return the place of a word's letter in arrays by letter. */
static int index_of_letter(int c) {
    return c == '@' ? V_WORD_RADIUS : c == '^' ? V_WORD_ANGLE : c - 'A';
}

/* Tell whether a word's value cannot be read; '@' is the letter below A. */
static bool is_unread(uint8_t c) { return c >= '@' + V_UNREAD_NUMBER; }

static Taken take(Block *b, uint8_t c, double value) {
    if (is_unread(c))
        return faulty(AT(b->machine->doubt_of_letter, index_of_letter(c - V_UNREAD_NUMBER)));
    if (c == 'G')
        return take_g(b, value);
    if (c == 'M')
        return take_m(b, value);
    const int index = index_of_letter(c);
    if (b->next_word == D_NEXT_VECTOR)
        return take_component(b, index - V_WORD_A, value) ? UNDERSTOOD : faulty(S_DOUBT_POSITION);
    if (b->next_word == D_NEXT_VIA)
        return take_via(b, index - V_WORD_I, value) ? UNDERSTOOD : faulty(S_DOUBT_POSITION);
    const bool repeated = b->has[index];
    if (b->next_word)
        say_of_word(b, index);
    b->has[index] = true;
    b->word[index] = value;
    if (!repeated)
        return UNDERSTOOD;
    report(b, F_REPEATED_WORD, (Says){.a = c});
    return faulty(AT(b->machine->doubt_of_letter, index));
}

/* Use up the scanner's marks of words that are left out. */
static void pass_marks(Block *b, const Words *words, int64_t from, int64_t to) {
    for (int64_t k = from; k < to; k++)
        b->counts->marks += AT(words->letter, k) == V_MARK;
}

/* Take note of % at word k: the second ends the program, or the first behind any block. */
static void tape_mark(Block *b, const Words *words, int64_t k, int64_t to, bool alone) {
    State *s = b->state;
    if (!alone) {
        report(b, F_BAD_CHARACTER, (Says){.a = '%'});
        pass_marks(b, words, k, to);
        return;
    }
    s->tape_marks++;
    if (s->tape_marks == 2 || (s->tape_marks == 1 && s->blocks > 0)) {
        s->ended = 1;
        s->end_line = b->line;
    }
}

static void take_mark(Block *b, const Words *words, double finding) {
    const int64_t mark = b->counts->marks++;
    report(b, (int32_t)finding, (Says){.a = mark < words->extra.rows ? AT(words->extra, mark) : 0.0});
}

/* Rotary and secondary axes: 0 is no motion and is noted; the first other value of each is an error. */
static bool rotary_is_harmless(Block *b) {
    State *s = b->state;
    bool good = true;
    for (int k = 0; k < OTHER_AXES_COUNT; k++) {
        const int index = OTHER_AXES[k], letter = index + 'A';
        if (!b->has[index] || is_declared(b->machine, k))
            continue;
        if (b->word[index] == 0.0) {
            note(b, S_NOTE_ROTARY, letter);
            continue;
        }
        good = false;
        if (s->rotary_refused & 1 << index)
            b->counts->consequences++;
        else
            report(b, F_ROTARY_WORD, (Says){.a = letter, .b = b->word[index]});
        s->rotary_refused |= 1 << index;
    }
    return good;
}

/* Tell whether G70 or G71 says again which unit is in force, as posts for Mach3 write behind G20 and G21; as a
   lathe's cycle it would have words that nothing here uses. */
static bool repeats_unit(const Block *b) {
    const bool inches = b->g[V_UNIT] >= 0 ? b->g[V_UNIT] == V_G20 : b->state->unit_mm != 1.0;
    const bool named = b->g[V_UNIT] >= 0 || b->state->unit_named;
    return named && !(b->state->doubt & S_DOUBT_UNIT) && b->unit_again == (inches ? V_G70 : V_G71);
}

static void begin_without_codes(Block *b) {
    for (int k = 0; k < V_GROUPS; k++)
        b->g[k] = -1;
    for (int k = 0; k < V_M_CODES; k++)
        b->m_codes[k] = -1;
}

/* Sort the words of a block that has none yet; `doubt` gets the bits of what is in doubt after it. */
BlockKind gather(Block *b, const Words *words, int64_t from, int64_t to, int32_t *doubt) {
    bool good = true, used = false;
    int slashes = 0;
    *doubt = 0;
    begin_without_codes(b);
    for (int64_t k = from; k < to; k++) {
        const uint8_t c = AT(words->letter, k);
        if (c == '/') {
            if (b->machine->block_delete) {
                pass_marks(b, words, from, to);
                return LEFT_OUT;
            }
            if (slashes++ > 0) { /* the second may be a slip for a digit or a letter */
                report(b, F_BAD_CHARACTER, (Says){.a = '/'});
                good = false;
            }
        } else if (c == '%') {
            tape_mark(b, words, k, to, to - from == 1);
            return LEFT_OUT;
        } else if (c == '(') {
            event(b, S_EVENT_TEXT, AT(words->value, k), 0.0);
        } else if (c == V_PROGRAM_LINE) {
            if (!want_program(b, b->machine->programs != D_PROGRAMS_NONE)) {
                good = false;
                *doubt |= S_DOUBT_ALL;
            }
        } else if (c == V_MARK) {
            take_mark(b, words, AT(words->value, k));
            good = false;
        } else if (c == D_PROGRAM_NUMBER) { /* behind blocks another program begins */
            b->counts->program_wanted |= b->state->blocks > 0;
        } else if (c < '@') {
            take_dialect_mark(b, c, AT(words->value, k));
            used = used || b->shift || b->tip || b->corner || b->turn || b->modal || b->cycle;
        } else {
            const Taken taken = take(b, c, AT(words->value, k));
            used = true;
            good = good && taken.good;
            *doubt |= taken.doubt;
        }
    }
    if (b->has[V_WORD_E] && good && !sets_output(b)) { /* else it belongs to what has been reported */
        report(b, F_UNKNOWN_LETTER, (Says){.a = V_WORD_E + 'A'});
        good = false;
    }
    if (b->unit_again && !repeats_unit(b)) {
        report(b, F_UNSUPPORTED_G, (Says){.a = (double)b->unit_again});
        *doubt |= AT(b->machine->doubt_of_g, b->unit_again);
        good = false;
    }
    if (good && !to_core_words(b))
        good = false;
    if (!rotary_is_harmless(b))
        good = false;
    if (!used && good)
        return LEFT_OUT;
    return good ? GOOD : FAULTY;
}
