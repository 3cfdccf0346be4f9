/* A LIN, PTP or CIRC by its components. */

#ifndef KRL_MOTION_H
#define KRL_MOTION_H

#include "krl/statement.h"

enum { NO_COMPONENT = -1 };
enum { COLUMN_X = 0, COLUMN_A = 3, COLUMN_S = 6, COLUMN_T = 7 };
/* Components A1 to A6 have the bits from here on, the others those of their columns. */
enum { AXIS_BITS = W_STATEMENT_COLUMNS, CARTESIAN = (1 << W_STATEMENT_COLUMNS) - 1, PLACE_BITS = 7 };
/* Components E1 to E6 have the bits behind those of A1 to A6. */
enum { EXTERNAL_BITS = AXIS_BITS + 6, AXES = ((1 << 6) - 1) << AXIS_BITS };

/* Read the name of a component; return the place behind it. */
static inline Place component(Place at, Place end, int *bit) {
    const uint8_t letter = capital(HERE(at, end));
    at++;
    if (letter >= 'X' && letter <= 'Z')
        *bit = COLUMN_X + letter - 'X';
    else if (letter == 'A' && at < end && is_axis(HERE(at, end))) {
        *bit = AXIS_BITS + HERE(at, end) - '1';
        at++;
    } else if (letter == 'E' && at < end && is_axis(HERE(at, end))) {
        *bit = EXTERNAL_BITS + HERE(at, end) - '1';
        at++;
    } else if (letter >= 'A' && letter <= 'C')
        *bit = COLUMN_A + letter - 'A';
    else if (letter == 'S')
        *bit = COLUMN_S;
    else
        *bit = letter == 'T' ? COLUMN_T : NO_COMPONENT;
    return at;
}

/* Read `{X 1.0,Y 2.0,…}`, the components found as bits; return the place behind the brace, else NULL. */
static inline Place components(Place at, Place end, double *value, double *external, int *found) {
    *found = 0;
    if (!is(at, end, '{'))
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
        if (bit >= EXTERNAL_BITS)
            external[INSIDE(bit - EXTERNAL_BITS, W_EXTERNAL_COLUMNS)] = read;
        else
            SLOT(value, bit >= AXIS_BITS ? bit - AXIS_BITS : bit) = read;
        at = blank(at, end);
        if (is(at, end, '}'))
            return at + 1;
        if (!is(at, end, ','))
            return NULL;
    }
}

/* Tell whether a blank or a brace stands at a place: what is before it is a whole word. */
static inline bool ends_word(Place at, Place end) {
    return at < end && (is_blank(HERE(at, end)) || is(at, end, '{'));
}

/* Tell whether a statement is a CIRC, and not a name that begins with it. */
static inline bool is_circ(Place begin, Place end) {
    return STANDS(begin, end, W_CIRC) && ends_word(begin + sizeof(W_CIRC) - 1, end);
}

/* Tell whether a statement is a point of a spline. */
static inline bool is_spl(Place begin, Place end) {
    return STANDS(begin, end, W_SPL) && ends_word(begin + sizeof(W_SPL) - 1, end);
}

/* Tell whether a statement is a motion, whether or not it can be read. */
static inline bool is_motion(Place begin, Place end) {
    return STANDS(begin, end, W_LIN) || STANDS(begin, end, W_PTP) || is_circ(begin, end) || is_spl(begin, end);
}

/* Read the point that a CIRC passes, which is asked for again by whoever needs it; return where its end begins. */
static inline Place passed_point(Place at, Place end, double *value) {
    int found;
    double none[W_EXTERNAL_COLUMNS];
    at = components(at, end, value, none, &found);
    if (at == NULL || (found & PLACE_BITS) != PLACE_BITS || found > CARTESIAN)
        return NULL;
    at = blank(at, end);
    return is(at, end, ',') ? blank(at + 1, end) : NULL;
}

/* Read a motion into value and external; of a CIRC its end. Tell in has_external whether there are any. */
static inline Statement motion(Place begin, Place end, double *value, double *external, bool *has_external) {
    const bool arc = is_circ(begin, end), point = is_spl(begin, end);
    Statement read = {arc                           ? W_KIND_CIRC
                      : point                       ? W_KIND_SPL
                      : STANDS(begin, end, W_LIN) ? W_KIND_LIN
                                                    : W_KIND_PTP,
                      W_MALFORMED};
    int found;
    *has_external = false;
    Place at = blank(begin + (arc ? sizeof(W_CIRC) : sizeof(W_LIN)) - 1, end);
    if (arc) {
        double passed[W_STATEMENT_COLUMNS];
        at = passed_point(at, end, passed);
        if (at == NULL)
            return read;
    }
    at = components(at, end, value, external, &found);
    *has_external = found >> EXTERNAL_BITS != 0;
    const bool axes = (found & AXES) != 0, linear = read.kind != W_KIND_PTP;
    if (axes && !linear)
        read.kind = W_KIND_PTP_AXES;
    if (at == NULL || (axes && (linear || found & CARTESIAN)))
        return read;
    at = blank(at, end);
    const bool blends = STANDS(at, end, W_C_DIS);
    if (blends && point)
        return read;
    if (blends)
        at = blank(at + sizeof(W_C_DIS) - 1, end);
    if (ends_here(at, end))
        read.blend = blends || point; /* it passes without a stop */
    return read;
}

#endif
