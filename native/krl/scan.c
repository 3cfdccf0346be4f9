/* KRL text to columns: motion lines, settings and triggers by their numbers, everything else by its line.

It knows nothing of the writer. Motions have columns of their own, so that a program of nothing but motions is
read to where it is used. */

#include "krl/motion.h"

#include <string.h>

/* A line without blanks around it, and where the next one begins. */
typedef struct {
    Place begin, end, newline, next;
} Line;

static inline Line line_at(Place at, Place end_of_text) {
    const Place newline = memchr(at, '\n', (size_t)(end_of_text - at));
    Line line = {at, newline ? newline : end_of_text, newline ? newline : end_of_text, NULL};
    line.next = newline ? newline + 1 : end_of_text;
    line.begin = blank(at, line.end);
    while (line.end > line.begin && (HERE(line.end - 1, line.newline) == '\r' ||
                                     is_blank(HERE(line.end - 1, line.newline))))
        line.end--;
    return line;
}

/* Tell whether a line has no statement: blank, a comment, or one that begins with &. */
static inline bool is_bare(Line line) {
    return ends_here(line.begin, line.end) || HERE(line.begin, line.end) == '&';
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

/* Write how many lines, statements and motions there are in the whole lines from a byte up to another. */
EXPORT void krl_count(Bytes text, int64_t from, int64_t up_to, Ints lines_statements_motions) {
    const Place end = place(text, up_to);
    int64_t lines = 0, statements = 0, motions = 0;
    for (Place at = place(text, from); at < end; lines++) {
        const Line line = line_at(at, end);
        if (!is_bare(line)) {
            statements++;
            motions += is_motion(line.begin, line.end);
        }
        at = line.next;
    }
    AT(lines_statements_motions, 0) = lines;
    AT(lines_statements_motions, 1) = statements;
    AT(lines_statements_motions, 2) = motions;
}

static double *nothing_known(double *value) {
    for (int k = 0; k < W_STATEMENT_COLUMNS; k++)
        SLOT(value, k) = NAN;
    return value;
}

/* Write a row for each statement in the whole lines from a byte up to another: kind, blending and line of
   each, the components of a motion into pose, span and numbers of any other into span and value.

   lines: those before them. found: first line that is too long, first that is not ASCII (0 = none), the
   folds that are opened less those that are closed, and the motions with E1 to E6. */
EXPORT void krl_scan(Bytes text, int64_t from, int64_t up_to, int64_t lines, Bytes kind, Bytes blend,
                     Ints32 line_of, Floats pose, Ints span, Floats value, Ints found) {
    const Place end = place(text, up_to), not_ascii = foreign(place(text, from), end);
    int64_t *too_long = &AT(found, 0), *foreign_line = &AT(found, 1), *folds = &AT(found, 2);
    int64_t row = 0, motions = 0, others = 0, *carried = &AT(found, 3);
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
        Statement read;
        if (is_motion(line.begin, line.end)) {
            double external[W_EXTERNAL_COLUMNS];
            bool has_external;
            read = motion(line.begin, line.end, nothing_known(&CELL(pose, motions++, 0)), external, &has_external);
            *carried += has_external;
        } else {
            CELL(span, others, 0) = line.begin - text.at;
            CELL(span, others, 1) = line.end - text.at;
            read = other_statement(line.begin, line.end, text.at, nothing_known(&CELL(value, others++, 0)));
        }
        AT(kind, row) = (uint8_t)read.kind;
        AT(blend, row) = (uint8_t)read.blend;
        AT(line_of, row) = (int32_t)lines;
        row++;
    }
}

/* Write E1 to E6 of each motion in the whole lines from a byte up to another, NaN where they are not stated. */
EXPORT void krl_external(Bytes text, int64_t from, int64_t up_to, Floats external) {
    const Place end = place(text, up_to);
    int64_t motions = 0;
    for (Place at = place(text, from); at < end;) {
        const Line line = line_at(at, end);
        at = line.next;
        if (is_bare(line) || !is_motion(line.begin, line.end))
            continue;
        double value[W_STATEMENT_COLUMNS];
        bool has_external;
        double *own = &CELL(external, motions++, 0);
        for (int k = 0; k < W_EXTERNAL_COLUMNS; k++)
            own[k] = NAN;
        motion(line.begin, line.end, value, own, &has_external);
    }
}
