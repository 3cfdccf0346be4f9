/* Shank and holder beside the cutter. */

#include "cutting/collisions.h"

/* A row of Cutters.above: what stands above the edge, and the height of its lower end; radius 0 = not checked. */
typedef struct {
    double radius, level;
} Above;

enum { SHANK, HOLDER, ABOVE_COUNT };

/* Return how far a disc above the edge reaches into material beside the cutter. */
static double overlap_of(const Grid *grid, const Sample *sample, double wide, double level) {
    const double x = sample->x, y = sample->y, radius = sample->outline->radius;
    const Cells rows = rows_between(grid, y - wide, y + wide, grid->height.rows);
    const Cells columns = columns_between(grid, x - wide, x + wide, grid->height.columns);
    double worst = 0.0;
    for (int64_t i = rows.first; i < rows.after; i++) {
        const double v = grid->y_mm + ((double)(i + grid->row) + 0.5) * grid->dy_mm - y;
        for (int64_t j = columns.first; j < columns.after; j++) {
            const double u = grid->x_mm + ((double)(j + grid->column) + 0.5) * grid->dx_mm - x;
            const double square = u * u + v * v;
            if (radius * radius < square && square < wide * wide)
                worst = greater(worst, CELL(grid->height, i, j) - level);
        }
    }
    return worst;
}

void collide(const Strip *strip, const Sample *sample, double *overlap_mm) {
    const Above *above = (const Above *)&CELL(strip->cutters->above, sample->tool, 0);
    for (int part = SHANK; part < ABOVE_COUNT; part++) {
        const double wide = above[part].radius, level = sample->z + above[part].level;
        if (wide <= sample->outline->radius)
            continue;
        if (highest_around(strip->grid, sample->x, sample->y, wide) <= level + FEEL_MM)
            continue;
        const double worst = overlap_of(strip->grid, sample, wide, level);
        if (worst > FEEL_MM)
            overlap_mm[1 + part] = worst;
    }
}
