/* How a part comes about: blocks of cells of a field, and which sweep lowered each of them, and when.

A block is shown at its mean height, so that the volume is that of the cells. What happens to it within one slot of
time counts as one event, with the last sweep that lowered it. */

#include "cutting/removal.h"
#include "cutting/walls.h"

#define CHANGE_MM 1e-3 /* a block that is lowered by less waits for more */

/* Blocks of `side` cells along both sides: the mean height of each, and the point that ends its last sweep, -1 where
   there is none. */
typedef struct {
    int64_t side;
    Floats32 mean;
    Ints32 last;
} Blocks;

/* Events that have been written, and where the next one goes. */
typedef struct {
    Ints32 block, point;
    Floats32 height;
    int64_t count;
} Events;

static double mean_of(const Grid *grid, int64_t side, int64_t i, int64_t j) {
    double sum = 0.0;
    for (int64_t row = i * side; row < (i + 1) * side; row++)
        for (int64_t column = j * side; column < (j + 1) * side; column++)
            sum += greater(CELL(grid->height, row - grid->row, column - grid->column), grid->bottom_mm);
    return sum / (double)(side * side);
}

static void note(const Grid *grid, const Blocks *blocks, Ints32 slot, int64_t k, int64_t i, int64_t j,
                 Events *events) {
    float *mean = &CELL(blocks->mean, i, j);
    int32_t *last = &CELL(blocks->last, i, j);
    const double now = mean_of(grid, blocks->side, i, j);
    if (!(now < (double)*mean - CHANGE_MM))
        return;
    if (*last >= 0 && AT(slot, *last) != AT(slot, k)) {
        AT(events->block, events->count) = (int32_t)(i * blocks->mean.columns + j);
        AT(events->point, events->count) = *last;
        AT(events->height, events->count) = *mean;
        events->count++;
    }
    *mean = (float)now;
    *last = (int32_t)k;
}

/* Cut a path out of a field from point `from` on; return the point to go on with, all of them where it is their
   number. It stops early where the events (e) might not suffice for another sweep; `count` gets how many there are.
   slot (p,) is the slot of time of each point. */
EXPORT int64_t cutting_history(const Grid *grid, const Path *path, Ints32 slot, int64_t from, int64_t side,
                               Floats32 mean, Ints32 last, Ints32 block, Ints32 point, Floats32 height, Ints count) {
    const Blocks blocks = {side, mean, last};
    Events events = {block, point, height, 0};
    const int64_t points = path->position_mm.rows;
    int64_t k = most(from, 1);
    for (; k < points && events.count + mean.rows * mean.columns <= block.rows; k++) {
        if (AT(path->first, k))
            continue;
        const double *a = place_of(path, k - 1), *b = place_of(path, k);
        const double radius = outline_of(path, AT(path->tool, k))->radius;
        const double x_low = lesser(a[0], b[0]) - radius, x_high = greater(a[0], b[0]) + radius;
        const double y_low = lesser(a[1], b[1]) - radius, y_high = greater(a[1], b[1]) + radius;
        if (highest(grid, x_low, x_high, y_low, y_high) <= lesser(a[2], b[2]))
            continue;
        remove_sweep(grid, path, k, 0.0);
        draw_walls(grid, path, k);
        const Cells rows = cells_between(y_low, y_high, grid->y_mm, grid->dy_mm, 0, mean.rows * side);
        const Cells columns = cells_between(x_low, x_high, grid->x_mm, grid->dx_mm, 0, mean.columns * side);
        if (rows.first >= rows.after || columns.first >= columns.after)
            continue;
        for (int64_t i = rows.first / side; i <= (rows.after - 1) / side; i++)
            for (int64_t j = columns.first / side; j <= (columns.after - 1) / side; j++)
                note(grid, &blocks, slot, k, i, j, &events);
    }
    AT(count, 0) = events.count;
    return k;
}
