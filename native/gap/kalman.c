/* Innovations of an autoregressive process plus parts that forget exponentially (gap/noise/short.py).

   The transition F is in observer form: row i < order has a_i in column 0 and 1 in column i + 1, a slow part has
   only its pole, on the diagonal. So a product with F takes one or two terms a number. Seen is the first state
   and every slow part. */

#include "core.h"

/* Relative change of the innovations' variance from which the gain is taken as steady. */
static const double SETTLED = 1e-13;
static const double LEAST_VARIANCE = 1e-300;

/* Return row i of F times a column, whose numbers are a stride apart. */
static inline double carried(Floats a, Floats poles, int64_t i, const double *column, int64_t stride) {
    if (i >= a.rows)
        return AT(poles, i - a.rows) * column[i * stride];
    const double first = AT(a, i) * column[0];
    return i + 1 < a.rows ? first + column[(i + 1) * stride] : first;
}

/* Return what is seen of states. */
static inline double seen(const double *state, int64_t order, int64_t count) {
    double total = state[0];
    for (int64_t i = order; i < count; i++)
        total += state[i];
    return total;
}

/* Replace the variance P (m, m) by F·P·Fᵀ + Q - s·k·kᵀ, made symmetric. */
static void predict(Floats a, Floats poles, Floats p, Floats q, double s, const double *k, Floats work) {
    const int64_t m = p.rows;
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j < m; j++)
            CELL(work, i, j) = carried(a, poles, i, &CELL(p, 0, j), m);
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j < m; j++)
            CELL(p, i, j) = carried(a, poles, j, &CELL(work, i, 0), 1) + CELL(q, i, j) - s * (k[i] * k[j]);
    for (int64_t i = 0; i < m; i++)
        for (int64_t j = 0; j <= i; j++)
            CELL(p, i, j) = CELL(p, j, i) = 0.5 * (CELL(p, i, j) + CELL(p, j, i));
}

/* Write gains (n, m) and variances (n) of the innovations until they are steady; return of how many rows.

   p: the variance (m, m) of the states before the first row, which is overwritten; q: what each row adds;
   work: (m + 1, m). */
EXPORT int64_t gap_gains(Floats a, Floats poles, Floats p, Floats q, Floats work, Floats gains, Floats variances) {
    const int64_t m = p.rows;
    double *covariance = &CELL(work, m, 0); /* of the states with what is seen */
    for (int64_t t = 0; t < variances.rows; t++) {
        for (int64_t i = 0; i < m; i++)
            covariance[i] = seen(&CELL(p, i, 0), a.rows, m);
        const double s = seen(covariance, a.rows, m) + LEAST_VARIANCE;
        for (int64_t i = 0; i < m; i++)
            CELL(gains, t, i) = carried(a, poles, i, covariance, 1) / s;
        AT(variances, t) = s;
        if (t > m && fabs(s - AT(variances, t - 1)) <= SETTLED * s)
            return t + 1;
        predict(a, poles, p, q, s, &CELL(gains, t, 0), work);
    }
    return variances.rows;
}

/* States of a filter: u (order + 1, c), the last of which stays 0, v (slow, c); of a row the innovation (c) and
   what u's first state was (c). */
typedef struct {
    Floats u, v;
    double *innovation, *first;
} Filter;

static void clear(Floats state) {
    for (int64_t i = 0; i < state.rows * state.columns; i++)
        AT(state, i) = 0.0;
}

/* Take one row (c): its innovation, and the states after it. Columns are innermost: vector instructions. */
static void take(const double *restrict row, Floats a, Floats poles, const double *gains, Filter by) {
    const int64_t columns = by.u.columns;
    double *restrict e = by.innovation, *restrict first = by.first, *restrict state = &CELL(by.u, 0, 0);
    for (int64_t c = 0; c < columns; c++) {
        e[c] = row[c] - state[c];
        first[c] = state[c];
    }
    for (int64_t i = 0; i < poles.rows; i++) {
        const double *restrict v = &CELL(by.v, i, 0);
        for (int64_t c = 0; c < columns; c++)
            e[c] -= v[c];
    }
    for (int64_t j = 0; j < a.rows; j++) {
        const double back = AT(a, j), gain = gains[j];
        double *restrict u = &CELL(by.u, j, 0);
        const double *restrict next = &CELL(by.u, j + 1, 0);
        for (int64_t c = 0; c < columns; c++)
            u[c] = back * first[c] + next[c] + gain * e[c];
    }
    for (int64_t i = 0; i < poles.rows; i++) {
        const double pole = AT(poles, i), gain = gains[a.rows + i];
        double *restrict v = &CELL(by.v, i, 0);
        for (int64_t c = 0; c < columns; c++)
            v[c] = pole * v[c] + gain * e[c];
    }
}

/* Write the innovations of columns (n, c) times their weights, each segment (from, to) by itself; rows beyond
   the gains (g, m) and weights (g) have the last of them. u, v: states of `Filter`; of_row: (2, c). */
EXPORT void gap_innovations(Floats values, Ints segments, Floats a, Floats poles, Floats gains, Floats weights,
                            Floats u, Floats v, Floats of_row, Floats out) {
    const Filter by = {u, v, &CELL(of_row, 0, 0), &CELL(of_row, 1, 0)};
    for (int64_t segment = 0; segment < segments.rows; segment++) {
        const int64_t first = CELL(segments, segment, 0), end = CELL(segments, segment, 1);
        clear(u);
        clear(v);
        for (int64_t t = first; t < end; t++) {
            const int64_t at = least(t - first, weights.rows - 1);
            const double weight = AT(weights, at);
            double *restrict white = &CELL(out, t, 0);
            take(&CELL(values, t, 0), a, poles, &CELL(gains, at, 0), by);
            for (int64_t c = 0; c < out.columns; c++)
                white[c] = by.innovation[c] * weight;
        }
    }
}
