/* Places in sorted columns. */

#ifndef SEARCH_H
#define SEARCH_H

#include "core.h"

/* Return how many of the rising values are not above x: all of them if x is NaN. */
static inline int64_t count_up_to(Floats rising, double x) {
    int64_t low = 0, high = rising.rows;
    while (low < high) {
        const int64_t middle = low + (high - low) / 2;
        if (x < AT(rising, middle))
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

#endif
