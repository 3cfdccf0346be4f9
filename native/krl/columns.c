/* From statements in the order of execution to columns of motions: what is in force at each. */

#include "constants.h"

static inline bool is_motion_kind(uint8_t kind) {
    return kind == W_KIND_LIN || kind == W_KIND_PTP || kind == W_KIND_PTP_AXES || kind == W_KIND_CIRC ||
           kind == W_KIND_SPL;
}

/* Take over a setting of the path speed in m/s or of the approximation in mm; one that has no number is none.
   Behind a statement that may have changed them both are unknown. */
static inline void set(uint8_t kind, double number, double *speed_mm_s, double *cdis_mm) {
    if (kind == W_KIND_FORGETS)
        *speed_mm_s = *cdis_mm = NAN;
    if (isnan(number))
        return;
    if (kind == W_KIND_VEL_CP)
        *speed_mm_s = number * U_MM_PER_M;
    else if (kind == W_KIND_APO_CDIS)
        *cdis_mm = number;
}

/* Go on over statements: settings change what is in force, speed and approximation; counts of motions and of
   other statements are raised.

   number: the first number of each statement that is no motion, from the first of the program on. */
EXPORT void krl_pass(Bytes kind, Floats number, Floats in_force, Ints motions_others) {
    int64_t *motions = &AT(motions_others, 0), *others = &AT(motions_others, 1);
    for (int64_t row = 0; row < kind.rows; row++) {
        if (is_motion_kind(AT(kind, row)))
            (*motions)++;
        else
            set(AT(kind, row), AT(number, (*others)++), &AT(in_force, 0), &AT(in_force, 1));
    }
}

/* Write a row for each motion among statements: whether it is a PTP, speed, approximation and line.

   number: the first number of each statement that is no motion. in_force: speed and approximation before
   them. */
EXPORT void krl_motions(Bytes kind, Bytes blend, Ints32 line, Floats number, Floats in_force, Bools ptp,
                        Floats speed_mm_s, Floats cdis_mm, Ints32 motion_line) {
    double speed = AT(in_force, 0), cdis = AT(in_force, 1);
    int64_t motion = 0, other = 0;
    for (int64_t row = 0; row < kind.rows; row++) {
        if (!is_motion_kind(AT(kind, row))) {
            set(AT(kind, row), AT(number, other++), &speed, &cdis);
            continue;
        }
        const bool is_ptp = AT(kind, row) == W_KIND_PTP || AT(kind, row) == W_KIND_PTP_AXES;
        AT(ptp, motion) = is_ptp;
        AT(speed_mm_s, motion) = is_ptp ? NAN : speed;
        AT(cdis_mm, motion) = AT(blend, row) == 1 ? cdis : 0.0;
        AT(motion_line, motion) = AT(line, row);
        motion++;
    }
}
