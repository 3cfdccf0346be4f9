/* The largest chip of a sample, over its arcs of engagement. */

#include "cutting/sweep.h"

/* Return the largest sine over an arc of less than a turn. */
static double largest_sine(double start, double end) {
    const double crest = start + (0.25 * TURN - start - TURN * floor((0.25 * TURN - start) / TURN));
    return crest <= end ? 1.0 : greater(sin(start), sin(end));
}

/* Write the largest chip thickness in mm, `out` (n), on a cylinder's edge and on the bottom; 0 without an arc.

   phi_rad (n, 2k) arcs, NaN pairs are none; f_z_mm, ramp_rad (n). */
EXPORT void cutting_largest_chips(Floats phi_rad, Floats f_z_mm, Floats ramp_rad, Floats out) {
    for (int64_t row = 0; row < out.rows; row++) {
        double sine = -INFINITY;
        for (int64_t arc = 0; arc + 1 < phi_rad.columns; arc += 2) {
            const double start = CELL(phi_rad, row, arc), end = CELL(phi_rad, row, arc + 1);
            if (end > start)
                sine = greater(sine, largest_sine(start, end));
        }
        AT(out, row) = 0.0;
        if (sine == -INFINITY)
            continue;
        const double gamma = AT(ramp_rad, row), side = greater(sine, 0.0) * cos(gamma);
        AT(out, row) = AT(f_z_mm, row) * greater(greater(side, sin(gamma)), 0.0);
    }
}
