/* Projection of a correction into the plane normal to the feed: eq. 10-11 of Haehn & Weigold 2020. */

#include "core.h"

/* Write a factor times the component of each row of r (n, 3) normal to that of v (n, 3). */
EXPORT void compliance_project(Floats r, Floats v, double factor, Floats normal) {
    for (int64_t i = 0; i < r.rows; i++) {
        const double *from = &CELL(r, i, 0), *feed = &CELL(v, i, 0);
        double *to = &CELL(normal, i, 0);
        double rx = from[0], ry = from[1], rz = from[2];
        const double largest = greater(greater(fabs(feed[0]), fabs(feed[1])), fabs(feed[2]));
        if (largest != 0.0) {
            const double vx = feed[0] / largest, vy = feed[1] / largest, vz = feed[2] / largest; /* eq. 11 */
            const double along = (rx * vx + ry * vy + rz * vz) / (vx * vx + vy * vy + vz * vz);
            rx = rx - along * vx; /* eq. 10 */
            ry = ry - along * vy;
            rz = rz - along * vz;
        }
        to[0] = factor * rx + 0.0; /* + 0.0: never a negative zero */
        to[1] = factor * ry + 0.0;
        to[2] = factor * rz + 0.0;
    }
}

/* Make each row of v (n, 3) a unit vector, zero where it is shorter than least; NaN stays. The squares are
   added as a processor adds three in one register: the first and the last, then the second. */
EXPORT void compliance_directions(Floats v, double least) {
    for (int64_t i = 0; i < v.rows; i++) {
        double *row = &CELL(v, i, 0);
        const double length = sqrt(squared(row[0]) + squared(row[2]) + squared(row[1]));
        for (int j = 0; j < 3; j++)
            row[j] = length < least ? 0.0 : row[j] / length;
    }
}
