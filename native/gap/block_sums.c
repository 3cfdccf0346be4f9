/* Sums of columns over blocks of rows (gap/noise/slow.py). */

#include "core.h"

/* Write the sums (b, c) of values (n, c) from each edge (b + 1) to the next, row after row. */
EXPORT void gap_block_sums(Floats values, Ints edges, Floats sums) {
    const int64_t columns = sums.columns;
    for (int64_t block = 0; block < sums.rows; block++) {
        double *restrict sum = &CELL(sums, block, 0);
        for (int64_t c = 0; c < columns; c++)
            sum[c] = 0.0;
        for (int64_t i = AT(edges, block); i < AT(edges, block + 1); i++) {
            const double *restrict row = &CELL(values, i, 0);
            for (int64_t c = 0; c < columns; c++)
                sum[c] += row[c];
        }
    }
}
