/* Where a path comes nearest to a place, and where it meets material first. */

#include "cutting/turned.h"

/* Write the points (n,) of a path whose cutter is the least outside of places (n, 3). */
EXPORT void cutting_nearest_poses(const Turned *points, Floats places_mm, Ints nearest) {
    for (int64_t n = 0; n < places_mm.rows; n++) {
        double least_mm = INFINITY;
        for (int64_t k = 0; k < points->position_mm.rows; k++) {
            const Pose pose = pose_of(points, k);
            const double outside = outside_at(body_of(points, AT(points->tool, k)), &pose, &CELL(places_mm, n, 0));
            if (outside < least_mm) {
                least_mm = outside;
                AT(nearest, n) = k;
            }
        }
    }
}

/* Cut along a path until it meets material; raise `removed_mm` (3) to the longest stretch taken from a ray of each field. Returns
   the point by which that was, the number of points where it meets none. */
EXPORT int64_t cutting_first_contact(const Dexels *dexels, const Turned *points, Floats removed_mm) {
    const Stock stock = stock_of(dexels);
    double *removed = &AT(removed_mm, 0);
    for (int64_t k = 1; k < points->position_mm.rows; k++) {
        if (!cut_way(&stock, points, k - 1, k, 0, removed) || lesser(removed[0], lesser(removed[1], removed[2])) > 0.0)
            return k;
    }
    return points->position_mm.rows;
}
