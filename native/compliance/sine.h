/* Sine and cosine without a branch or a call into a library: in a loop, vector instructions. */

#ifndef COMPLIANCE_SINE_H
#define COMPLIANCE_SINE_H

#include "core.h"

/* pi/2 in 30 bits, whose product with a small integer is exact (Cody and Waite 1980), and the rest of it. */
#define QUARTER_HIGH 0x1.921fb54p+0
#define QUARTER_LOW ((PI / 2 - QUARTER_HIGH) + 6.123233995736766e-17)

/* Sine and cosine by their series: to 2e-16 up to pi/4, to 1e-11 up to pi/2. */
static inline double sin_near_zero(double angle) {
    const double s = angle * angle;
    const double end = 1.0 / 39916800 - s * (1.0 / 6227020800.0 - s * (1.0 / 1307674368000.0));
    const double tail = 1.0 / 5040 - s * (1.0 / 362880 - s * end);
    return angle * (1.0 - s * (1.0 / 6 - s * (1.0 / 120 - s * tail)));
}

static inline double cos_near_zero(double angle) {
    const double s = angle * angle;
    const double end = 1.0 / 479001600 - s * (1.0 / 87178291200.0 - s * (1.0 / 20922789888000.0));
    const double tail = 1.0 / 40320 - s * (1.0 / 3628800 - s * end);
    return 1.0 - s * (1.0 / 2 - s * (1.0 / 24 - s * (1.0 / 720 - s * tail)));
}

/* Write sine and cosine, to 2e-16 for angles up to 1e5. */
static inline void sin_cos(double angle, double *sine, double *cosine) {
    const double quarters = floor(angle * (2.0 / PI) + 0.5);
    const double rest = angle - quarters * QUARTER_HIGH - quarters * QUARTER_LOW;
    const double quadrant = quarters - 4.0 * floor(quarters * 0.25);
    const double s = sin_near_zero(rest), c = cos_near_zero(rest);
    const bool is_odd = (quadrant == 1.0) | (quadrant == 3.0);
    const double of_y = is_odd ? c : s, of_x = is_odd ? s : c;
    *sine = quadrant >= 2.0 ? -of_y : of_y;
    *cosine = (quadrant == 1.0) | (quadrant == 2.0) ? -of_x : of_x;
}

#endif
