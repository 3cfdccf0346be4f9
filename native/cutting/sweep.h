/* The height that one sweep of a cutter leaves at a point, and the grid it is cut out of.

A sweep is the volume that the cutter passes through on the straight line between two samples. Grid, Path and
what else comes from Python are declared in gcode2krl/cutting/sweep.py. */

#ifndef CUTTING_SWEEP_H
#define CUTTING_SWEEP_H

#include "constants.h"
#include "core.h"

/* Material thinner than this is rounding of the path, not material. */
#define FEEL_MM 1e-3
/* Room for rounding at the joint of two sweeps: what one leaves to the other is so much smaller. */
#define JOINT_MM 1e-4
#define TURN (2.0 * PI)

/* A row of Path.outlines: the cutter's lower outline; the corner arc ends at (arc_radius, arc_top), above it
   the side is steep (0 = upright), kind is SW_FLAT, SW_BALL or SW_OTHER. Lengths in mm. */
typedef struct {
    double radius, bottom, corner, arc_radius, arc_top, steep, kind;
} Outline;

/* The point of a sweep that is nearest in plan: its distance, its share of the way, its height. */
typedef struct {
    double distance, share, z;
} Nearest;

/* The straight way of a sweep from a to b; of an upright one the nearest point is the lower end: its square
   in plan is taken as infinite, so that the share is 0, and it dips. */
typedef struct {
    const double *a, *b;
    double ux, uy, uz, square, dip;
} Way;

/* Cells in a row or column: the first and the one after the last. */
typedef struct {
    int64_t first, after;
} Cells;

typedef struct {
    int64_t row, column;
} Cell;

static inline const double *place_of(const Path *path, int64_t k) { return &CELL(path->position_mm, k, 0); }

static inline const Outline *outline_of(const Path *path, int64_t tool) {
    return (const Outline *)&CELL(path->outlines, tool, 0);
}

/* Return the height of the cutter's lower outline above the tip at radius r. */
static inline double outline_height(double r, const Outline *outline) {
    const double corner = outline->corner, x = lesser(greater(r - outline->bottom, 0.0), corner);
    const double arc = corner - sqrt(corner * corner - x * x);
    const double side = outline->arc_top + (r - outline->arc_radius) * outline->steep;
    return (r < outline->arc_radius) | (outline->steep == 0.0) ? arc : side;
}

static inline Way way_between(const double *a, const double *b) {
    const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2], square = ux * ux + uy * uy;
    const bool is_upright = square < 1e-18;
    return (Way){a, b, ux, uy, uz, is_upright ? INFINITY : square, is_upright ? lesser(uz, 0.0) : 0.0};
}

static inline Nearest nearest(const Way *way, double x, double y) {
    const double u = x - way->a[0], v = y - way->a[1];
    const double share = lesser(greater((u * way->ux + v * way->uy) / way->square, 0.0), 1.0);
    const double distance = sqrt(squared(u - share * way->ux) + squared(v - share * way->uy));
    return (Nearest){distance, share, way->a[2] + (share * way->uz + way->dip)};
}

/* Return how deep the cutter at a place cuts at a point, inf beside it. */
static inline double height_from(const double *place, const Outline *outline, double x, double y,
                                 double slack) {
    const double r = sqrt(squared(x - place[0]) + squared(y - place[1]));
    const double height = place[2] + outline_height(lesser(r, outline->radius), outline);
    return r < outline->radius + slack ? height : INFINITY;
}

/* Return how deep a sweep cuts at a point, inf beside it. Without branches: the compiler takes several points
   at once. */
static inline double sweep_height(const Way *way, const Outline *outline, double x, double y, double slack) {
    const Nearest point = nearest(way, x, y);
    double lowest = point.z + outline_height(lesser(point.distance, outline->radius), outline);
    /* on a slope the nearest point in plan is not always the lowest */
    lowest = lesser(lowest, height_from(way->a, outline, x, y, slack));
    lowest = lesser(lowest, height_from(way->b, outline, x, y, slack));
    return point.distance >= outline->radius + slack ? INFINITY : lowest;
}

static inline bool is_inside(const Grid *grid, Cell cell) {
    return cell.column >= 0 && cell.row >= 0 && cell.column < grid->height.columns &&
           cell.row < grid->height.rows;
}

/* Return the cell at a point; it may lie outside the grid. */
static inline Cell cell_at(const Grid *grid, double x, double y) {
    const int64_t column = (int64_t)floor((x - grid->x_mm) / grid->dx_mm) - grid->column;
    return (Cell){(int64_t)floor((y - grid->y_mm) / grid->dy_mm) - grid->row, column};
}

/* Return the cells, `count` in all, whose middles lie between two coordinates. */
static inline Cells cells_between(double low, double high, double origin, double size, int64_t shift,
                                  int64_t count) {
    const int64_t first = (int64_t)ceil((low - origin) / size - 0.5) - shift;
    const int64_t after = (int64_t)floor((high - origin) / size - 0.5) + 1 - shift;
    return (Cells){most(first, 0), least(after, count)};
}

static inline Cells columns_between(const Grid *grid, double low, double high, int64_t count) {
    return cells_between(low, high, grid->x_mm, grid->dx_mm, grid->column, count);
}

static inline Cells rows_between(const Grid *grid, double low, double high, int64_t count) {
    return cells_between(low, high, grid->y_mm, grid->dy_mm, grid->row, count);
}

/* Return a bound of the height within a rectangle, -inf where it misses the field. */
static inline float highest(const Grid *grid, double x_low, double x_high, double y_low, double y_high) {
    const Floats32 bound = grid->bound;
    const Cells columns =
        columns_between(grid, x_low - grid->dx_mm, x_high + grid->dx_mm, bound.columns * SW_BLOCK);
    const Cells rows = rows_between(grid, y_low - grid->dy_mm, y_high + grid->dy_mm, bound.rows * SW_BLOCK);
    float top = -INFINITY;
    if (columns.first >= columns.after || rows.first >= rows.after)
        return top;
    for (int64_t i = rows.first / SW_BLOCK; i <= (rows.after - 1) / SW_BLOCK; i++)
        for (int64_t j = columns.first / SW_BLOCK; j <= (columns.after - 1) / SW_BLOCK; j++)
            top = CELL(bound, i, j) > top ? CELL(bound, i, j) : top;
    return top;
}

/* The same around a point. */
static inline float highest_around(const Grid *grid, double x, double y, double radius) {
    return highest(grid, x - radius, x + radius, y - radius, y + radius);
}

/* Compute the bound of a block again. */
static inline void refresh(const Grid *grid, int64_t i, int64_t j) {
    const int64_t begin = j * SW_BLOCK, width = least(SW_BLOCK, grid->height.columns - begin);
    float tops[SW_BLOCK], top = -INFINITY;
    for (int column = 0; column < SW_BLOCK; column++)
        tops[column] = -INFINITY;
    for (int64_t row = i * SW_BLOCK; row < least((i + 1) * SW_BLOCK, grid->height.rows); row++) {
        const float *height = &CELL(grid->height, row, begin);
        for (int64_t column = 0; column < width; column++)
            tops[column] = height[column] > tops[column] ? height[column] : tops[column];
    }
    for (int column = 0; column < SW_BLOCK; column++)
        top = tops[column] > top ? tops[column] : top;
    CELL(grid->bound, i, j) = top;
}

#endif
