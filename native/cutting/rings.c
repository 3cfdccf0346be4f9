/* Material along a ring of the cutter, before the sweep that is about to cut it.

Loops over bins have no branches, so that the compiler takes several bins at once. */

#include "cutting/rings.h"

#include "cutting/walls.h"

/* Room for rounding in a bound of a sweep's height. */
#define ROUNDING_MM 1e-9

enum { CHUNK = 32 }; /* bins that are worked on together */

/* Write the indices of the cells of a range of bins; the cells at the border, and those beyond, are empty. */
static void list_cells(const Grid *grid, const Sample *sample, const Ring *ring, int64_t first, int64_t count,
                       int32_t *columns, int32_t *rows) {
    const double ax = (sample->x - grid->x_mm) / grid->dx_mm, ay = (sample->y - grid->y_mm) / grid->dy_mm;
    const double rx = ring->r / grid->dx_mm, ry = ring->r / grid->dy_mm;
    const double nx = (double)grid->height.columns - 0.5, ny = (double)grid->height.rows - 0.5;
    const double column_0 = (double)grid->column, row_0 = (double)grid->row;
    const double *east = ring->east + first, *north = ring->north + first;
    for (int64_t j = 0; j < count; j++) {
        double u = ax + rx * east[j] - column_0, v = ay + ry * north[j] - row_0;
        u = u > 0.5 ? u : 0.5;
        v = v > 0.5 ? v : 0.5;
        columns[j] = (int32_t)(u < nx ? u : nx);
        rows[j] = (int32_t)(v < ny ? v : ny);
    }
}

bool tops_on_ring(const Grid *grid, const Sample *sample, const Ring *ring) {
    int32_t columns[CHUNK], rows[CHUNK], walls = -1;
    for (int64_t first = ring->first; first < ring->after; first += CHUNK) {
        const int64_t count = least(CHUNK, ring->after - first);
        list_cells(grid, sample, ring, first, count, columns, rows);
        for (int64_t j = 0; j < count; j++) {
            walls &= CELL(grid->wall, rows[j], columns[j]);
            ring->tops[first + j] = CELL(grid->height, rows[j], columns[j]);
        }
    }
    return walls >= 0;
}

void stand_above_cutter(const Grid *grid, const Sample *sample, const Ring *ring) {
    /* A cell's height is that of its middle, so it is compared with the cutter's surface there. This is also
       better for a layer so thin that it is parallel to the cutter. */
    const Outline outline = *sample->outline;
    const double dx = grid->dx_mm, dy = grid->dy_mm, z = sample->z, level = ring->level;
    const double ax = (sample->x - grid->x_mm) / dx, ay = (sample->y - grid->y_mm) / dy;
    const double rx = ring->r / dx, ry = ring->r / dy;
    const double *restrict east = ring->east, *restrict north = ring->north, *restrict tops = ring->tops;
    double *restrict above = ring->above;
    for (int64_t j = ring->first; j < ring->after; j++) {
        const double u = (floor(ax + rx * east[j]) + 0.5 - ax) * dx;
        const double v = (floor(ay + ry * north[j]) + 0.5 - ay) * dy;
        const double surface = outline_height(lesser(sqrt(u * u + v * v), outline.radius), &outline);
        const double own = tops[j] - z - surface, plain = tops[j] - level;
        above[j] = (own <= FEEL_MM) | (own < 2.0 * fabs(own - plain)) ? own : plain;
    }
}

void correct_at_walls(const Grid *grid, const Path *path, const Sample *sample, const Ring *ring) {
    for (int64_t j = ring->first; j < ring->after; j++) {
        const double x = sample->x + ring->r * ring->east[j], y = sample->y + ring->r * ring->north[j];
        const Cell cell = cell_at(grid, x, y);
        if (!is_inside(grid, cell))
            continue;
        const int64_t sweep = CELL(grid->wall, cell.row, cell.column);
        if (sweep >= 0) {
            ring->tops[j] = beside_wall(grid, path, sweep, cell, x, y);
            ring->above[j] = ring->tops[j] - ring->level;
        }
    }
}

/* Return whether the sweep may lower anything in a range of bins: no point of it is below its lower end. */
static bool may_lower(const Way *sweep, const Ring *ring, int64_t first, int64_t after) {
    const double lowest = lesser(sweep->a[2], sweep->b[2]) - ROUNDING_MM;
    int64_t is_above = 0;
    for (int64_t j = first; j < after; j++)
        is_above |= (ring->tops[j] > lowest) | (ring->above[j] > lowest - ring->level);
    return is_above;
}

/* Lower a range of bins, at most CHUNK, by a sweep. */
static void take_off(const Way *sweep, const Sample *sample, const Ring *ring, int64_t first, int64_t after) {
    const Way way = *sweep;
    const Outline outline = *sample->outline;
    const double *east = ring->east + first, *north = ring->north + first;
    const double x = sample->x, y = sample->y, r = ring->r;
    double cuts[CHUNK];
    for (int64_t j = 0; j < after - first; j++)
        cuts[j] = sweep_height(&way, &outline, x + r * east[j], y + r * north[j], 0.0);
    for (int64_t j = first; j < after; j++) {
        ring->tops[j] = lesser(ring->tops[j], cuts[j - first]);
        ring->above[j] = lesser(ring->above[j], cuts[j - first] - ring->level);
    }
}

void take_off_recent(const Sample *sample, const Ring *ring) {
    for (int past = 0; past < sample->recent_count; past++)
        for (int64_t first = ring->first; first < ring->after; first += CHUNK) {
            const int64_t after = least(first + CHUNK, ring->after);
            if (may_lower(&sample->recent[past], ring, first, after))
                take_off(&sample->recent[past], sample, ring, first, after);
        }
}
