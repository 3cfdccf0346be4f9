/* The poses of the arm, row by row: distance to the limits, and what is not allowed (robot/standing.py). */

#include "constants.h"
#include "robot/arm.h"

VIEW(Bits, uint16_t);

/* A joint may be faster than its limit by rounding. */
static const double SPEED_ROOM = 1.0 + 1e-6;

/* Return what is wrong with the motion into a row. Without most_rad_s the wrist is checked. */
static int32_t too_fast(Floats q_rad, int64_t i, double duration_s, Floats most_rad_s) {
    if (most_rad_s.rows == 0)
        return fabs(sin(CELL(q_rad, i, 4))) < sin(STANDING_WRIST_ZONE_RAD) ? STANDING_WRIST : 0;
    for (int64_t j = 0; i > 0 && j < AXES; j++) /* NaN, where there is no row before, is not too fast */
        if (fabs(CELL(q_rad, i, j) - CELL(q_rad, i - 1, j)) > AT(most_rad_s, j) * duration_s * SPEED_ROOM)
            return STANDING_FAST;
    return 0;
}

/* Write the distance (n) to the nearest limit, and what is wrong with as many rows as there are durations. */
EXPORT void robot_judge(Floats q_rad, Floats duration_s, Floats limits, Floats most_rad_s, Floats margin,
                        Bits wrong) {
    for (int64_t i = 0; i < q_rad.rows; i++) {
        double nearest = INFINITY;
        int32_t bits = 0;
        if (isnan(CELL(q_rad, i, 0))) { /* a pose out of reach has no angle at all */
            nearest = NAN;
            bits = STANDING_UNREACHED;
        } else {
            for (int j = 0; j < AXES; j++) {
                const double q = CELL(q_rad, i, j);
                const double room = lesser(q - CELL(limits, j, 0), CELL(limits, j, 1) - q);
                nearest = lesser(nearest, room);
                if (room < 0.0)
                    bits |= 1 << j;
            }
        }
        AT(margin, i) = nearest;
        if (i < wrong.rows)
            AT(wrong, i) = (uint16_t)(bits | too_fast(q_rad, i, AT(duration_s, i), most_rad_s));
    }
}

/* Raise the share of each row to the largest ratio of its samples' joint speeds (m, 6) to their limits. */
EXPORT void robot_speed_share(Floats qd_rad_s, Floats most_rad_s, Ints32 row, Floats share) {
    for (int64_t i = 0; i < qd_rad_s.rows; i++) {
        double *of_row = &AT(share, AT(row, i));
        for (int j = 0; j < AXES; j++) {
            const double ratio = fabs(CELL(qd_rad_s, i, j)) / AT(most_rad_s, j);
            if (ratio > *of_row) /* NaN is not */
                *of_row = ratio;
        }
    }
}
