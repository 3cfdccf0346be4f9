/* Cut a motion out of a grid and read the engagement along it.

The engagement is read at nodes, a twentieth of the diameter apart (nodes.c), and at the samples between two of them
where these are not alike: where contact begins and ends, where the force jumps. Otherwise a sample between two nodes
has what lies between theirs, with its own heading and its own feed per tooth: the force of the chip grows with the
feed, that of the edge does not depend on it, and both parts are kept.

A node is read at its own position, before its sweep is removed. The field lags a little behind
the cutter (Cutters.lag_mm): cells near the rim of the last sweeps would be read as cut or as uncut by chance. The
sweeps that the field does not show yet are evaluated exactly at each point that is read. On a straight path there
are none: no point in front of a convex cutter was inside it before. */

#include "cutting/edge.h"
#include "cutting/removal.h"
#include "cutting/walls.h"

#define STRAIGHT 0.03 /* sine of the angle in plan below which a path counts as straight */
#define LEVEL 0.15    /* the same up or down, where it only moves the angle at which the chip begins */
/* By how much two nodes may differ, as a share of the force and at the ends of arcs, if samples between them are taken
   from them. */
#define ALIKE_SHARE 0.05
#define ALIKE_RAD 0.05

/* A row of Cutters.above: what stands above the edge, and the height of its lower end; radius 0 = not checked. */
typedef struct {
    double radius, level;
} Above;

enum { SHANK, HOLDER, ABOVE_COUNT };

enum { MOST_WRITTEN = RD_ARCS, LOADS = sizeof(Load) / sizeof(double) };

/* What is read at a sample: load of the chip at 1 mm a tooth and of the edge, depth, width and arcs. */
typedef struct {
    Load chip, edge;
    double a_p_mm, a_e_mm, phi_rad[2 * MOST_WRITTEN];
    int64_t arc_count;
} Node;

/* Set the unit vector in plan of the path's tangent at a sample, sine and cosine of its descent. */
static void set_heading(Sample *sample, const double *direction) {
    const double dx = direction[0], dy = direction[1], plan = sqrt(dx * dx + dy * dy);
    const bool is_upright = plan < 1e-9;
    sample->fx = is_upright ? 1.0 : dx / plan;
    sample->fy = is_upright ? 0.0 : dy / plan;
    sample->chip.sin_gamma = -direction[2];
    sample->chip.cos_gamma = is_upright ? 0.0 : plan;
}

/* Return the last point whose sweep the edge at sample i finds cut: a feed per tooth before it.

   What an edge meets is what the tooth before has left. A step of the sampling or of the path's shape in its place
   would make the force depend on how densely points lie. */
static int64_t met_at(const Path *path, const Samples *samples, int64_t i, int64_t lag) {
    const double way_mm = AT(samples->way_mm, i) - AT(samples->f_z_mm, i);
    int64_t met = AT(samples->point, i);
    while (met > lag && AT(path->way_mm, met) > way_mm)
        met--;
    return met;
}

/* List the sweeps up to point `met` that the field does not show yet and that were not on a straight path to the
   sample. */
static void list_recent(const Path *path, int64_t lag, int64_t met, Sample *sample) {
    const int64_t stride = most((met - lag + MOST_RECENT - 1) / MOST_RECENT, 1);
    const double dx = sample->fx * sample->chip.cos_gamma, dy = sample->fy * sample->chip.cos_gamma;
    const double dz = -sample->chip.sin_gamma;
    sample->recent_count = 0;
    for (int64_t start = lag; start < met; start += stride) {
        const double *there = place_of(path, start);
        const double ax = sample->x - there[0], ay = sample->y - there[1], az = sample->z - there[2];
        const double back = ax * dx + ay * dy + az * dz, aside = ax * dy - ay * dx;
        const double off = ax * ax + ay * ay + az * az - back * back;
        if (back < 0.0 || off > squared(LEVEL * back) + 1e-12 || fabs(aside) > STRAIGHT * back)
            sample->recent[sample->recent_count++] = way_between(there, place_of(path, least(start + stride, met)));
    }
}

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

/* Note how far shank and holder reach into material beside the cutter. */
static void collide(const Strip *strip, const Sample *sample, double *overlap_mm) {
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

/* Return a sample with its place and heading, and note what is known without reading the edge. */
static Sample sample_at(const Strip *strip, const Samples *samples, int64_t i, const Result *result) {
    const Grid *grid = strip->grid;
    const double *position = &CELL(samples->position_mm, i, 0);
    Sample sample = {.x = position[0], .y = position[1], .z = position[2], .tool = AT(samples->tool, i)};
    sample.chip.f_z_mm = 1.0; /* what is read holds for any feed, see feed_scale */
    sample.outline = outline_of(strip->path, sample.tool);
    sample.bottom = grid->bottom_mm - sample.z;
    set_heading(&sample, &CELL(samples->direction, i, 0));
    sample.moves = sample.chip.sin_gamma != 0.0 || sample.chip.cos_gamma != 0.0;
    if (result == NULL)
        return sample;
    collide(strip, &sample, &CELL(result->overlap_mm, i, 0));
    if (sample.moves)
        AT(result->ramp_rad, i) = atan2(sample.chip.sin_gamma, sample.chip.cos_gamma);
    if (sample.chip.sin_gamma > 0.0) {
        const double centre = height_at(grid, strip->path, sample.x, sample.y);
        const double below = centre - greater(sample.z, grid->bottom_mm);
        AT(result->centre_mm, i) = below > FEEL_MM ? below : 0.0;
    }
    return sample;
}

/* Read the engagement at sample i. */
static Node read_node(const Strip *strip, const Samples *samples, int64_t i, int64_t lag, Sample *sample) {
    Node node = {.arc_count = 0};
    sample->top = highest_around(strip->grid, sample->x, sample->y, sample->outline->radius) - sample->z;
    if (!sample->moves || sample->top <= FEEL_MM)
        return node;
    list_recent(strip->path, lag, met_at(strip->path, samples, i, lag), sample);
    Reading reading = {.least_mm = INFINITY, .most_mm = -INFINITY};
    reading.arcs.count = 0;
    add_bands(strip, sample, &reading);
    if (reading.arcs.count == 0)
        return node;
    node.chip = reading.chip;
    node.edge = reading.edge;
    node.a_p_mm = reading.a_p_mm;
    node.a_e_mm = reading.most_mm - reading.least_mm;
    write_union(&reading.arcs, node.phi_rad, MOST_WRITTEN);
    node.arc_count = reading.arcs.count;
    return node;
}

static double between(double a, double b, double share) { return a + share * (b - a); }

/* Return scale·chip + edge of the loads between two nodes. */
static Load load_between(const Node *a, const Node *b, double share, double scale) {
    const double *chip_a = &a->chip.feed, *chip_b = &b->chip.feed, *edge_a = &a->edge.feed, *edge_b = &b->edge.feed;
    Load load;
    double *sum = &load.feed;
    for (int q = 0; q < LOADS; q++)
        sum[q] = scale * between(chip_a[q], chip_b[q], share) + between(edge_a[q], edge_b[q], share);
    return load;
}

/* Write the row of a sample that lies a share of the way from one node to another. */
static void write_row(const Strip *strip, const Samples *samples, const Sample *sample, int64_t i, const Node *a,
                      const Node *b, double share, const Result *result) {
    const double f_z_mm = AT(samples->f_z_mm, i);
    if (a->arc_count == 0)
        return;
    for (int64_t k = 0; k < 2 * a->arc_count; k++)
        CELL(result->phi_rad, i, k) = between(a->phi_rad[k], b->phi_rad[k], share);
    AT(result->a_p_mm, i) = between(a->a_p_mm, b->a_p_mm, share);
    AT(result->a_e_mm, i) = between(a->a_e_mm, b->a_e_mm, share);
    if (!(f_z_mm > 0.0))
        return; /* what does not advance does not cut */
    const Load load = load_between(a, b, share, feed_scale(strip->law, f_z_mm));
    const double per_turn = AT(strip->cutters->teeth, sample->tool) / TURN, fx = sample->fx, fy = sample->fy;
    double *force_N = &CELL(result->force_N, i, 0), *moment_Nmm = &CELL(result->moment_Nmm, i, 0);
    force_N[0] = per_turn * (load.feed * fx - load.normal * fy);
    force_N[1] = per_turn * (load.feed * fy + load.normal * fx);
    force_N[2] = -per_turn * load.axial;
    moment_Nmm[0] = per_turn * (load.about_feed * fx - load.about_normal * fy);
    moment_Nmm[1] = per_turn * (load.about_feed * fy + load.about_normal * fx);
    moment_Nmm[2] = per_turn * load.torque;
    AT(result->torque_Nmm, i) = per_turn * load.torque;
}

/* Tell whether samples between two nodes may be taken from them: both in the air, or the same arcs and nearly the
   same force. */
static bool is_alike(const Strip *strip, const Node *a, const Node *b, double f_z_mm) {
    if (a->arc_count != b->arc_count)
        return false;
    for (int64_t k = 0; k < 2 * a->arc_count; k++)
        if (fabs(a->phi_rad[k] - b->phi_rad[k]) > ALIKE_RAD)
            return false;
    const double scale = feed_scale(strip->law, greater(f_z_mm, 0.0));
    const Load at_a = load_between(a, a, 0.0, scale), at_b = load_between(b, b, 0.0, scale);
    const double apart = squared(at_a.feed - at_b.feed) + squared(at_a.normal - at_b.normal) +
                         squared(at_a.axial - at_b.axial);
    const double size = squared(at_b.feed) + squared(at_b.normal) + squared(at_b.axial);
    return apart <= squared(ALIKE_SHARE) * size;
}

/* A range of coordinates along an axis. */
typedef struct {
    int64_t axis;
    double low, high;
} Range;

static bool is_in(Range range, const double *position) {
    return range.low <= position[range.axis] && position[range.axis] < range.high;
}

/* Remove a sweep where it comes near the strip; note what a rapid cuts off. */
static void apply(const Strip *strip, int64_t k, Range near, double *rapid_mm) {
    const Path *path = strip->path;
    if (AT(path->first, k))
        return;
    const double a = CELL(path->position_mm, k - 1, near.axis), b = CELL(path->position_mm, k, near.axis);
    if (greater(a, b) < near.low || lesser(a, b) > near.high)
        return;
    const double cut_mm = remove_sweep(strip->grid, path, k);
    draw_walls(strip->grid, path, k);
    if (AT(path->rapid, k))
        *rapid_mm = cut_mm;
}

/* How far a strip has come: the last point that was passed, the last whose sweep the field shows, whether the motion
   goes on behind samples that were given before, and whether the reading at the last of them is known. */
typedef struct {
    int64_t passed, lag, goes_on, is_known;
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

/* Return the share of the way from one sample to another at which a third lies. */
static double share_of_way(const Samples *samples, int64_t begin, int64_t i, int64_t end) {
    const double from_mm = AT(samples->way_mm, begin), length_mm = AT(samples->way_mm, end) - from_mm;
    return length_mm > 0.0 ? (AT(samples->way_mm, i) - from_mm) / length_mm : 0.0;
}

/* Read the samples after one node up to the next, `end`; those between the two are read only where the two are not
   alike. Rows are written for samples in the strip. Returns the reading at `end`. */
static Node read_stretch(const Strip *strip, const Samples *samples, int64_t begin, int64_t end, const Node *before,
                         int64_t lag, Range own, const Result *result) {
    const bool is_own = is_in(own, &CELL(samples->position_mm, end, 0));
    Sample last = sample_at(strip, samples, end, is_own ? result : NULL);
    const Node after = read_node(strip, samples, end, lag, &last);
    const bool is_between = before != NULL && is_alike(strip, before, &after, AT(samples->f_z_mm, end));
    for (int64_t i = begin + 1; i < end; i++) {
        if (!is_in(own, &CELL(samples->position_mm, i, 0)))
            continue;
        Sample sample = sample_at(strip, samples, i, result);
        if (is_between) {
            write_row(strip, samples, &sample, i, before, &after, share_of_way(samples, begin, i, end), result);
        } else {
            const Node here = read_node(strip, samples, i, lag, &sample);
            write_row(strip, samples, &sample, i, &here, &here, 0.0, result);
            AT(result->is_read, i) = 1;
        }
    }
    if (is_own) {
        write_row(strip, samples, &last, end, &after, &after, 0.0, result);
        AT(result->is_read, end) = 1;
    }
    return after;
}

_Static_assert(sizeof(Node) == RD_NODE_NUMBERS * sizeof(double), "a node has that many numbers");

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
    Node *node = (Node *)&AT(node_so_far, 0);
    const Cutting cutting = {progress, {axis, low - reach_mm, high + reach_mm}, progress->lag + 1, rapid_mm};
    int64_t tool = -1;
    for (int64_t begin = progress->goes_on - 1, end; begin + 1 < samples->way_mm.rows; begin = end) {
        bool is_near = false;
        end = begin;
        do {
            end++;
            is_near |= is_in(read, &CELL(samples->position_mm, end, 0));
        } while (!AT(samples->node, end));
        if (!is_near) {
            progress->is_known = 0;
            continue;
        }
        follow(&strip, samples, begin + 1, &cutting);
        if (AT(samples->tool, end) != tool) {
            tool = AT(samples->tool, end);
            fill_turn(work, AT(cutters->wall_bins, tool), AT(cutters->ring_bins, tool));
        }
        *node = read_stretch(&strip, samples, begin, end, progress->is_known ? node : NULL, progress->lag, own, result);
        progress->is_known = 1;
    }
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
