/* When the motions of a program run along a predicted Motion (krl/windows.py). */

#include "core.h"

/* The squares are added as in compliance_directions: the first and the last, then the second. */
static double way(Floats start_mm, Floats end_mm, int64_t i) {
    const double *a = &CELL(start_mm, i, 0), *b = &CELL(end_mm, i, 0);
    return sqrt(squared(b[0] - a[0]) + squared(b[2] - a[2]) + squared(b[1] - a[1]));
}

/* Write the lengths (n,) of the straight part of each move, and of its parts in corners at start and end.
   A vertex where the move goes straight on has no corner: what is approximated there is its CDIS. */
EXPORT void krl_straight(Floats start_mm, Floats end_mm, Floats blend_mm, Floats scale, Bools stop,
                         Floats cdis_mm, Floats straight_mm, Floats head_mm, Floats tail_mm) {
    const int64_t last = start_mm.rows - 1;
    double head = 0.0, length = last >= 0 ? way(start_mm, end_mm, 0) : 0.0;
    for (int64_t i = 0; i <= last; i++) {
        double next = 0.0, tail = 0.0, next_head = 0.0;
        if (i < last) {
            const double blend = AT(blend_mm, i);
            next = way(start_mm, end_mm, i + 1);
            if (blend > 0) {
                tail = blend * AT(scale, i);
                next_head = blend * AT(scale, i + 1);
            } else if (!AT(stop, i))
                tail = next_head = lesser(AT(cdis_mm, i), lesser(length, next) / 2.0);
        }
        AT(straight_mm, i) = greater(length - head - tail, 0.0);
        AT(head_mm, i) = head;
        AT(tail_mm, i) = tail;
        length = next;
        head = next_head;
    }
}

typedef struct {
    Floats time, path, speed, acceleration;
    double jerk;
} Clock;

/* Return how long before a sample the motion began: v = J·t²/2 at first, then v = a·(t - a/(2·J)). */
static double from_rest(Clock clock, int64_t i) {
    const double v = AT(clock.speed, i), a = AT(clock.acceleration, i);
    return a > 0 ? v / a + a / (2.0 * clock.jerk) : 0.0;
}

/* Return the instant of a path between two samples, at an acceleration that is constant in between. */
static double between(Clock clock, double path, int64_t before, int64_t after) {
    const double begin_s = AT(clock.time, before), way = AT(clock.path, after) - AT(clock.path, before);
    const double part = lesser(greater(path - AT(clock.path, before), 0.0), way);
    const double v0 = AT(clock.speed, before), v1 = AT(clock.speed, after);
    double share = 1.0;
    if (way > 0 && v0 + v1 > 0) {
        const double v = sqrt(greater(v0 * v0 + (v1 * v1 - v0 * v0) * part / way, 0.0));
        share = part / way * (v0 + v1) / (v0 + v > 0 ? v0 + v : 1.0);
    }
    return begin_s + lesser(greater(share, 0.0), 1.0) * (AT(clock.time, after) - begin_s);
}

/* Write the instants (n,) at which a path, at_mm, is reached or, with `leaves`, left; where the robot rests
   there the motion ends or begins between two samples. The paths rise nearly always, so the search goes on
   from the sample of the one before. `slack_mm`: how far off a sample may be and still count as there. */
EXPORT void krl_instants(Floats time, Floats path, Floats speed, Floats acceleration, double jerk,
                         Floats at_mm, Bools rests, int64_t leaves, double slack_mm, Floats instant_s) {
    const Clock clock = {time, path, speed, acceleration, jerk};
    const int64_t count = time.rows;
    int64_t passed = 0;
    for (int64_t i = 0; i < at_mm.rows; i++) {
        const double at = AT(at_mm, i), edge = leaves ? at + slack_mm : at - slack_mm;
        while (passed < count && (leaves ? AT(path, passed) <= edge : AT(path, passed) < edge))
            passed++;
        while (passed > 0 && (leaves ? AT(path, passed - 1) > edge : AT(path, passed - 1) >= edge))
            passed--;
        const int64_t after = least(most(passed, 1), count - 1), before = most(after - 1, 0);
        if (!AT(rests, i))
            AT(instant_s, i) = between(clock, at, before, after);
        else if (leaves)
            AT(instant_s, i) = greater(AT(time, after) - from_rest(clock, after), AT(time, before));
        else
            AT(instant_s, i) = lesser(AT(time, before) + from_rest(clock, before), AT(time, after));
    }
}
