/* Low-pass and moving average of a sensor's loads (online/compensator.py). */

#include "core.h"

enum { WIDTH = 6 };

/* Take one load into the low-pass and into the window of its last outputs; the first fills both. */
static void take(const double *load, double share, int64_t seen, double *low, Floats window) {
    for (int c = 0; c < WIDTH; c++) {
        low[c] = seen == 0 ? load[c] : low[c] + share * (load[c] - low[c]);
        for (int64_t k = 0; seen == 0 && k < window.rows; k++)
            CELL(window, k, c) = low[c];
        CELL(window, seen % window.rows, c) = low[c];
    }
}

/* Write filtered loads (n, 6), and where the sensor is lost; counts: samples so far, and invalid ones in a row. */
EXPORT void online_filter(Floats load, Floats low, Floats window, Ints counts, double share, int64_t allowed,
                          double most_N, Floats filtered, Bools lost) {
    for (int64_t i = 0; i < load.rows; i++) {
        const double *values = &CELL(load, i, 0);
        bool is_finite = true;
        double size_2 = 0.0;
        for (int c = 0; c < WIDTH; c++)
            is_finite = is_finite && isfinite(values[c]);
        for (int c = 0; c < 3; c++)
            size_2 += values[c] * values[c];
        if (is_finite && size_2 <= most_N * most_N) {
            take(values, share, AT(counts, 0), &AT(low, 0), window);
            AT(counts, 0)++;
            AT(counts, 1) = 0;
        } else {
            AT(counts, 1)++;
            AT(lost, i) = AT(counts, 1) > allowed || is_finite;
        }
        for (int c = 0; c < WIDTH; c++) {
            double total = 0.0;
            for (int64_t k = 0; k < window.rows; k++)
                total += CELL(window, k, c);
            CELL(filtered, i, c) = total / (double)window.rows;
        }
    }
}
