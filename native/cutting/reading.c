/* Cut a motion out of a grid and read the engagement along it.

The engagement is read at nodes (nodes.c), half way between two of them, and where these three do not lie on a line, at
more samples between (stretch.c). Every other sample has what lies between those that
are read, with its own heading and its own feed per tooth: the force of the chip grows with the feed, that of the edge
does not depend on it, and both parts are kept. */

#include "cutting/removal.h"
#include "cutting/stretch.h"
#include "cutting/walls.h"

/* Remove a sweep where it comes near the strip. */
static void apply(const Strip *strip, int64_t k, Range near, Floats rapid_mm) {
    const Path *path = strip->path;
    if (AT(path->first, k))
        return;
    const double a = CELL(path->position_mm, k - 1, near.axis), b = CELL(path->position_mm, k, near.axis);
    if (greater(a, b) < near.low || lesser(a, b) > near.high)
        return;
    const double cut_mm = remove_sweep(strip->grid, path, k);
    draw_walls(strip->grid, path, k);
    if (AT(path->rapid, k))
        AT(rapid_mm, k) = cut_mm;
}

/* How far a strip has come: the last point that was passed, and the last whose sweep the field shows. */
typedef struct {
    int64_t passed, lag;
} Progress;

static void remove_up_to(const Strip *strip, int64_t lag, Range near, Floats rapid_mm, Progress *progress) {
    for (int64_t k = progress->lag + 1; k <= lag; k++)
        apply(strip, k, near, rapid_mm);
    progress->lag = most(progress->lag, lag);
}

/* Remove the sweeps that end farther behind sample i than the field lags, and all before a change of tool. */
static void follow(const Strip *strip, const Samples *samples, int64_t i, Range near, Floats rapid_mm,
                   Progress *progress) {
    const Path *path = strip->path;
    const int64_t point = AT(samples->point, i);
    int64_t lag = progress->lag;
    for (; progress->passed < point; progress->passed++)
        if (AT(path->first, progress->passed + 1))
            lag = progress->passed + 1;
    const double limit_mm = AT(samples->way_mm, i) - AT(strip->cutters->lag_mm, AT(samples->tool, i));
    while (lag < point && AT(path->way_mm, lag + 1) <= limit_mm)
        lag++;
    remove_up_to(strip, lag, near, rapid_mm, progress);
}

/* Cut all samples one after the other; write the rows of those whose coordinate along `axis` lies in [low, high).

   Sweeps farther than `reach_mm` from there are left out: the field outside is another strip's. Nodes up to
   `apart_mm` outside are read too, for the samples between them. What is read at a sample depends only on the samples
   before it, not on how the field is divided. rapid_mm gets the height that rapids cut off, a row a point. */
EXPORT void cutting_cut_strip(const Grid *grid, const Path *path, const Samples *samples, const Cutters *cutters,
                              Floats law, double low, double high, int64_t axis, double reach_mm, double apart_mm,
                              const Work *work, Floats rapid_mm, const Result *result) {
    const Strip strip = {grid, path, cutters, work, law.at};
    const Range own = {axis, low, high}, near = {axis, low - reach_mm, high + reach_mm};
    const Range read = {axis, low - apart_mm, high + apart_mm};
    Progress progress = {0, 0};
    Reader reader = {&strip, samples, result, own, 0};
    Known last = {-1, {.arc_count = 0}};
    int64_t tool = -1;
    for (int64_t begin = -1, end; begin + 1 < samples->way_mm.rows; begin = end) {
        bool is_near = false;
        end = begin;
        do {
            end++;
            is_near |= is_in(read, &CELL(samples->position_mm, end, 0));
        } while (!AT(samples->node, end));
        if (!is_near) {
            last = (Known){end, {.arc_count = 0}};
            continue;
        }
        follow(&strip, samples, begin + 1, near, rapid_mm, &progress);
        if (AT(samples->tool, end) != tool) {
            tool = AT(samples->tool, end);
            fill_turn(work, AT(cutters->wall_bins, tool), AT(cutters->ring_bins, tool));
        }
        reader.lag = progress.lag;
        last = read_stretch(&reader, last, end);
    }
    remove_up_to(&strip, path->way_mm.rows - 1, near, rapid_mm, &progress);
}

/* For tests: the height of a cutter's outline (7) at a radius. */
EXPORT double cutting_outline_height(double r, Floats outline) {
    return outline_height(r, (const Outline *)&AT(outline, 0));
}
