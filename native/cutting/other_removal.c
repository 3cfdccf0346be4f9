/* Lower a field below the sweep of a cutter that is no ball.

A sweep changes a crescent. Where it rises or is level, the flat bottom at its start was cut to that height by the sweep
before; where it sinks and the next one sinks on, that one cuts what is below the flat bottom at its end. Both discs are
left out. The cells of ROWS rows are found side by side. */

#include "cutting/swept.h"

#define ROOM_CELLS 1e-3f /* for rounding of where a row enters and leaves; each cell is tested again */
#define FAR_MM 1e6f      /* farther than any field is wide */
#define STEEPEST 1e9     /* in place of the reciprocal of nothing */

enum { ROWS = 32, LANES = 8 };

/* A sweep over rows of cells, in single precision: all places are counted from its start, columns from its cell. */
typedef struct {
    float dx, dy, ex, ey, per_dx, per_ex, per_ey, start_x, start_y;
    float radius, square, length, end_x, end_y;
    float from;                    /* nothing farther back along the sweep changes */
    float gap_x, gap_y, gap_square; /* the disc that is left out; negative: none */
    int64_t row, column;           /* of the start in the grid */
    int32_t low, high;             /* columns of the grid */
} Plan;

/* Cells of rows: from first on without those from gap on and from behind on. */
typedef struct {
    float y[ROWS];
    int32_t first[ROWS], gap[ROWS], behind[ROWS], after[ROWS];
} Spans;

typedef float Below(const Sweep32 *sweep, float along, float beside);

/* Below a flat cutter: its height where it reaches or leaves a cell. */
static inline float below_flat(const Sweep32 *sweep, float along, float beside) {
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

/* Return how far back along a sweep cells were not cut when the cutter was at its start. */
static double behind(const Sweep *sweep) {
    if (!sweep->follows || sweep->slope < 0.0)
        return -FAR_MM;
    return 0.0;
}

static Plan plan_of(const Grid *grid, const Sweep *sweep) {
    const double ex = sweep->ex, ey = sweep->ey, length = sweep->length, radius = sweep->outline->radius;
    const double inner = greater(sweep->outline->bottom - JOINT_MM, 0.0);
    const bool is_start = sweep->follows && sweep->slope >= 0.0 && length > 0.0;
    const double gap_at = is_start ? 0.0 : length;
    const bool has_gap = is_start || sweep->goes_on;
    Plan plan = {.dx = (float)grid->dx_mm,
                 .dy = (float)grid->dy_mm,
                 .ex = (float)ex,
                 .ey = (float)ey,
                 .per_dx = (float)(1.0 / grid->dx_mm),
                 .per_ex = (float)(fabs(ex) > 1.0 / STEEPEST ? 1.0 / ex : STEEPEST),
                 .per_ey = (float)(fabs(ey) > 1.0 / STEEPEST ? 1.0 / ey : STEEPEST),
                 .radius = (float)radius,
                 .square = (float)(radius * radius),
                 .length = (float)length,
                 .end_x = (float)(length * ex),
                 .end_y = (float)(length * ey),
                 .from = (float)behind(sweep),
                 .gap_x = (float)(gap_at * ex),
                 .gap_y = (float)(gap_at * ey),
                 .gap_square = has_gap ? (float)(inner * inner) : -1.0f};
    plan.start_x = place_in(sweep->ax, grid->x_mm, grid->dx_mm, grid->column, &plan.column);
    plan.start_y = place_in(sweep->ay, grid->y_mm, grid->dy_mm, grid->row, &plan.row);
    plan.low = (int32_t)-plan.column;
    plan.high = (int32_t)(grid->height.columns - SW_LANES - plan.column);
    return plan;
}

/* Find the cells of ROWS rows that a sweep may change; `row` counts from its start. */
static void find_cells(const Plan *given, int32_t row, Spans *spans) {
    const Plan plan = *given;
    for (int32_t lane = 0; lane < ROWS; lane++) {
        const float y = ((float)(row + lane) - plan.start_y) * plan.dy, end_y = y - plan.end_y;
        /* the discs at both ends, and the band between them */
        const float at_start = plan.square - y * y, at_end = plan.square - end_y * end_y;
        const float start = root32(at_start), end = root32(at_end);
        const float far_start = at_start >= 0.0f ? 0.0f : FAR_MM, far_end = at_end >= 0.0f ? 0.0f : FAR_MM;
        const float a = -y * plan.ey * plan.per_ex, b = (plan.length - y * plan.ey) * plan.per_ex;
        const float c = (y * plan.ex - plan.radius) * plan.per_ey, d = (y * plan.ex + plan.radius) * plan.per_ey;
        float left = max32(min32(a, b), min32(c, d)), right = min32(max32(a, b), max32(c, d));
        const float none = left <= right ? 0.0f : FAR_MM;
        left = min32(left + none, min32(far_start - start, plan.end_x + far_end - end));
        right = max32(right - none, max32(start - far_start, plan.end_x + end - far_end));
        const float back = (plan.from - y * plan.ey) * plan.per_ex;
        left = plan.per_ex > 0.0f ? max32(left, back) : left;
        right = plan.per_ex > 0.0f ? right : min32(right, back);
        const float gap_y = y - plan.gap_y, half = root32(plan.gap_square - gap_y * gap_y);
        const float low = (float)plan.low, high = (float)plan.high;
        const float first = clamp32(ceilf(left * plan.per_dx + plan.start_x - ROOM_CELLS), low, high);
        const float after = clamp32(floorf(right * plan.per_dx + plan.start_x + ROOM_CELLS) + 1.0f, first, high);
        const float gap = clamp32(ceilf((plan.gap_x - half) * plan.per_dx + plan.start_x), first, after);
        const float onward = clamp32(floorf((plan.gap_x + half) * plan.per_dx + plan.start_x) + 1.0f, gap, after);
        spans->y[lane] = y;
        spans->first[lane] = (int32_t)first;
        spans->gap[lane] = (int32_t)(half > 0.0f ? gap : after);
        spans->behind[lane] = (int32_t)(half > 0.0f ? onward : after);
        spans->after[lane] = (int32_t)after;
    }
}

/* Write the height below a sweep over LANES cells of a row, from a column on; INFINITY beside the sweep. */
static inline void heights_below(const Plan *plan, const Sweep32 *sweep, Below *below, float y, int32_t column,
                                 float *lows) {
    const float along_row = y * plan->ey, beside_row = y * plan->ex;
    for (int32_t lane = 0; lane < LANES; lane++) {
        const float x = ((float)(column + lane) - plan->start_x) * plan->dx;
        const float along = along_row + x * plan->ex, beside = beside_row - x * plan->ey;
        const float off = along - clamp32(along, 0.0f, sweep->length);
        const float low = below(sweep, along, beside);
        lows[lane] = off * off + beside * beside <= sweep->square ? low : INFINITY;
    }
}

static inline bool any_above(const float *heights, const float *lows) {
    int32_t is_above = 0;
    for (int32_t lane = 0; lane < LANES; lane++)
        is_above |= heights[lane] > lows[lane];
    return is_above;
}

static inline bool any_above_all(const float *heights, float low) {
    int32_t is_above = 0;
    for (int32_t lane = 0; lane < LANES; lane++)
        is_above |= heights[lane] > low;
    return is_above;
}

/* Lower some cells of a row, LANES at once: without branches and with as many spare cells behind a row, so that the
   compiler takes them together. Where a cell is lowered, older walls end. Cells that are all below a bound of the sweep
   are left out. */
static inline void lower_cells(const Grid *grid, const Plan *plan, const Sweep32 *sweep, Below *below, Below *bound,
                               int64_t i, float y, int32_t first, int32_t after) {
    float lows[LANES];
    for (int32_t column = first; column < after; column += LANES) {
        const int64_t j = column + plan->column;
        float *height = &CELL(grid->height, i, j);
        int32_t *wall = &CELL(grid->wall, i, j);
        (void)INSIDE(j + LANES - 1, grid->height.columns);
        COUNT(AT(grid->counted, LOOKED_AT), least(after - column, LANES));
        if (!any_above_all(height, sweep->lowest))
            continue;
        if (bound) {
            heights_below(plan, sweep, bound, y, column, lows);
            if (!any_above(height, lows))
                continue;
        }
        heights_below(plan, sweep, below, y, column, lows);
        const int32_t left = after - column;
        for (int32_t lane = 0; lane < LANES; lane++) {
            const float low = lane < left ? lows[lane] : INFINITY;
            COUNT(AT(grid->counted, LOWERED), low < height[lane]);
            wall[lane] = low < height[lane] ? -1 : wall[lane];
            height[lane] = low < height[lane] ? low : height[lane];
        }
    }
}

/* Lower the cells of all rows. */
static inline void lower_rows(const Grid *grid, const Sweep *sweep, Below *below, Below *bound, Cells rows) {
    const Plan plan = plan_of(grid, sweep);
    const Sweep32 single = in_single(sweep);
    Spans spans;
    for (int64_t begin = rows.first; begin < rows.after; begin += ROWS) {
        find_cells(&plan, (int32_t)(begin - plan.row), &spans);
        const int64_t count = least(ROWS, rows.after - begin);
        for (int64_t k = 0; k < count; k++) {
            const float y = spans.y[k];
            lower_cells(grid, &plan, &single, below, bound, begin + k, y, spans.first[k], spans.gap[k]);
            lower_cells(grid, &plan, &single, below, bound, begin + k, y, spans.behind[k], spans.after[k]);
        }
    }
}

void lower_below_other(const Grid *grid, const Sweep *sweep, Cells rows) {
    const Outline *outline = sweep->outline;
    if (outline->kind == SW_FLAT)
        lower_rows(grid, sweep, below_flat, NULL, rows);
    else if (sweep->slope == 0.0 && (outline->steep == 0.0 || sweep->length == 0.0))
        lower_rows(grid, sweep, below_level, NULL, rows);
    else
        lower_rows(grid, sweep, below_other, bound_other, rows);
}

/* Return the largest height that a sweep cuts off in a part of a row. */
static double measure(const Grid *grid, const Plan *plan, const Sweep *sweep, int64_t i, int32_t first, int32_t after) {
    const double y = ((double)(i - plan->row) - plan->start_y) * grid->dy_mm;
    double worst = 0.0;
    for (int32_t column = first; column < after; column++) {
        const double x = ((double)column - plan->start_x) * grid->dx_mm;
        const double along = x * sweep->ex + y * sweep->ey, beside = y * sweep->ex - x * sweep->ey;
        const double t = lesser(greater(along, 0.0), sweep->length);
        const double r = sqrt(squared(along - t) + beside * beside);
        if (r > sweep->outline->radius)
            continue;
        const double low = sweep->az + sweep->slope * t + outline_height(r, sweep->outline);
        worst = greater(worst, CELL(grid->height, i, column + plan->column) - low);
    }
    return worst;
}

double cut_off_by(const Grid *grid, const Sweep *sweep, Cells rows) {
    const Plan plan = plan_of(grid, sweep);
    double worst = 0.0;
    Spans spans;
    for (int64_t begin = rows.first; begin < rows.after; begin += ROWS) {
        find_cells(&plan, (int32_t)(begin - plan.row), &spans);
        for (int64_t k = 0; k < least(ROWS, rows.after - begin); k++) {
            worst = greater(worst, measure(grid, &plan, sweep, begin + k, spans.first[k], spans.gap[k]));
            worst = greater(worst, measure(grid, &plan, sweep, begin + k, spans.behind[k], spans.after[k]));
        }
    }
    return worst;
}
