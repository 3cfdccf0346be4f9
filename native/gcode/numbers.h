/* Numbers behind letters: at once what most look like, and whatever else may stand there. */

#ifndef GCODE_NUMBERS_H
#define GCODE_NUMBERS_H

#include "gcode/characters.h"

enum { MOST_DIGITS = 15, MOST_DECIMALS = 18 };
static const double TEN_TO[MOST_DECIMALS + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8, 1e9,
                                                 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18};

/* A number: `plain` is a whole one without a minus sign. */
typedef struct {
    int finding;
    double value;
    int64_t digits, decimals;
    bool plain;
    int64_t end;
} Number;

Number any_number(Bytes text, int64_t i);
bool is_line_number(Bytes text, int64_t i, int64_t end);

/* Add the digits from i on to a mantissa; return the place behind. */
static inline int64_t add_digits(Bytes text, int64_t i, int64_t *mantissa) {
    for (; i < text.rows && is_digit(AT(text, i)); i++)
        *mantissa = (int64_t)((uint64_t)*mantissa * 10 + (AT(text, i) - '0'));
    return i;
}

/* Read the number from i on: at once what most look like, a sign, digits, a point, digits. */
static inline Number number(Bytes text, int64_t i) {
    const int64_t start = i;
    int64_t mantissa = 0, decimals = 0;
    const bool negative = i < text.rows && AT(text, i) == '-';
    const int64_t first_digit = i += negative;
    i = add_digits(text, i, &mantissa);
    int64_t digits = i - first_digit;
    const bool point = i < text.rows && AT(text, i) == '.';
    if (point) {
        const int64_t behind = i + 1;
        i = add_digits(text, behind, &mantissa);
        decimals = i - behind;
        digits += decimals;
    }
    while (i < text.rows && is_space(AT(text, i)))
        i++;
    const bool goes_on = i < text.rows && (is_digit(AT(text, i)) || AT(text, i) == '.');
    if (digits == 0 || digits > MOST_DIGITS || goes_on)
        return any_number(text, start);
    const double value = (negative ? -(double)mantissa : (double)mantissa) / TEN_TO[decimals];
    return (Number){F_OK, value, digits, decimals, !point && !negative, i};
}

#endif
