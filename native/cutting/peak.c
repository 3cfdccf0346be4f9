/* The largest force within a revolution, on all teeth together, helix included. */

#include "cutting/slices.h"

#include "cutting/sweep.h"

/* A straight edge is spread over this angle, so that one rule applies to all. */
#define SHARP_RAD 1e-3

enum {
    CORNER_EDGES = 4, /* a peak is for warnings: four edges on a corner are within 1 % */
    EDGES = CORNER_EDGES + 3,
    FEWEST_STEPS = 4, /* within a pitch */
    STEPS_PER_TURN = 24,
};

/* A piece of the edge: its contact width, lowest and highest z. */
typedef struct {
    Facet facet;
    double width, low, high;
} Edge;

/* The teeth in the arcs of a sample; an edge lags behind the tip by an angle per mm of height. */
typedef struct {
    const double *arcs;
    int64_t arc_count;
    double pitch, lag;
    Chip chip;
    const double *law;
    int edge_count;
    Edge edges[EDGES];
} Teeth;

static void put_edge(Teeth *teeth, double sin_kappa, double cos_kappa, double width, double low,
                     double high) {
    teeth->edges[teeth->edge_count++] =
        (Edge){facet_of(sin_kappa, cos_kappa, &teeth->chip), width, low, high};
}

/* List the edges below a depth. */
static void list_edges(Teeth *teeth, double depth, double gamma, const Shape *shape) {
    const double corner = shape->corner_mm, kappa = shape->kappa_rad, side = shape->side_mm;
    const double arc_top = corner * (1.0 - cos(kappa));
    teeth->edge_count = 0;
    if (shape->bottom_mm > 0.0 && gamma > 0.0)
        put_edge(teeth, 0.0, 1.0, shape->bottom_mm, 0.0, 0.0);
    if (corner > 0.0) {
        const double reach = depth >= arc_top ? kappa : acos(1.0 - depth / corner);
        const double lowest = lesser(greater(-gamma, 0.0), reach); /* up-hill, flatter edges never cut */
        const double step = (reach - lowest) / CORNER_EDGES;
        for (int i = 0; i < CORNER_EDGES; i++) {
            const double begin = lowest + i * step, middle = begin + 0.5 * step;
            put_edge(teeth, sin(middle), cos(middle), corner * step, corner * (1.0 - cos(begin)),
                     corner * (1.0 - cos(begin + step)));
        }
    }
    const double top = lesser(depth, side);
    if (top > arc_top)
        put_edge(teeth, sin(kappa), cos(kappa), (top - arc_top) / sin(kappa), arc_top, top);
    if (depth > side)
        put_edge(teeth, 1.0, 0.0, depth - side, side, depth);
}

/* Add the force on an edge of all teeth in an arc; that of the first one lies between two angles. */
static void add_in_arc(const Teeth *teeth, const Edge *edge, double low, double high, double start,
                       double end, double force[3]) {
    const double density = edge->width / (high - low), pitch = teeth->pitch;
    const int64_t left = (int64_t)ceil((low - end) / pitch); /* teeth that have left the arc */
    double ahead = (double)left * pitch;
    for (; start + ahead < high; ahead += pitch) {
        Parts parts = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
        add_arc_force(greater(low - ahead, start), lesser(high - ahead, end), &edge->facet, teeth->law, &parts);
        const Force part = total_of(&parts);
        force[0] += density * part.feed;
        force[1] += density * part.normal;
        force[2] += density * part.axial;
    }
}

/* Return the square of the force on all teeth, one tip at an angle, the others a pitch apart; each edge
   spreads over the arc of its lag. */
static double square_at(const Teeth *teeth, double angle) {
    double force[3] = {0.0, 0.0, 0.0};
    for (int i = 0; i < teeth->edge_count; i++) {
        const Edge *edge = &teeth->edges[i];
        const double high = angle - teeth->lag * edge->low;
        const double low = lesser(angle - teeth->lag * edge->high, high - SHARP_RAD);
        for (int64_t arc = 0; arc < teeth->arc_count; arc++) {
            const double start = teeth->arcs[2 * arc], end = teeth->arcs[2 * arc + 1];
            if (end > start)
                add_in_arc(teeth, edge, low, high, start, end, force);
        }
    }
    return force[0] * force[0] + force[1] * force[1] + force[2] * force[2];
}

/* Sample a pitch, and where a whole tooth is in the cut or begins to leave it: there the force jumps. */
static double largest_square(const Teeth *teeth, double depth, int64_t steps) {
    double largest = 0.0;
    for (int64_t step = 0; step < steps; step++)
        largest = greater(largest, square_at(teeth, teeth->pitch * (double)step / (double)steps));
    for (int64_t end = 0; end < 2 * teeth->arc_count; end++) {
        const double angle = teeth->arcs[end] + (end % 2 == 0 ? teeth->lag * depth : 0.0);
        if (!isnan(angle))
            largest = greater(largest, square_at(teeth, angle));
    }
    return largest;
}

/* Write the largest force in N, `out` (n), sampled every 15° or closer.

   phi_rad (n, 2k) arcs, NaN pairs are none; a_p_mm, f_z_mm, ramp_rad (n); lag_rad_mm: how much an edge lags
   behind the tip per mm of height. */
EXPORT void cutting_peak_rows(Floats phi_rad, Floats a_p_mm, Floats f_z_mm, Floats ramp_rad,
                              int64_t teeth_count, double lag_rad_mm, const Shape *shape, Floats law,
                              Floats out) {
    const double per_pitch = ceil((double)STEPS_PER_TURN / (double)teeth_count);
    const int64_t steps = most(FEWEST_STEPS, (int64_t)per_pitch);
    for (int64_t row = 0; row < out.rows; row++) {
        AT(out, row) = 0.0;
        if (!(AT(a_p_mm, row) > 0.0 && AT(f_z_mm, row) > 0.0))
            continue;
        const double gamma = AT(ramp_rad, row), depth = lesser(AT(a_p_mm, row), shape->flute_mm);
        Teeth teeth = {.arcs = &CELL(phi_rad, row, 0), .arc_count = phi_rad.columns / 2};
        teeth.pitch = TURN / (double)teeth_count;
        teeth.lag = greater(lag_rad_mm, SHARP_RAD / depth);
        teeth.chip = (Chip){AT(f_z_mm, row), sin(gamma), cos(gamma)};
        teeth.law = law.at;
        list_edges(&teeth, depth, gamma, shape);
        AT(out, row) = sqrt(largest_square(&teeth, depth, steps));
    }
}
