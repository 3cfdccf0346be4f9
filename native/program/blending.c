/* CDIS at each corner, from a tolerance or the cell's; formula and source stand in program/blending.py. */

#include "core.h"

/* Part by which rounding may exceed a tolerance, and the least cosine that a corner is divided by. */
#define ROUNDING 1e-12

/* The lines that meet at a point: the squares of their lengths, and their product as vectors. */
typedef struct {
    double before2, after2, dot;
} Corner;

static Corner corner_at(Floats position, int64_t i) {
    const double *here = &CELL(position, i, 0);
    const double *last = &CELL(position, i - 1, 0), *next = &CELL(position, i + 1, 0);
    Corner corner = {0.0, 0.0, 0.0};
    for (int c = 0; c < 3; c++) {
        const double a = here[c] - last[c], b = next[c] - here[c];
        corner.dot += a * b;
        corner.before2 += a * a;
        corner.after2 += b * b;
    }
    return corner;
}

/* Return the largest level that a tolerance allows, none beyond what half the line can use. */
static double level_within(Floats levels, double largest, double half_line) {
    double level = 0.0;
    for (int64_t k = 0; k < levels.rows; k++) {
        if (AT(levels, k) > largest * (1.0 + ROUNDING) || level >= half_line)
            break;
        level = AT(levels, k);
    }
    return level;
}

/* Write the CDIS in mm of the corners `first` up to `behind`; the first and the last of all positions are
   none.

   tolerance: NaN where the cell's cdis applies. reversal_cos: cosine of the interior angle of a reversal. */
EXPORT void program_corner_cdis(Floats position, Floats tolerance, double cdis, Bools exact, Floats levels,
                                double reversal_cos, int64_t first, int64_t behind, Floats result) {
    double current = 0.0;
    for (int64_t i = first; i < behind; i++) {
        AT(result, i) = 0.0;
        if (AT(exact, i) || i == 0 || i == position.rows - 1)
            continue;
        const Corner corner = corner_at(position, i);
        if (corner.before2 == 0.0 || corner.after2 == 0.0) {
            AT(result, i) = current > 0.0 ? current : cdis;
            continue;
        }
        /* alpha = 180° - turn */
        const double cos_turn = lesser(1.0, greater(-1.0, corner.dot / sqrt(corner.before2 * corner.after2)));
        if (cos_turn < -reversal_cos)
            continue;
        if (isnan(AT(tolerance, i))) {
            AT(result, i) = cdis;
            continue;
        }
        const double cos_half = sqrt(greater(0.0, 0.5 * (1.0 - cos_turn))); /* cos(alpha/2) */
        const double widest = AT(levels, levels.rows - 1);
        const double largest = cos_half < ROUNDING ? widest : 2.0 * AT(tolerance, i) / cos_half;
        const double half_line = 0.5 * sqrt(lesser(corner.before2, corner.after2));
        const double level = level_within(levels, largest, half_line);
        if (!(current <= largest && current > 0.0 && current >= lesser(level, half_line)))
            current = level;
        AT(result, i) = current;
    }
}
