/* The numbers of the sweeps whose walls a grid shows: which are needed, and new ones. */

#include "constants.h"
#include "core.h"

enum { TOGETHER = 64 };

/* A range of cells. */
typedef struct {
    int64_t first, after;
} Span;

/* Return the next cells behind a span that may have walls: most have none, and TOGETHER are looked at at once. */
static Span with_walls(Ints32 wall, Span span) {
    const int64_t cells = wall.rows * wall.columns;
    int32_t none = -1;
    do {
        span = (Span){span.after, least(span.after + TOGETHER, cells)};
        for (int64_t i = span.first; i < span.after; i++)
            none &= AT(wall, i);
    } while (none < 0 && span.first < cells);
    return span;
}

/* Mark the points (p) at which the sweeps begin and end whose walls the grid shows. */
EXPORT void cutting_mark_walls(const Grid *grid, Bools point) {
    for (Span span = with_walls(grid->wall, (Span){0, 0}); span.first < span.after; span = with_walls(grid->wall, span))
        for (int64_t i = span.first; i < span.after; i++) {
            const int32_t sweep = AT(grid->wall, i);
            if (sweep >= 0)
                AT(point, sweep) = AT(point, sweep - 1) = 1;
        }
}

/* Give the sweeps whose walls the grid shows the new numbers (p) of the points at which they end. */
EXPORT void cutting_number_walls(const Grid *grid, Ints32 number) {
    for (Span span = with_walls(grid->wall, (Span){0, 0}); span.first < span.after; span = with_walls(grid->wall, span))
        for (int64_t i = span.first; i < span.after; i++) {
            const int32_t sweep = AT(grid->wall, i);
            if (sweep >= 0)
                AT(grid->wall, i) = AT(number, sweep);
        }
}
