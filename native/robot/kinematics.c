/* Forward kinematics, status and turn of the arm of robot/kinematics.py (eq. 1 there). */

#include "robot/arm.h"

/* Return the same direction in (-pi, pi]; an angle already there is returned unchanged. */
static double wrapped(double angle_rad) {
    const double turns = ceil((angle_rad - PI) / (2.0 * PI));
    return angle_rad - 2.0 * PI * turns;
}

/* Write the status and turn (n) of angles (n, 6), rounded to a grid if that is not 0. */
EXPORT void robot_status_turn(Floats q_rad, Floats geometry, double grid_rad, Ints32 status, Ints32 turn) {
    const Arm arm = arm_of(geometry);
    const double stretched = atan2(arm.a2, arm.c3), forearm = hypot(arm.a2, arm.c3);
    for (int64_t i = 0; i < q_rad.rows; i++) {
        double angle[AXES];
        int32_t turns = 0, bits = 0;
        for (int j = 0; j < AXES; j++) {
            const double q = CELL(q_rad, i, j);
            angle[j] = grid_rad > 0.0 ? rint(q / grid_rad) * grid_rad : q;
            if (angle[j] < 0.0)
                turns |= 1 << j;
        }
        const double elbow = angle[2] + stretched;
        if (arm.a1 + arm.c2 * cos(angle[1]) + forearm * cos(angle[1] + elbow) < 0.0)
            bits |= 1;
        if (wrapped(elbow) >= 0.0)
            bits |= 2;
        if (wrapped(angle[4]) < 0.0)
            bits |= 4;
        AT(status, i) = bits;
        AT(turn, i) = turns;
    }
}

/* Write the flange's origin (n, 3) and axes (n, 3, 3) of angles (n, 6), eq. 1. */
EXPORT void robot_flange(Floats q_rad, Floats geometry, Floats position_mm, Floats rotation) {
    const Arm arm = arm_of(geometry);
    for (int64_t i = 0; i < q_rad.rows; i++) {
        const double *q = &CELL(q_rad, i, 0);
        const double cos_1 = cos(q[0]), sin_1 = sin(q[0]), cos_2 = cos(q[1]), sin_2 = sin(q[1]);
        const double cos_23 = cos(q[1] + q[2]), sin_23 = sin(q[1] + q[2]);
        const double cos_4 = cos(q[3]), sin_4 = sin(q[3]), cos_5 = cos(q[4]), sin_5 = sin(q[4]);
        const double cos_6 = cos(q[5]), sin_6 = sin(q[5]);
        /* columns of Rx(-A4) Ry(A5) Rx(-A6) Ry(90 deg): the flange's axes along those of the forearm */
        const double flange[3][3] = {
            {-sin_5 * cos_6, -cos_4 * sin_6 - sin_4 * cos_5 * cos_6, sin_4 * sin_6 - cos_4 * cos_5 * cos_6},
            {-sin_5 * sin_6, cos_4 * cos_6 - sin_4 * cos_5 * sin_6, -sin_4 * cos_6 - cos_4 * cos_5 * sin_6},
            {cos_5, -sin_4 * sin_5, -cos_4 * sin_5},
        };
        double *turned = &CELL(rotation, i, 0);
        for (int column = 0; column < 3; column++) {
            const double x = flange[column][0], y = flange[column][1], z = flange[column][2];
            const double along = cos_23 * x + sin_23 * z; /* the arm's plane, then Rz(-A1) */
            turned[column] = cos_1 * along + sin_1 * y;
            turned[3 + column] = -sin_1 * along + cos_1 * y;
            turned[6 + column] = -sin_23 * x + cos_23 * z;
        }
        const double radius = arm.a1 + arm.c2 * cos_2 + arm.c3 * cos_23 - arm.a2 * sin_23;
        const double height = arm.c1 - arm.c2 * sin_2 - arm.c3 * sin_23 - arm.a2 * cos_23;
        CELL(position_mm, i, 0) = cos_1 * radius + arm.c4 * turned[2];
        CELL(position_mm, i, 1) = -sin_1 * radius + arm.c4 * turned[5];
        CELL(position_mm, i, 2) = height + arm.c4 * turned[8];
    }
}
