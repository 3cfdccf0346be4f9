/* The engagement at one sample: read, compared with others, written.

A node is read at its own position, before its sweep is removed. The field lags a little behind the cutter
(Cutters.lag_mm): cells near the rim of the last sweeps would be read as cut or as uncut by chance. The sweeps that the
field does not show yet are evaluated exactly at each point that is read. On a straight path there are none: no point
in front of a convex cutter was inside it before. */

#include "cutting/node.h"

#include "cutting/collisions.h"
#include "cutting/removal.h"
#include "cutting/walls.h"

#define STRAIGHT 0.03 /* sine of the angle in plan below which a path counts as straight */
#define SMALL 0.15     /* share of the whole force below which a part of it need not be known to a share of itself */
#define LEVEL 0.15    /* the same up or down, where it only moves the angle at which the chip begins */
/* By how much a node may differ from what lies between two others, at the ends of arcs and as a share of the force; by
   how much the force may change between those. */
typedef struct {
    double arc_rad, share, change;
} Tolerance;

/* A ball's arcs are known to a bin of each of its rings, but its force has no jumps. */
static const Tolerance ON_BALL = {0.3, 0.05, 0.15}, ON_OTHER = {0.3, 0.1, 0.15};

enum { LOADS = sizeof(Load) / sizeof(double) };

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

Sample sample_at(const Reader *reader, int64_t i, bool is_own) {
    const Strip *strip = reader->strip;
    const Samples *samples = reader->samples;
    const Result *result = reader->result;
    const Grid *grid = strip->grid;
    const double *position = &CELL(samples->position_mm, i, 0);
    Sample sample = {.x = position[0], .y = position[1], .z = position[2], .tool = AT(samples->tool, i)};
    sample.chip.f_z_mm = 1.0; /* what is read holds for any feed, see feed_scale */
    sample.outline = outline_of(strip->path, sample.tool);
    sample.bottom = grid->bottom_mm - sample.z;
    set_heading(&sample, &CELL(samples->direction, i, 0));
    if (leaves_disc(strip->path, reader->lag, AT(strip->cutters->lag_mm, sample.tool)))
        sample.disc = place_of(strip->path, reader->lag);
    sample.moves = sample.chip.sin_gamma != 0.0 || sample.chip.cos_gamma != 0.0;
    if (!is_own)
        return sample;
    collide(strip, &sample, &CELL(result->overlap_mm, i, 0));
    if (sample.moves)
        AT(result->ramp_rad, i) = atan2(sample.chip.sin_gamma, sample.chip.cos_gamma);
    if (sample.chip.sin_gamma > 0.0) {
        const double centre = top_at(grid, strip->path, &sample, sample.x, sample.y);
        const double below = centre - greater(sample.z, grid->bottom_mm);
        AT(result->centre_mm, i) = below > FEEL_MM ? below : 0.0;
    }
    return sample;
}

Node read_node(const Reader *reader, int64_t i, Sample *sample) {
    const Strip *strip = reader->strip;
    const int64_t met = met_at(strip->path, reader->samples, i, reader->lag);
    Node node = {.arc_count = 0};
    sample->top = highest_around(strip->grid, sample->x, sample->y, sample->outline->radius) - sample->z;
    if (!sample->moves || sample->top <= FEEL_MM)
        return node;
    list_recent(strip->path, reader->lag, met, sample);
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

void write_row(const Reader *reader, const Sample *sample, int64_t i, const Node *a, const Node *b, double share) {
    const Strip *strip = reader->strip;
    const Result *result = reader->result;
    const double f_z_mm = AT(reader->samples->f_z_mm, i);
    if (a->arc_count == 0)
        return;
    const Node *nearest = share > 0.5 ? b : a;
    for (int64_t k = 0; k < 2 * nearest->arc_count; k++)
        CELL(result->phi_rad, i, k) = a->arc_count == b->arc_count ? between(a->phi_rad[k], b->phi_rad[k], share)
                                                                   : nearest->phi_rad[k];
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

/* Tell whether two loads differ by no more than a share of a third one: the force across the axis by none of that, unless it
   is small beside the force along it. */
static bool are_near(const Load *a, const Load *b, const Load *size, double share) {
    const double across = squared(size->feed) + squared(size->normal), whole = across + squared(size->axial);
    const double apart = squared(a->feed - b->feed) + squared(a->normal - b->normal), most = squared(share);
    return apart <= most * greater(across, squared(SMALL) * whole) &&
           apart + squared(a->axial - b->axial) <= most * whole;
}

/* Return where the contact of a node begins or ends. */
static double end_of(const Node *node, bool last) { return node->phi_rad[last ? 2 * node->arc_count - 1 : 0]; }

/* Tell whether three nodes are in contact, one from about between the ends of two others, or none is. */
static bool has_ends_between(const Node *node, const Node *a, const Node *b, double share, double most_rad) {
    const bool is_in_air = node->arc_count == 0;
    if (is_in_air != (a->arc_count == 0) || is_in_air != (b->arc_count == 0))
        return false;
    for (int last = 0; last < 2 && !is_in_air; last++)
        if (fabs(between(end_of(a, last), end_of(b, last), share) - end_of(node, last)) > most_rad)
            return false;
    return true;
}

bool lies_between(const Reader *reader, int64_t i, const Node *node, const Node *a, const Node *b, double share) {
    const Samples *samples = reader->samples;
    const double *law = reader->strip->law;
    const Tolerance *most = outline_of(reader->strip->path, AT(samples->tool, i))->kind == SW_BALL ? &ON_BALL : &ON_OTHER;
    if (!has_ends_between(node, a, b, share, most->arc_rad) || !has_ends_between(b, a, a, 0.0, most->arc_rad))
        return false;
    const double scale = feed_scale(law, greater(AT(samples->f_z_mm, i), 0.0));
    const Load at_a = load_between(a, a, 0.0, scale), at_b = load_between(b, b, 0.0, scale);
    const Load mean = load_between(a, b, share, scale), here = load_between(node, node, 0.0, scale);
    return are_near(&mean, &here, &here, most->share) && are_near(&at_a, &at_b, &here, most->change);
}
