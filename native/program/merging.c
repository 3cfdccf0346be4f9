/* Which corners of a path straight moves may leave out; conditions and proof stand in program/merging.py. */

#include "core.h"

typedef struct {
    double x, y, z;
} Point;

static Point point_at(Floats position, int64_t i) {
    const double *at = &CELL(position, i, 0);
    return (Point){at[0], at[1], at[2]};
}

static Point minus(Point a, Point b) { return (Point){a.x - b.x, a.y - b.y, a.z - b.z}; }
static double dot(Point a, Point b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/* What a merged move has to keep to. */
typedef struct {
    double limit2, cos_turn;
} Bounds;

/* Return the square of the largest distance of the corners a + 1 up to b - 1 to the move from a to b, -1 where
   it may not replace the moves between.

   path: as programmed. written: as the program says it, where the new move begins and ends. */
static double off2(Floats path, Floats written, int64_t a, int64_t b, Bounds bounds) {
    const Point start = point_at(written, a), way = minus(point_at(written, b), start);
    const double length = sqrt(dot(way, way));
    if (length == 0.0)
        return -1.0;
    const Point unit = {way.x / length, way.y / length, way.z / length};
    double largest = 0.0;
    Point last = point_at(path, a);
    for (int64_t i = a + 1; i <= b; i++) {
        const Point here = point_at(path, i), step = minus(here, last);
        if (dot(step, unit) < bounds.cos_turn * sqrt(dot(step, step)))
            return -1.0;
        last = here;
        if (i == b)
            break;
        const Point from = minus(here, start);
        const double along = lesser(length, greater(0.0, dot(from, unit)));
        const Point off = {from.x - along * unit.x, from.y - along * unit.y, from.z - along * unit.z};
        const double distance2 = dot(off, off);
        if (distance2 > bounds.limit2)
            return -1.0;
        largest = greater(largest, distance2);
    }
    return largest;
}

/* Return a corner, as far as `end`, to which one move may go from corner a, and how far off it is.

   Twice as many moves are tried each time; where that fails, the corner is sought between the last two. */
static int64_t reached(Floats path, Floats written, int64_t a, int64_t end, Bounds bounds, double *largest) {
    int64_t good = a + 1;
    *largest = 0.0;
    while (good < end) {
        int64_t next = least(a + 2 * (good - a), end);
        double found = off2(path, written, a, next, bounds);
        if (found < 0.0) {
            while (next - good > 1) {
                const int64_t middle = good + (next - good) / 2;
                found = off2(path, written, a, middle, bounds);
                if (found < 0.0) {
                    next = middle;
                } else {
                    good = middle;
                    *largest = found;
                }
            }
            break;
        }
        good = next;
        *largest = found;
    }
    return good;
}

/* Mark in `keep` the corners that stay, among them the first and the last; write into `off` (mm), at the end of
   each new move, how far the corners that it leaves out are from it at most. */
EXPORT void program_merge(Floats path, Floats written, Bools may_go, double limit, double cos_turn, Bools keep,
                          Floats off) {
    const Bounds bounds = {limit * limit, cos_turn};
    const int64_t last = path.rows - 1;
    AT(keep, 0) = 1;
    for (int64_t a = 0; a < last;) {
        int64_t end = a + 1;
        while (end < last && AT(may_go, end))
            end++;
        while (a < end) {
            double largest;
            a = reached(path, written, a, end, bounds, &largest);
            AT(keep, a) = 1;
            AT(off, a) = sqrt(largest);
        }
    }
}
