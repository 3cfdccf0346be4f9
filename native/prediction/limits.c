/* The largest figures of a block's samples (prediction/limits.py). */

#include "constants.h"
#include "core.h"

#include <float.h>

enum { BLOCK = 128 };

/* The longest of the vectors so far, and the first row of that length. */
typedef struct {
    double square, length;
    int64_t row;
} Longest;

/* The squares are added as a processor adds three in one register: the first and the last, then the second. */
static inline double square_of(const double *v) { return squared(v[0]) + squared(v[2]) + squared(v[1]); }

static inline void hold(Longest *longest, double square, int64_t row) {
    if (!(square > longest->square))
        return;
    const double length = sqrt(square);
    longest->square = square;
    if (length > longest->length) {
        longest->length = length;
        longest->row = row;
    }
}

/* Return the first row of the longest vector (n, 3), which is as long as found[0]; one that is not a number
   counts as 0. found[1] is 1 where the squares of all are finite, else 0: 0 times another one is NaN. */
EXPORT int64_t prediction_longest(Floats vectors, Floats found) {
    Longest longest = {0.0, 0.0, 0};
    double none = 0.0;
    for (int64_t i = 0; i < vectors.rows; i++) {
        const double square = square_of(&CELL(vectors, i, 0));
        none += 0.0 * square;
        hold(&longest, square, i);
    }
    AT(found, 0) = lesser(longest.length, DBL_MAX);
    AT(found, 1) = none == 0.0;
    return longest.row;
}

/* What of the samples `prediction_loads` looks at. */
typedef struct {
    Floats force, moment, torque, peak;
    Ints32 tool, tools;
    Floats weight;
} Loaded;

/* Write the squares of forces on the tool and on the flange in a row, and whether they can be: apart from what is made
   of them, so that it is done for several at a time. */
static void squares(const Loaded *of, int64_t first, int64_t count, const double *weight, double most_N, double *cut2,
                    double *whole2, uint8_t *is_known) {
    for (int64_t i = 0; i < count; i++) {
        const double *f = &CELL(of->force, first + i, 0), *m = &CELL(of->moment, first + i, 0);
        const double none = 0.0 * m[0] + 0.0 * m[1] + 0.0 * m[2] + 0.0 * AT(of->torque, first + i) +
                            0.0 * AT(of->peak, first + i);
        cut2[i] = square_of(f);
        whole2[i] = squared(f[0] + weight[0]) + squared(f[1] + weight[1]) + squared(f[2] + weight[2]);
        is_known[i] = (none == 0.0) & (cut2[i] <= most_N * most_N);
    }
}

/* Return how many samples from `first` on, a block at most, have its tool, and write which of `tools` it is. */
static int64_t with_one_tool(const Loaded *of, int64_t first, int64_t *which) {
    int64_t after = first + 1;
    while (after < least(of->tool.rows, first + BLOCK) && AT(of->tool, after) == AT(of->tool, first))
        after++;
    for (*which = 0; AT(of->tools, *which) != AT(of->tool, first);)
        ++*which;
    return after - first;
}

/* Return the first sample that is not finite or loaded with more than most_N, -1 without. Else write the largest force on
   the tool, torque in N·m and force on the flange: the cut, or cut and weight; what both are there; and their rows.

   Forces and moments (n, 3), torque and peak (n), tools (n); `weight` (k, 3) on the flange with each of `tools` (k). */
EXPORT int64_t prediction_loads(Floats force, Floats moment, Floats torque, Floats peak, Ints32 tool, Ints32 tools,
                                Floats weight, double most_N, Floats found, Ints rows) {
    const Loaded of = {force, moment, torque, peak, tool, tools, weight};
    Longest cut = {0.0, 0.0, 0}, load = {0.0, 0.0, 0};
    double largest_Nm = -INFINITY, cut2[BLOCK], whole2[BLOCK];
    uint8_t is_known[BLOCK];
    for (int64_t first = 0, count; first < force.rows; first += count) {
        int64_t which;
        count = with_one_tool(&of, first, &which);
        squares(&of, first, count, &CELL(weight, which, 0), most_N, cut2, whole2, is_known);
        for (int64_t i = 0; i < count; i++) {
            const double torque_Nm = AT(torque, first + i) / U_NMM_PER_NM;
            if (!is_known[i])
                return first + i;
            hold(&cut, cut2[i], first + i);
            hold(&load, cut2[i] > 0.0 ? greater(cut2[i], whole2[i]) : 0.0, first + i);
            if (load.row == first + i) {
                AT(found, 3) = sqrt(cut2[i]);
                AT(found, 4) = sqrt(whole2[i]);
            }
            if (torque_Nm > largest_Nm) {
                largest_Nm = torque_Nm;
                AT(rows, 1) = first + i;
            }
        }
    }
    AT(found, 0) = cut.length;
    AT(found, 1) = largest_Nm;
    AT(found, 2) = load.length;
    AT(rows, 0) = cut.row;
    AT(rows, 2) = load.row;
    return -1;
}

/* Write the accelerations of all but the first and last `apart` positions (m, 3), from those so far before and behind;
   0 where the tool changes on the way. */
EXPORT void prediction_bends(Floats position_mm, Ints32 tool, int64_t apart, double seconds, Floats bends) {
    for (int64_t i = 0; i < bends.rows; i++) {
        const double *a = &CELL(position_mm, i, 0), *b = &CELL(position_mm, i + apart, 0),
                     *c = &CELL(position_mm, i + 2 * apart, 0);
        const double x = c[0] - 2.0 * b[0] + a[0], y = c[1] - 2.0 * b[1] + a[1], z = c[2] - 2.0 * b[2] + a[2];
        const double bend_mm = sqrt(x * x + z * z + y * y);
        AT(bends, i) = AT(tool, i) == AT(tool, i + 2 * apart) ? bend_mm / (seconds * seconds) : 0.0;
    }
}
