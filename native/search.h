/* Places in rising numbers, as numpy.searchsorted finds them; NaN stands behind all numbers. */

#ifndef SEARCH_H
#define SEARCH_H

#include "core.h"

static inline bool is_below(double a, double b) { return a < b || (isnan(b) && !isnan(a)); }

/* Return how many of the first `count` are less than a number (side="left"). */
static inline int64_t count_below(Floats rising, int64_t count, double number) {
    int64_t from = 0;
    while (from < count) {
        const int64_t middle = from + (count - from) / 2;
        if (is_below(AT(rising, middle), number))
            from = middle + 1;
        else
            count = middle;
    }
    return from;
}

/* Return how many of the first `count` are not greater than a number (side="right"). */
static inline int64_t count_up_to(Floats rising, int64_t count, double number) {
    int64_t from = 0;
    while (from < count) {
        const int64_t middle = from + (count - from) / 2;
        if (is_below(number, AT(rising, middle)))
            count = middle;
        else
            from = middle + 1;
    }
    return from;
}

#endif
