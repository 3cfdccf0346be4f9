/* Numbers and words appended to a text in memory. */

#ifndef KRL_NUMBER_TEXT_H
#define KRL_NUMBER_TEXT_H

#include "core.h"

#include <string.h>

/* Append a literal; return the place behind it. */
#define PUT(to, literal) put((to), (literal), sizeof(literal) - 1)

static inline uint8_t *put(uint8_t *to, const void *text, size_t length) {
    memcpy(to, text, length);
    return to + length;
}

/* Return a number that is not negative as a whole number of its last decimal, half away from zero.

   It is rounded to 1e-9 first and then as an integer, so that no floating-point formatting is involved. */
static inline int64_t in_last_decimal(double size, int64_t nano_per_unit) {
    return ((int64_t)rint(size * 1e9) + nano_per_unit / 2) / nano_per_unit;
}

uint8_t *put_integer(uint8_t *to, int64_t value);
uint8_t *put_fixed(uint8_t *to, double value, int decimals);

#endif
