/* Jacobian of the arm, and how far a pose is from a singularity (robot/velocity_kinematics.py).

   Column j is the velocity of a point of the flange, and the angular velocity of the flange, for A(j+1) turning
   with 1 rad/s: the axis of rotation crossed with the lever arm, and the axis itself (Whitney 1972).
   Singular values are found for several rows together: each innermost loop is a vector instruction. */

#include "robot/arm.h"

enum { TOGETHER = 32 };
/* A 6 by 6 matrix of each of the rows worked on together. */
typedef double Matrices[AXES][AXES][TOGETHER];
typedef double Vectors[AXES][TOGETHER];

/* Write the Jacobian of a row, its velocity rows times a scale: row k of column j at k * across + j * along. */
static inline void fill(const double *q, Arm arm, const double *tool_mm, double scale, double *columns,
                        int across, int along) {
    const double cos_1 = cos(q[0]), sin_1 = sin(q[0]), cos_2 = cos(q[1]), sin_2 = sin(q[1]);
    const double cos_23 = cos(q[1] + q[2]), sin_23 = sin(q[1] + q[2]);
    const double cos_4 = cos(q[3]), sin_4 = sin(q[3]), cos_5 = cos(q[4]), sin_5 = sin(q[4]);
    const double cos_6 = cos(q[5]), sin_6 = sin(q[5]);

    /* the tip from the wrist centre, turned by eq. 1 from the right to the left: Ry(90 deg) Tr(c4,0,0) first */
    const double x_6 = tool_mm[2] + arm.c4, y_6 = tool_mm[1], z_6 = -tool_mm[0];
    const double y_5 = cos_6 * y_6 + sin_6 * z_6, z_5 = cos_6 * z_6 - sin_6 * y_6;
    const double x_4 = cos_5 * x_6 + sin_5 * z_5, z_4 = cos_5 * z_5 - sin_5 * x_6;
    const double y = cos_4 * y_5 + sin_4 * z_4, z_3 = cos_4 * z_4 - sin_4 * y_5;
    /* now along the forearm; then in the arm's plane: x forward, y to the left, z up */
    const double x = cos_23 * x_4 + sin_23 * z_3, z = cos_23 * z_3 - sin_23 * x_4;
    const double forearm_x = arm.c3 * cos_23 - arm.a2 * sin_23, forearm_z = -arm.c3 * sin_23 - arm.a2 * cos_23;
    const double upper_x = arm.c2 * cos_2, upper_z = -arm.c2 * sin_2;
    const double axis_6_x = -cos_23 * cos_5 + sin_23 * cos_4 * sin_5;
    const double axis_6_y = sin_4 * sin_5;
    const double axis_6_z = cos_23 * cos_4 * sin_5 + sin_23 * cos_5;

    /* axis of rotation (x, y, z) and lever arm (x, z) from a point of it to the tip, both in the arm's plane */
    const double from_3_x = x + forearm_x, from_3_z = z + forearm_z;
    const double from_2_x = from_3_x + upper_x, from_2_z = from_3_z + upper_z;
    const double joints[AXES][5] = {
        {0.0, 0.0, -1.0, from_2_x + arm.a1, from_2_z},
        {0.0, 1.0, 0.0, from_2_x, from_2_z},
        {0.0, 1.0, 0.0, from_3_x, from_3_z},
        {-cos_23, 0.0, sin_23, x, z},
        {-sin_23 * sin_4, cos_4, -cos_23 * sin_4, x, z},
        {axis_6_x, axis_6_y, axis_6_z, x, z},
    };
    for (int j = 0; j < AXES; j++) {
        const double axis_x = joints[j][0], axis_y = joints[j][1], axis_z = joints[j][2];
        const double lever_x = joints[j][3], lever_z = joints[j][4];
        const double speed_x = scale * (axis_y * lever_z - axis_z * y);
        const double speed_y = scale * (axis_z * lever_x - axis_x * lever_z);
        double *column = columns + j * along;
        column[0] = cos_1 * speed_x + sin_1 * speed_y; /* Rz(-A1): from the plane to the root */
        column[across] = cos_1 * speed_y - sin_1 * speed_x;
        column[2 * across] = scale * (axis_x * y - axis_y * lever_x);
        column[3 * across] = cos_1 * axis_x + sin_1 * axis_y;
        column[4 * across] = cos_1 * axis_y - sin_1 * axis_x;
        column[5 * across] = axis_z;
    }
}

/* Write the Jacobians (n, 6, 6) of angles (n, 6). */
EXPORT void robot_jacobian(Floats q_rad, Floats geometry, Floats tool_mm, Floats jacobian) {
    const Arm arm = arm_of(geometry);
    for (int64_t i = 0; i < q_rad.rows; i++)
        fill(&CELL(q_rad, i, 0), arm, &AT(tool_mm, 0), 1.0, &CELL(jacobian, i, 0), AXES, 1);
}

/* Write the lower half of the products of the rows of each matrix with each other. */
static void multiply(Matrices a, Matrices gram) {
    for (int row = 0; row < AXES; row++)
        for (int other = 0; other <= row; other++)
            for (int m = 0; m < TOGETHER; m++) {
                double total = 0.0;
                for (int j = 0; j < AXES; j++)
                    total += a[row][j][m] * a[other][j][m];
                gram[row][other][m] = total;
            }
}

/* Make a Householder vector of column k below the diagonal, in its place; two_over = 2 / its square. */
static inline void reflect(Matrices a, int k, Vectors square, double *restrict two_over) {
    double below[TOGETHER] = {0.0};
    for (int i = k + 2; i < AXES; i++)
        for (int m = 0; m < TOGETHER; m++)
            below[m] += a[i][k][m] * a[i][k][m];
    for (int m = 0; m < TOGETHER; m++) {
        double head = a[k + 1][k][m];
        const double beside = -copysign(sqrt(head * head + below[m]), head);
        square[k + 1][m] = beside * beside;
        head -= beside;
        a[k + 1][k][m] = head;
        const double size = head * head + below[m];
        two_over[m] = size > 1e-300 ? 2.0 / size : 0.0;
    }
}

/* Apply the reflection of column k from both sides to what is below and right of it. */
static inline void turn_remainder(Matrices a, int k, const double *restrict two_over) {
    Vectors step;
    for (int i = k + 1; i < AXES; i++) {
        double total[TOGETHER] = {0.0};
        for (int j = k + 1; j < AXES; j++) {
            const double *restrict row = j <= i ? a[i][j] : a[j][i], *restrict vector = a[j][k];
            for (int m = 0; m < TOGETHER; m++)
                total[m] += row[m] * vector[m];
        }
        for (int m = 0; m < TOGETHER; m++)
            step[i][m] = total[m] * two_over[m];
    }
    double along[TOGETHER] = {0.0};
    for (int i = k + 1; i < AXES; i++)
        for (int m = 0; m < TOGETHER; m++)
            along[m] += step[i][m] * a[i][k][m];
    for (int m = 0; m < TOGETHER; m++)
        along[m] *= 0.5 * two_over[m];
    for (int i = k + 1; i < AXES; i++)
        for (int m = 0; m < TOGETHER; m++)
            step[i][m] -= along[m] * a[i][k][m];
    for (int i = k + 1; i < AXES; i++)
        for (int j = k + 1; j <= i; j++)
            for (int m = 0; m < TOGETHER; m++)
                a[i][j][m] -= a[i][k][m] * step[j][m] + step[i][m] * a[j][k][m];
}

/* Bring symmetric matrices, of which the lower half is read, to Householder's tridiagonal form.

   The diagonal is left in a; square gets the squares of the off-diagonal, from row 1 on (Golub and Van Loan,
   8.3). */
static void make_tridiagonal(Matrices a, Vectors square) {
    double two_over[TOGETHER];
    for (int k = 0; k < AXES - 2; k++) {
        reflect(a, k, square, two_over);
        turn_remainder(a, k, two_over);
    }
    for (int m = 0; m < TOGETHER; m++)
        square[AXES - 1][m] = a[AXES - 1][AXES - 2][m] * a[AXES - 1][AXES - 2][m];
}

/* Write the smallest eigenvalues of positive semi-definite tridiagonal matrices, NaN where they are.

   Newton's method on the characteristic polynomial from below: all roots being real, it rises to the smallest
   one and never passes it (Golub and Van Loan, 8.4). */
static void smallest_roots(Matrices a, Vectors square, double *restrict root) {
    for (int m = 0; m < TOGETHER; m++)
        root[m] = 0.0;
    for (int round = 0; round < 60; round++) {
        int64_t rising = 0;
        for (int m = 0; m < TOGETHER; m++) {
            const double at = root[m];
            double value = a[0][0][m] - at, slope = -1.0, value_before = 1.0, slope_before = 0.0;
            for (int k = 1; k < AXES; k++) {
                const double diagonal = a[k][k][m] - at, beside = square[k][m];
                const double next = diagonal * value - beside * value_before;
                const double next_slope = diagonal * slope - value - beside * slope_before;
                value_before = value, slope_before = slope;
                value = next, slope = next_slope;
            }
            const double step = -value / slope;
            const bool rises = step > 1e-15 * (1.0 + at); /* 0 / 0 at a double root does not */
            root[m] = at + (rises ? step : 0.0 * value);
            rising += rises;
        }
        if (rising == 0)
            return;
    }
}

/* Write the smallest singular values (n) of the dimensionless Jacobians of angles (n, 6). */
EXPORT void robot_smallest_singular_value(Floats q_rad, Floats geometry, Floats tool_mm, Floats sigma_min) {
    const Arm arm = arm_of(geometry);
    const double scale = 1.0 / (arm.c2 + hypot(arm.c3, arm.a2));
    const int64_t count = q_rad.rows;
    Matrices columns, gram;
    Vectors square;
    double root[TOGETHER];
    for (int64_t first = 0; first < count; first += TOGETHER) {
        for (int m = 0; m < TOGETHER; m++)
            fill(&CELL(q_rad, least(first + m, count - 1), 0), arm, &AT(tool_mm, 0), scale, &columns[0][0][m],
                 AXES * TOGETHER, TOGETHER);
        multiply(columns, gram);
        make_tridiagonal(gram, square);
        smallest_roots(gram, square, root);
        for (int64_t m = 0; m < least(TOGETHER, count - first); m++)
            AT(sigma_min, first + m) = sqrt(root[m]);
    }
}
