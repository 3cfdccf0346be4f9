/* Whether a tip swings by itself (compliance/mode_coupling.py): loops over rows, and over gains of each.

   All solutions of u'' + C·u' + A·u = 0 die out where the first column of Routh's array of
   det(s²·I + s·C + A) has no change of sign (Routh 1877). The polynomial's coefficients are the mixed principal
   minors of C and A. */

#include "core.h"

enum { DEGREE = 6, HALVINGS = 7 };
static const double LEAST_GAIN = 1.0 / 16.0, STEP = 1.4142135623730951;

typedef double Matrix[3][3];

static double trace(Matrix a) {
    return a[0][0] + a[1][1] + a[2][2];
}

/* The trace of a·b. */
static double along(Matrix a, Matrix b) {
    double sum = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            sum += a[i][j] * b[j][i];
    return sum;
}

/* Write the adjugate of a matrix, and return its determinant. */
static double adjugate(Matrix a, Matrix minors) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int r = (j + 1) % 3, s = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
            minors[i][j] = a[r][c] * a[s][d] - a[r][d] * a[s][c];
        }
    return a[0][0] * minors[0][0] + a[0][1] * minors[1][0] + a[0][2] * minors[2][0];
}

/* Tell whether all solutions die out. `upper` and `lower` are two rows of Routh's array, the lower one shifted by one. */
static bool dies_out(Matrix drag, Matrix stiffness) {
    Matrix of_drag, of_stiffness;
    const double det_drag = adjugate(drag, of_drag), det_stiffness = adjugate(stiffness, of_stiffness);
    double upper[4] = {1.0, trace(of_drag) + trace(stiffness), trace(of_stiffness) + along(of_drag, stiffness),
                       det_stiffness};
    double lower[4] = {trace(drag), det_drag + trace(drag) * trace(stiffness) - along(drag, stiffness),
                       along(of_stiffness, drag), 0.0};
    for (int row = 0; row < DEGREE; row++) {
        if (!(lower[0] > 0.0))
            return false;
        const double ratio = upper[0] / lower[0];
        for (int i = 0; i < 3; i++) {
            const double next = upper[i + 1] - ratio * lower[i + 1];
            upper[i] = lower[i];
            lower[i] = next;
        }
        upper[3] = lower[3];
        lower[3] = 0.0;
    }
    return true;
}

static bool grows(Matrix drag, Matrix stiffness, Matrix process, double gain) {
    Matrix left;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            left[i][j] = stiffness[i][j] - gain * process[i][j];
    return !dies_out(drag, left);
}

static void row_of(Floats matrices, int64_t row, Matrix matrix) {
    for (int i = 0; i < 9; i++)
        matrix[i / 3][i % 3] = CELL(matrices, row, i);
}

/* index (n,) gets 1/g of the least gain g, in steps and then by bisection, at which a tip swings by itself; 0 where none up
   to `most_gain` does. Matrices (n, 9), finite. */
EXPORT void compliance_coupling_index(Floats drag, Floats stiffness, Floats process, double most_gain,
                                      Floats index) {
    for (int64_t row = 0; row < index.rows; row++) {
        Matrix c, k, p;
        row_of(drag, row, c);
        row_of(stiffness, row, k);
        row_of(process, row, p);
        double low = 0.0, high = LEAST_GAIN;
        while (high <= most_gain * (1.0 + 1e-9) && !grows(c, k, p, high)) {
            low = high;
            high *= STEP;
        }
        if (high > most_gain * (1.0 + 1e-9)) {
            AT(index, row) = 0.0;
            continue;
        }
        for (int i = 0; i < HALVINGS; i++) {
            const double middle = (low + high) / 2.0;
            if (grows(c, k, p, middle))
                high = middle;
            else
                low = middle;
        }
        AT(index, row) = 1.0 / high;
    }
}
