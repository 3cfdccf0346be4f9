/* The limits of every correction (sum, rate, step) and the PID controller before them (online/limits.py). */

#include "constants.h"
#include "core.h"

enum { WIDEST = 6 };

/* State and constants of the controller, as in limits.py. */
typedef struct {
    Floats sent, integral, before, most, step, gains;
    double cycle_s;
    bool is_vector;
} Controller;

/* Scale a correction into its bounds, keeping its direction; of a vector its length is bounded. */
static void shrink(double *u, Floats most, bool is_vector) {
    double share = 0.0;
    for (int64_t c = 0; c < most.rows; c++) {
        const double own = fabs(u[c]) / AT(most, c);
        share = is_vector ? share + own * own : greater(share, own);
    }
    share = is_vector ? sqrt(share) : share;
    for (int64_t c = 0; share > 1.0 && c < most.rows; c++)
        u[c] /= share;
}

EXPORT void online_shrink(Floats change, Floats most, int64_t is_vector) {
    shrink(&AT(change, 0), most, is_vector);
}

static bool is_valid(const double *wanted, int64_t width) {
    for (int64_t c = 0; c < width; c++)
        if (!(fabs(wanted[c]) < LIMITS_NO_CORRECTION)) /* a NaN too */
            return false;
    return true;
}

/* Go one step towards a wanted correction. */
static void advance(const double *wanted, Controller by) {
    const int64_t width = by.most.rows;
    double r[WIDEST], u[WIDEST];
    for (int64_t c = 0; c < width; c++)
        r[INSIDE(c, WIDEST)] = wanted[c];
    shrink(r, by.most, by.is_vector);
    for (int64_t c = 0; c < width; c++) {
        const double before = AT(by.before, c), slope = before == before ? (r[c] - before) / by.cycle_s : 0.0;
        const double *gains = &CELL(by.gains, c, 0);
        u[c] = gains[0] * r[c] + gains[1] * AT(by.integral, c) + gains[2] * slope;
        AT(by.before, c) = r[c];
    }
    shrink(u, by.most, by.is_vector);
    for (int64_t c = 0; c < width; c++)
        u[c] -= AT(by.sent, c);
    shrink(u, by.step, by.is_vector);
    for (int64_t c = 0; c < width; c++) {
        AT(by.sent, c) += u[c];
        AT(by.integral, c) += (r[c] - AT(by.sent, c)) * by.cycle_s;
    }
}

/* Write the corrections (n, w) that are sent for the wanted ones (n, w). */
EXPORT void online_limit(Floats wanted, Bools held, Floats sent, Floats integral, Floats before, Floats most,
                         Floats step, int64_t is_vector, Floats gains, double cycle_s, Floats corrections) {
    const Controller by = {sent, integral, before, most, step, gains, cycle_s, is_vector};
    for (int64_t i = 0; i < wanted.rows; i++) {
        if (!AT(held, i) && is_valid(&CELL(wanted, i, 0), most.rows))
            advance(&CELL(wanted, i, 0), by);
        else
            for (int64_t c = 0; c < most.rows; c++)
                AT(before, c) = NAN; /* no derivative over the gap */
        for (int64_t c = 0; c < most.rows; c++)
            CELL(corrections, i, c) = AT(sent, c);
    }
}
