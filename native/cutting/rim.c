/* The force on an upright band of the edge, read along its rim.

Linear edge forces are summed bin by bin; a place where the depth steps is searched within its bin. The force of any other
law is that of arcs of one mean depth. */

#include "cutting/edge.h"
#include "cutting/rings.h"
#include "cutting/walls.h"

#define JUMP 0.1  /* change of depth, relative, at which an arc is split */
#define STEP 0.05 /* the same as a share of the deepest, at which the place is searched */

enum { HALVINGS = 4, LANES = 8 };

/* Sums over bins, weighted: of 1, sine, cosine, sine², sine·cosine. */
enum { ONE, SIN, COS, SIN_SIN, SIN_COS, SUMS };

static bool jumps(double a, double b) {
    return fabs(a - b) > JUMP * greater(a, b) || (a == 0.0) != (b == 0.0);
}

static double between(float a, float b, double share) { return (double)a + share * ((double)b - (double)a); }

static float min_of(float a, float b) { return a < b ? a : b; }

static double depth_above(double height, double foot) {
    return height - foot > FEEL_MM ? height - foot : 0.0;
}

/* Return the share of the way from the middle of bin j - 1 to that of j at which the depth above a foot jumps. */
static double edge_between(const Strip *strip, const Sample *sample, const Ring *rim, int64_t j, double foot) {
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
    return 0.5 * (low + high);
}

/* Turn the tops along the rim into depths above a foot; return the largest. */
static float to_depths(const Ring *rim, float foot) {
    float deepest[LANES] = {0.0f}, *depths = rim->tops, most_deep = 0.0f;
    const float feel = (float)FEEL_MM;
    for (int64_t j = rim->first; j < rim->after; j += LANES)
        for (int lane = 0; lane < LANES; lane++) {
            const float depth = depths[j + lane] - foot;
            depths[j + lane] = depth > feel ? depth : 0.0f;
            deepest[lane] = deepest[lane] > depths[j + lane] ? deepest[lane] : depths[j + lane];
        }
    for (int lane = 0; lane < LANES; lane++)
        most_deep = most_deep > deepest[lane] ? most_deep : deepest[lane];
    return most_deep;
}

/* Read the material's top along the rim. */
static void read_tops(const Strip *strip, const Sample *sample, const Ring *rim) {
    read_cells(strip->grid, strip->path, sample, rim);
    take_off_recent(sample, rim);
}

static void list_arc(Reading *reading, double radius, double a, double b) {
    reading->most_mm = greater(reading->most_mm, radius * cos(a));
    reading->least_mm = lesser(reading->least_mm, radius * cos(b));
    put_arc(&reading->arcs, a, b);
}

/* Add the force over an arc of one depth above the band's foot. */
static void add_arc(const Strip *strip, const Sample *sample, const Band *band, double a, double b,
                    double deep, double foot, Reading *reading) {
    const double width = lesser(deep, band->high - foot);
    Parts parts = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    const Facet facet = facet_of(band->sin_kappa, band->cos_kappa, &sample->chip);
    add_arc_force(a, b, &facet, strip->law, &parts);
    add_force(reading, &parts, width, band->r_high, foot + 0.5 * width);
    list_arc(reading, band->r_high, a, b);
}

/* Add sums over the bins of the rim, weighted by the width of contact and by its square. */
static void sum_bins(const Work *work, const Ring *rim, float widest, double *by_width, double *by_square) {
    const float *sine = &CELL(work->turn, RIM_SIN, 0), *cosine = &CELL(work->turn, RIM_COS, 0);
    float sums[2 * SUMS][LANES] = {{0.0f}};
    for (int64_t j = rim->first; j < rim->after; j += LANES)
        for (int lane = 0; lane < LANES; lane++) {
            const float depth = rim->tops[j + lane], width = depth < widest ? depth : widest, square = width * width;
            const float s = sine[j + lane], c = cosine[j + lane], s_s = s * s, s_c = s * c;
            sums[ONE][lane] += width;
            sums[SIN][lane] += width * s;
            sums[COS][lane] += width * c;
            sums[SIN_SIN][lane] += width * s_s;
            sums[SIN_COS][lane] += width * s_c;
            sums[SUMS + ONE][lane] += square;
            sums[SUMS + SIN][lane] += square * s;
            sums[SUMS + COS][lane] += square * c;
            sums[SUMS + SIN_SIN][lane] += square * s_s;
            sums[SUMS + SIN_COS][lane] += square * s_c;
        }
    for (int k = 0; k < SUMS; k++)
        for (int lane = 0; lane < LANES; lane++) {
            by_width[k] += (double)sums[k][lane];
            by_square[k] += (double)sums[SUMS + k][lane];
        }
}

/* Return the integrals over bins of a half-width, of which the sums of what holds in their middle are known. */
static Integrals integrals_of(const double *sums, double half) {
    const double chord = 2.0 * sin(half), wobble = 0.5 * sin(2.0 * half);
    return (Integrals){.one = 2.0 * half * sums[ONE],
                       .sin = chord * sums[SIN],
                       .cos = chord * sums[COS],
                       .sin_sin = half * sums[ONE] - (sums[ONE] - 2.0 * sums[SIN_SIN]) * wobble,
                       .sin_cos = 2.0 * wobble * sums[SIN_COS]};
}

/* Move the place between bins j - 1 and j, at which the depth steps, by a share of a bin. */
static void move_step(const Work *work, const Ring *rim, int64_t j, double share, float widest, double *by_width,
                      double *by_square) {
    const double before = (double)min_of(rim->tops[j - 1], widest), behind = (double)min_of(rim->tops[j], widest);
    const double s = 0.5 * ((double)CELL(work->turn, RIM_SIN, j - 1) + (double)CELL(work->turn, RIM_SIN, j));
    const double c = 0.5 * ((double)CELL(work->turn, RIM_COS, j - 1) + (double)CELL(work->turn, RIM_COS, j));
    const double by[SUMS] = {1.0, s, c, s * s, s * c};
    for (int k = 0; k < SUMS; k++) {
        by_width[k] += share * (before - behind) * by[k];
        by_square[k] += share * (before * before - behind * behind) * by[k];
    }
}

/* Add the moment of a force that is the sum of width² per mm: half the width above the foot. */
static void add_lever(Load *load, const Force *by_square) {
    load->about_feed -= 0.5 * by_square->normal;
    load->about_normal += 0.5 * by_square->feed;
}

/* Add the linear edge forces of the depths along the rim. */
static void add_linear(const Strip *strip, const Sample *sample, const Band *band, const Ring *rim, float deepest,
                       double foot, Reading *reading) {
    const Work *work = strip->work;
    const int64_t bins = AT(strip->cutters->wall_bins, sample->tool);
    const float *depths = rim->tops, step = (float)STEP * deepest, widest = (float)(band->high - foot);
    double by_width[SUMS] = {0.0}, by_square[SUMS] = {0.0}, begin = depths[rim->first] > 0.0f ? 0.0 : NAN;
    sum_bins(work, rim, widest, by_width, by_square);
    for (int64_t j = rim->first + 1; j < rim->after; j++) {
        if (depths[j - 1] == depths[j])
            continue;
        const bool begins = depths[j - 1] == 0.0f, ends = depths[j] == 0.0f;
        double share = 0.0;
        if (fabsf(depths[j] - depths[j - 1]) > step) {
            share = edge_between(strip, sample, rim, j, foot) - 0.5;
            move_step(work, rim, j, share, widest, by_width, by_square);
        }
        if (ends)
            list_arc(reading, band->r_high, begin, bin_angle((double)j + share, bins));
        begin = begins ? bin_angle((double)j + share, bins) : begin;
    }
    if (depths[rim->after - 1] > 0.0f)
        list_arc(reading, band->r_high, begin, 0.5 * TURN);
    const Facet facet = facet_of(band->sin_kappa, band->cos_kappa, &sample->chip);
    if (facet.engaged == NO_CHIP)
        return;
    const double half = 0.5 * TURN / (double)bins;
    const Integrals widths = integrals_of(by_width, half), squares = integrals_of(by_square, half);
    Parts force = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}}, lever = force;
    add_linear_edge(&widths, &facet, strip->law, &force);
    add_linear_edge(&squares, &facet, strip->law, &lever);
    add_force(reading, &force, 1.0, band->r_high, foot);
    add_lever(&reading->chip, &lever.chip);
    add_lever(&reading->edge, &lever.edge);
}

/* Add the force of arcs of one depth: any law. */
static void add_arcs(const Strip *strip, const Sample *sample, const Band *band, const Ring *rim, double foot,
                     Reading *reading) {
    const int64_t bins = AT(strip->cutters->wall_bins, sample->tool);
    const float *depths = rim->tops;
    double a = 0.0;
    for (int64_t at = rim->first, end; at < rim->after; at = end) {
        double added = 0.0;
        for (end = at; end < rim->after && !jumps(depths[at], depths[end]); end++)
            added += depths[end];
        const double b = end < rim->after
                             ? bin_angle((double)end - 0.5 + edge_between(strip, sample, rim, end, foot), bins)
                             : 0.5 * TURN;
        if (depths[at] > 0.0f && b > a)
            add_arc(strip, sample, band, a, b, added / (double)(end - at), foot, reading);
        a = b;
    }
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
    const float deepest = to_depths(&rim, (float)foot);
    if (deepest == 0.0f)
        return;
    reading->a_p_mm = greater(reading->a_p_mm, (double)deepest + foot - greater(sample->bottom, 0.0));
    if (strip->law[0] == LAW_LINEAR_EDGE)
        add_linear(strip, sample, band, &rim, deepest, foot, reading);
    else
        add_arcs(strip, sample, band, &rim, foot, reading);
}
