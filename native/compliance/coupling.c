/* Whether a tip swings by itself (compliance/mode_coupling.py): loops over rows, and over gains of each.

   All solutions of u'' + C·u' + A·u = 0 die out where the first column of Routh's array of
   det(s²·I + s·C + A) has no change of sign (Routh 1877). The polynomial's coefficients are the mixed principal
   minors of C and A. */

#include "core.h"

#include <string.h>

enum { DEGREE = 6, HALVINGS = 7, MOST_TURNS = 30 };
static const double LEAST_GAIN = 1.0 / 16.0, STEP = 1.4142135623730951, NO_ENTRY = 1e-17;

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

/* Turn columns p and q of a matrix. */
static void turn_columns(Matrix a, int p, int q, double cosine, double sine) {
    for (int i = 0; i < 3; i++) {
        const double left = a[i][p], right = a[i][q];
        a[i][p] = cosine * left - sine * right;
        a[i][q] = sine * left + cosine * right;
    }
}

/* Make a symmetric matrix diagonal, and write its eigenvectors: Jacobi's turns, each of which makes the entry between two
   axes 0 (Golub and Van Loan, Matrix Computations, 4th ed. 2013, sec. 8.5). */
static void diagonalize(Matrix a, Matrix vectors) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            vectors[i][j] = i == j;
    for (int turn = 0; turn < MOST_TURNS; turn++) {
        const int p = turn % 3, q = (turn + 1) % 3, r = (turn + 2) % 3;
        if (fabs(a[p][q]) + fabs(a[q][r]) + fabs(a[r][p]) <= NO_ENTRY * trace(a))
            return;
        if (a[p][q] == 0.0)
            continue;
        const double tau = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
        const double tangent = copysign(1.0, tau) / (fabs(tau) + sqrt(1.0 + tau * tau));
        const double cosine = 1.0 / sqrt(1.0 + tangent * tangent), sine = tangent * cosine;
        const double pr = a[p][r], qr = a[q][r], more = tangent * a[p][q];
        a[p][p] -= more;
        a[q][q] += more;
        a[p][q] = a[q][p] = 0.0;
        a[p][r] = a[r][p] = cosine * pr - sine * qr;
        a[q][r] = a[r][q] = sine * pr + cosine * qr;
        turn_columns(vectors, p, q, cosine, sine);
    }
}

/* Write the stiffness of a flexibility, and the drag of modes of this damping: 2·zeta·sqrt(K) for one mass. */
static void of_modes(Matrix flexibility, double damping, Matrix stiffness, Matrix drag) {
    Matrix vectors;
    diagonalize(flexibility, vectors);
    memset(stiffness, 0, sizeof(Matrix));
    memset(drag, 0, sizeof(Matrix));
    for (int mode = 0; mode < 3; mode++) {
        const double stiff = 1.0 / flexibility[mode][mode], slows = 2.0 * damping * sqrt(stiff);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                const double part = vectors[i][mode] * vectors[j][mode];
                stiffness[i][j] += stiff * part;
                drag[i][j] += slows * part;
            }
    }
}

/* Write a row of matrices (n, 9); tell whether all of it is finite. */
static bool row_of(Floats matrices, int64_t row, Matrix matrix) {
    double none = 0.0;
    for (int i = 0; i < 9; i++) {
        matrix[i / 3][i % 3] = CELL(matrices, row, i);
        none += 0.0 * CELL(matrices, row, i);
    }
    return none == 0.0;
}

/* Return 1/g of the least gain g, in steps and then by bisection, at which a tip swings by itself; 0 where none up to
   `most_gain` does. */
static double index_of(Matrix drag, Matrix stiffness, Matrix process, double most_gain) {
    double low = 0.0, high = LEAST_GAIN;
    while (high <= most_gain * (1.0 + 1e-9) && !grows(drag, stiffness, process, high)) {
        low = high;
        high *= STEP;
    }
    if (high > most_gain * (1.0 + 1e-9))
        return 0.0;
    for (int i = 0; i < HALVINGS; i++) {
        const double middle = (low + high) / 2.0;
        if (grows(drag, stiffness, process, middle))
            high = middle;
        else
            low = middle;
    }
    return 1.0 / high;
}

/* Write the index (n,) of tips of these flexibilities (n, 9) under process stiffnesses (n, 9); NaN where one is not
   finite. */
EXPORT void compliance_coupling_index(Floats flexibility, Floats process, double damping, double most_gain,
                                      Floats index) {
    for (int64_t row = 0; row < index.rows; row++) {
        Matrix f, p, k, c;
        if (!row_of(flexibility, row, f) || !row_of(process, row, p)) {
            AT(index, row) = NAN;
            continue;
        }
        of_modes(f, damping, k, c);
        AT(index, row) = index_of(c, k, p, most_gain);
    }
}
