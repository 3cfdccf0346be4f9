/* A polyline through forces: which samples it needs (Douglas & Peucker 1973), how far the others are off. */

#include "core.h"

/* Length of path below which a chord is read by time alone. */
#define NO_WAY_MM 1e-6

enum { BLOCK = 128 };

typedef struct {
    Floats time, path, force;
} Samples;

/* The polyline between two knots, in the three components of the force. */
typedef struct {
    double time, path, force[3], seconds, way, change[3];
} Chord;

static Chord chord(double time_a, double time_b, double path_a, double path_b, const double *a,
                   const double *b) {
    Chord made = {.time = time_a, .path = path_a, .seconds = time_b - time_a, .way = path_b - path_a};
    for (int c = 0; c < 3; c++) {
        made.force[c] = a[c];
        made.change[c] = b[c] - a[c];
    }
    return made;
}

static inline double clipped(double share) { return lesser(greater(share, 0.0), 1.0); }

/* Return the square of the distance of a force from a share of the chord. */
static inline double distance2(const Chord *chord, double share, const double *force) {
    const double x = force[0] - chord->force[0] - share * chord->change[0];
    const double y = force[1] - chord->force[1] - share * chord->change[1];
    const double z = force[2] - chord->force[2] - share * chord->change[2];
    return x * x + y * y + z * z;
}

/* Return the square of a sample's distance to the chord, linear in time or in the path, the larger. */
static inline double off2(const Chord *chord, double time, double path, const double *force) {
    const double by_time = clipped((time - chord->time) / chord->seconds);
    const double by_path = chord->way > NO_WAY_MM ? clipped((path - chord->path) / chord->way) : by_time;
    return greater(distance2(chord, by_time, force), distance2(chord, by_path, force));
}

/* Write the off2 of some samples in a row; apart from its comparison, so that it is done four at a time. */
static void offs2(const Chord *to, const double *restrict time, const double *restrict path,
                  const double *restrict force, int64_t count, double *restrict off) {
    const Chord chord = *to;
    if (chord.way > NO_WAY_MM)
        for (int64_t i = 0; i < count; i++)
            off[i] = off2(&chord, time[i], path[i], force + 3 * i);
    else
        for (int64_t i = 0; i < count; i++)
            off[i] = distance2(&chord, clipped((time[i] - chord.time) / chord.seconds), force + 3 * i);
}

/* Return the sample from `first` up to `behind` that is farthest from the chord, -1 if none is beyond most2. */
static int64_t farthest(Samples samples, const Chord *chord, int64_t first, int64_t behind, double most2) {
    double off[BLOCK];
    int64_t at = -1;
    for (; first < behind; first += BLOCK) {
        const int64_t count = least(BLOCK, behind - first);
        const double *time = &AT(samples.time, first), *path = &AT(samples.path, first);
        offs2(chord, time, path, &CELL(samples.force, first, 0), count, off);
        for (int64_t i = 0; i < count; i++)
            if (off[i] > most2) {
                most2 = off[i];
                at = first + i;
            }
    }
    return at;
}

static Chord chord_between(Samples samples, int64_t a, int64_t b) {
    return chord(AT(samples.time, a), AT(samples.time, b), AT(samples.path, a), AT(samples.path, b),
                 &CELL(samples.force, a, 0), &CELL(samples.force, b, 0));
}

/* Return the farthest sample between a and b that is a cycle away from both, -1 if none is beyond `most2`. */
static int64_t split_at(Samples samples, int64_t a, int64_t b, double most2, double cycle_s) {
    const Floats time = samples.time;
    int64_t first = a + 1, behind = b;
    while (first < behind && AT(time, first) - AT(time, a) < cycle_s)
        first++;
    while (first < behind && AT(time, b) - AT(time, behind - 1) < cycle_s)
        behind--;
    const Chord between = chord_between(samples, a, b);
    return farthest(samples, &between, first, behind, most2);
}

/* Mark the times that are at least `least_s` after the last marked one. */
EXPORT void pilot_spaced(Floats time, double least_s, Bools marked) {
    double last = -INFINITY;
    for (int64_t i = 0; i < time.rows; i++) {
        AT(marked, i) = AT(time, i) - last >= least_s;
        if (AT(marked, i))
            last = AT(time, i);
    }
}

/* Mark the further samples that the polyline needs between the kept ones (`rows`).

   The right ends of the open spans wait on a stack, as long as the samples are many. */
EXPORT void pilot_thin(Floats time, Floats path, Floats force, Ints rows, double tolerance, double least_s,
                       Ints ends, Bools kept) {
    const Samples samples = {time, path, force};
    for (int64_t k = 0; k + 1 < rows.rows; k++) {
        int64_t a = AT(rows, k), depth = 1;
        AT(ends, 0) = AT(rows, k + 1);
        while (depth > 0) {
            const int64_t b = AT(ends, depth - 1);
            const int64_t at = split_at(samples, a, b, tolerance * tolerance, least_s);
            if (at >= 0) {
                AT(kept, at) = true;
                AT(ends, depth) = at;
                depth++;
            } else {
                a = b;
                depth--;
            }
        }
    }
}

/* Write the distance of each sample to the polyline through knots at `rows`; outside it the pilot is zero. */
EXPORT void pilot_errors(Floats time, Floats path, Floats force, Ints rows, Floats knot_time,
                         Floats knot_path, Floats knot_force, Floats error) {
    static const double NO_FORCE[3] = {0.0, 0.0, 0.0};
    const Samples knots = {knot_time, knot_path, knot_force};
    const int64_t last = rows.rows - 1;
    int64_t k = -1;
    Chord between = {0};
    for (int64_t i = 0; i < time.rows; i++) {
        const double *here = &CELL(force, i, 0);
        for (; k < last && AT(rows, k + 1) <= i; k++)
            if (k + 1 < last)
                between = chord_between(knots, k + 1, k + 2);
        if (k >= 0 && k < last)
            AT(error, i) = sqrt(off2(&between, AT(time, i), AT(path, i), here));
        else {
            const double *pilot = k >= 0 && AT(rows, last) == i ? &CELL(knot_force, last, 0) : NO_FORCE;
            AT(error, i) =
                sqrt(squared(here[0] - pilot[0]) + squared(here[1] - pilot[1]) + squared(here[2] - pilot[2]));
        }
    }
}
