/* The force along the cutter's edge at one sample, from the material in front of it. */

#include "cutting/edge.h"

#include "cutting/rings.h"

#define COARSE_JUMP 0.25 /* change of a band's engaged fraction at which an arc is split */
#define THIN 1e-6 /* chip over feed per tooth below which there is none */
#define QUARTER (0.25 * TURN)

enum { NOT_TURNED = -1, LANES = 8 };

void fill_turn(const Work *work, int64_t rim_bins, int64_t ring_bins) {
    const Floats32 turn = work->turn;
    const int64_t bins_of[2] = {rim_bins, ring_bins};
    for (int which = 0; which < 2; which++)
        for (int64_t j = 0; j < bins_of[which]; j++) {
            const double phi = bin_angle((double)j + 0.5, bins_of[which]);
            CELL(turn, 2 * which, j) = (float)sin(phi);
            CELL(turn, 2 * which + 1, j) = (float)cos(phi);
        }
    const double half = 0.5 * TURN / (double)ring_bins, wobble = 0.5 * sin(2.0 * half);
    for (int64_t j = 0; j < ring_bins; j++) {
        const double phi = bin_angle((double)j + 0.5, ring_bins), sine = sin(phi), cosine = cos(phi);
        CELL(turn, BIN_ONE, j) = (float)(2.0 * half);
        CELL(turn, BIN_SIN, j) = (float)(2.0 * sine * sin(half));
        CELL(turn, BIN_COS, j) = (float)(2.0 * cosine * sin(half));
        CELL(turn, BIN_SIN_SIN, j) = (float)(half - (cosine * cosine - sine * sine) * wobble);
        CELL(turn, BIN_SIN_COS, j) = (float)(2.0 * sine * cosine * wobble);
    }
}

/* Turn the table of directions into the heading of the sample; return which it is. */
static int turn_to(const Work *work, const Sample *sample, int which, int64_t bins, int turned) {
    if (turned == which)
        return turned;
    const float *restrict sine = &CELL(work->turn, which, 0);
    const float *restrict cosine = &CELL(work->turn, which + 1, 0);
    float *restrict east = &CELL(work->heading, 0, 0), *restrict north = &CELL(work->heading, 1, 0);
    const float fx = (float)sample->fx, fy = (float)sample->fy;
    for (int64_t j = 0; j < bins; j++) {
        east[j] = sine[j] * fx - cosine[j] * fy;
        north[j] = sine[j] * fy + cosine[j] * fx;
    }
    return which;
}

/* Return the angle at which the chip of a band begins; it ends at 180° minus that. 90° = no chip. */
static double first_angle(const Band *band, const Chip *chip) {
    const double swing = band->sin_kappa * chip->cos_gamma, offset = band->cos_kappa * chip->sin_gamma;
    if (swing <= THIN)
        return offset > THIN ? -QUARTER : QUARTER;
    if (offset == 0.0)
        return 0.0;
    return -asin(lesser(greater(offset / swing, -1.0), 1.0));
}

/* Return the bins whose middle has a chip. */
static Bins bins_from(double start, int64_t bins) {
    const double place = (start + 0.25 * TURN) / TURN * (double)bins;
    const int64_t first = most((int64_t)ceil(place - 0.5 - 1e-9), 0);
    return (Bins){first, bins - first};
}

/* Write the material's top and its thickness above the cutter on a ring. */
static void read_ring(const Strip *strip, const Sample *sample, double r, Bins bins, float *tops, float *above) {
    const Ring ring = {.r = r,
                       .height = outline_height(r, sample->outline),
                       .first = bins.first,
                       .after = bins.after,
                       .east = &CELL(strip->work->heading, 0, 0),
                       .north = &CELL(strip->work->heading, 1, 0),
                       .tops = tops,
                       .above = above};
    read_cells(strip->grid, strip->path, sample, &ring);
    take_off_recent(sample, &ring);
}

/* Write the fraction of a band that is engaged: between its rings the thickness changes linearly. */
static void write_share(double bottom, const Band *band, Bins bins, const float *restrict lower,
                        const float *restrict upper, float *restrict share) {
    const double height = band->high - band->low, missing = greater(bottom - band->low, 0.0);
    const double above_bottom = height > 0.0 ? greater(1.0 - missing / height, 0.0) : 0.0;
    const float sound = (float)(missing == 0.0 ? 1.0 : above_bottom), feel = (float)FEEL_MM;
    for (int64_t j = bins.first; j < bins.after; j++) {
        const float low = lower[j], high = upper[j];
        const bool low_in = low > feel, high_in = high > feel;
        const float thickest = low > high ? low : high, gap = fabsf(low - high);
        float part = thickest / (gap > thickest ? gap : thickest);
        part = low_in | high_in ? part : 0.0f;
        share[j] = sound * (low_in & high_in ? 1.0f : part);
    }
}

/* Leave out bins at both ends that are not engaged. */
static Bins engaged(Bins bins, const float *share) {
    while (bins.first < bins.after && share[bins.first] == 0.0f)
        bins.first++;
    while (bins.first < bins.after && share[bins.after - 1] == 0.0f)
        bins.after--;
    return bins;
}

/* Note the radius of a band, and the height of the material above the tip, where the band is engaged. */
static void extend(float radius, Bins bins, const float *restrict share, const float *restrict lower_top,
                   const float *restrict upper, const float *restrict upper_top, float *restrict reach,
                   float *restrict depth) {
    const float feel = (float)FEEL_MM;
    for (int64_t j = bins.first; j < bins.after; j++) {
        const float here = share[j] > 0.0f ? radius : 0.0f;
        float top = upper[j] > feel ? upper_top[j] : lower_top[j];
        top = share[j] > 0.0f ? top : 0.0f;
        reach[j] = reach[j] > here ? reach[j] : here;
        depth[j] = depth[j] > top ? depth[j] : top;
    }
}

/* Return the sum of products over bins, LANES of them side by side. */
static float summed(Bins bins, const float *restrict share, const float *restrict weight) {
    float sums[LANES] = {0.0f}, sum = 0.0f;
    int64_t j = bins.first;
    for (; j + LANES <= bins.after; j += LANES)
        for (int lane = 0; lane < LANES; lane++)
            sums[lane] += share[j + lane] * weight[j + lane];
    for (; j < bins.after; j++)
        sums[0] += share[j] * weight[j];
    for (int lane = 0; lane < LANES; lane++)
        sum += sums[lane];
    return sum;
}

/* Return the force of a band from the integrals over its bins: linear edge forces. */
static Parts integrated(const Strip *strip, const Sample *sample, const Band *band, Bins bins, const float *share) {
    const Floats32 turn = strip->work->turn;
    Integrals arc = {.one = summed(bins, share, &CELL(turn, BIN_ONE, 0)),
                     .sin = summed(bins, share, &CELL(turn, BIN_SIN, 0)),
                     .cos = summed(bins, share, &CELL(turn, BIN_COS, 0)),
                     .sin_sin = summed(bins, share, &CELL(turn, BIN_SIN_SIN, 0)),
                     .sin_cos = summed(bins, share, &CELL(turn, BIN_SIN_COS, 0))};
    Parts parts = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    const Chip chip = sample->chip;
    if (arc.one > 0.0 && chip.f_z_mm > 0.0) {
        const Facet facet = {.sin_kappa = band->sin_kappa,
                             .cos_kappa = band->cos_kappa,
                             .swing_mm = chip.f_z_mm * band->sin_kappa * chip.cos_gamma,
                             .offset_mm = chip.f_z_mm * band->cos_kappa * chip.sin_gamma};
        add_linear_edge(&arc, &facet, strip->law, &parts);
    }
    return parts;
}

static void add_share(Force *force, const Force *one, double share) {
    force->feed += share * one->feed;
    force->normal += share * one->normal;
    force->axial += share * one->axial;
    force->tangential += share * one->tangential;
}

/* Return the force of a band arc by arc: any law. */
static Parts by_arcs(const Strip *strip, const Sample *sample, const Band *band, Bins bins, int64_t all,
                     const float *share) {
    const Facet facet = facet_of(band->sin_kappa, band->cos_kappa, &sample->chip);
    Parts parts = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    for (int64_t at = bins.first, end; at < bins.after; at = most(end, at + 1)) {
        double added = 0.0;
        for (end = at; end < bins.after && share[end] > 0.0f && fabsf(share[end] - share[at]) < (float)COARSE_JUMP;
             end++)
            added += share[end];
        if (end == at)
            continue;
        Parts one = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
        add_arc_force(bin_angle((double)at, all), bin_angle((double)end, all), &facet, strip->law, &one);
        const double mean = added / (double)(end - at);
        add_share(&parts.chip, &one.chip, mean);
        add_share(&parts.edge, &one.edge, mean);
    }
    return parts;
}

/* List the arcs over which any band between rings is engaged, and their extent normal to the feed. */
static void list_arcs(const Work *work, Bins bins, int64_t all, double below, Reading *reading) {
    const float *reach = &CELL(work->reach, 0, 0), *depth = &CELL(work->reach, 1, 0);
    const float *cosine = &CELL(work->turn, RING_COS, 0);
    double most_mm = reading->most_mm, least_mm = reading->least_mm, top = reading->a_p_mm + below;
    int64_t open_at = -1;
    for (int64_t j = bins.first; j <= bins.after; j++) {
        if (j < bins.after && reach[j] > 0.0f) {
            const double side = (double)reach[j] * (double)cosine[j];
            most_mm = side > most_mm ? side : most_mm;
            least_mm = side < least_mm ? side : least_mm;
            top = depth[j] > top ? depth[j] : top;
            open_at = open_at < 0 ? j : open_at;
        } else if (open_at >= 0) {
            put_arc(&reading->arcs, bin_angle((double)open_at, all), bin_angle((double)j, all));
            open_at = -1;
        }
    }
    reading->most_mm = most_mm;
    reading->least_mm = least_mm;
    reading->a_p_mm = top - below;
}

/* Add the force of a band between two rings that are read. */
static void add_band(const Strip *strip, const Sample *sample, const Band *band, Bins bins, int64_t all,
                     float *const rows[5], Reading *reading) {
    const Work *work = strip->work;
    const bool is_linear = strip->law[0] == LAW_LINEAR_EDGE;
    write_share(sample->bottom, band, bins, rows[LOWER], rows[UPPER], rows[SHARE]);
    bins = engaged(bins, rows[SHARE]);
    if (bins.first == bins.after)
        return;
    extend((float)band->r_high, bins, rows[SHARE], rows[LOWER_TOP], rows[UPPER], rows[UPPER_TOP],
           &CELL(work->reach, 0, 0), &CELL(work->reach, 1, 0));
    const Parts parts = is_linear ? integrated(strip, sample, band, bins, rows[SHARE])
                                 : by_arcs(strip, sample, band, bins, all, rows[SHARE]);
    const double lever = 0.5 * (band->low + greater(sample->bottom - band->low, 0.0) + band->high);
    add_force(reading, &parts, band->width, 0.5 * (band->r_low + band->r_high), lever);
}

/* Read a ring that becomes a band's upper one; what was the upper one becomes the lower. */
static void next_ring(const Strip *strip, const Sample *sample, double r, Bins bins, float *rows[5]) {
    float *above = rows[LOWER], *tops = rows[LOWER_TOP];
    rows[LOWER] = rows[UPPER];
    rows[LOWER_TOP] = rows[UPPER_TOP];
    rows[UPPER] = above;
    rows[UPPER_TOP] = tops;
    read_ring(strip, sample, r, bins, tops, above);
}

void add_bands(const Strip *strip, const Sample *sample, Reading *reading) {
    const Cutters *cutters = strip->cutters;
    const Work *work = strip->work;
    const int64_t all = AT(cutters->ring_bins, sample->tool), last = AT(cutters->used, sample->tool) - 1;
    const Band *bands = (const Band *)&CELL(cutters->bands, sample->tool, 0);
    float *rows[5];
    for (int row = 0; row < 5; row++)
        rows[row] = &CELL(work->rows, row, 0);
    for (int64_t j = 0; j < all; j++)
        CELL(work->reach, 0, j) = CELL(work->reach, 1, j) = 0.0f;
    Bins widest = {all, 0};
    double known = -1.0;
    int turned = NOT_TURNED;
    double next = first_angle(&bands[0], &sample->chip);
    for (int64_t b = 0; b <= last && bands[b].low < sample->top; b++) {
        const Band *band = &bands[b];
        const double start = next;
        next = first_angle(&bands[least(b + 1, last)], &sample->chip);
        if (start >= QUARTER)
            continue;
        if (band->cos_kappa == 0.0) {
            turned = turn_to(work, sample, RIM_SIN, AT(cutters->wall_bins, sample->tool), turned);
            add_rim(strip, sample, band, reading);
            continue;
        }
        turned = turn_to(work, sample, RING_SIN, all, turned);
        const Bins read = bins_from(lesser(start, next), all);
        if (known != band->r_low)
            next_ring(strip, sample, band->r_low, read, rows);
        next_ring(strip, sample, band->r_high, read, rows);
        known = band->r_high;
        widest = read.first < widest.first ? read : widest;
        add_band(strip, sample, band, bins_from(start, all), all, rows, reading);
    }
    list_arcs(work, widest, all, greater(sample->bottom, 0.0), reading);
}
