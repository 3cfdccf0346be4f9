/* Walls inside cells: drawn by the sweeps that leave them, read to a small fraction of a cell. */

#include "cutting/walls.h"

/* Distance in cells within which a wall counts as cut: sweeps are chords, whose joints recede a little. */
#define WALL_SLACK 0.05
#define QUARTER (0.5 * PI)

/* What draws walls: sweep k from a to b, of a radius, whose rim leaves the material above a floor. */
typedef struct {
    const Grid *grid;
    const Path *path;
    int64_t k;
    const double *a, *b;
    double radius, floor;
} Drawing;

double height_at(const Grid *grid, const Path *path, double x, double y) {
    const Cell cell = cell_at(grid, x, y);
    if (!is_inside(grid, cell))
        return -INFINITY;
    const int64_t sweep = CELL(grid->wall, cell.row, cell.column);
    if (sweep < 0)
        return CELL(grid->height, cell.row, cell.column);
    return beside_wall(grid, path, sweep, cell, x, y);
}

double top_at(const Grid *grid, const Path *path, const Sample *sample, double x, double y) {
    const Cell cell = cell_at(grid, x, y);
    if (sample->disc && is_inside(grid, cell) && CELL(grid->height, cell.row, cell.column) > sample->disc[2]) {
        const double u = grid->x_mm + ((double)(cell.column + grid->column) + 0.5) * grid->dx_mm - sample->disc[0];
        const double v = grid->y_mm + ((double)(cell.row + grid->row) + 0.5) * grid->dy_mm - sample->disc[1];
        if (u * u + v * v < squared(sample->outline->bottom - JOINT_MM))
            return sample->disc[2];
    }
    return height_at(grid, path, x, y);
}

double beside_wall(const Grid *grid, const Path *path, int64_t sweep, Cell cell, double x, double y) {
    const double here = CELL(grid->height, cell.row, cell.column);
    const Way way = way_between(place_of(path, sweep - 1), place_of(path, sweep));
    const Outline *outline = outline_of(path, AT(path->tool, sweep));
    const double cut = sweep_height(&way, outline, x, y, WALL_SLACK * grid->dx_mm);
    if (cut < INFINITY)
        return lesser(here, cut);
    const double middle_x = grid->x_mm + ((double)(cell.column + grid->column) + 0.5) * grid->dx_mm;
    const double middle_y = grid->y_mm + ((double)(cell.row + grid->row) + 0.5) * grid->dy_mm;
    if (nearest(&way, middle_x, middle_y).distance >= outline->radius)
        return here;
    /* the cell's height is that of the cut side */
    const Nearest foot = nearest(&way, x, y);
    const double foot_x = way.a[0] + foot.share * way.ux, foot_y = way.a[1] + foot.share * way.uy;
    const double away_x = (x - foot_x) / foot.distance * grid->dx_mm;
    const double away_y = (y - foot_y) / foot.distance * grid->dy_mm;
    const Cell away = cell_at(grid, x + away_x, y + away_y);
    return is_inside(grid, away) ? greater(here, CELL(grid->height, away.row, away.column)) : -INFINITY;
}

/* Return whether the sweep reaches deeper or farther at a point than the one whose wall is drawn there. */
static bool is_deeper(const Drawing *drawing, int64_t old, double x, double y) {
    const Path *path = drawing->path;
    const Outline *outline = outline_of(path, AT(path->tool, old));
    const Way way = way_between(drawing->a, drawing->b);
    const Way old_way = way_between(place_of(path, old - 1), place_of(path, old));
    const double old_floor = lesser(old_way.a[2], old_way.b[2]) + outline_height(outline->radius, outline);
    if (drawing->floor < old_floor - FEEL_MM)
        return true;
    const double old_gap = nearest(&old_way, x, y).distance - outline->radius;
    const double new_gap = nearest(&way, x, y).distance - drawing->radius;
    return new_gap < old_gap - 0.5 * WALL_SLACK * drawing->grid->dx_mm;
}

/* Note the wall in a cell of the whole field, unless there is no material behind it or a deeper wall is
   there. */
static void draw_cell(const Drawing *drawing, Cell whole, double nx, double ny) {
    const Grid *grid = drawing->grid;
    const Cell cell = {whole.row - grid->row, whole.column - grid->column};
    if (!is_inside(grid, cell))
        return;
    const Cell behind = {cell.row + (int64_t)floor(0.5 + ny), cell.column + (int64_t)floor(0.5 + nx)};
    double top = CELL(grid->height, cell.row, cell.column);
    if (is_inside(grid, behind))
        top = greater(top, CELL(grid->height, behind.row, behind.column));
    if (!(top > drawing->floor + FEEL_MM))
        return;
    const double x = grid->x_mm + ((double)whole.column + 0.5) * grid->dx_mm;
    const double y = grid->y_mm + ((double)whole.row + 0.5) * grid->dy_mm;
    int32_t *wall = &CELL(grid->wall, cell.row, cell.column);
    if (*wall < 0 || is_deeper(drawing, *wall, x, y))
        *wall = (int32_t)drawing->k;
}

/* Draw the wall beside the sweep on the side of the normal: every cell that it crosses. */
static void draw_line(const Drawing *drawing, double nx, double ny) {
    const Grid *grid = drawing->grid;
    const double *a = drawing->a, *b = drawing->b, dx = grid->dx_mm, dy = grid->dy_mm;
    const double x = (a[0] + drawing->radius * nx - grid->x_mm) / dx;
    const double y = (a[1] + drawing->radius * ny - grid->y_mm) / dy;
    const double ux = (b[0] - a[0]) / dx, uy = (b[1] - a[1]) / dy;
    Cell cell = {(int64_t)floor(y), (int64_t)floor(x)};
    const int64_t step_x = ux > 0.0 ? 1 : -1, step_y = uy > 0.0 ? 1 : -1;
    const double over_x = ux != 0.0 ? fabs(1.0 / ux) : INFINITY,
                 over_y = uy != 0.0 ? fabs(1.0 / uy) : INFINITY;
    double next_x = ux != 0.0 ? ((double)(cell.column + (ux > 0.0)) - x) / ux : INFINITY;
    double next_y = uy != 0.0 ? ((double)(cell.row + (uy > 0.0)) - y) / uy : INFINITY;
    double at = 0.0;
    while (at <= 1.0) {
        draw_cell(drawing, cell, nx, ny);
        if (next_x < next_y) {
            at = next_x;
            cell.column += step_x;
            next_x += over_x;
        } else {
            at = next_y;
            cell.row += step_y;
            next_y += over_y;
        }
    }
}

/* Draw the wall on a part of the circle about a point, counter-clockwise in rad. */
static void draw_round(const Drawing *drawing, const double *middle, double start, double stop) {
    const Grid *grid = drawing->grid;
    const double radius = drawing->radius;
    const int64_t count = (int64_t)ceil((stop - start) * radius / (0.25 * grid->dx_mm));
    for (int64_t step = 0; step < count; step++) {
        const double angle = start + ((double)step + 0.5) * (stop - start) / (double)count;
        const double nx = cos(angle), ny = sin(angle);
        const Cell cell = {(int64_t)floor((middle[1] + radius * ny - grid->y_mm) / grid->dy_mm),
                           (int64_t)floor((middle[0] + radius * nx - grid->x_mm) / grid->dx_mm)};
        draw_cell(drawing, cell, nx, ny);
    }
}

/* Draw the round at the end of the sweep, towards the side from which the next one turns away; `next` is b
   where there is none. */
static void draw_end(const Drawing *drawing, const double *next) {
    const double *a = drawing->a, *b = drawing->b;
    const double ux = b[0] - a[0], uy = b[1] - a[1], vx = next[0] - b[0], vy = next[1] - b[1];
    if (next != b && vx == 0.0 && vy == 0.0)
        return; /* the last of the samples at one place draws the round */
    const double cross = ux * vy - uy * vx, dot = ux * vx + uy * vy;
    if (dot > 0.0 && fabs(cross) * drawing->radius < 0.5 * drawing->grid->dx_mm * dot)
        return; /* straight on, within the resolution of a cell */
    const bool moved = sqrt(ux * ux + uy * uy) > 0.0, goes_on = sqrt(vx * vx + vy * vy) > 0.0;
    if (!moved && !goes_on) {
        draw_round(drawing, b, 0.0, 4 * QUARTER);
    } else if (!moved) {
        const double goes = atan2(vy, vx);
        draw_round(drawing, b, goes + QUARTER, goes + 3 * QUARTER);
    } else {
        const double came = atan2(uy, ux), turn = goes_on ? atan2(cross, dot) : 0.0;
        const double right = came - QUARTER, left = came + QUARTER;
        if (!goes_on)
            draw_round(drawing, b, right, left);
        else if (turn > 0.0)
            draw_round(drawing, b, right, right + turn);
        else
            draw_round(drawing, b, left + turn, left);
    }
}

void draw_walls(const Grid *grid, const Path *path, int64_t k) {
    const Outline *outline = outline_of(path, AT(path->tool, k));
    const double *a = place_of(path, k - 1), *b = place_of(path, k);
    const double radius = outline->radius, floor_mm = lesser(a[2], b[2]) + outline_height(radius, outline);
    const double top = highest(grid, lesser(a[0], b[0]) - radius, greater(a[0], b[0]) + radius,
                               lesser(a[1], b[1]) - radius, greater(a[1], b[1]) + radius);
    if (top <= floor_mm + FEEL_MM)
        return;
    const Drawing drawing = {grid, path, k, a, b, radius, floor_mm};
    const double length = sqrt(squared(b[0] - a[0]) + squared(b[1] - a[1]));
    if (length > 0.0) {
        const double nx = -(b[1] - a[1]) / length, ny = (b[0] - a[0]) / length;
        draw_line(&drawing, nx, ny);
        draw_line(&drawing, -nx, -ny);
        if (AT(path->first, k - 1)) { /* the round at the start of the chain */
            const double came = atan2(b[1] - a[1], b[0] - a[0]);
            draw_round(&drawing, a, came + QUARTER, came + 3 * QUARTER);
        }
    }
    const bool has_next = k + 1 < path->position_mm.rows && !AT(path->first, k + 1);
    draw_end(&drawing, has_next ? place_of(path, k + 1) : b);
}
