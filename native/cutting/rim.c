/* The force on an upright band of the edge, read along its rim. */

#include "cutting/edge.h"
#include "cutting/rings.h"
#include "cutting/walls.h"

#define JUMP 0.1 /* change of depth, relative, at which an arc is split */

enum { HALVINGS = 4 };

static bool jumps(double a, double b) {
    return fabs(a - b) > JUMP * greater(a, b) || (a == 0.0) != (b == 0.0);
}

static double between(float a, float b, double share) { return (double)a + share * ((double)b - (double)a); }

static double depth_above(double height, double foot) {
    return height - foot > FEEL_MM ? height - foot : 0.0;
}

/* Return the angle between bins j - 1 and j at which the depth above a foot jumps. */
static double edge_between(const Strip *strip, const Sample *sample, const Ring *rim, int64_t j, int64_t bins,
                           double foot) {
    const double before = (double)rim->tops[j - 1], behind = (double)rim->tops[j];
    double low = 0.0, high = 1.0;
    for (int halving = 0; halving < HALVINGS; halving++) {
        const double middle = 0.5 * (low + high);
        const double x = sample->x + rim->r * between(rim->east[j - 1], rim->east[j], middle);
        const double y = sample->y + rim->r * between(rim->north[j - 1], rim->north[j], middle);
        double height = top_at(strip->grid, strip->path, sample, x, y);
        for (int past = 0; past < sample->recent_count; past++)
            height = lesser(height, sweep_height(&sample->recent[past], sample->outline, x, y, 0.0));
        const double depth = depth_above(height - sample->z, foot);
        if (fabs(depth - before) < fabs(depth - behind))
            low = middle;
        else
            high = middle;
    }
    return bin_angle((double)j - 0.5 + 0.5 * (low + high), bins);
}

/* Turn the tops along the rim into depths above a foot; return whether there is any. */
static bool to_depths(const Ring *rim, double foot) {
    bool is_engaged = false;
    for (int64_t j = rim->first; j < rim->after; j++) {
        const double depth = depth_above((double)rim->tops[j], foot);
        is_engaged |= depth > 0.0;
        rim->tops[j] = (float)depth;
    }
    return is_engaged;
}

/* Read the material's top along the rim. */
static void read_tops(const Strip *strip, const Sample *sample, const Ring *rim) {
    read_cells(strip->grid, strip->path, sample, rim);
    take_off_recent(sample, rim);
}

/* Add the force over an arc of one depth above the band's foot. */
static void add_arc(const Strip *strip, const Sample *sample, const Band *band, double a, double b,
                    double deep, double foot, Reading *reading) {
    const double width = lesser(deep, band->high - foot);
    Parts parts = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    const Facet facet = facet_of(band->sin_kappa, band->cos_kappa, &sample->chip);
    add_arc_force(a, b, &facet, strip->law, &parts);
    add_force(reading, &parts, width, band->r_high, foot + 0.5 * width);
    reading->a_p_mm = greater(reading->a_p_mm, deep + foot - greater(sample->bottom, 0.0));
    reading->most_mm = greater(reading->most_mm, band->r_high * cos(a));
    reading->least_mm = lesser(reading->least_mm, band->r_high * cos(b));
    put_arc(&reading->arcs, a, b);
}

void add_rim(const Strip *strip, const Sample *sample, const Band *band, Reading *reading) {
    const int64_t bins = AT(strip->cutters->wall_bins, sample->tool);
    float *depths = &CELL(strip->work->rows, SHARE, 0);
    const Ring rim = {.r = band->r_high,
                      .height = 0.0,
                      .first = bins / 4,
                      .after = bins - bins / 4,
                      .east = &CELL(strip->work->heading, 0, 0),
                      .north = &CELL(strip->work->heading, 1, 0),
                      .tops = depths,
                      .above = depths};
    const double foot = greater(band->low, greater(sample->bottom, 0.0));
    read_tops(strip, sample, &rim);
    if (!to_depths(&rim, foot))
        return;
    double a = 0.0;
    for (int64_t at = rim.first, end; at < rim.after; at = end) {
        double added = 0.0;
        for (end = at; end < rim.after && !jumps(depths[at], depths[end]); end++)
            added += depths[end];
        const double b =
            end < rim.after ? edge_between(strip, sample, &rim, end, bins, foot) : 0.5 * TURN;
        if (depths[at] > 0.0f && b > a)
            add_arc(strip, sample, band, a, b, added / (double)(end - at), foot, reading);
        a = b;
    }
}
