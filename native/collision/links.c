/* Where the bodies of the arm are (robot/kinematics.py, eq. 1, link by link). */

#include "collision/links.h"

enum { LINKS = AXES + 1 };

/* A frame: the rotation row by row, then the origin. */
typedef struct {
    double turn[9], origin[3];
} LinkFrame;

/* Go on by a translation along the frame's own axes. */
static void shift(LinkFrame *frame, double x, double y, double z) {
    for (int row = 0; row < 3; row++)
        frame->origin[row] += frame->turn[3 * row] * x + frame->turn[3 * row + 1] * y + frame->turn[3 * row + 2] * z;
}

/* Go on by a turn in the plane of two of the frame's own axes, from the first to the second. */
static void turn(LinkFrame *frame, int from, int to, double angle) {
    const double cosine = cos(angle), sine = sin(angle);
    for (int row = 0; row < 3; row++) {
        double *a = &frame->turn[3 * row + from], *b = &frame->turn[3 * row + to];
        const double first = *a, second = *b;
        *a = cosine * first + sine * second;
        *b = cosine * second - sine * first;
    }
}

static void link_frames(const double *q, const Arm *arm, LinkFrame *links) {
    enum { X, Y, Z };
    LinkFrame frame = {{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}, {q[AXES], q[AXES + 1], q[AXES + 2]}};
    links[0] = frame;
    turn(&frame, X, Y, -q[0]);
    links[1] = frame;
    shift(&frame, arm->a1, 0.0, arm->c1);
    turn(&frame, Z, X, q[1]);
    links[2] = frame;
    shift(&frame, arm->c2, 0.0, 0.0);
    turn(&frame, Z, X, q[2]);
    links[3] = frame;
    shift(&frame, arm->c3, 0.0, -arm->a2);
    turn(&frame, Y, Z, -q[3]);
    links[4] = frame;
    turn(&frame, Z, X, q[4]);
    links[5] = frame;
    turn(&frame, Y, Z, -q[5]);
    shift(&frame, arm->c4, 0.0, 0.0);
    turn(&frame, Z, X, PI / 2.0);
    links[6] = frame;
}

static void place(const LinkFrame *links, const Bodies *bodies, int64_t body, double *ends) {
    for (int end = 0; end < 2; end++) {
        const LinkFrame *frame = &links[CELL(bodies->link, body, end)];
        for (int row = 0; row < 3; row++)
            ends[3 * end + row] =
                frame->origin[row] + dot3(&frame->turn[3 * row], &CELL(bodies->ends_mm, body, 3 * end));
    }
}

void place_bodies(const double *stance, const Arm *arm, const Bodies *bodies, Ends *ends) {
    LinkFrame links[LINKS];
    link_frames(stance, arm, links);
    for (int64_t body = 0; body < bodies->link.rows; body++)
        place(links, bodies, body, ends[body]);
}

void place_two(const double *stance, const Arm *arm, const Bodies *bodies, const int32_t *pair, Ends *ends) {
    LinkFrame links[LINKS];
    link_frames(stance, arm, links);
    place(links, bodies, pair[0], ends[0]);
    if (pair[1] < 0)
        place(links, bodies, pair[2], ends[1]);
}

/* Write the ends (n, b, 6) of all bodies in the robot root, for angles (n, 6). */
EXPORT void collision_bodies(Floats q_rad, Floats geometry, const Bodies *bodies, Floats ends_mm) {
    const Arm arm = arm_of(geometry);
    const int64_t count = bodies->link.rows;
    for (int64_t i = 0; i < q_rad.rows; i++) {
        Ends ends[SCENE_MOST_BODIES];
        Stance stance = {0.0};
        for (int j = 0; j < AXES; j++)
            stance[j] = CELL(q_rad, i, j);
        place_bodies(stance, &arm, bodies, ends);
        for (int64_t k = 0; k < 6 * count; k++)
            CELL(ends_mm, i, k) = ends[k / 6][k % 6];
    }
}
