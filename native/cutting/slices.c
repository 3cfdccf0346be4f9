/* Force of one tooth while it sweeps an arc, per mm of engaged edge, and the mean over a revolution made of
   it. */

#include "cutting/slices.h"

#include "cutting/sweep.h"

/* A chip below this fraction of the feed per tooth is rounding of a direction: the edge only slides along. */
#define NOT_ENGAGED 1e-6

enum { NODES = 16 };

/* Gauss-Legendre quadrature on [-1, 1]. */
static const double NODE[NODES] = {
    -0.9894009349916499, -0.9445750230732326,  -0.8656312023878318, -0.755404408355003,
    -0.6178762444026438, -0.45801677765722737, -0.2816035507792589, -0.09501250983763744,
    0.09501250983763744, 0.2816035507792589,   0.45801677765722737, 0.6178762444026438,
    0.755404408355003,   0.8656312023878318,   0.9445750230732326,  0.9894009349916499,
};
static const double WEIGHT[NODES] = {
    0.027152459411754176, 0.062253523938647456, 0.0951585116824926,   0.12462897125553407,
    0.1495959888165767,   0.16915651939500265,  0.18260341504492364,  0.18945061045506864,
    0.18945061045506864,  0.18260341504492364,  0.16915651939500265,  0.1495959888165767,
    0.12462897125553407,  0.0951585116824926,   0.062253523938647456, 0.027152459411754176,
};

void add_linear_edge(const Integrals *arc, const Facet *facet, const double *law, Parts *out) {
    const double sin_kappa = facet->sin_kappa, cos_kappa = facet->cos_kappa;
    const double h = facet->swing_mm * arc->sin + facet->offset_mm * arc->one;
    const double h_sin = facet->swing_mm * arc->sin_sin + facet->offset_mm * arc->sin;
    const double h_cos = facet->swing_mm * arc->sin_cos + facet->offset_mm * arc->cos;
    const double radial_c = sin_kappa * law[2] + cos_kappa * law[3];
    const double radial_e = sin_kappa * law[5] + cos_kappa * law[6];
    const double axial_c = sin_kappa * law[3] - cos_kappa * law[2];
    const double axial_e = sin_kappa * law[6] - cos_kappa * law[5];
    out->chip.feed -= law[1] * h_cos + radial_c * h_sin;
    out->chip.normal += law[1] * h_sin - radial_c * h_cos;
    out->chip.axial += axial_c * h;
    out->chip.tangential += law[1] * h;
    out->edge.feed -= law[4] * arc->cos + radial_e * arc->sin;
    out->edge.normal += law[4] * arc->sin - radial_e * arc->cos;
    out->edge.axial += axial_e * arc->one;
    out->edge.tangential += law[4] * arc->one;
}

static Integrals integrals_of(double a, double b) {
    const double sin_a = sin(a), cos_a = cos(a), sin_b = sin(b), cos_b = cos(b), one = b - a;
    const double sin_sin = 0.5 * (one - sin_b * cos_b + sin_a * cos_a);
    return (Integrals){one, cos_a - cos_b, sin_b - sin_a, sin_sin, 0.5 * (sin_b * sin_b - sin_a * sin_a)};
}

/* F_t = kc11·h^(1 - mc)·db by quadrature; radial and axial are fractions of it. */
static void add_kienzle(double a, double b, const Facet *facet, const double *law, Force *out) {
    const double half = 0.5 * (b - a), middle = 0.5 * (b + a);
    double one = 0.0, sine = 0.0, cosine = 0.0;
    for (int node = 0; node < NODES; node++) {
        const double phi = middle + half * NODE[node], sin_phi = sin(phi);
        const double h = greater(facet->swing_mm * sin_phi + facet->offset_mm, 0.0);
        const double force = WEIGHT[node] * pow(h, 1.0 - law[2]);
        one += force;
        sine += force * sin_phi;
        cosine += force * cos(phi);
    }
    const double tangential = half * law[1];
    const double radial = facet->sin_kappa * law[3] + facet->cos_kappa * law[4];
    const double axial = facet->sin_kappa * law[4] - facet->cos_kappa * law[3];
    out->feed -= tangential * (cosine + radial * sine);
    out->normal += tangential * (sine - radial * cosine);
    out->axial += tangential * axial * one;
    out->tangential += tangential * one;
}

/* Add the integral over an arc on which the chip is not negative. */
static void add(double a, double b, const Facet *facet, const double *law, Parts *out) {
    if (law[0] == LAW_LINEAR_EDGE) {
        const Integrals arc = integrals_of(a, b);
        add_linear_edge(&arc, facet, law, out);
    } else {
        add_kienzle(a, b, facet, law, &out->chip);
    }
}

Facet facet_of(double sin_kappa, double cos_kappa, const Chip *chip) {
    return facet_at(sin_kappa, cos_kappa, chip->f_z_mm, sin_kappa * chip->cos_gamma, cos_kappa * chip->sin_gamma);
}

Facet facet_at(double sin_kappa, double cos_kappa, double f_z_mm, double swing, double offset) {
    const bool is_flat = swing < NOT_ENGAGED;
    Facet facet = {.sin_kappa = sin_kappa, .cos_kappa = cos_kappa, .engaged = WHOLE_TURN};
    facet.swing_mm = is_flat ? 0.0 : f_z_mm * swing;
    facet.offset_mm = f_z_mm * offset;
    if (!(f_z_mm > 0.0) || (is_flat ? !(offset > NOT_ENGAGED) : offset <= -swing))
        facet.engaged = NO_CHIP;
    else if (!is_flat && offset < swing) {
        facet.engaged = PART_OF_TURN;
        facet.start = -asin(offset / swing);
        facet.stop = PI - facet.start;
    }
    return facet;
}

void add_arc_force(double phi_a, double phi_b, const Facet *facet, const double *law, Parts *out) {
    if (!(phi_b > phi_a) || facet->engaged == NO_CHIP)
        return;
    const bool is_in_front = facet->offset_mm >= 0.0 && phi_a >= 0.0 && phi_b <= PI;
    if (is_in_front || facet->engaged == WHOLE_TURN) {
        add(phi_a, phi_b, facet, law, out);
        return;
    }
    const double start = facet->start, stop = facet->stop;
    double turn = (double)(int64_t)floor((phi_a - stop) / TURN) * TURN + TURN;
    for (; start + turn < phi_b; turn += TURN) {
        const double a = greater(phi_a, start + turn), b = lesser(phi_b, stop + turn);
        if (b > a)
            add(a, b, facet, law, out);
    }
}

/* What the mean of a sample is made of. arcs: pairs of angles, NaN pairs are none. */
typedef struct {
    const double *arcs;
    int64_t arc_count;
    Chip chip;
    const double *law;
    double total[4]; /* feed, normal, axial force and torque */
} Mean;

/* Add an edge of a contact width at a mean radius, in mm, over all arcs. */
static void add_edge(Mean *mean, double sin_kappa, double cos_kappa, double width, double radius) {
    const Facet facet = facet_of(sin_kappa, cos_kappa, &mean->chip);
    Parts parts = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    for (int64_t arc = 0; arc < mean->arc_count; arc++)
        add_arc_force(mean->arcs[2 * arc], mean->arcs[2 * arc + 1], &facet, mean->law, &parts);
    const Force part = total_of(&parts);
    mean->total[0] += width * part.feed;
    mean->total[1] += width * part.normal;
    mean->total[2] += width * part.axial;
    mean->total[3] += width * radius * part.tangential;
}

/* Add the corner arc between two edge angles, by quadrature over the edge angle. */
static void add_corner(Mean *mean, double kappa_a, double kappa_b, const Shape *shape) {
    const double half = 0.5 * (kappa_b - kappa_a), middle = 0.5 * (kappa_b + kappa_a);
    if (half <= 0.0)
        return;
    for (int node = 0; node < NODES; node++) {
        const double kappa = middle + half * NODE[node], sin_kappa = sin(kappa);
        add_edge(mean, sin_kappa, cos(kappa), half * WEIGHT[node] * shape->corner_mm,
                 shape->bottom_mm + shape->corner_mm * sin_kappa);
    }
}

/* Add the integral over a turn of one tooth: bottom, corner arc, side and cylinder below a depth. */
static void add_tooth(Mean *mean, double a_p_mm, double tilt, const Shape *shape) {
    const double bottom = shape->bottom_mm, corner = shape->corner_mm, kappa = shape->kappa_rad,
                 side = shape->side_mm;
    const double depth = lesser(a_p_mm, shape->flute_mm), sin_kappa = sin(kappa), cos_kappa = cos(kappa);
    if (bottom > 0.0 && mean->chip.sin_gamma > 0.0)
        add_edge(mean, 0.0, 1.0, bottom, 0.5 * bottom);
    const double arc_top = corner * (1.0 - cos_kappa);
    if (corner > 0.0) {
        const double reach = depth >= arc_top ? kappa : acos(1.0 - depth / corner);
        /* below it a ramp's chip is of one sign all round, above it only in front */
        const double begin = lesser(tilt, reach);
        add_corner(mean, 0.0, begin, shape);
        add_corner(mean, begin, reach, shape);
    }
    const double top = lesser(depth, side), rim = bottom + corner * sin_kappa;
    if (top > arc_top) {
        const double radius = rim + 0.5 * (top - arc_top) * (cos_kappa / sin_kappa);
        add_edge(mean, sin_kappa, cos_kappa, (top - arc_top) / sin_kappa, radius);
    }
    if (depth > side)
        add_edge(mean, 1.0, 0.0, depth - side, rim + (side - arc_top) * cos_kappa / sin_kappa);
}

/* Write the mean feed, normal and axial force in N and the torque in N·mm, `out` (n, 4), of n samples.

   phi_rad (n, 2k) arcs, NaN pairs are none; a_p_mm, f_z_mm, ramp_rad (n). */
EXPORT void cutting_mean_rows(Floats phi_rad, Floats a_p_mm, Floats f_z_mm, Floats ramp_rad, double teeth,
                              const Shape *shape, Floats law, Floats out) {
    for (int64_t row = 0; row < out.rows; row++) {
        const double gamma = AT(ramp_rad, row), share = teeth / TURN;
        Mean mean = {&CELL(phi_rad, row, 0), phi_rad.columns / 2, {AT(f_z_mm, row), 0.0, 0.0}, law.at, {0.0}};
        if (AT(a_p_mm, row) > 0.0 && AT(f_z_mm, row) > 0.0) {
            mean.chip.sin_gamma = sin(gamma);
            mean.chip.cos_gamma = cos(gamma);
            add_tooth(&mean, AT(a_p_mm, row), fabs(gamma), shape);
        }
        for (int q = 0; q < 4; q++)
            CELL(out, row, q) = mean.total[q] * share;
    }
}

static void add_to(Floats out, const Parts *parts) {
    const Force total = total_of(parts);
    AT(out, 0) += total.feed;
    AT(out, 1) += total.normal;
    AT(out, 2) += total.axial;
    AT(out, 3) += total.tangential;
}

/* Add the force of an arc to `out` (4). */
EXPORT void cutting_arc_force(double phi_a, double phi_b, double sin_kappa, double cos_kappa, double f_z_mm,
                              double sin_gamma, double cos_gamma, Floats law, Floats out) {
    const Chip chip = {f_z_mm, sin_gamma, cos_gamma};
    const Facet facet = facet_of(sin_kappa, cos_kappa, &chip);
    Parts parts = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    add_arc_force(phi_a, phi_b, &facet, law.at, &parts);
    add_to(out, &parts);
}

/* For tests: the same of linear edge forces, from the integrals (5) over the arc. */
EXPORT void cutting_linear_edge(Floats integrals, double sin_kappa, double cos_kappa, double swing_mm,
                                double offset_mm, Floats law, Floats out) {
    const Facet facet = {sin_kappa, cos_kappa, swing_mm, offset_mm, 0.0, TURN, WHOLE_TURN};
    Parts parts = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    add_linear_edge((const Integrals *)&AT(integrals, 0), &facet, law.at, &parts);
    add_to(out, &parts);
}
