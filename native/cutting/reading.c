/* Cut a motion out of a grid and read the engagement along it.

The engagement is read at nodes (nodes.c), half way between two of them, and where these three do not lie on a line, at
more samples between (stretch.c). Every other sample has what lies between those that
are read, with its own heading and its own feed per tooth: the force of the chip grows with the feed, that of the edge
does not depend on it, and both parts are kept. */

#include "cutting/removal.h"
#include "cutting/stretch.h"
#include "cutting/walls.h"

/* Remove a sweep where it comes near the strip; note what a rapid cuts off. */
static void apply(const Strip *strip, int64_t k, Range near, double *rapid_mm) {
    const Path *path = strip->path;
    if (AT(path->first, k))
        return;
    const double a = CELL(path->position_mm, k - 1, near.axis), b = CELL(path->position_mm, k, near.axis);
    if (greater(a, b) < near.low || lesser(a, b) > near.high)
        return;
    const double cut_mm = remove_sweep(strip->grid, path, k, AT(strip->cutters->lag_mm, AT(path->tool, k)));
    draw_walls(strip->grid, path, k);
    if (AT(path->rapid, k))
        *rapid_mm = cut_mm;
}

/* How far a strip has come: the last point that was passed, the last whose sweep the field shows, and whether the motion
   goes on behind samples that were given before. */
typedef struct {
    int64_t passed, lag, goes_on;
} Progress;

/* A strip that is being cut: how far it has come, what is near it, and what rapids cut off, a row a point from
   `noted` on. */
typedef struct {
    Progress *progress;
    Range near;
    int64_t noted;
    Floats rapid_mm;
} Cutting;

static void remove_up_to(const Strip *strip, int64_t lag, const Cutting *cutting) {
    for (int64_t k = cutting->progress->lag + 1; k <= lag; k++)
        apply(strip, k, cutting->near, &AT(cutting->rapid_mm, k - cutting->noted));
    cutting->progress->lag = most(cutting->progress->lag, lag);
}

/* Remove the sweeps that end farther behind sample i than the field lags, and all before a change of tool. */
static void follow(const Strip *strip, const Samples *samples, int64_t i, const Cutting *cutting) {
    const Path *path = strip->path;
    Progress *progress = cutting->progress;
    const int64_t point = AT(samples->point, i);
    int64_t lag = progress->lag;
    for (; progress->passed < point; progress->passed++)
        if (AT(path->first, progress->passed + 1))
            lag = progress->passed + 1;
    const double limit_mm = AT(samples->way_mm, i) - AT(strip->cutters->lag_mm, AT(samples->tool, i));
    while (lag < point && AT(path->way_mm, lag + 1) <= limit_mm)
        lag++;
    remove_up_to(strip, lag, cutting);
}

_Static_assert(sizeof(Node) == RD_NODE_NUMBERS * sizeof(double), "a node has that many numbers");
_Static_assert(sizeof(Progress) == RD_PROGRESS * sizeof(int64_t), "and how far a strip has come that many");

/* Cut all samples one after the other; write the rows of those whose coordinate along `axis` lies in [low, high).

   Sweeps farther than `reach_mm` from there are left out: the field outside is another strip's. Nodes up to
   `apart_mm` outside are read too, for the samples between them. What is read at a sample depends only on the samples
   before it, not on how the field is divided, nor on how many samples are given at a time: the last one has to be a
   node, and the next ones begin with it again. The motion `ends` with the last samples. rapid_mm gets the height
   that rapids cut off, a row a point behind the sweeps that are removed already. */
EXPORT void cutting_cut_strip(const Grid *grid, const Path *path, const Samples *samples, const Cutters *cutters,
                              Floats law, double low, double high, int64_t axis, double reach_mm, double apart_mm,
                              int64_t ends, const Work *work, Ints progress_so_far, Floats node_so_far,
                              Floats rapid_mm, const Result *result) {
    const Strip strip = {grid, path, cutters, work, law.at};
    const Range own = {axis, low, high}, read = {axis, low - apart_mm, high + apart_mm};
    Progress *progress = (Progress *)&AT(progress_so_far, 0);
    const Cutting cutting = {progress, {axis, low - reach_mm, high + reach_mm}, progress->lag + 1, rapid_mm};
    Reader reader = {&strip, samples, result, own, 0};
    Known last = {progress->goes_on - 1, *(const Node *)&AT(node_so_far, 0)};
    int64_t tool = -1;
    for (int64_t begin = last.i, end; begin + 1 < samples->way_mm.rows; begin = end) {
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
        follow(&strip, samples, begin + 1, &cutting);
        if (AT(samples->tool, end) != tool) {
            tool = AT(samples->tool, end);
            fill_turn(work, AT(cutters->wall_bins, tool), AT(cutters->ring_bins, tool));
        }
        reader.lag = progress->lag;
        last = read_stretch(&reader, last, end);
    }
    *(Node *)&AT(node_so_far, 0) = last.node;
    progress->goes_on = 1;
    if (ends)
        remove_up_to(&strip, path->way_mm.rows - 1, &cutting);
    else
        follow(&strip, samples, samples->way_mm.rows - 1, &cutting);
}

/* For tests: the height of a cutter's outline (7) at a radius. */
EXPORT double cutting_outline_height(double r, Floats outline) {
    return outline_height(r, (const Outline *)&AT(outline, 0));
}
