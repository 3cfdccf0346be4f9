/* Signals between their samples (gap/compare/interpolation.py). */

#include "search.h"

/* Write the row (n) before each time, the last but one at most, and the share (n) of the way on. */
EXPORT void gap_place(Floats times_s, Floats own_s, Ints rows, Floats shares) {
    const int64_t last = own_s.rows - 2;
    int64_t row = 0;
    for (int64_t i = 0; i < times_s.rows; i++) {
        const double now_s = AT(times_s, i);
        if (AT(own_s, row) > now_s || (row < last && AT(own_s, least(row + 8, last)) <= now_s))
            row = least(most(count_up_to(own_s, own_s.rows, now_s) - 1, 0), last);
        while (row < last && AT(own_s, row + 1) <= now_s) /* times mostly follow each other */
            row++;
        const double share = (now_s - AT(own_s, row)) / (AT(own_s, row + 1) - AT(own_s, row));
        AT(rows, i) = row;
        AT(shares, i) = lesser(greater(share, 0.0), 1.0);
    }
}

/* Write the columns of values (m, c) at places, along lines. */
EXPORT void gap_lines(Ints rows, Floats shares, Floats values, Floats found) {
    for (int64_t i = 0; i < rows.rows; i++) {
        const double share = AT(shares, i);
        for (int64_t c = 0; c < values.columns; c++) {
            const double a = CELL(values, AT(rows, i), c), b = CELL(values, AT(rows, i) + 1, c);
            CELL(found, i, c) = a + share * (b - a);
        }
    }
}

/* Return the slope at a row to second order in uneven steps, that of the only step at an end. */
static double slope_at(Floats own_s, Floats values, int64_t at, int64_t c) {
    const int64_t last = own_s.rows - 1;
    if (at == 0 || at == last) {
        const int64_t low = at == 0 ? 0 : last - 1;
        return (CELL(values, low + 1, c) - CELL(values, low, c)) / (AT(own_s, low + 1) - AT(own_s, low));
    }
    const double before = AT(own_s, at) - AT(own_s, at - 1), after = AT(own_s, at + 1) - AT(own_s, at);
    const double to = CELL(values, at + 1, c) - CELL(values, at, c);
    const double off = CELL(values, at, c) - CELL(values, at - 1, c);
    return (before / after * to + after / before * off) / (before + after);
}

/* Write the columns of values (m, c) at places, along cubic Hermite pieces with central slopes. */
EXPORT void gap_cubics(Ints rows, Floats shares, Floats own_s, Floats values, Floats found) {
    for (int64_t i = 0; i < rows.rows; i++) {
        const int64_t at = AT(rows, i);
        const double u = AT(shares, i), width = AT(own_s, at + 1) - AT(own_s, at);
        for (int64_t c = 0; c < values.columns; c++) {
            const double a = CELL(values, at, c), b = CELL(values, at + 1, c);
            const double da = slope_at(own_s, values, at, c) * width;
            const double db = slope_at(own_s, values, at + 1, c) * width;
            const double bend = 3.0 * (b - a) - 2.0 * da - db + u * (2.0 * (a - b) + da + db);
            CELL(found, i, c) = a + u * (da + u * bend);
        }
    }
}
