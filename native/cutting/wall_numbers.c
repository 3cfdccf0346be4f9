/* The numbers of the sweeps whose walls a grid shows: which are needed, and new ones. */

#include "constants.h"
#include "core.h"

/* Mark the points (p) at which the sweeps begin and end whose walls the grid shows. */
EXPORT void cutting_mark_walls(const Grid *grid, Bools point) {
    const int64_t cells = grid->wall.rows * grid->wall.columns;
    for (int64_t i = 0; i < cells; i++) {
        const int32_t sweep = AT(grid->wall, i);
        if (sweep >= 0)
            AT(point, sweep) = AT(point, sweep - 1) = 1;
    }
}

/* Give the sweeps whose walls the grid shows the new numbers (p) of the points at which they end. */
EXPORT void cutting_number_walls(const Grid *grid, Ints32 number) {
    const int64_t cells = grid->wall.rows * grid->wall.columns;
    for (int64_t i = 0; i < cells; i++) {
        const int32_t sweep = AT(grid->wall, i);
        if (sweep >= 0)
            AT(grid->wall, i) = AT(number, sweep);
    }
}
