/* The lowest tip over each cell of a grid (online/judge.py). */

#include "core.h"

/* Lower the floor (ny, nx) below a flat bottom at each position (n, 3); a row of cells at a time. */
EXPORT void online_lower(Floats position_mm, Floats radius_mm, Floats low_mm, double cell_mm, Floats floor_mm) {
    for (int64_t k = 0; k < position_mm.rows; k++) {
        const double x = CELL(position_mm, k, 0) - AT(low_mm, 0), y = CELL(position_mm, k, 1) - AT(low_mm, 1);
        const double r = AT(radius_mm, k);
        const int64_t first = most((int64_t)ceil((y - r) / cell_mm), 0);
        const int64_t last = least((int64_t)((y + r) / cell_mm), floor_mm.rows - 1);
        for (int64_t i = first; i <= last; i++) {
            const double half = sqrt(greater(r * r - squared((double)i * cell_mm - y), 0.0));
            const int64_t left = most((int64_t)ceil((x - half) / cell_mm), 0);
            const int64_t right = least((int64_t)((x + half) / cell_mm), floor_mm.columns - 1);
            for (int64_t j = left; j <= right; j++)
                CELL(floor_mm, i, j) = lesser(CELL(floor_mm, i, j), CELL(position_mm, k, 2));
        }
    }
}
