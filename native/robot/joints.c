/* Joint speeds along a motion (robot/joints.py). */

#include "robot/arm.h"

/* Write the central differences (n, 6) of angles over the time of two rows: 0 in the first and the last row,
   and beside a change of the tool, where the path goes on elsewhere. */
EXPORT void robot_speeds(Floats q_rad, Ints32 tool, double window_s, Floats qd_rad_s) {
    const int64_t last = q_rad.rows - 1;
    for (int64_t i = 0; i <= last; i++) {
        const bool rests = i == 0 || i == last || AT(tool, i - 1) != AT(tool, i) || AT(tool, i) != AT(tool, i + 1);
        for (int j = 0; j < AXES; j++)
            CELL(qd_rad_s, i, j) = rests ? 0.0 : (CELL(q_rad, i + 1, j) - CELL(q_rad, i - 1, j)) / window_s;
    }
}
