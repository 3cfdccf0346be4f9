/* Capsules of the arm and the spindle in the material of a height field. */

#include "collision/shapes.h"
#include "cutting/sweep.h"

/* A capsule in the frame of the field. */
typedef struct {
    const double *ends;
    double radius, lowest, highest;
} Capsule;

/* What has been found deepest so far: how far it is in, and the middle of the column's overlap. */
typedef struct {
    double depth, place[3];
} Deepest;

static Cells common(Cells a, Cells b) { return (Cells){most(a.first, b.first), least(a.after, b.after)}; }

static Capsule capsule_of(const double *ends, double radius) {
    return (Capsule){ends, radius, lesser(ends[2], ends[5]) - radius, greater(ends[2], ends[5]) + radius};
}

/* Hold the column of material over the middle of a cell against a capsule: it is a segment too. */
static void hold_column(const Grid *grid, int64_t i, int64_t j, const Capsule *capsule, Deepest *found) {
    const double top = CELL(grid->height, i, j);
    if (top <= capsule->lowest || top <= grid->bottom_mm)
        return;
    const double x = grid->x_mm + ((double)(j + grid->column) + 0.5) * grid->dx_mm;
    const double y = grid->y_mm + ((double)(i + grid->row) + 0.5) * grid->dy_mm;
    const double column[6] = {x, y, grid->bottom_mm, x, y, top};
    double place[3];
    const double depth = capsule->radius - sqrt(segment_segment(capsule->ends, column, place));
    if (depth > found->depth) {
        found->depth = depth;
        copy3(place, found->place);
    }
}

/* The cells below a capsule, in its share of the strip, block by block: what ends below it is passed over. */
static Deepest deepest_in(const Grid *grid, const Capsule *capsule, Cells own_rows, Cells own_columns) {
    Deepest found = {0.0, {NAN, NAN, NAN}};
    if (!(capsule->highest > grid->bottom_mm))
        return found;
    const double *a = capsule->ends, *b = capsule->ends + 3, wide = capsule->radius;
    Cells rows = rows_between(grid, lesser(a[1], b[1]) - wide, greater(a[1], b[1]) + wide, grid->height.rows);
    Cells columns = columns_between(grid, lesser(a[0], b[0]) - wide, greater(a[0], b[0]) + wide, grid->height.columns);
    rows = common(rows, own_rows);
    columns = common(columns, own_columns);
    for (int64_t first = rows.first; first < rows.after; first = (first / SW_BLOCK + 1) * SW_BLOCK) {
        const int64_t last = (first / SW_BLOCK + 1) * SW_BLOCK;
        for (int64_t begin = columns.first; begin < columns.after; begin = (begin / SW_BLOCK + 1) * SW_BLOCK) {
            if (CELL(grid->bound, first / SW_BLOCK, begin / SW_BLOCK) <= capsule->lowest)
                continue;
            const int64_t end = (begin / SW_BLOCK + 1) * SW_BLOCK;
            for (int64_t i = first; i < last && i < rows.after; i++)
                for (int64_t j = begin; j < end && j < columns.after; j++)
                    hold_column(grid, i, j, capsule, &found);
        }
    }
    return found;
}

/* Write how deep capsules (n, 6), radii (n), are in the material at most, 0 where they are not, and where. ``own``
   (4,): the first row of the grid that counts and the one behind the last, and the same of the columns. */
EXPORT void cutting_bodies(const Grid *grid, Floats ends_mm, Floats radius_mm, Ints own, Floats depth_mm, Floats place_mm) {
    const Cells rows = {AT(own, 0), AT(own, 1)}, columns = {AT(own, 2), AT(own, 3)};
    for (int64_t k = 0; k < ends_mm.rows; k++) {
        const Capsule capsule = capsule_of(&CELL(ends_mm, k, 0), AT(radius_mm, k));
        const Deepest found = deepest_in(grid, &capsule, rows, columns);
        AT(depth_mm, k) = found.depth;
        copy3(found.place, &CELL(place_mm, k, 0));
    }
}
