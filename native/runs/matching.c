/* Products of two recordings at every offset between them (runs/matching.py). */

#include "core.h"

/* A smaller share of a signal's power is rounding: it does not move. */
static const double STILL = 1e-12;

/* Sums over the rows of one offset: r and m, r times m, r times r, m times m. */
typedef struct {
    double *r, *m, *products, *squares, *total;
} Sums;

/* Add one row of the reference (k) and one of the measured (j). */
static inline void add(const double *restrict r, int64_t k, const double *restrict m, int64_t j, Sums to) {
    double *restrict products = to.products, *restrict squares = to.squares;
    for (int64_t a = 0; a < k; a++) {
        to.r[a] += r[a];
        for (int64_t b = 0; b < j; b++)
            products[a * j + b] += r[a] * m[b];
        for (int64_t b = 0; b < k; b++)
            squares[a * k + b] += r[a] * r[b];
    }
    for (int64_t b = 0; b < j; b++) {
        to.m[b] += m[b];
        *to.total += m[b] * m[b];
    }
}

/* Take the means off the sums over a number of rows. */
static void centre(int64_t k, int64_t j, int64_t count, Sums of) {
    const double rows = (double)most(count, 1), power = *of.total;
    for (int64_t a = 0; a < k; a++) {
        for (int64_t b = 0; b < j; b++)
            of.products[a * j + b] -= of.r[a] * of.m[b] / rows;
        for (int64_t b = 0; b < k; b++)
            of.squares[a * k + b] -= of.r[a] * of.r[b] / rows;
    }
    for (int64_t b = 0; b < j; b++)
        *of.total -= of.m[b] * of.m[b] / rows;
    if (*of.total <= STILL * power)
        *of.total = 0.0;
}

/* Write for each offset whether rows are enough, and r'm (o, k, j), r'r (o, k, k) and the sum of m squared (o)
   about their means; all sums come as zeros. Of the rows inside one in every few is taken. work: (k + j). */
EXPORT void runs_products(Floats reference, Floats measured, Bools inside, int64_t every, int64_t least_rows,
                          Floats work, Bools enough, Floats products, Floats squares, Floats total) {
    const int64_t n = reference.rows, k = reference.columns, j = measured.columns;
    for (int64_t offset = 0; offset < total.rows; offset++) {
        const Sums sums = {&AT(work, 0), &AT(work, k), &CELL(products, offset, 0), &CELL(squares, offset, 0),
                           &AT(total, offset)};
        int64_t seen = 0, count = 0;
        for (int64_t i = 0; i < k + j; i++)
            AT(work, i) = 0.0;
        for (int64_t t = 0; t < n; t++) {
            if (!AT(inside, offset + t))
                continue;
            if (seen++ % every == 0) {
                add(&CELL(reference, t, 0), k, &CELL(measured, offset + t, 0), j, sums);
                count++;
            }
        }
        AT(enough, offset) = seen >= least_rows;
        centre(k, j, count, sums);
    }
}
