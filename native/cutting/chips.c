/* Cuts outside the range of the coefficients (cutting/findings.py): a loop over samples. */

#include "constants.h"
#include "cutting/sweep.h"

enum { CHIP_THIN, CHIP_THICK, CHIP_UNMEASURED, CHIP_KINDS };

/* Return the largest sine over an arc of less than a turn. */
static double largest_sine(double start, double end) {
    const double crest = start + (0.25 * TURN - start - TURN * floor((0.25 * TURN - start) / TURN));
    return crest <= end ? 1.0 : greater(sin(start), sin(end));
}

/* Return the largest chip thickness in mm on a cylinder's edge and on the bottom over arcs, NaN pairs are none; 0
   without. */
static double largest_chip(const double *ends, int64_t count, double f_z_mm, double ramp_rad) {
    double sine = -INFINITY;
    for (int64_t arc = 0; arc + 1 < count; arc += 2)
        if (ends[arc + 1] > ends[arc])
            sine = greater(sine, largest_sine(ends[arc], ends[arc + 1]));
    if (sine == -INFINITY)
        return 0.0;
    return f_z_mm * greater(greater(greater(sine, 0.0) * cos(ramp_rad), sin(ramp_rad)), 0.0);
}

/* Tell whether the largest chip is surely neither thin nor thick, without a sine: from 0 to pi, sin x >= x·(1 - x/pi), and
   cos x >= 1 - x²/2. */
static bool is_usual(const double *ends, int64_t count, double f_z_mm, double ramp_rad) {
    double share = 0.0;
    for (int64_t end = 1; end < count; end += 2)
        if (ends[end] > ends[end - 1])
            share = greater(share, greater(ends[end - 1] * (PI - ends[end - 1]), ends[end] * (PI - ends[end])) / PI);
    const double least_mm = f_z_mm * share * (1.0 - 0.5 * squared(ramp_rad));
    return f_z_mm <= LAW_THICK_CHIP_MM && least_mm > 1.001 * LAW_THIN_CHIP_MM;
}

/* Tell whether a value is not between those that were measured, and widen what is known of such values. */
static bool is_beyond(double value, const double *measured, double *beyond) {
    if (!(value < measured[0] || value > measured[1]))
        return false;
    beyond[0] = lesser(beyond[0], value);
    beyond[1] = greater(beyond[1], value);
    return true;
}

/* Count the samples that cut, and of them those with thin chips, thick ones and unmeasured ones, with the line of the
   first of each.

   phi_rad (n, 2k) arcs; `measured` and `beyond` (2, 2): from and to, of f_z_mm and a_p_mm; `counts` (4), `first` (3). */
EXPORT void cutting_count_chips(Bools engaged, Floats phi_rad, Floats f_z_mm, Floats ramp_rad, Floats a_p_mm, Ints32 line,
                                Floats measured, Floats beyond, Ints counts, Ints first) {
    for (int64_t row = 0; row < engaged.rows; row++) {
        const double f_z = AT(f_z_mm, row);
        if (!AT(engaged, row) || !(f_z > 0.0))
            continue;
        const double *ends = &CELL(phi_rad, row, 0), ramp = AT(ramp_rad, row);
        const bool usual = is_usual(ends, phi_rad.columns, f_z, ramp);
        const double chip = usual ? LAW_THIN_CHIP_MM : largest_chip(ends, phi_rad.columns, f_z, ramp);
        const bool fast = is_beyond(f_z, &CELL(measured, 0, 0), &CELL(beyond, 0, 0));
        const bool deep = is_beyond(AT(a_p_mm, row), &CELL(measured, 1, 0), &CELL(beyond, 1, 0));
        const bool is_wrong[CHIP_KINDS] = {chip < LAW_THIN_CHIP_MM, chip > LAW_THICK_CHIP_MM, fast || deep};
        AT(counts, CHIP_KINDS)++;
        for (int kind = 0; kind < CHIP_KINDS; kind++)
            if (is_wrong[kind] && AT(counts, kind)++ == 0)
                AT(first, kind) = AT(line, row);
    }
}
