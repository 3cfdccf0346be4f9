/* Lower a field below the sweep of a ball.

The lowest point over a cell belongs to the nearest point of the ball's way. At a half-width w of the ball, these are
the cells between s·w and length + s·w along a sweep whose slope has the sine s: a band as wide as the sweep is long.
Those outside it are cut lower by the sweeps before and after. So the cells are taken across the sweep: SW_LANES lines
side by side, rows or columns, each from its own first cell. */

#include "cutting/swept.h"

#define ROOM_CELLS 1e-3f /* for rounding of where a line enters and leaves the band */

/* Lines across a sweep and the cells along them: their size, the sweep's start in cells of the whole field, the unit
   vector of the sweep, all along (p) and across (q) the lines. */
typedef struct {
    float dp, dq, ep, eq, start_p, start_q;
    float per_dp, per_ep;     /* reciprocals */
    int64_t shift_p, shift_q; /* from the cell at the start to the grid */
    int64_t cells, lines;     /* of the grid */
    int64_t step_p, step_q;   /* from cell to cell in memory */
} Lines;

/* The band along the sweep that it cuts: w·from to to + w·ahead at a half-width w. */
typedef struct {
    float from, to, ahead, radius;
} Band32;

/* The cells of SW_LANES lines: q of the line, first cell and the one after the last, counted from the start. */
typedef struct {
    float q[SW_LANES];
    int32_t first[SW_LANES], after[SW_LANES];
} Block;

static Lines lines_across(const Grid *grid, const Sweep *sweep) {
    const int64_t rows = grid->height.rows, columns = grid->height.columns - SW_LANES;
    const float dx = (float)grid->dx_mm, dy = (float)grid->dy_mm, ex = (float)sweep->ex, ey = (float)sweep->ey;
    int64_t column, row;
    const float x = place_in(sweep->ax, grid->x_mm, grid->dx_mm, grid->column, &column);
    const float y = place_in(sweep->ay, grid->y_mm, grid->dy_mm, grid->row, &row);
    if (fabs(sweep->ex) >= fabs(sweep->ey))
        return (Lines){dx, dy, ex, ey, x, y, 1.0f / dx, 1.0f / ex, column, row, columns, rows, 1, grid->height.columns};
    return (Lines){dy, dx, ey, ex, y, x, 1.0f / dy, 1.0f / ey, row, column, rows, columns, grid->height.columns, 1};
}

static Band32 band_of(const Sweep *sweep) {
    const double ahead = sweep->goes_on ? greater(sweep->sink, sweep->next_sink) : 1.0;
    return (Band32){.from = sweep->follows ? (float)sweep->sink : -1.0f,
                    .to = (float)(sweep->length + sweep->wedge),
                    .ahead = (float)ahead,
                    .radius = (float)sweep->outline->radius};
}

/* Where a line enters and leaves the band between two half-widths. */
static inline void cross(const Lines *lines, const Band32 *band, float q, float least_w, float most_w, float *enters,
                         float *leaves) {
    const float low = band->from * (band->from < 0.0f ? most_w : least_w);
    const float high = band->to + band->ahead * (band->ahead < 0.0f ? least_w : most_w);
    const float a = (low - q * lines->eq) * lines->per_ep, b = (high - q * lines->eq) * lines->per_ep;
    *enters = min32(a, b);
    *leaves = max32(a, b);
}

/* Find the cells of lines that lie in the band; `line` counts from the start. */
static void find_cells(const Lines *lines, const Band32 *band, int64_t line, Block *block) {
    const float square = band->radius * band->radius;
    const int32_t low = (int32_t)-lines->shift_p, high = (int32_t)(lines->cells - lines->shift_p);
    for (int32_t lane = 0; lane < SW_LANES; lane++) {
        const float q = ((float)((int32_t)line + lane) - lines->start_q) * lines->dq;
        float enters, leaves;
        cross(lines, band, q, 0.0f, band->radius, &enters, &leaves);
        const float beside_a = q * lines->ep - enters * lines->eq, beside_b = q * lines->ep - leaves * lines->eq;
        const float farthest = max32(fabsf(beside_a), fabsf(beside_b));
        const float nearest = beside_a * beside_b < 0.0f ? 0.0f : min32(fabsf(beside_a), fabsf(beside_b));
        cross(lines, band, q, root32(square - farthest * farthest), root32(square - nearest * nearest), &enters,
              &leaves);
        const int32_t first = (int32_t)ceilf(enters * lines->per_dp + lines->start_p - ROOM_CELLS);
        const int32_t last = (int32_t)floorf(leaves * lines->per_dp + lines->start_p + ROOM_CELLS);
        block->q[lane] = q;
        block->first[lane] = first > low ? first : low;
        block->after[lane] = nearest > band->radius ? block->first[lane] : last < high ? last + 1 : high;
    }
}

/* Write the height below a ball over the `step`-th cell of each line, INFINITY where there is none. */
static inline void heights_below(const Lines *lines, const Sweep32 *sweep, const Block *block, int32_t step,
                                 float *lows) {
    for (int32_t lane = 0; lane < SW_LANES; lane++) {
        const int32_t cell = block->first[lane] + step;
        const float p = ((float)cell - lines->start_p) * lines->dp, q = block->q[lane];
        const float along = p * lines->ep + q * lines->eq, beside = q * lines->ep - p * lines->eq;
        const float rest = sweep->square - beside * beside;
        const float t = clamp32(along - sweep->sink * root32(rest), 0.0f, sweep->length);
        const float below = sweep->z + sweep->slope * t - root32(rest - (along - t) * (along - t));
        const float off = along - clamp32(along, 0.0f, sweep->length);
        lows[lane] = (cell < block->after[lane]) & (off * off <= rest) ? below : INFINITY;
    }
}

/* Lower the cells of some lines, the first of them `line`; where a cell is lowered, older walls end. */
static void lower_block(const Grid *grid, const Lines *lines, const Sweep32 *sweep, const Block *block, int64_t line,
                        int64_t count) {
    const Floats32 height = grid->height;
    const Ints32 wall = grid->wall;
    const int64_t begin = line + lines->shift_q;
    float lows[SW_LANES];
    int32_t steps = 0;
    for (int32_t lane = 0; lane < SW_LANES; lane++) {
        const int32_t cells = block->after[lane] - block->first[lane];
        steps = cells > steps ? cells : steps;
    }
    for (int32_t step = 0; step < steps; step++) {
        heights_below(lines, sweep, block, step, lows);
        for (int64_t lane = 0; lane < count; lane++) {
            const int64_t cell = block->first[lane] + step + lines->shift_p;
            const int64_t at = (begin + lane) * lines->step_q + cell * lines->step_p;
            COUNT(AT(grid->counted, LOOKED_AT), block->first[lane] + step < block->after[lane]);
            if (lows[lane] < INFINITY && lows[lane] < AT(height, at)) {
                AT(height, at) = lows[lane];
                AT(wall, at) = -1;
                COUNT(AT(grid->counted, LOWERED), 1);
            }
        }
    }
}

void lower_below_ball(const Grid *grid, const Sweep *sweep) {
    const Lines lines = lines_across(grid, sweep);
    const Band32 band = band_of(sweep);
    const Sweep32 single = in_single(sweep);
    const float end_q = (float)sweep->length * lines.eq, reach = band.radius;
    const int64_t first = (int64_t)floorf((min32(end_q, 0.0f) - reach) / lines.dq + lines.start_q);
    const int64_t last = (int64_t)ceilf((max32(end_q, 0.0f) + reach) / lines.dq + lines.start_q);
    const int64_t after = least(last + 1, lines.lines - lines.shift_q);
    Block block;
    for (int64_t line = most(first, -lines.shift_q); line < after; line += SW_LANES) {
        find_cells(&lines, &band, line, &block);
        lower_block(grid, &lines, &single, &block, line, least(SW_LANES, after - line));
    }
}
