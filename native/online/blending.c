/* Blends the measured force with the pilot's estimate (online/compensator.py; Haehn & Weigold 2020, section 2.3). */

#include "constants.h"
#include "core.h"

/* What decides about the blend: cycle and time of blending, threshold, and how long an estimate that does not
   change may stay beyond it. */
typedef struct {
    double cycle_s, threshold_N, blend_s, patience_s;
} Blending;

/* Follow how long a steady estimate has been beyond the threshold; return whether it is beyond it. */
static bool watch(const double *measured, const double *estimate, bool is_known, Blending by, double *state) {
    double *anchor = state + BLENDING_ANCHOR, difference_2 = 0.0, moved_2 = 0.0;
    for (int c = 0; c < 3; c++) {
        difference_2 += squared(estimate[c] - measured[c]);
        moved_2 += squared(estimate[c] - anchor[c]);
    }
    const bool is_beyond = is_known && difference_2 >= by.threshold_N * by.threshold_N;
    if (!is_beyond || moved_2 > squared(BLENDING_STEADY_SHARE * by.threshold_N)) {
        state[BLENDING_BEYOND_S] = 0.0;
        for (int c = 0; c < 3; c++)
            anchor[c] = estimate[c];
    } else {
        state[BLENDING_BEYOND_S] += by.cycle_s;
    }
    if (!is_beyond)
        state[BLENDING_DISTRUSTED] = 0.0;
    else if (state[BLENDING_BEYOND_S] > by.patience_s)
        state[BLENDING_DISTRUSTED] = 1.0;
    return is_beyond;
}

/* Write the load (n, 6) of measured loads (n, 6) and estimates (n, 3), and how it was blended. */
EXPORT void online_blend(Floats measured, Floats estimate_N, Bools known, Floats state, double cycle_s,
                         double threshold_N, double blend_s, double patience_s, Floats load, Floats weight,
                         Bools distrusted) {
    const Blending by = {cycle_s, threshold_N, blend_s, patience_s};
    double *own = &AT(state, 0), *last = &AT(state, BLENDING_LAST);
    const double step = cycle_s / blend_s;
    for (int64_t i = 0; i < measured.rows; i++) {
        const double *force = &CELL(measured, i, 0), *estimate = &CELL(estimate_N, i, 0);
        const bool is_beyond = watch(force, estimate, AT(known, i), by, own);
        const bool towards = is_beyond && own[BLENDING_DISTRUSTED] == 0.0;
        const double before = own[BLENDING_WEIGHT];
        const double w = towards ? lesser(before + step, 1.0) : greater(before - step, 0.0);
        own[BLENDING_WEIGHT] = w;
        for (int c = 0; c < 3; c++) {
            if (AT(known, i))
                last[c] = estimate[c];
            CELL(load, i, c) = (1.0 - w) * force[c] + w * last[c];
            CELL(load, i, c + 3) = (1.0 - w) * force[c + 3];
        }
        AT(weight, i) = w;
        AT(distrusted, i) = own[BLENDING_DISTRUSTED] > 0.0;
    }
}
