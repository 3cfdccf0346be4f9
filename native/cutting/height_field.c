/* The bounds of a grid that is about to be cut. */

#include "cutting/sweep.h"

EXPORT void cutting_bound(const Grid *grid) {
    for (int64_t i = 0; i < grid->bound.rows; i++)
        for (int64_t j = 0; j < grid->bound.columns; j++)
            refresh(grid, i, j);
}
