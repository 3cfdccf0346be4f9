/* From the planned pieces to samples: the last moving average, corners, positions and their derivatives. */

#include "core.h"

/* A corner with less bend than this part of its lines is straight. */
#define NO_BEND 1e-12
/* The least q², so that it divides. */
#define LEAST_Q2 1e-300

enum { NO_MOVE = -1 };

static inline double product(const double *a, const double *b) {
    double sum = 0.0;
    for (int c = 0; c < 3; c++)
        sum += a[c] * b[c];
    return sum;
}
static inline double norm(const double *a) { return sqrt(product(a, a)); }

/* --- time law --------------------------------------------------------------------------------------- */

/* Pieces of constant acceleration, by time. */
typedef struct {
    Floats time, path, speed, acceleration, integral;
} Pieces;

/* The planned motion at an instant, and the piece that it lies in. */
typedef struct {
    int64_t piece;
    double path, speed, acceleration, integral;
} Instant;

/* Return the instant t, at or behind a piece; before the start everything is 0. */
static inline Instant instant(const Pieces *pieces, int64_t piece, double t) {
    if (t <= 0.0)
        return (Instant){0, 0.0, 0.0, 0.0, 0.0};
    const int64_t last = pieces->time.rows - 1;
    while (piece < last && AT(pieces->time, piece + 1) <= t)
        piece++;
    const double dt = t - AT(pieces->time, piece), a = AT(pieces->acceleration, piece);
    const double v = AT(pieces->speed, piece), s = AT(pieces->path, piece);
    return (Instant){
        .piece = piece,
        .path = s + v * dt + 0.5 * a * dt * dt,
        .speed = v + a * dt,
        .acceleration = a,
        .integral = AT(pieces->integral, piece) + s * dt + 0.5 * v * dt * dt + a * (dt * squared(dt)) / 6.0,
    };
}

/* Write speed, acceleration, jerk and planned path at times; `now` and `then` are pieces not after the first
   time and not after k before it. */
EXPORT void krc4_law(Floats time, Floats piece_time, Floats piece_path, Floats piece_speed,
                     Floats piece_acceleration, Floats piece_integral, double k_s, int64_t now, int64_t then,
                     Floats speed, Floats acceleration, Floats jerk, Floats path) {
    const Pieces pieces = {piece_time, piece_path, piece_speed, piece_acceleration, piece_integral};
    for (int64_t row = 0; row < time.rows; row++) {
        const Instant here = instant(&pieces, now, AT(time, row));
        now = here.piece;
        AT(speed, row) = here.speed;
        AT(acceleration, row) = here.acceleration;
        AT(jerk, row) = 0.0;
        AT(path, row) = here.path;
        if (k_s > 0.0) {
            const Instant old = instant(&pieces, then, AT(time, row) - k_s);
            then = old.piece;
            AT(speed, row) = (here.path - old.path) / k_s;
            AT(acceleration, row) = (here.speed - old.speed) / k_s;
            AT(jerk, row) = (here.acceleration - old.acceleration) / k_s;
            AT(path, row) = (here.integral - old.integral) / k_s;
        }
    }
}

/* Write the move that each planned path lies in; it never goes back to an earlier one. */
EXPORT void krc4_moves(Floats path, Floats begins, Ints move) {
    const int64_t last = begins.rows - 2;
    int64_t i = 0;
    for (int64_t row = 0; row < path.rows; row++) {
        while (i < last && AT(path, row) >= AT(begins, i + 1))
            i++;
        AT(move, row) = i;
    }
}

/* --- corners ---------------------------------------------------------------------------------------- */

/* Moves; the blend belongs to the end of each. */
typedef struct {
    Floats start, end, length, blend;
} Moves;

static inline void way_of(const Moves *moves, int64_t i, double *way) {
    const double *start = &CELL(moves->start, i, 0), *end = &CELL(moves->end, i, 0);
    for (int c = 0; c < 3; c++)
        way[c] = end[c] - start[c];
}

/* The parabola at the end of a move: d before and after it, the tangents u and w there. Over tau from 0 to 1
   the square of its speed, in units of 2·d, is bend²·((tau + middle)² + q²); x0_r0 and asinh0 are terms of the
   length at tau = 0. */
typedef struct {
    int64_t move;
    double u[3], w[3], d, speed, bend, middle, q2, q, x0_r0, asinh0;
    bool straight;
} Corner;

static inline void set_corner(Corner *corner, const Moves *moves, int64_t i) {
    const double before = AT(moves->length, i), after = AT(moves->length, i + 1);
    double p[3], n[3];
    way_of(moves, i, p);
    way_of(moves, i + 1, n);
    const double uu = product(p, p) / squared(before), ww = product(n, n) / squared(after);
    const double uw = product(p, n) / (before * after), bend2 = uu - 2.0 * uw + ww;
    corner->move = i;
    corner->d = AT(moves->blend, i);
    corner->speed = sqrt(uu);
    for (int c = 0; c < 3; c++) {
        corner->u[c] = p[c] / before;
        corner->w[c] = n[c] / after;
    }
    corner->straight = bend2 < NO_BEND * (uu + ww);
    if (corner->straight)
        return;
    const double x0 = (uw - uu) / bend2, q2 = greater(uu / bend2 - x0 * x0, LEAST_Q2), q = sqrt(q2);
    corner->bend = sqrt(bend2);
    corner->middle = x0;
    corner->q2 = q2;
    corner->q = q;
    corner->x0_r0 = x0 * sqrt(x0 * x0 + q2);
    corner->asinh0 = asinh(x0 / q);
}

/* Return the length of the parabola up to tau: the integral of |(1 - t)·u + t·w| from 0 to tau. */
static inline double arc_length(const Corner *corner, double tau) {
    if (corner->straight)
        return corner->speed * tau;
    const double x1 = tau + corner->middle, r1 = sqrt(x1 * x1 + corner->q2);
    const double turned = asinh(x1 / corner->q) - corner->asinh0;
    return corner->bend * (0.5 * (x1 * r1 - corner->x0_r0 + corner->q2 * turned));
}

/* Return how much path is left to the vertex at fraction tau of the corner. */
static inline double short_of_vertex(const Corner *corner, double tau) {
    return corner->d * (corner->speed - 2.0 * arc_length(corner, tau));
}

/* Write the length of moves `first` up to `behind` in space (0 for a turn on the spot), and how much the
   corners at their ends shorten it. */
EXPORT void krc4_savings(Floats start, Floats end, Floats length, Floats blend, int64_t first, int64_t behind,
                         Floats size, Floats saving) {
    const Moves moves = {start, end, length, blend};
    for (int64_t i = first; i < behind; i++) {
        double way[3];
        way_of(&moves, i, way);
        AT(size, i) = norm(way);
        AT(saving, i) = 0.0;
        if (AT(moves.blend, i) > 0.0 && i + 1 < moves.length.rows) {
            Corner corner;
            set_corner(&corner, &moves, i);
            way_of(&moves, i + 1, way);
            const double join = corner.d * norm(way) / AT(moves.length, i + 1);
            AT(saving, i) = join + short_of_vertex(&corner, 1.0);
        }
    }
}

/* --- places ----------------------------------------------------------------------------------------- */

/* The way through a sample's place over its planned path: the first and the second derivative. */
typedef struct {
    double first[3], second[3];
} Bend;

/* Write the derivatives of a move by its planned path. */
static inline void tangent(const Moves *moves, int64_t i, double *u) {
    const double length = AT(moves->length, i);
    way_of(moves, i, u);
    for (int c = 0; c < 3; c++)
        u[c] = length > 0.0 ? u[c] / length : 0.0;
}

/* Write the place on the parabola after a move; return its derivatives. */
static inline Bend on_parabola(const Moves *moves, const Corner *corner, double tau, double *position) {
    const double *vertex = &CELL(moves->end, corner->move, 0), *u = corner->u, *w = corner->w, d = corner->d;
    Bend bend;
    for (int c = 0; c < 3; c++) {
        position[c] = vertex[c] + d * (tau * tau * w[c] - (1.0 - tau) * (1.0 - tau) * u[c]);
        bend.first[c] = (1.0 - tau) * u[c] + tau * w[c];
        bend.second[c] = (w[c] - u[c]) / (2.0 * d);
    }
    return bend;
}

/* Write the place on the line of a move; return its derivatives. */
static Bend on_line(const Moves *moves, int64_t i, const double *u, double inside, double *position) {
    const bool at_end = inside == AT(moves->length, i);
    Bend bend = {{u[0], u[1], u[2]}, {0.0, 0.0, 0.0}};
    for (int c = 0; c < 3; c++)
        position[c] = at_end ? CELL(moves->end, i, c) : CELL(moves->start, i, c) + u[c] * inside;
    return bend;
}

/* Turn speed, acceleration and jerk along the planned path into their magnitudes in space. */
static inline void to_space(const Bend *bend, double *speed, double *acceleration, double *jerk) {
    const double v = *speed, a = *acceleration, j = *jerk;
    double speed2 = 0.0, acceleration2 = 0.0, jerk2 = 0.0;
    for (int c = 0; c < 3; c++) {
        speed2 += squared(bend->first[c] * v);
        acceleration2 += squared(bend->first[c] * a + bend->second[c] * v * v);
        jerk2 += squared(bend->first[c] * j + 3.0 * bend->second[c] * v * a);
    }
    *speed = sqrt(speed2);
    *acceleration = sqrt(acceleration2);
    *jerk = sqrt(jerk2);
}

/* Write position, tangent, part of the move and corner of samples; over speed, acceleration, jerk and planned
   path write their magnitudes in space and the arc length.

   begins, way_to, saved_to: planned path, length in space, and what corners have saved of it, before each move. */
EXPORT void krc4_place(Ints move, Floats start, Floats end, Floats lengths, Floats blend, Floats begins,
                       Floats way_to, Floats saved_to, Floats speed, Floats acceleration, Floats jerk,
                       Floats path, Floats position, Floats direction, Floats part, Bools in_corner) {
    const Moves moves = {start, end, lengths, blend};
    Corner corner = {.move = NO_MOVE};
    double u[3] = {0.0, 0.0, 0.0}, share = 0.0;
    for (int64_t row = 0, last = NO_MOVE; row < move.rows; row++) {
        const int64_t i = AT(move, row);
        if (i != last) {
            tangent(&moves, i, u);
            share = norm(u);
            last = i;
        }
        const double length = AT(moves.length, i), d_end = AT(moves.blend, i);
        const double d_start = i > 0 ? AT(moves.blend, i - 1) : 0.0;
        const double inside = lesser(greater(AT(path, row) - AT(begins, i), 0.0), length);
        const bool leaves = d_end > 0.0 && inside > length - d_end;
        AT(in_corner, row) = leaves || (d_start > 0.0 && inside < d_start);
        Bend bend;
        if (AT(in_corner, row)) {
            const int64_t vertex = leaves ? i : i - 1;
            if (corner.move != vertex)
                set_corner(&corner, &moves, vertex);
            const double since = leaves ? inside - length + d_end : inside + d_start;
            const double tau = since / (2.0 * corner.d);
            const double to_vertex = AT(way_to, i) + (leaves ? length * share : 0.0) - AT(saved_to, vertex);
            AT(path, row) = to_vertex - short_of_vertex(&corner, tau);
            bend = on_parabola(&moves, &corner, tau, &CELL(position, row, 0));
        } else {
            AT(path, row) = AT(way_to, i) + inside * share - AT(saved_to, i);
            bend = on_line(&moves, i, u, inside, &CELL(position, row, 0));
        }
        to_space(&bend, &AT(speed, row), &AT(acceleration, row), &AT(jerk, row));
        const double steep = norm(bend.first);
        for (int c = 0; c < 3; c++)
            CELL(direction, row, c) = steep > 0.0 ? bend.first[c] / steep : 0.0;
        AT(part, row) = length > 0.0 ? inside / length : 1.0;
    }
}
