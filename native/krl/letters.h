/* The characters of a KRL text: blanks, words and numbers, read at a place before an end.

A place is a pointer into the text; the byte there is read with HERE, which says before which end it has to
lie, and a build with CHECKED proves it. */

#ifndef KRL_LETTERS_H
#define KRL_LETTERS_H

#include "constants.h"

#define HERE(at, end) ((at)[INSIDE(0, (end) - (at))])
#define STANDS(at, end, word) stands((at), (end), (word), sizeof(word) - 1)

enum { MOST_DIGITS = 15 };

static const double TEN_TO[] = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};

typedef const uint8_t *Place;

static inline bool is_blank(uint8_t c) { return c == ' ' || c == '\t'; }
static inline bool is_digit(uint8_t c) { return c >= '0' && c <= '9'; }
static inline bool is_axis(uint8_t c) { return c >= '1' && c <= '6'; }
static inline uint8_t capital(uint8_t c) { return c >= 'a' && c <= 'z' ? c - CH_CASE_BIT : c; }
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
static inline bool ends_here(Place at, Place end) { return at >= end || HERE(at, end) == ';'; }

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
        *whole = *whole * 10 + (uint64_t)(HERE(at, end) - '0');
    return at;
}

/* Read a number; return the place behind it, NULL and NaN where there is none or it has too many digits. */
static inline Place number(Place at, Place end, double *value) {
    const bool negative = is(at, end, '-');
    if (negative || is(at, end, '+'))
        at++;
    uint64_t whole = 0;
    const Place behind = digits(at, end, &whole);
    int64_t count = behind - at, decimals = 0;
    at = behind;
    if (is(at, end, '.')) {
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

/* Read a number and the blanks after it; return NULL where there is none. */
static inline Place number_at(Place at, Place end, double *value) {
    *value = NAN;
    at = at != NULL ? number(at, end, value) : NULL;
    return at != NULL ? blank(at, end) : NULL;
}

#endif
