/* Material along a ring of the cutter, before the sweep that is about to cut it.

Loops over bins have no branches, so that the compiler takes several bins at once. */

#include "cutting/rings.h"

#include "cutting/walls.h"

bool tops_on_ring(const Grid *grid, const Sample *sample, const Ring *ring) {
    const double ax = (sample->x - grid->x_mm) / grid->dx_mm, ay = (sample->y - grid->y_mm) / grid->dy_mm;
    const double rx = ring->r / grid->dx_mm, ry = ring->r / grid->dy_mm;
    const double nx = (double)grid->height.columns - 0.5, ny = (double)grid->height.rows - 0.5;
    const double column_0 = (double)grid->column, row_0 = (double)grid->row;
    const double *restrict east = ring->east, *restrict north = ring->north;
    double *restrict tops = ring->tops;
    int32_t walls = -1;
    for (int64_t j = ring->first; j < ring->after; j++) {
        double u = ax + rx * east[j] - column_0, v = ay + ry * north[j] - row_0;
        u = u > 0.5 ? u : 0.5; /* the cells at the border are empty */
        v = v > 0.5 ? v : 0.5;
        const int32_t column = (int32_t)(u < nx ? u : nx), row = (int32_t)(v < ny ? v : ny);
        walls &= CELL(grid->wall, row, column);
        tops[j] = CELL(grid->height, row, column);
    }
    return walls >= 0;
}

void stand_above_cutter(const Grid *grid, const Sample *sample, const Ring *ring) {
    /* A cell's height is that of its middle, so it is compared with the cutter's surface there. This is also better
       for a layer so thin that it is parallel to the cutter. */
    const Outline outline = *sample->outline;
    const double dx = grid->dx_mm, dy = grid->dy_mm, z = sample->z, level = ring->level;
    const double ax = (sample->x - grid->x_mm) / dx, ay = (sample->y - grid->y_mm) / dy;
    const double rx = ring->r / dx, ry = ring->r / dy;
    const double arc_radius = outline.steep > 0.0 ? outline.arc_radius : INFINITY;
    const double *restrict east = ring->east, *restrict north = ring->north, *restrict tops = ring->tops;
    double *restrict above = ring->above;
    for (int64_t j = ring->first; j < ring->after; j++) {
        const double u = (floor(ax + rx * east[j]) + 0.5 - ax) * dx;
        const double v = (floor(ay + ry * north[j]) + 0.5 - ay) * dy;
        double s = sqrt(u * u + v * v);
        s = s < outline.radius ? s : outline.radius;
        double w = s - outline.bottom;
        w = w > 0.0 ? w : 0.0;
        w = w < outline.corner ? w : outline.corner;
        const double arc = outline.corner - sqrt(outline.corner * outline.corner - w * w);
        const double side = outline.arc_top + (s - arc_radius) * outline.steep;
        const double surface = s < arc_radius ? arc : side;
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

void take_off_recent(const Path *path, const Sample *sample, const Ring *ring) {
    for (int past = 0; past < sample->recent_count; past++) {
        const Recent sweep = sample->recent[past];
        for (int64_t j = ring->first; j < ring->after; j++) {
            const double x = sample->x + ring->r * ring->east[j], y = sample->y + ring->r * ring->north[j];
            const double cut = sweep_height(path, sweep.start, sweep.end, sample->outline, x, y, 0.0);
            ring->tops[j] = lesser(ring->tops[j], cut);
            ring->above[j] = lesser(ring->above[j], cut - ring->level);
        }
    }
}
