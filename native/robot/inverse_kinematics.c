/* Closed-form inverse kinematics: all eight branches, or one along a path (robot/inverse_kinematics.py).

   The wrist centre splits the problem (Pieper 1968). An angle is found as a direction (y, x) first, so that a
   caller can take the arc tangent of many at once. */

#include "robot/arm.h"

/* How far cos(A3 - phi) may exceed 1 by rounding; less than 1e-8 mm beyond the stretched arm. */
static const double STRETCH_TOLERANCE = 1e-12;
/* A wrist centre as close as this to axis 1 leaves A1 free. */
static const double AXIS_1_TOLERANCE_MM = 1e-9;
/* Below this |sin A5| axes 4 and 6 are one: A4 is free, A5 is exactly 0 or pi, A6 takes the rest. */
static const double WRIST_TOLERANCE = 1e-9;

enum { BRANCHES = 8, OVERHEAD = 1, ELBOW = 2, WRIST = 4 };

/* A1 to A6 as directions, and whether A1 and A4 are free. */
typedef struct {
    double sin_1, sin_2, sin_3, sin_4, sin_5, sin_6;
    double cos_1, cos_2, cos_3, cos_4, cos_5, cos_6;
    bool free_1, free_4;
} Directions;

/* The same as columns: y and x of A1 to A6. */
#define SINES(to) {to.sin_1, to.sin_2, to.sin_3, to.sin_4, to.sin_5, to.sin_6}
#define COSINES(to) {to.cos_1, to.cos_2, to.cos_3, to.cos_4, to.cos_5, to.cos_6}

/* What A1 and A4 are where they are free. */
typedef struct {
    double cos_1, sin_1, cos_4, sin_4;
} Given;
static const Given ZERO = {1.0, 0.0, 1.0, 0.0};

/* Return the directions of a position (3) and a rotation (3, 3); out of reach, all are NaN. */
static inline Directions directions(const double *p, const double *r, Arm arm, int64_t branch, Given given) {
    double wrist_x = p[0] - arm.c4 * r[2]; /* wrist centre: back along the flange's z */
    double wrist_y = p[1] - arm.c4 * r[5];
    double radius = sqrt(wrist_x * wrist_x + wrist_y * wrist_y);
    if (branch & OVERHEAD) { /* axis 1 faces away from the wrist centre */
        wrist_x = -wrist_x;
        wrist_y = -wrist_y;
        radius = -radius;
    }
    const bool free_1 = !(fabs(radius) > AXIS_1_TOLERANCE_MM);
    double cos_1 = free_1 ? given.cos_1 : wrist_x / fabs(radius);
    const double sin_1 = free_1 ? given.sin_1 : -wrist_y / fabs(radius);

    /* triangle of upper arm, forearm and the line from axis 2 to the wrist centre; angles count downwards */
    const double along = radius - arm.a1;
    const double down = arm.c1 - (p[2] - arm.c4 * r[8]);
    const double forearm_2 = arm.c3 * arm.c3 + arm.a2 * arm.a2;
    const double forearm = sqrt(forearm_2);
    const double distance_2 = along * along + down * down;
    double cos_elbow = (distance_2 - arm.c2 * arm.c2 - forearm_2) / (2.0 * arm.c2 * forearm);
    const bool reached = fabs(cos_elbow) <= 1.0 + STRETCH_TOLERANCE; /* NaN input is not */
    cos_1 = reached ? cos_1 : NAN;
    cos_elbow = reached ? cos_elbow : NAN;
    const double square = (1.0 - cos_elbow) * (1.0 + cos_elbow);
    const double bend = sqrt(square < 0.0 ? 0.0 : square);
    const double sin_elbow = branch & ELBOW ? bend : -bend;
    const double reach_along = arm.c2 + forearm * cos_elbow, reach_down = forearm * sin_elbow;
    const double cos_2 = (along * reach_along + down * reach_down) / distance_2;
    const double sin_2 = (down * reach_along - along * reach_down) / distance_2;
    const double cos_3 = (cos_elbow * arm.c3 + sin_elbow * arm.a2) / forearm;
    const double sin_3 = (sin_elbow * arm.c3 - cos_elbow * arm.a2) / forearm;
    const double cos_23 = cos_2 * cos_3 - sin_2 * sin_3, sin_23 = sin_2 * cos_3 + cos_2 * sin_3;

    /* Rx(-A4) Ry(A5) Rx(-A6) = m, the flange's axes z, y, -x seen from the forearm */
    const double y_x = sin_1, y_y = cos_1; /* the forearm's y; its z is (z_x, z_y, cos_23) */
    const double z_x = cos_1 * sin_23, z_y = -sin_1 * sin_23;
    const double m_00 = (cos_1 * r[2] - sin_1 * r[5]) * cos_23 - sin_23 * r[8];
    const double m_10 = y_x * r[2] + y_y * r[5];
    const double m_20 = z_x * r[2] + z_y * r[5] + cos_23 * r[8];
    const double m_11 = y_x * r[1] + y_y * r[4];
    const double m_21 = z_x * r[1] + z_y * r[4] + cos_23 * r[7];
    const double m_12 = -y_x * r[0] - y_y * r[3];
    const double m_22 = -z_x * r[0] - z_y * r[3] - cos_23 * r[6];
    const double size_5 = sqrt(m_10 * m_10 + m_20 * m_20);
    const bool free_4 = size_5 < WRIST_TOLERANCE;
    const double sin_5 = branch & WRIST ? -size_5 : size_5;
    const double cos_4 = free_4 ? given.cos_4 : -m_20 / sin_5;
    const double sin_4 = free_4 ? given.sin_4 : -m_10 / sin_5;
    /* rows 1 and 2 of Rx(A4) m = Ry(A5) Rx(-A6): exact for the A4 taken, at the singularity too */
    const double sin_6 = cos_4 * m_12 - sin_4 * m_22, cos_6 = cos_4 * m_11 - sin_4 * m_21;
    const Directions found = {
        sin_1, sin_2, sin_3, sin_4, free_4 ? 0.0 : sin_5, sin_6, cos_1, cos_2, cos_3, cos_4, m_00, cos_6,
        free_1, free_4,
    };
    return found;
}

/* Return the same direction in (-pi, pi], for an angle less than a turn away from it. */
static double main_value(double angle_rad) {
    if (angle_rad > PI)
        return angle_rad - 2.0 * PI;
    if (angle_rad <= -PI)
        return angle_rad + 2.0 * PI;
    return angle_rad;
}

/* Return the angle with the whole turns that bring it nearest to another. */
static inline double nearest_turn(double angle_rad, double before_rad) {
    const double way = before_rad - angle_rad;
    if (-PI <= way && way < PI)
        return angle_rad;
    return angle_rad + 2.0 * PI * floor(way / (2.0 * PI) + 0.5);
}

/* Write all branches (n, 8, 6) of poses. */
EXPORT void robot_all_branches(Floats position_mm, Floats rotation, Floats geometry, Floats q_rad) {
    const Arm arm = arm_of(geometry);
    for (int64_t i = 0; i < position_mm.rows; i++) {
        const double *p = &CELL(position_mm, i, 0), *r = &CELL(rotation, i, 0);
        double *q = &CELL(q_rad, i, 0);
        for (int64_t branch = 0; branch < BRANCHES; branch++) {
            const Directions to = directions(p, r, arm, branch, ZERO);
            const double y[AXES] = SINES(to), x[AXES] = COSINES(to);
            for (int j = 0; j < AXES; j++) {
                /* the wrist does not change A1 to A3 */
                const bool is_known = branch >= WRIST && j < 3;
                q[AXES * branch + j] =
                    is_known ? q[AXES * (branch - WRIST) + j] : main_value(atan2(y[j], x[j]));
            }
        }
    }
}

/* Directions of several rows; as columns of a fixed length, so that a loop over them becomes vector
   instructions. */
enum { TOGETHER = 32 };
typedef struct {
    double y[AXES][TOGETHER], x[AXES][TOGETHER];
    int64_t irregular[TOGETHER];
} Columns;

/* Find the directions of rows of poses: inputs (12) are p and r as columns. */
static void fill(double in[12][TOGETHER], Arm arm, int64_t branch, Columns *restrict out) {
    for (int i = 0; i < TOGETHER; i++) {
        const double p[3] = {in[0][i], in[1][i], in[2][i]};
        const double r[9] = {in[3][i], in[4][i], in[5][i], in[6][i], in[7][i],
                             in[8][i], in[9][i], in[10][i], in[11][i]};
        const Directions to = directions(p, r, arm, branch, ZERO);
        out->y[0][i] = to.sin_1;
        out->y[1][i] = to.sin_2;
        out->y[2][i] = to.sin_3;
        out->y[3][i] = to.sin_4;
        out->y[4][i] = to.sin_5;
        out->y[5][i] = to.sin_6;
        out->x[0][i] = to.cos_1;
        out->x[1][i] = to.cos_2;
        out->x[2][i] = to.cos_3;
        out->x[3][i] = to.cos_4;
        out->x[4][i] = to.cos_5;
        out->x[5][i] = to.cos_6;
        out->irregular[i] = to.free_1 | to.free_4 | (to.sin_6 != to.sin_6);
    }
}

/* Write the angles of one branch as directions y, x (6, n); return 0 where one depends on the row before or
   has none. */
EXPORT int64_t robot_directions(Floats position_mm, Floats rotation, Floats geometry, int64_t branch, Floats y,
                                Floats x) {
    const Arm arm = arm_of(geometry);
    const int64_t n = position_mm.rows;
    double in[12][TOGETHER] = {{0.0}};
    Columns out;
    int64_t irregular = 0;
    for (int64_t first = 0; first < n; first += TOGETHER) {
        const int64_t rows = least(TOGETHER, n - first);
        for (int64_t i = 0; i < rows; i++) {
            const double *p = &CELL(position_mm, first + i, 0);
            const double *r = &CELL(rotation, rotation.rows > 1 ? first + i : 0, 0);
            for (int k = 0; k < 3; k++)
                in[k][i] = p[k];
            for (int k = 0; k < 9; k++)
                in[3 + k][i] = r[k];
        }
        fill(in, arm, branch, &out);
        for (int64_t i = 0; i < rows; i++)
            irregular |= out.irregular[i];
        for (int j = 0; j < AXES; j++)
            for (int64_t i = 0; i < rows; i++) {
                CELL(y, j, first + i) = out.y[j][i];
                CELL(x, j, first + i) = out.x[j][i];
            }
    }
    return !irregular;
}

/* Write the turns (n, 6) of angles (6, n) that are nearest to the row before. */
EXPORT void robot_wind(Floats angle_rad, Floats q_reference_rad, Floats q_rad) {
    for (int64_t j = 0; j < AXES; j++) {
        double before = AT(q_reference_rad, j);
        for (int64_t i = 0; i < q_rad.rows; i++) {
            before = nearest_turn(CELL(angle_rad, j, i), before);
            CELL(q_rad, i, j) = before;
        }
    }
}

/* Write the angles of one branch row by row; free angles are those of the row before. */
EXPORT void robot_path(Floats position_mm, Floats rotation, Floats geometry, int64_t branch,
                       Floats q_reference_rad, Floats q_rad) {
    const Arm arm = arm_of(geometry);
    double before[AXES];
    for (int j = 0; j < AXES; j++)
        before[j] = AT(q_reference_rad, j);
    for (int64_t i = 0; i < position_mm.rows; i++) {
        const double *r = &CELL(rotation, rotation.rows > 1 ? i : 0, 0);
        const Given given = {cos(before[0]), sin(before[0]), cos(before[3]), sin(before[3])};
        const Directions to = directions(&CELL(position_mm, i, 0), r, arm, branch, given);
        const double y[AXES] = SINES(to), x[AXES] = COSINES(to);
        const bool reached = !isnan(y[5]); /* NaN as soon as any part of the pose is */
        for (int j = 0; j < AXES; j++) {
            const bool stays = (j == 0 && to.free_1) || (j == 3 && to.free_4);
            if (reached && !stays)
                before[j] = nearest_turn(atan2(y[j], x[j]), before[j]);
            CELL(q_rad, i, j) = reached ? before[j] : NAN;
        }
    }
}
