/* Lower a height field below the sweeps of a cutter. */

#include "cutting/removal.h"

#include "cutting/swept.h"

#define NO_LENGTH_MM 1e-9
#define LEAST_ONWARD 2.0 /* how far a sweep goes on for what it goes aside, if it follows the one before */

enum { REFRESH = 48 }; /* visits after which the bound of a block is computed again */

/* Note whether the next sweep goes on from a ball's sweep at nearly the same heading.

   It cuts all cells that are lowest below its own way. Those below the joint that lie behind the plane across its
   beginning, s·w ahead of the joint on a slope of sine s at a half-width w of the ball, are the first one's: the
   wedge is what turns by an angle of tangent t may move that border by, t·R in plan and, as w is steep at the rim,
   s·R·(sqrt(2t + t²) + t²). */
static void join(const Path *path, int64_t k, Sweep *sweep) {
    const int64_t next = k + 1;
    if (next >= path->position_mm.rows || AT(path->first, next) || AT(path->rapid, k) || AT(path->rapid, next))
        return;
    const double *b = place_of(path, k), *c = place_of(path, next);
    const double x = c[0] - b[0], y = c[1] - b[1], z = c[2] - b[2];
    const double onward = x * sweep->ex + y * sweep->ey, aside = fabs(y * sweep->ex - x * sweep->ey);
    if (!(onward > LEAST_ONWARD * aside) || !(onward > NO_LENGTH_MM))
        return;
    const double turn = aside / onward, radius = sweep->outline->radius;
    sweep->goes_on = true;
    sweep->next_sink = z / sqrt(x * x + y * y + z * z);
    sweep->wedge = JOINT_MM + radius * (turn + fabs(sweep->next_sink) * (sqrt(2.0 * turn + turn * turn) + turn * turn));
}

bool leaves_disc(const Path *path, int64_t k, double lag_mm) {
    const int64_t next = k + 1;
    if (k < 1 || next >= path->position_mm.rows || AT(path->first, k) || AT(path->first, next) ||
        AT(path->rapid, k) || AT(path->rapid, next) || outline_of(path, AT(path->tool, k))->kind == SW_BALL)
        return false;
    const double *a = place_of(path, k - 1), *b = place_of(path, k), *c = place_of(path, next);
    return b[2] < a[2] && c[2] < b[2] && AT(path->way_mm, next) - AT(path->way_mm, k) <= lag_mm &&
           squared(b[0] - a[0]) + squared(b[1] - a[1]) > squared(NO_LENGTH_MM);
}

static Sweep sweep_to(const Path *path, int64_t k, double lag_mm) {
    const double *a = place_of(path, k - 1), *b = place_of(path, k);
    const Outline *outline = outline_of(path, AT(path->tool, k));
    Sweep sweep = {.outline = outline, .ax = a[0], .ay = a[1], .az = a[2], .ex = 1.0};
    const double length = sqrt(squared(b[0] - a[0]) + squared(b[1] - a[1])), rise = b[2] - a[2];
    if (!(length > NO_LENGTH_MM)) {
        sweep.az = lesser(a[2], b[2]);
        return sweep;
    }
    sweep.length = length;
    sweep.ex = (b[0] - a[0]) / length;
    sweep.ey = (b[1] - a[1]) / length;
    sweep.slope = rise / length;
    sweep.sink = rise / sqrt(length * length + rise * rise);
    sweep.follows = k > 1 && !AT(path->first, k - 1);
    if (outline->kind == SW_BALL)
        join(path, k, &sweep);
    else
        sweep.goes_on = leaves_disc(path, k, lag_mm);
    return sweep;
}

/* Count a visit of every block of a range of cells; refresh its bound every REFRESH visits. */
static void visit(const Grid *grid, Cells rows, Cells columns) {
    for (int64_t i = rows.first / SW_BLOCK; i <= (rows.after - 1) / SW_BLOCK; i++)
        for (int64_t j = columns.first / SW_BLOCK; j <= (columns.after - 1) / SW_BLOCK; j++)
            if (++CELL(grid->visits, i, j) >= REFRESH) {
                refresh(grid, i, j);
                CELL(grid->visits, i, j) = 0;
            }
}

double remove_sweep(const Grid *grid, const Path *path, int64_t k, double lag_mm) {
    const double *a = place_of(path, k - 1), *b = place_of(path, k);
    const double radius = outline_of(path, AT(path->tool, k))->radius;
    const double x_low = lesser(a[0], b[0]) - radius, x_high = greater(a[0], b[0]) + radius;
    const double y_low = lesser(a[1], b[1]) - radius, y_high = greater(a[1], b[1]) + radius;
    if (highest(grid, x_low, x_high, y_low, y_high) <= lesser(a[2], b[2]))
        return 0.0;
    const Cells rows = rows_between(grid, y_low, y_high, grid->height.rows);
    const Cells columns = columns_between(grid, x_low, x_high, grid->height.columns - SW_LANES);
    if (rows.first >= rows.after || columns.first >= columns.after)
        return 0.0;
    const Sweep sweep = sweep_to(path, k, lag_mm);
    const double worst = AT(path->rapid, k) ? cut_off_by(grid, &sweep, rows) : 0.0;
    if (sweep.outline->kind == SW_BALL)
        lower_below_ball(grid, &sweep);
    else
        lower_below_other(grid, &sweep, rows);
    visit(grid, rows, columns);
    return worst;
}
