/* Lower the rows of a field below the sweep of a cutter that is no ball. */

#include "cutting/swept.h"

/* Where a row enters and leaves something, in mm from the start of the sweep; nothing if left > right. */
typedef struct {
    double left, right;
} Chord;

/* Cells of a row at a height y above the start of the sweep: along and beside it at the cell `begin`, which may lie
   outside the grid, and their steps from cell to cell. */
typedef struct {
    int64_t i, begin;
    Cells cells;
    double y, along, beside, along_step, beside_step;
} Row;

typedef float Below(const Sweep32 *sweep, float along, float beside);

/* Below a flat cutter that rises or sinks: its height where it reaches or leaves a cell. */
static inline float below_ramp(const Sweep32 *sweep, float along, float beside) {
    const float reach = root32(sweep->square - beside * beside);
    return sweep->z + sweep->slope * clamp32(along + sweep->towards * reach, 0.0f, sweep->length);
}

/* `outline_height` of a squared radius, in single precision and without branches. */
static inline float height32(const Sweep32 *sweep, float square) {
    const float r = sqrtf(square);
    const float x = clamp32(r - sweep->bottom, 0.0f, sweep->corner);
    const float arc = sweep->corner - root32(sweep->corner * sweep->corner - x * x);
    const float side = sweep->arc_top + (r - sweep->arc_radius) * sweep->steep;
    return r < sweep->arc_radius ? arc : side;
}

static inline float height_at_way(const Sweep32 *sweep, float along, float beside_square, float t) {
    return sweep->slope * t + height32(sweep, beside_square + (along - t) * (along - t));
}

/* Below any cutter. Along the sweep the height over a cell is convex: the lowest of both ends of the contact,
   the nearest point in plan, and the lowest point of a parabola. */
static inline float below_other(const Sweep32 *sweep, float along, float beside) {
    const float square = beside * beside, reach = root32(sweep->square - square);
    float a = along - reach, b = along + reach;
    a = a > 0.0f ? a : 0.0f;
    b = b < sweep->length ? b : sweep->length;
    b = b > a ? b : a;
    const float middle = 0.5f * (a + b);
    const float at_a = height_at_way(sweep, along, square, a), at_b = height_at_way(sweep, along, square, b);
    const float at_middle = height_at_way(sweep, along, square, middle);
    const float bend = at_a - at_middle + at_b - at_middle;
    const float t = middle - 0.25f * (b - a) * (at_b - at_a) / (bend > 1e-9f ? bend : 1e-9f);
    const float at_lowest = height_at_way(sweep, along, square, clamp32(t, a, b));
    const float near = height_at_way(sweep, along, square, clamp32(along, a, b));
    return sweep->z + min32(min32(min32(min32(at_lowest, near), at_a), at_b), at_middle);
}

/* The same where all heights along the way are alike: on the level, as larger radii are not lower,
   or upright. */
static inline float below_level(const Sweep32 *sweep, float along, float beside) {
    const float square = beside * beside, reach = root32(sweep->square - square);
    float a = along - reach, b = along + reach;
    a = a > 0.0f ? a : 0.0f;
    b = b < sweep->length ? b : sweep->length;
    b = b > a ? b : a;
    return sweep->z + height_at_way(sweep, along, square, clamp32(along, a, b));
}

/* Not above `below_other`: the nearest point of the way, as if it were at the lower end of the slope. */
static inline float bound_other(const Sweep32 *sweep, float along, float beside) {
    const float off = along - clamp32(along, 0.0f, sweep->length);
    return sweep->lowest + height32(sweep, beside * beside + off * off);
}

/* Not above any: what no point of the cutter gets below. */
static inline float bound_any(const Sweep32 *sweep, float along, float beside) {
    (void)along;
    (void)beside;
    return sweep->lowest;
}

/* Write the height below a sweep over SW_LANES cells, the first `from` cells after the row's begin. */
static inline void heights_below(const Row *row, const Sweep32 *sweep, Below *below, int32_t from,
                                 float *lows) {
    const float along = (float)row->along, along_step = (float)row->along_step;
    const float beside = (float)row->beside, beside_step = (float)row->beside_step;
    for (int32_t lane = 0; lane < SW_LANES; lane++) {
        const float at = (float)(from + lane);
        lows[lane] = below(sweep, along + at * along_step, beside + at * beside_step);
    }
}

static inline bool any_above(const float *heights, const float *lows) {
    int32_t is_above = 0;
    for (int32_t lane = 0; lane < SW_LANES; lane++)
        is_above |= heights[lane] > lows[lane];
    return is_above;
}

/* Lower the cells of a row, SW_LANES at once: without branches and with as many spare cells behind a row, so
   that the compiler takes eight together. Where a cell is lowered, older walls end. Cells that are all below
   a bound of the sweep are left out; most were cut by the sweep before. */
static inline void lower_row(const Grid *grid, const Row *row, const Sweep32 *sweep, Below *below,
                             Below *bound) {
    float lows[SW_LANES];
    for (int64_t j = row->cells.first; j < row->cells.after; j += SW_LANES) {
        float *height = &CELL(grid->height, row->i, j);
        int32_t *wall = &CELL(grid->wall, row->i, j);
        (void)INSIDE(j + SW_LANES - 1, grid->height.columns);
        const int32_t from = (int32_t)(j - row->begin), left = (int32_t)least(row->cells.after - j, SW_LANES);
        if (bound) {
            heights_below(row, sweep, bound_any, from, lows);
            if (!any_above(height, lows))
                continue;
        }
        if (bound && bound != bound_any) {
            heights_below(row, sweep, bound, from, lows);
            if (!any_above(height, lows))
                continue;
        }
        heights_below(row, sweep, below, from, lows);
        for (int32_t lane = 0; lane < SW_LANES; lane++) {
            const float low = lane < left ? lows[lane] : INFINITY;
            wall[lane] = low < height[lane] ? -1 : wall[lane];
            height[lane] = low < height[lane] ? low : height[lane];
        }
    }
}

/* Lower the cells of a row to a level. */
static void lower_level(const Grid *grid, int64_t i, int64_t first, int64_t after, float z) {
    if (first >= after)
        return;
    float *restrict height = &CELL(grid->height, i, first);
    int32_t *restrict wall = &CELL(grid->wall, i, first);
    (void)INSIDE(after - 1, grid->height.columns);
    for (int64_t j = 0; j < after - first; j++) {
        wall[j] = z < height[j] ? -1 : wall[j];
        height[j] = z < height[j] ? z : height[j];
    }
}

/* Lower a row below a level sweep of a flat cutter, without what the disc at its start has cut. */
static void lower_flat(const Grid *grid, const Row *row, const Sweep *sweep) {
    const double radius = sweep->outline->radius, y = row->y;
    const int64_t first = row->cells.first, after = row->cells.after;
    Cells gap = {after, after};
    if (sweep->follows && fabs(y) < radius) {
        const double half = sqrt(radius * radius - y * y);
        gap = columns_between(grid, sweep->ax - half, sweep->ax + half, grid->height.columns - SW_LANES);
    }
    lower_level(grid, row->i, first, least(gap.first, after), (float)sweep->az);
    lower_level(grid, row->i, most(gap.after, first), after, (float)sweep->az);
}

/* Return the largest height that a sweep cuts off in a row of cells. */
static double measure(const Grid *grid, const Row *row, const Sweep *sweep) {
    double worst = 0.0;
    for (int64_t j = row->cells.first; j < row->cells.after; j++) {
        const double at = (double)(j - row->begin);
        const double along = row->along + at * row->along_step, beside = row->beside + at * row->beside_step;
        const double t = lesser(greater(along, 0.0), sweep->length);
        const double r = sqrt(squared(along - t) + beside * beside);
        const double low = sweep->az + sweep->slope * t + outline_height(r, sweep->outline);
        worst = greater(worst, CELL(grid->height, row->i, j) - low);
    }
    return worst;
}

/* Return where a row enters and leaves the plan of a sweep. */
static Chord chord(double y, const Sweep *sweep) {
    const double ex = sweep->ex, ey = sweep->ey, radius = sweep->outline->radius;
    double low = 0.0, high = sweep->length, left = 0.0, right = sweep->length;
    if (ey != 0.0) {
        const double a = (y - radius) / ey, b = (y + radius) / ey;
        low = greater(low, lesser(a, b));
        high = lesser(high, greater(a, b));
        const double tangent = ey > 0.0 ? radius * ex : -radius * ex;
        left = (y - tangent) / ey;
        right = (y + tangent) / ey;
    } else if (ex < 0.0) {
        left = sweep->length;
        right = 0.0;
    }
    if (low > high || (ey == 0.0 && fabs(y) > radius))
        return (Chord){1.0, 0.0};
    left = lesser(greater(left, low), high);
    right = lesser(greater(right, low), high);
    const double reach_left = sqrt(greater(radius * radius - squared(y - ey * left), 0.0));
    const double reach_right = sqrt(greater(radius * radius - squared(y - ey * right), 0.0));
    return (Chord){ex * left - reach_left, ex * right + reach_right};
}

/* Return how far back along a sweep cells were not cut when the cutter was at its start. */
static double behind(const Sweep *sweep) {
    if (!sweep->follows)
        return -INFINITY;
    if (sweep->slope >= 0.0)
        return 0.0;
    return sweep->outline->kind == SW_BALL ? sweep->sink * sweep->outline->radius : -sweep->outline->radius;
}

/* Leave out what the sweep before has cut. */
static Chord in_front(Chord row, double y, const Sweep *sweep) {
    const double from = behind(sweep) - y * sweep->ey;
    if (fabs(sweep->ex) > 1e-9) {
        const double x = from / sweep->ex;
        return sweep->ex > 0.0 ? (Chord){greater(row.left, x), row.right} : (Chord){row.left, lesser(row.right, x)};
    }
    return from > 0.0 ? (Chord){INFINITY, -INFINITY} : row;
}

/* Return the cells of a row that a sweep cuts. */
static Row row_below(const Grid *grid, const Sweep *sweep, int64_t i) {
    const double dx = grid->dx_mm, y = grid->y_mm + ((double)(i + grid->row) + 0.5) * grid->dy_mm - sweep->ay;
    const Chord cut = in_front(chord(y, sweep), y, sweep);
    if (cut.left > cut.right)
        return (Row){.i = i};
    const int64_t begin = (int64_t)ceil((cut.left + sweep->ax - grid->x_mm) / dx - 0.5) - grid->column;
    const double x = grid->x_mm + ((double)(begin + grid->column) + 0.5) * dx - sweep->ax;
    const int64_t columns = grid->height.columns - SW_LANES;
    return (Row){.i = i,
                 .begin = begin,
                 .cells = columns_between(grid, cut.left + sweep->ax, cut.right + sweep->ax, columns),
                 .y = y,
                 .along = x * sweep->ex + y * sweep->ey,
                 .beside = y * sweep->ex - x * sweep->ey,
                 .along_step = dx * sweep->ex,
                 .beside_step = -dx * sweep->ey};
}

double cut_off_by(const Grid *grid, const Sweep *sweep, Cells rows) {
    double worst = 0.0;
    for (int64_t i = rows.first; i < rows.after; i++) {
        const Row row = row_below(grid, sweep, i);
        worst = greater(worst, measure(grid, &row, sweep));
    }
    return worst;
}

static void lower(const Grid *grid, const Row *row, const Sweep *sweep, const Sweep32 *single) {
    const double kind = sweep->outline->kind;
    if (kind == SW_FLAT && sweep->slope == 0.0)
        lower_flat(grid, row, sweep);
    else if (kind == SW_FLAT)
        lower_row(grid, row, single, below_ramp, bound_any);
    else if (sweep->slope == 0.0 && (sweep->outline->steep == 0.0 || sweep->length == 0.0))
        lower_row(grid, row, single, below_level, bound_any);
    else
        lower_row(grid, row, single, below_other, bound_other);
}


void lower_below_other(const Grid *grid, const Sweep *sweep, Cells rows) {
    const Sweep32 single = in_single(sweep);
    for (int64_t i = rows.first; i < rows.after; i++) {
        const Row row = row_below(grid, sweep, i);
        lower(grid, &row, sweep, &single);
    }
}
