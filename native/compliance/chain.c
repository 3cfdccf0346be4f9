/* The elastic chain of Haehn & Weigold 2020, eq. 1-9: loops over rows of joints and loads (compliance/chain.py).

   A frame follows from the one before by T_i = Rx(alpha)·Tx(a)·Tz(d)·Rz(theta) (eq. 1). The load is carried
   outwards into each frame (eq. 5), then tip, shift and turn are carried inwards, from the last frame to the
   root.

   Rows are taken in blocks, one array for each quantity, so that each line below is one vector instruction
   for several rows. Every row passes through the same operations wherever it is: results do not depend on
   how rows are cut into chunks. */

#include "compliance/sine.h"
#include "constants.h"

#include <string.h>

enum { AXES = 6, FRAMES = CHAIN_FRAMES, BLOCK = 32 };

static const int AXIS_FRAME[AXES] = CHAIN_AXIS_FRAME;
static const double AXIS_SIGN[AXES] = CHAIN_AXIS_SIGN;
static const double AXIS_ZERO[AXES] = CHAIN_AXIS_ZERO;

/* A quantity of each row of a block, and one with three components. */
typedef double Scalar[BLOCK];
typedef Scalar Vector[3];

/* A rotation as a quaternion. */
typedef struct {
    Scalar w;
    Vector v;
} Turn;

/* What is carried inwards: the tip r_i (eq. 2), its change under the load, and the rotation R̂_i·R_iᵀ. */
typedef struct {
    Vector tip, shift;
    Turn turn;
} Carried;

typedef struct {
    Vector force, moment;
} Load;

typedef struct {
    Scalar cos[FRAMES], sin[FRAMES];
} Turns;

/* Write cos and sin of theta for the frames that an axis turns. */
static void turns_of(Floats q_rad, int64_t first, int64_t rows, Turns *turns) {
    for (int axis = 0; axis < AXES; axis++) {
        double *restrict cos_i = turns->cos[AXIS_FRAME[axis]], *restrict sin_i = turns->sin[AXIS_FRAME[axis]];
        for (int64_t j = 0; j < rows; j++)
            cos_i[j] = AXIS_SIGN[axis] * CELL(q_rad, first + j, axis) + AXIS_ZERO[axis];
        for (int j = 0; j < BLOCK; j++)
            sin_cos(cos_i[j], &sin_i[j], &cos_i[j]);
    }
}

/* Frames that no axis turns. */
static void start_turns(Turns *turns) {
    for (int i = 0; i < FRAMES; i++)
        for (int j = 0; j < BLOCK; j++) {
            turns->cos[i][j] = 1.0;
            turns->sin[i][j] = 0.0;
        }
}

/* Write rows of vectors (n, 3) along the axes of a rotation (3, 3). */
static void take(Floats rows_of, Floats base, int64_t first, int64_t rows, Vector out) {
    for (int k = 0; k < 3; k++) {
        const double to_x = CELL(base, k, 0), to_y = CELL(base, k, 1), to_z = CELL(base, k, 2);
        for (int64_t j = 0; j < rows; j++) {
            const double *v = &CELL(rows_of, first + j, 0);
            out[k][j] = to_x * v[0] + to_y * v[1] + to_z * v[2];
        }
    }
}

/* Write vectors along the root's axes as rows (n, 3) along those of the base. */
static void give(Vector vector, Floats base, int64_t first, int64_t rows, Floats out) {
    for (int k = 0; k < 3; k++) {
        const double of_x = CELL(base, 0, k), of_y = CELL(base, 1, k), of_z = CELL(base, 2, k);
        for (int64_t j = 0; j < rows; j++)
            CELL(out, first + j, k) = of_x * vector[0][j] + of_y * vector[1][j] + of_z * vector[2][j];
    }
}

/* Put the tip of each row into the last frame, neither shifted nor turned. */
static void start(Floats tips_mm, Ints32 tool, int64_t first, int64_t rows, Carried *state) {
    memset(state->shift, 0, sizeof state->shift);
    memset(&state->turn, 0, sizeof state->turn);
    for (int j = 0; j < BLOCK; j++)
        state->turn.w[j] = 1.0;
    for (int k = 0; k < 3; k++)
        for (int64_t j = 0; j < rows; j++)
            state->tip[k][j] = CELL(tips_mm, AT(tool, first + j), k);
}

/* Turn a vector into the next frame outwards, eq. 5. */
static void outwards(Vector vector, const double *frame, const double *restrict cos_i,
                     const double *restrict sin_i, Vector turned) {
    const double cos_alpha = frame[0], sin_alpha = frame[1];
    for (int j = 0; j < BLOCK; j++) {
        const double x = vector[0][j];
        const double y = cos_alpha * vector[1][j] + sin_alpha * vector[2][j];
        const double z = cos_alpha * vector[2][j] - sin_alpha * vector[1][j];
        turned[0][j] = cos_i[j] * x + sin_i[j] * y;
        turned[1][j] = cos_i[j] * y - sin_i[j] * x;
        turned[2][j] = z;
    }
}

/* Find the elastic rotation R* of a virtual joint under the load, as a quaternion (w, x, y, z): eq. 3, 4, 6, 7. */
static void yield(const Load *load, const double *softness, Vector tip, Turn *restrict by) {
    const double half_c = 0.5 * softness[0], half_b = 0.5 * softness[1], half_a = 0.5 * softness[2];
    for (int j = 0; j < BLOCK; j++) {
        const double rx = tip[0][j], ry = tip[1][j], rz = tip[2][j];
        const double fx = load->force[0][j], fy = load->force[1][j], fz = load->force[2][j];
        const double c = (ry * fz - rz * fy + load->moment[0][j]) * half_c; /* eq. 6, 7 */
        const double b = (rz * fx - rx * fz + load->moment[1][j]) * half_b;
        const double a = (rx * fy - ry * fx + load->moment[2][j]) * half_a;
        const double sin_c = sin_near_zero(c), cos_c = cos_near_zero(c);
        const double sin_b = sin_near_zero(b), cos_b = cos_near_zero(b);
        const double sin_a = sin_near_zero(a), cos_a = cos_near_zero(a);
        by->w[j] = cos_c * cos_b * cos_a + sin_c * sin_b * sin_a; /* eq. 4: Rz·Ry·Rx */
        by->v[0][j] = sin_c * cos_b * cos_a - cos_c * sin_b * sin_a;
        by->v[1][j] = cos_c * sin_b * cos_a + sin_c * cos_b * sin_a;
        by->v[2][j] = cos_c * cos_b * sin_a - sin_c * sin_b * cos_a;
    }
}

/* Turn the deflected tip p: it moves by w·t + v x t, t = 2·v x p, which loses no digits however small the
   angles are. */
static void move(const Turn *by, Vector tip, Vector shift) {
    for (int j = 0; j < BLOCK; j++) {
        const double w = by->w[j], x = by->v[0][j], y = by->v[1][j], z = by->v[2][j];
        const double px = tip[0][j] + shift[0][j], py = tip[1][j] + shift[1][j], pz = tip[2][j] + shift[2][j];
        const double tx = 2.0 * (y * pz - z * py), ty = 2.0 * (z * px - x * pz), tz = 2.0 * (x * py - y * px);
        shift[0][j] += w * tx + y * tz - z * ty;
        shift[1][j] += w * ty + z * tx - x * tz;
        shift[2][j] += w * tz + x * ty - y * tx;
    }
}

/* Turn the turn of everything outside. */
static void add_turn(const Turn *restrict by, Turn *restrict turn) {
    for (int j = 0; j < BLOCK; j++) {
        const double w = by->w[j], x = by->v[0][j], y = by->v[1][j], z = by->v[2][j];
        const double w_0 = turn->w[j], x_0 = turn->v[0][j], y_0 = turn->v[1][j], z_0 = turn->v[2][j];
        turn->w[j] = w * w_0 - x * x_0 - y * y_0 - z * z_0;
        turn->v[0][j] = w * x_0 + x * w_0 + y * z_0 - z * y_0;
        turn->v[1][j] = w * y_0 + y * w_0 + z * x_0 - x * z_0;
        turn->v[2][j] = w * z_0 + z * w_0 + x * y_0 - y * x_0;
    }
}

/* Express a vector in the next frame inwards, eq. 1; a point is moved by a and d, too. */
static void inwards(Vector vector, const double *frame, double a_mm, double d_mm,
                           const double *restrict cos_i, const double *restrict sin_i) {
    const double cos_alpha = frame[0], sin_alpha = frame[1];
    for (int j = 0; j < BLOCK; j++) {
        const double x = cos_i[j] * vector[0][j] - sin_i[j] * vector[1][j] + a_mm;
        const double y = cos_i[j] * vector[1][j] + sin_i[j] * vector[0][j];
        const double z = vector[2][j] + d_mm;
        vector[0][j] = x;
        vector[1][j] = cos_alpha * y - sin_alpha * z;
        vector[2][j] = cos_alpha * z + sin_alpha * y;
    }
}

/* Replace the quaternions by rotation vectors: 2·atan(|v|/w)·v/|v|. */
static void to_rotation_vectors(int64_t rows, Carried *state) {
    for (int64_t j = 0; j < rows; j++) {
        const double w = state->turn.w[j];
        const double x = state->turn.v[0][j], y = state->turn.v[1][j], z = state->turn.v[2][j];
        const double sine_2 = x * x + y * y + z * z;
        const double tangent_2 = sine_2 / (w * w);
        double factor;
        if (tangent_2 < 1e-3) { /* the series of atan, exact to rounding here */
            const double tail = 1.0 / 5 - tangent_2 * (1.0 / 7 - tangent_2 * (1.0 / 9 - tangent_2 / 11));
            factor = 2.0 / w * (1.0 - tangent_2 * (1.0 / 3 - tangent_2 * tail));
        } else {
            factor = 2.0 * atan2(sqrt(sine_2), w) / sqrt(sine_2);
        }
        state->turn.v[0][j] = factor * x;
        state->turn.v[1][j] = factor * y;
        state->turn.v[2][j] = factor * z;
    }
}

/* Write how fast each frame turns about its z. */
static void rates_of(Floats qd_rad_s, int64_t first, int64_t rows, Scalar *rate) {
    for (int axis = 0; axis < AXES; axis++)
        for (int64_t j = 0; j < rows; j++)
            rate[AXIS_FRAME[axis]][j] = AXIS_SIGN[axis] * CELL(qd_rad_s, first + j, axis);
}

/* Add omega x r, omega along z: the velocity of the tip by the turning of one frame. */
static void add_speed(const double *restrict rate, Vector tip, Vector velocity) {
    for (int j = 0; j < BLOCK; j++) {
        velocity[0][j] -= rate[j] * tip[1][j];
        velocity[1][j] += rate[j] * tip[0][j];
    }
}

/* Write how far the tip moves under a load, eq. 2-9, and how fast the rigid tip goes; compliance/chain.py
   says of which arrays. */
EXPORT void compliance_displaced(Floats q_rad, Floats force_N, Floats moment_Nmm, Floats frames,
                                 Floats softness, Floats base, Floats tips_mm, Ints32 tool, Floats shift_mm,
                                 Floats turn_rad, Floats qd_rad_s, Floats velocity_mm_s) {
    Turns turns;
    Load load[FRAMES + 1];
    Carried state;
    Turn by;
    Scalar rate[FRAMES];
    Vector velocity;
    const bool turned = turn_rad.rows > 0, moves = velocity_mm_s.rows > 0;
    memset(load, 0, sizeof load);
    memset(rate, 0, sizeof rate);
    memset(&state, 0, sizeof state);
    start_turns(&turns);
    for (int64_t first = 0; first < q_rad.rows; first += BLOCK) {
        const int64_t rows = least(BLOCK, q_rad.rows - first);
        turns_of(q_rad, first, rows, &turns);
        take(force_N, base, first, rows, load[0].force);
        take(moment_Nmm, base, first, rows, load[0].moment);
        for (int i = 0; i < FRAMES; i++) {
            const double *frame = &CELL(frames, i, 0);
            outwards(load[i].force, frame, turns.cos[i], turns.sin[i], load[i + 1].force);
            outwards(load[i].moment, frame, turns.cos[i], turns.sin[i], load[i + 1].moment);
        }
        start(tips_mm, tool, first, rows, &state);
        memset(velocity, 0, sizeof velocity);
        if (moves)
            rates_of(qd_rad_s, first, rows, rate);
        for (int i = FRAMES - 1; i >= 0; i--) {
            const double *frame = &CELL(frames, i, 0);
            if (moves) {
                add_speed(rate[i], state.tip, velocity);
                inwards(velocity, frame, 0.0, 0.0, turns.cos[i], turns.sin[i]);
            }
            yield(&load[i + 1], &CELL(softness, i, 0), state.tip, &by);
            move(&by, state.tip, state.shift);
            inwards(state.tip, frame, frame[2], frame[3], turns.cos[i], turns.sin[i]);
            inwards(state.shift, frame, 0.0, 0.0, turns.cos[i], turns.sin[i]);
            if (turned) {
                add_turn(&by, &state.turn);
                inwards(state.turn.v, frame, 0.0, 0.0, turns.cos[i], turns.sin[i]);
            }
        }
        give(state.shift, base, first, rows, shift_mm);
        if (turned) {
            to_rotation_vectors(rows, &state);
            give(state.turn.v, base, first, rows, turn_rad);
        }
        if (moves)
            give(velocity, base, first, rows, velocity_mm_s);
    }
}

/* Write where the rigid tip is, seen from the foot of axis 1, and its velocity. */
EXPORT void compliance_tip(Floats q_rad, Floats qd_rad_s, Floats frames, Floats base, Floats tips_mm,
                           Ints32 tool, Floats position_mm, Floats velocity_mm_s) {
    Turns turns;
    Carried state;
    Scalar rate[FRAMES];
    memset(rate, 0, sizeof rate);
    memset(&state, 0, sizeof state);
    start_turns(&turns);
    for (int64_t first = 0; first < q_rad.rows; first += BLOCK) {
        const int64_t rows = least(BLOCK, q_rad.rows - first);
        turns_of(q_rad, first, rows, &turns);
        rates_of(qd_rad_s, first, rows, rate);
        start(tips_mm, tool, first, rows, &state);
        for (int i = FRAMES - 1; i >= 0; i--) {
            const double *frame = &CELL(frames, i, 0);
            add_speed(rate[i], state.tip, state.shift);
            inwards(state.tip, frame, frame[2], frame[3], turns.cos[i], turns.sin[i]);
            inwards(state.shift, frame, 0.0, 0.0, turns.cos[i], turns.sin[i]);
        }
        give(state.tip, base, first, rows, position_mm);
        give(state.shift, base, first, rows, velocity_mm_s);
    }
}

/* The flexibility of the tip, a symmetric matrix: a displacement by a force. */
typedef struct {
    Scalar xx, yy, zz, xy, yz, zx;
} Flexibility;

/* Add that of a virtual joint: minus r x (S·(r x f)), S its softness, to first order in the elastic angles. */
static void soften(const double *softness, Vector tip, Flexibility *by) {
    const double c = softness[0], b = softness[1], a = softness[2];
    for (int j = 0; j < BLOCK; j++) {
        const double x = tip[0][j], y = tip[1][j], z = tip[2][j];
        by->xx[j] += b * z * z + a * y * y;
        by->yy[j] += c * z * z + a * x * x;
        by->zz[j] += c * y * y + b * x * x;
        by->xy[j] -= a * x * y;
        by->yz[j] -= c * y * z;
        by->zx[j] -= b * x * z;
    }
}

/* Turn two of the axes, p and q, of a symmetric matrix from p towards q; r is the third. */
static void turn_axes(double *restrict pp, double *restrict qq, double *restrict pq, double *restrict pr,
                      double *restrict qr, const double *restrict cosine, const double *restrict sine) {
    for (int j = 0; j < BLOCK; j++) {
        const double c = cosine[j], s = sine[j], mixed = 2.0 * c * s * pq[j], p = pp[j], q = qq[j], to = pr[j];
        pp[j] = c * c * p - mixed + s * s * q;
        qq[j] = s * s * p + mixed + c * c * q;
        pq[j] = c * s * (p - q) + (c * c - s * s) * pq[j];
        pr[j] = c * to - s * qr[j];
        qr[j] = s * to + c * qr[j];
    }
}

/* Write the flexibility (n, 9) of the tip in mm/N along `base`; arrays as for compliance_displaced. */
EXPORT void compliance_flexibility(Floats q_rad, Floats frames, Floats softness, Floats base, Floats tips_mm,
                                   Ints32 tool, Floats flexibility) {
    Turns turns;
    Carried state;
    Scalar cosine, sine;
    start_turns(&turns);
    memset(&state, 0, sizeof state);
    for (int64_t first = 0; first < q_rad.rows; first += BLOCK) {
        const int64_t rows = least(BLOCK, q_rad.rows - first);
        Flexibility of;
        memset(&of, 0, sizeof of);
        turns_of(q_rad, first, rows, &turns);
        start(tips_mm, tool, first, rows, &state);
        for (int i = FRAMES - 1; i >= 0; i--) {
            const double *frame = &CELL(frames, i, 0);
            soften(&CELL(softness, i, 0), state.tip, &of);
            inwards(state.tip, frame, frame[2], frame[3], turns.cos[i], turns.sin[i]);
            turn_axes(of.xx, of.yy, of.xy, of.zx, of.yz, turns.cos[i], turns.sin[i]);
            for (int j = 0; j < BLOCK; j++) {
                cosine[j] = frame[0];
                sine[j] = frame[1];
            }
            turn_axes(of.yy, of.zz, of.yz, of.xy, of.zx, cosine, sine);
        }
        for (int64_t j = 0; j < rows; j++) {
            const double in_root[3][3] = {{of.xx[j], of.xy[j], of.zx[j]},
                                          {of.xy[j], of.yy[j], of.yz[j]},
                                          {of.zx[j], of.yz[j], of.zz[j]}};
            for (int i = 0; i < 9; i++) {
                double sum = 0.0;
                for (int k = 0; k < 9; k++)
                    sum += CELL(base, k / 3, i / 3) * in_root[k / 3][k % 3] * CELL(base, k % 3, i % 3);
                CELL(flexibility, first + j, i) = sum;
            }
        }
    }
}
