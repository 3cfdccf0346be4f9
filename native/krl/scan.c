/* KRL text to columns: motion lines, settings and triggers by their numbers, everything else by its line.

It knows nothing of the writer. A place is a pointer into the text; the byte there is read with HERE, which
says before which end it has to lie, and a build with CHECKED proves it. */

#include "core.h"

#include "constants.h"

#include <string.h>

#define HERE(at, end) ((at)[INSIDE(0, (end) - (at))])
#define SLOT(value, k) ((value)[INSIDE(k, W_STATEMENT_COLUMNS)])
#define STANDS(at, end, word) stands((at), (end), (word), sizeof(word) - 1)

enum { MOST_DIGITS = 15, NO_COMPONENT = -1, NO_KIND = -1 };
enum { COLUMN_X = 0, COLUMN_A = 3, COLUMN_S = 6, COLUMN_T = 7 };
/* Components A1 to A6 have the bits from here on, the others those of their columns. */
enum { AXIS_BITS = W_STATEMENT_COLUMNS, CARTESIAN = (1 << W_STATEMENT_COLUMNS) - 1 };

static const double TEN_TO[] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};

typedef const uint8_t *Place;

/* A line without blanks around it, and where the next one begins. */
typedef struct {
    Place begin, end, newline, next;
} Line;

typedef struct {
    int kind, blend;
} Statement;

static inline bool is_blank(uint8_t c) { return c == CH_SPACE || c == CH_TAB; }
static inline bool is_digit(uint8_t c) { return c >= CH_DIGIT_0 && c <= CH_DIGIT_9; }
static inline bool is_axis(uint8_t c) { return c >= CH_DIGIT_1 && c <= CH_DIGIT_6; }
static inline uint8_t capital(uint8_t c) { return c >= CH_SMALL_A && c <= CH_SMALL_Z ? c - CH_CASE_BIT : c; }
static inline bool is(Place at, Place end, uint8_t c) { return at < end && HERE(at, end) == c; }

/* Return the place behind blanks. */
static inline Place blank(Place at, Place end) {
    while (at < end && is_blank(HERE(at, end)))
        at++;
    return at;
}

/* Return the place behind one more character and blanks. */
static inline Place blank_behind(Place at, Place end) { return blank(at < end ? at + 1 : end, end); }

/* Tell whether nothing but a comment follows. */
static inline bool ends_here(Place at, Place end) { return at >= end || HERE(at, end) == CH_SEMICOLON; }

/* Tell whether a word stands at a place, in capitals or small letters. */
static inline bool stands(Place at, Place end, const char *word, int length) {
    if (end - at < length)
        return false;
    for (int k = 0; k < length; k++)
        if (capital(HERE(at + k, end)) != capital((uint8_t)word[k]))
            return false;
    return true;
}

/* Append digits to a whole number; return the place behind them. */
static inline Place digits(Place at, Place end, uint64_t *whole) {
    for (; at < end && is_digit(HERE(at, end)); at++)
        *whole = *whole * 10 + (uint64_t)(HERE(at, end) - CH_DIGIT_0);
    return at;
}

/* Read a number; return the place behind it, NULL and NaN where there is none or it has too many digits. */
static inline Place number(Place at, Place end, double *value) {
    const bool negative = is(at, end, CH_MINUS);
    if (negative || is(at, end, CH_PLUS))
        at++;
    uint64_t whole = 0;
    const Place behind = digits(at, end, &whole);
    int64_t count = behind - at, decimals = 0;
    at = behind;
    if (is(at, end, CH_POINT)) {
        at = digits(at + 1, end, &whole);
        decimals = at - behind - 1;
        count += decimals;
    }
    if (count == 0 || count > MOST_DIGITS) {
        *value = NAN;
        return NULL;
    }
    *value = (negative ? -1.0 : 1.0) * (double)(int64_t)whole / TEN_TO[decimals];
    return at;
}

/* Read the name of a component; return the place behind it. */
static inline Place component(Place at, Place end, int *bit) {
    const uint8_t letter = capital(HERE(at, end));
    at++;
    if (letter >= CH_LETTER_X && letter <= CH_LETTER_Z)
        *bit = COLUMN_X + letter - CH_LETTER_X;
    else if (letter == CH_LETTER_A && at < end && is_axis(HERE(at, end))) {
        *bit = AXIS_BITS + HERE(at, end) - CH_DIGIT_1;
        at++;
    } else if (letter >= CH_LETTER_A && letter <= CH_LETTER_C)
        *bit = COLUMN_A + letter - CH_LETTER_A;
    else if (letter == CH_LETTER_S)
        *bit = COLUMN_S;
    else
        *bit = letter == CH_LETTER_T ? COLUMN_T : NO_COMPONENT;
    return at;
}

/* Read `{X 1.0,Y 2.0,…}`, the components found as bits; return the place behind the brace, else NULL. */
static inline Place components(Place at, Place end, double *value, int *found) {
    *found = 0;
    if (!is(at, end, CH_BRACE_OPEN))
        return NULL;
    for (;;) {
        int bit;
        double read;
        at = blank(at + 1, end);
        if (at >= end)
            return NULL;
        at = component(at, end, &bit);
        if (bit == NO_COMPONENT || at >= end || !is_blank(HERE(at, end)))
            return NULL;
        at = number(blank(at, end), end, &read);
        if (at == NULL || *found & (1 << bit))
            return NULL;
        *found |= 1 << bit;
        SLOT(value, bit >= AXIS_BITS ? bit - AXIS_BITS : bit) = read;
        at = blank(at, end);
        if (is(at, end, CH_BRACE_CLOSE))
            return at + 1;
        if (!is(at, end, CH_COMMA))
            return NULL;
    }
}

/* Read a LIN or PTP into value. */
static inline Statement motion(Place begin, Place end, double *value) {
    Statement read = {NO_KIND, 0};
    if (STANDS(begin, end, W_LIN))
        read.kind = W_KIND_LIN;
    else if (STANDS(begin, end, W_PTP))
        read.kind = W_KIND_PTP;
    else
        return read;
    int found;
    Place at = components(blank(begin + sizeof(W_LIN) - 1, end), end, value, &found);
    const bool axes = found > CARTESIAN, linear = read.kind == W_KIND_LIN;
    if (axes && !linear)
        read.kind = W_KIND_PTP_AXES;
    read.blend = W_MALFORMED;
    if (at == NULL || (axes && (linear || found & CARTESIAN)))
        return read;
    at = blank(at, end);
    const bool blends = STANDS(at, end, W_C_DIS);
    if (blends)
        at = blank(at + sizeof(W_C_DIS) - 1, end);
    if (ends_here(at, end))
        read.blend = blends;
    return read;
}

/* Read a number and the blanks after it; return NULL where there is none. */
static Place number_at(Place at, Place end, double *value) {
    *value = NAN;
    at = at != NULL ? number(at, end, value) : NULL;
    return at != NULL ? blank(at, end) : NULL;
}

/* Return the place behind the words of $VEL.CP, $APO.CDIS and WAIT SEC, else NULL. */
static Place setting(Place begin, Place end, int *kind) {
    *kind = W_KIND_VEL_CP;
    if (STANDS(begin, end, W_VEL_CP))
        return begin + sizeof(W_VEL_CP) - 1;
    *kind = W_KIND_APO_CDIS;
    if (STANDS(begin, end, W_APO_CDIS))
        return begin + sizeof(W_APO_CDIS) - 1;
    *kind = W_KIND_WAIT_SEC;
    if (!STANDS(begin, end, W_WAIT))
        return NULL;
    const Place behind = begin + sizeof(W_WAIT) - 1, second = blank(behind, end);
    return second > behind && STANDS(second, end, W_SEC) ? second + sizeof(W_SEC) - 1 : NULL;
}

/* Read what a setting is set to into value; return its blending: 1 for a dwell, W_MALFORMED, else 0. */
static int set_to(Place at, Place end, int kind, double *value) {
    bool sound = true;
    at = blank(at, end);
    if (kind != W_KIND_WAIT_SEC) {
        sound = is(at, end, CH_EQUALS);
        at = blank_behind(at, end);
    }
    at = number_at(at, end, &SLOT(value, 0));
    if (!sound || at == NULL || !ends_here(at, end))
        return W_MALFORMED;
    return kind == W_KIND_WAIT_SEC && at < end && STANDS(blank_behind(at, end), end, W_DWELL);
}

/* Return the place behind a word and the blanks after it, NULL where it does not stand there. */
static Place behind(Place at, Place end, const char *word) {
    const int length = (int)strlen(word);
    return at != NULL && stands(at, end, word, length) ? blank(at + length, end) : NULL;
}

/* Read the name that is assigned to or called; return the place of the `=` or `(`, NULL without one. */
static Place written_name(Place at, Place end, Place text, double *value) {
    const Place first = at;
    if (at == NULL)
        return NULL;
    while (at < end && HERE(at, end) != CH_EQUALS && HERE(at, end) != CH_PAREN_OPEN && !ends_here(at, end))
        at++;
    Place last = at;
    while (last > first && is_blank(HERE(last - 1, end)))
        last--;
    SLOT(value, W_TRIGGER_NAME) = (double)(first - text);
    SLOT(value, W_TRIGGER_NAME + 1) = (double)(last - first);
    return ends_here(at, end) || last == first ? NULL : at;
}

/* Read the numbers of a call from its `(` on; return the place behind `)`, NULL where it is another. */
static Place arguments(Place at, Place end, double *value) {
    for (int k = 0; k < W_TRIGGER_NUMBERS; k++) {
        const uint8_t separator = k < W_TRIGGER_NUMBERS - 1 ? CH_COMMA : CH_PAREN_CLOSE;
        at = number_at(blank_behind(at, end), end, &SLOT(value, W_TRIGGER_WRITTEN + k));
        if (at == NULL || !is(at, end, separator))
            return NULL;
    }
    return blank_behind(at, end);
}

/* Read `TRIGGER WHEN DISTANCE=0 DELAY=7 DO …` into value; return what it does, 0 for anything else. */
static int trigger(Place at, Place end, Place text, double *value) {
    at = behind(behind(behind(behind(at, end, W_TRIGGER), end, W_WHEN), end, W_DISTANCE), end, "=");
    at = number_at(at, end, &SLOT(value, W_TRIGGER_DISTANCE));
    at = number_at(behind(behind(at, end, W_DELAY), end, "="), end, &SLOT(value, W_TRIGGER_DELAY));
    at = written_name(behind(at, end, W_DO), end, text, value);
    if (at == NULL)
        return 0;
    const bool calls = HERE(at, end) == CH_PAREN_OPEN;
    if (calls) {
        double prio;
        at = behind(behind(arguments(at, end, value), end, W_PRIO), end, "=");
        at = number_at(at, end, &prio);
        if (at == NULL || prio != W_PRIO_BY_CONTROLLER)
            return 0;
    } else
        at = number_at(blank_behind(at, end), end, &SLOT(value, W_TRIGGER_WRITTEN));
    if (at == NULL || !ends_here(at, end))
        return 0;
    return calls ? W_CALLS : W_ASSIGNS;
}

/* Read a statement into value. */
static inline Statement statement(Line line, Place text, double *value) {
    Statement read = motion(line.begin, line.end, value);
    if (read.kind != NO_KIND)
        return read;
    const Place behind_words = setting(line.begin, line.end, &read.kind);
    if (behind_words != NULL)
        read.blend = set_to(behind_words, line.end, read.kind, value);
    else {
        read.blend = trigger(line.begin, line.end, text, value);
        read.kind = read.blend > 0 ? W_KIND_TRIGGER : W_KIND_OTHER;
    }
    return read;
}

static inline Line line_at(Place at, Place end_of_text) {
    const Place newline = memchr(at, CH_NEWLINE, (size_t)(end_of_text - at));
    Line line = {at, newline ? newline : end_of_text, newline ? newline : end_of_text, NULL};
    line.next = newline ? newline + 1 : end_of_text;
    line.begin = blank(at, line.end);
    while (line.end > line.begin && (HERE(line.end - 1, line.newline) == CH_RETURN ||
                                     is_blank(HERE(line.end - 1, line.newline))))
        line.end--;
    return line;
}

/* Tell whether a line has no statement: blank, a comment, or one that begins with &. */
static inline bool is_bare(Line line) {
    return ends_here(line.begin, line.end) || HERE(line.begin, line.end) == CH_AMPERSAND;
}

/* Return 1 for a comment that opens a fold, -1 for one that closes it, else 0. */
static int fold(Line line) {
    return STANDS(line.begin, line.end, W_FOLD) - STANDS(line.begin, line.end, W_ENDFOLD);
}

/* Return the first byte that is not ASCII, else the end. */
static Place foreign(Place at, Place end) {
    enum { BLOCK = 4096 };
    while (at < end) {
        const Place block_end = end - at > BLOCK ? at + BLOCK : end;
        uint8_t all = 0;
        for (Place c = at; c < block_end; c++)
            all |= *c;
        if (all >= CH_FIRST_FOREIGN)
            break;
        at = block_end;
    }
    while (at < end && HERE(at, end) < CH_FIRST_FOREIGN)
        at++;
    return at;
}

static Place place(Bytes text, int64_t byte) { return text.at + INSIDE(byte, text.rows + 1); }

/* Write how many lines and statements there are in the whole lines from a byte up to another. */
EXPORT void krl_count(Bytes text, int64_t from, int64_t up_to, Ints lines_statements) {
    const Place end = place(text, up_to);
    int64_t lines = 0, statements = 0;
    for (Place at = place(text, from); at < end; lines++) {
        const Line line = line_at(at, end);
        statements += !is_bare(line);
        at = line.next;
    }
    AT(lines_statements, 0) = lines;
    AT(lines_statements, 1) = statements;
}

/* Write a row for each statement in the whole lines from a byte up to another.

   lines: those before them. found: first line that is too long, first that is not ASCII (0 = none), and the
   folds that are opened less those that are closed. */
EXPORT void krl_scan(Bytes text, int64_t from, int64_t up_to, int64_t lines, Bytes kind, Ints32 line_of,
                     Ints span, Floats value, Bytes blend, Ints found) {
    const Place end = place(text, up_to), not_ascii = foreign(place(text, from), end);
    int64_t *too_long = &AT(found, 0), *foreign_line = &AT(found, 1), *folds = &AT(found, 2);
    int64_t row = 0;
    for (Place at = place(text, from); at < end;) {
        const Line line = line_at(at, end);
        lines++;
        if (line.newline - at > W_LONGEST_LINE + 1 && *too_long == 0)
            *too_long = lines;
        if (not_ascii < line.newline && *foreign_line == 0)
            *foreign_line = lines;
        at = line.next;
        if (is_bare(line)) {
            *folds += fold(line);
            continue;
        }
        double *values = &CELL(value, row, 0);
        for (int k = 0; k < W_STATEMENT_COLUMNS; k++)
            SLOT(values, k) = NAN;
        const Statement read = statement(line, text.at, values);
        AT(kind, row) = (uint8_t)read.kind;
        AT(blend, row) = (uint8_t)read.blend;
        AT(line_of, row) = (int32_t)lines;
        CELL(span, row, 0) = line.begin - text.at;
        CELL(span, row, 1) = line.end - text.at;
        row++;
    }
}
