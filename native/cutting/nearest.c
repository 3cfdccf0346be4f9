/* Which pose of a path comes nearest to a place. */

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
