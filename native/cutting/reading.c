/* Cut a motion out of a grid and read every sample.

The engagement of a sample is read at its own position, before its sweep is removed. The field lags a little
behind the cutter (Cutters.lag_mm): cells near the rim of the last sweeps would be read as cut or as uncut by
chance. The sweeps that the field does not show yet are evaluated exactly at each point that is read. On a
straight path there are none: no point in front of a convex cutter was inside it before. */

#include "cutting/edge.h"
#include "cutting/removal.h"
#include "cutting/walls.h"

#define STRAIGHT 0.03 /* sine of the angle in plan below which a path counts as straight */
#define LEVEL 0.15    /* the same up or down, where it only moves the angle at which the chip begins */

/* A row of Cutters.above: what stands above the edge, and the height of its lower end; radius 0 = not
   checked. */
typedef struct {
    double radius, level;
} Above;

enum { SHANK, HOLDER, ABOVE_COUNT };

/* The motion: feed per tooth and way along the path of each sample. */
typedef struct {
    Floats f_z_mm, way_mm;
} Motion;

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

   What an edge meets is what the tooth before has left. A step of the sampling or of the path's shape in its
   place would make the force depend on how densely points lie. */
static int64_t met_at(const Motion *motion, int64_t i, int64_t lag) {
    int64_t met = i - 1;
    while (met > lag && AT(motion->way_mm, met) > AT(motion->way_mm, i) - AT(motion->f_z_mm, i))
        met--;
    return met;
}

/* List the sweeps up to point `met` that the field does not show yet and that were not on a straight path to
   sample i. */
static void list_recent(const Path *path, int64_t i, int64_t lag, int64_t met, Sample *sample) {
    const int64_t stride = most((met - lag + MOST_RECENT - 1) / MOST_RECENT, 1);
    const double dx = sample->fx * sample->chip.cos_gamma, dy = sample->fy * sample->chip.cos_gamma;
    const double dz = -sample->chip.sin_gamma;
    const double *here = place_of(path, i);
    sample->recent_count = 0;
    for (int64_t start = lag; start < met; start += stride) {
        const double *there = place_of(path, start);
        const double ax = here[0] - there[0], ay = here[1] - there[1], az = here[2] - there[2];
        const double back = ax * dx + ay * dy + az * dz, aside = ax * dy - ay * dx;
        const double off = ax * ax + ay * ay + az * az - back * back;
        if (back < 0.0 || off > squared(LEVEL * back) + 1e-12 || fabs(aside) > STRAIGHT * back)
            sample->recent[sample->recent_count++] =
                way_between(there, place_of(path, least(start + stride, met)));
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

/* Write the row of sample i. */
static void write_row(Reading *reading, const Sample *sample, double teeth, int64_t i, const Result *result) {
    const double scale = teeth / TURN, fx = sample->fx, fy = sample->fy;
    const double feed = scale * reading->force.feed, normal = scale * reading->force.normal;
    const double about_feed = scale * reading->about_feed, about_normal = scale * reading->about_normal;
    double *force_N = &CELL(result->force_N, i, 0), *moment_Nmm = &CELL(result->moment_Nmm, i, 0);
    force_N[0] = feed * fx - normal * fy;
    force_N[1] = feed * fy + normal * fx;
    force_N[2] = -scale * reading->force.axial;
    moment_Nmm[0] = about_feed * fx - about_normal * fy;
    moment_Nmm[1] = about_feed * fy + about_normal * fx;
    moment_Nmm[2] = scale * reading->torque;
    AT(result->torque_Nmm, i) = scale * reading->torque;
    AT(result->a_p_mm, i) = reading->a_p_mm;
    AT(result->a_e_mm, i) = reading->most_mm - reading->least_mm;
    write_union(&reading->arcs, &CELL(result->phi_rad, i, 0), result->phi_rad.columns / 2);
}

/* Read the engagement at sample i and write its row. */
static void read_sample(const Strip *strip, const Motion *motion, int64_t i, int64_t lag,
                        const Result *result) {
    const Grid *grid = strip->grid;
    const double *position = place_of(strip->path, i);
    Sample sample = {.x = position[0], .y = position[1], .z = position[2], .tool = AT(strip->path->tool, i)};
    sample.outline = outline_of(strip->path, sample.tool);
    sample.bottom = grid->bottom_mm - sample.z;
    sample.chip.f_z_mm = AT(motion->f_z_mm, i);
    collide(strip, &sample, &CELL(result->overlap_mm, i, 0));
    set_heading(&sample, &CELL(strip->path->direction, i, 0));
    const double sink = sample.chip.sin_gamma;
    if (sink == 0.0 && sample.chip.cos_gamma == 0.0)
        return;
    AT(result->ramp_rad, i) = atan2(sink, sample.chip.cos_gamma);
    sample.top = highest_around(grid, sample.x, sample.y, sample.outline->radius) - sample.z;
    if (sample.top <= FEEL_MM)
        return;
    if (sink > 0.0) {
        const double centre = height_at(grid, strip->path, sample.x, sample.y);
        const double below = centre - greater(sample.z, grid->bottom_mm);
        AT(result->centre_mm, i) = below > FEEL_MM ? below : 0.0;
    }
    list_recent(strip->path, i, lag, met_at(motion, i, lag), &sample);
    Reading reading;
    reading.force = (Force){0.0, 0.0, 0.0, 0.0};
    reading.about_feed = reading.about_normal = reading.torque = reading.a_p_mm = 0.0;
    reading.least_mm = INFINITY;
    reading.most_mm = -INFINITY;
    reading.arcs.count = 0;
    add_bands(strip, &sample, &reading);
    if (reading.arcs.count > 0)
        write_row(&reading, &sample, AT(strip->cutters->teeth, sample.tool), i, result);
}

/* A range of coordinates along an axis. */
typedef struct {
    int64_t axis;
    double low, high;
} Range;

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

/* Cut all samples one after the other; read those whose coordinate along `axis` lies in [low, high).

   Sweeps farther than `reach_mm` from there are left out: the field outside is another strip's. The reading
   of a sample depends only on the samples before it, not on how the field is divided. rapid_mm (n) gets the
   height that rapids cut off. */
EXPORT void cutting_cut_strip(const Grid *grid, const Path *path, const Cutters *cutters, Floats law,
                              Floats f_z_mm, Floats way_mm, double low, double high, int64_t axis,
                              double reach_mm, const Work *work, Floats rapid_mm, const Result *result) {
    const Strip strip = {grid, path, cutters, work, law.at};
    const Motion motion = {f_z_mm, way_mm};
    const Range near = {axis, low - reach_mm, high + reach_mm};
    const int64_t n = way_mm.rows;
    int64_t done = 0, lag = 0, tool = -1;
    for (int64_t i = 0; i <= n; i++) {
        if (i < n) {
            if (AT(path->first, i))
                lag = i;
            const double along = CELL(path->position_mm, i, axis);
            if (!(AT(path->read, i) && low <= along && along < high))
                continue;
            const double limit = AT(way_mm, i) - AT(cutters->lag_mm, AT(path->tool, i));
            while (lag + 1 < i && AT(way_mm, lag + 1) <= limit)
                lag++;
        } else {
            lag = n - 1;
        }
        for (int64_t k = done + 1; k <= lag; k++)
            apply(&strip, k, near, rapid_mm);
        done = most(done, lag);
        if (i == n)
            return;
        if (AT(path->tool, i) != tool) {
            tool = AT(path->tool, i);
            fill_turn(work, AT(cutters->wall_bins, tool), AT(cutters->ring_bins, tool));
        }
        read_sample(&strip, &motion, i, lag, result);
    }
}

/* For tests: the height of a cutter's outline (7) at a radius. */
EXPORT double cutting_outline_height(double r, Floats outline) {
    return outline_height(r, (const Outline *)&AT(outline, 0));
}
