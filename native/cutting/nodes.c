/* Which samples of a motion are read, and which of its points a sweep has to begin and end at. */

#include "constants.h"
#include "core.h"

#define TURN_COSINE 0.984807753012208 /* of 10 degrees: a node where the path has turned by more */
#define OFF_MM 5e-4 /* by which points of a path may lie beside the sweep that takes them together */

enum { MOST_JOINED = 32 };

typedef struct {
    double x, y, z;
} Vector;

static Vector row_of(Floats table, int64_t i) {
    return (Vector){CELL(table, i, 0), CELL(table, i, 1), CELL(table, i, 2)};
}

static Vector from_to(Vector a, Vector b) { return (Vector){b.x - a.x, b.y - a.y, b.z - a.z}; }

static double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static double squared_cross(Vector a, Vector b) {
    return squared(a.y * b.z - a.z * b.y) + squared(a.z * b.x - a.x * b.z) + squared(a.x * b.y - a.y * b.x);
}

/* Tell whether something changes at sample i that nothing may be interpolated across. */
static bool changes(const Samples *samples, Bools rapid, int64_t i) {
    const Vector before = row_of(samples->direction, i - 1), here = row_of(samples->direction, i);
    return AT(samples->tool, i) != AT(samples->tool, i - 1) || AT(rapid, i) != AT(rapid, i - 1) ||
           dot(before, before) == 0.0 || dot(here, here) == 0.0;
}

/* Tell whether a tool begins or ceases to sink at sample i: its bottom cuts only while it does. */
static bool dips(const Samples *samples, int64_t i) {
    return (row_of(samples->direction, i - 1).z < 0.0) != (row_of(samples->direction, i).z < 0.0);
}

/* Tell whether the path has turned too much at sample i since a node. */
static bool has_turned(const Samples *samples, int64_t node, int64_t i) {
    return dot(row_of(samples->direction, i), row_of(samples->direction, node)) < TURN_COSINE;
}

/* Return which of two samples is the nearer to the multiple of a distance that the way passes between them, -1 if it
   passes none. */
static int64_t at_multiple(const Samples *samples, int64_t i, double apart_mm) {
    const double before_mm = AT(samples->way_mm, i - 1), here_mm = AT(samples->way_mm, i);
    const double multiple = floor(here_mm / apart_mm);
    if (multiple == floor(before_mm / apart_mm))
        return -1;
    return multiple * apart_mm - before_mm < here_mm - multiple * apart_mm ? i - 1 : i;
}

/* Mark the nodes of a motion: where the way passes multiples of apart_mm (a row a tool; 0 = every sample), so that the
   same ones are read however densely samples lie.

   Behind a turn or a change the engagement is a new one, and every sample is a node for new_mm (a row a tool): up to
   settled_mm, at a node at which the samples may be divided (NaN at others). The first sample is one, with its
   settled_mm given; the last one is a node where the motion `ends`. */
EXPORT void cutting_mark_nodes(const Samples *samples, Bools rapid, Floats apart_mm, Floats new_mm, int64_t ends,
                               Bools node, Floats settled_mm) {
    int64_t last = 0;
    double settled = AT(settled_mm, 0);
    for (int64_t i = 0; i < node.rows; i++)
        AT(node, i) = i == 0 || (ends && i == node.rows - 1);
    for (int64_t i = 1; i < node.rows; i++) {
        const int64_t tool = AT(samples->tool, i);
        const double way_mm = AT(samples->way_mm, i), apart = AT(apart_mm, tool);
        const bool is_new = changes(samples, rapid, i) || has_turned(samples, last, i);
        if (is_new) {
            settled = way_mm + AT(new_mm, tool);
            AT(node, i - 1) = 1;
        }
        if (dips(samples, i))
            AT(node, i - 1) = AT(node, i) = 1;
        const int64_t near = apart > 0.0 ? at_multiple(samples, i, apart) : i;
        if (near >= 0)
            AT(node, near) = 1;
        if (is_new || way_mm < settled)
            AT(node, i) = 1;
        if (AT(node, i) || near >= 0)
            last = AT(node, i) ? i : i - 1;
        AT(settled_mm, i) = last == i ? settled : NAN;
    }
}

/* Tell whether the points between two stay within `OFF_MM` of the straight line that joins them. */
static bool is_straight(Floats position_mm, int64_t from, int64_t to) {
    const Vector start = row_of(position_mm, from), chord = from_to(start, row_of(position_mm, to));
    const double length2 = dot(chord, chord);
    for (int64_t i = from + 1; i < to; i++) {
        const Vector here = from_to(start, row_of(position_mm, i));
        const double along = dot(here, chord);
        if (along < 0.0 || along > length2 || squared_cross(here, chord) > squared(OFF_MM) * length2)
            return false;
    }
    return true;
}

/* Mark the points between which a path is one sweep: straight, no longer than longest_mm (a row a tool), of few points.
   Every point of a rapid is one, as its findings name it, and of a slope that a cutter goes whose sweeps are exact
   only if they are short. */
EXPORT void cutting_mark_corners(Floats position_mm, Floats way_mm, Bools first, Bools rapid, Ints32 tool,
                                 Floats longest_mm, Bools is_short, Bools corner) {
    int64_t last = 0;
    for (int64_t i = 0; i < corner.rows; i++) {
        const bool is_end = i == 0 || i == corner.rows - 1 || AT(first, i) || AT(first, i + 1);
        bool is_corner = is_end || AT(rapid, i) || AT(rapid, i + 1) || i + 1 - last > MOST_JOINED;
        if (!is_corner) {
            const int64_t t = AT(tool, i);
            const bool slopes = CELL(position_mm, i + 1, 2) != CELL(position_mm, last, 2);
            is_corner = AT(way_mm, i + 1) - AT(way_mm, last) > AT(longest_mm, t) || (slopes && AT(is_short, t)) ||
                        !is_straight(position_mm, last, i + 1);
        }
        AT(corner, i) = is_corner;
        if (is_corner)
            last = i;
    }
}
