/* Motions of a program beside its targets: which of them only cut the way to a target. */

#include "core.h"

static const double *point(Floats points, int64_t row) { return &CELL(points, row, 0); }

static double distance2(const double *a, const double *b) {
    return squared(a[0] - b[0]) + squared(a[1] - b[1]) + squared(a[2] - b[2]);
}

/* Return the share of the way from start to target at the foot of a position. */
static double share_at(const double *position, const double *start, const double *target) {
    double along = 0.0;
    for (int c = 0; c < 3; c++)
        along += (position[c] - start[c]) * (target[c] - start[c]);
    return along / distance2(target, start);
}

/* Return the square of the distance of a position from a share of the way. */
static double beside2(const double *position, const double *start, const double *target, double share) {
    double sum = 0.0;
    for (int c = 0; c < 3; c++)
        sum += squared(start[c] + share * (target[c] - start[c]) - position[c]);
    return sum;
}

/* Walk both in step; a motion that ends on the way to the next target belongs to it: write row and share. */
EXPORT void krl_align(Floats position, Bools ptp, Floats cdis, Floats target, Bools target_ptp, Floats start,
                      double limit_mm, Ints row, Floats share) {
    int64_t at = 0;
    double before = 0.0;
    for (int64_t i = 0; i < position.rows && at < target.rows; i++) {
        const double *here = point(position, i), *from = point(start, at), *to = point(target, at);
        const bool arrives = AT(ptp, i) || AT(target_ptp, at) || distance2(here, to) <= limit_mm * limit_mm;
        if (!arrives && distance2(to, from) > 0.0 && AT(cdis, i) > 0.0) {
            const double along = share_at(here, from, to);
            if (before < along && along < 1.0 && beside2(here, from, to, along) <= limit_mm * limit_mm) {
                AT(row, i) = at;
                AT(share, i) = before = along;
                continue;
            }
        }
        at++;
        before = 0.0;
    }
}
