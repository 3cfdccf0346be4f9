/* The longest of a block's vectors (prediction/limits.py). */

#include "core.h"

#include <float.h>

/* Return the first row of the longest vector (n, 3), which is as long as found[0]; one that is not a number
   counts as 0. found[1] is 1 where the squares of all are finite, else 0: 0 times another one is NaN. */
EXPORT int64_t prediction_longest(Floats vectors, Floats found) {
    double most2 = 0.0, longest = 0.0, none = 0.0;
    int64_t row = 0;
    for (int64_t i = 0; i < vectors.rows; i++) {
        const double *v = &CELL(vectors, i, 0);
        const double length2 = squared(v[0]) + squared(v[1]) + squared(v[2]);
        none += 0.0 * length2;
        if (length2 > most2) {
            const double length = sqrt(length2);
            most2 = length2;
            if (length > longest) {
                longest = length;
                row = i;
            }
        }
    }
    AT(found, 0) = lesser(longest, DBL_MAX);
    AT(found, 1) = none == 0.0;
    return row;
}
