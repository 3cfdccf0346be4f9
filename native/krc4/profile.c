/* Speed along a chain of moves: what bounds it at each vertex, and the pieces of constant acceleration. */

#include "core.h"

/* A move that a slow place slows down over more than this fraction of its length is slow as a whole. */
#define ROOM 0.8
/* So is a move shorter than SHORT times the reach of a place that is only slightly slower: chords of an arc
   differ by the micrometre they are rounded to, which must not decide their speed. */
#define NEARLY 0.99
#define SHORT 4.0
/* A difference of path that is rounding. */
#define ROUNDING_MM 1e-9

/* Write the upper bound (n + 1) of the speed at each vertex: programmed, stops, look-ahead.

   Look-ahead (an assumption, the controller's planning is not published): at the end of a move only the next
   `in_view` moves are known (negative = all), and a stop at their end must be possible:
   v·(v/a + k)/2 <= the length in view. */
EXPORT void krc4_vertex_speeds(Floats length, Floats speed, Bools stop, Floats a, double k_s, int64_t in_view,
                               Floats vertex) {
    const int64_t count = length.rows;
    AT(vertex, 0) = AT(vertex, count) = 0.0;
    for (int64_t i = 0; i + 1 < count; i++) {
        if (AT(stop, i)) {
            AT(vertex, i + 1) = 0.0;
            continue;
        }
        double bound = lesser(AT(speed, i), AT(speed, i + 1));
        if (in_view >= 0) {
            double seen = 0.0;
            for (int64_t j = i + 1; j < least(i + 1 + in_view, count); j++) {
                seen += AT(length, j);
                if (AT(stop, j))
                    break;
            }
            const double ak = AT(a, i) * k_s;
            bound = lesser(bound, 0.5 * (sqrt(ak * ak + 8.0 * AT(a, i) * seen) - ak));
        }
        AT(vertex, i + 1) = bound;
    }
}

/* The runs of moves (n), and of each what it keeps at its begin and end of the lower speeds there. */
typedef struct {
    Floats length, blend;
    Bools stop;
    Floats bound, vertex, head, tail, top;
    double k_s;
} Runs;

/* Tell whether run i is as slow as a place: it reaches too far into it, or is about as fast and short. */
static bool is_slow_as_a_whole(const Runs *runs, int64_t i, double bound, double reach, double taken) {
    const double length = AT(runs->length, i);
    const bool alike = bound > NEARLY * AT(runs->top, i) && length < SHORT * reach;
    return taken > ROOM * length || alike;
}

/* Write what each run keeps, at its begin, of the lower speed of the corners before it. */
static void keep_behind_slow_places(const Runs *runs) {
    for (int64_t i = 1; i < runs->length.rows; i++) {
        double way = 0.0;
        for (int64_t j = i; j > 0 && !AT(runs->stop, j - 1); j--) {
            const double bound = AT(runs->bound, j);
            const double reach = AT(runs->blend, j - 1) + 0.5 * bound * runs->k_s - way;
            if (bound < AT(runs->top, i) && reach > 0.0) {
                if (is_slow_as_a_whole(runs, i, bound, reach, reach))
                    AT(runs->top, i) = bound;
                else
                    AT(runs->head, i) = greater(AT(runs->head, i), reach);
                if (reach >= AT(runs->length, i))
                    AT(runs->vertex, i + 1) = lesser(AT(runs->vertex, i + 1), bound);
            }
            way += AT(runs->length, j - 1);
            if (way > AT(runs->blend, j - 1) + 0.5 * AT(runs->top, i) * runs->k_s)
                break;
        }
    }
}

/* Write what each run takes on, at its end, of the lower speed of the corners after it. */
static void slow_down_before_slow_places(const Runs *runs) {
    const int64_t count = runs->length.rows;
    for (int64_t i = count - 2; i >= 0; i--) {
        double way = 0.0;
        for (int64_t j = i; j < count - 1 && !AT(runs->stop, j); j++) {
            const double bound = AT(runs->bound, j + 1);
            const double reach = AT(runs->blend, j) + 0.5 * bound * runs->k_s - way;
            if (bound < AT(runs->top, i) && reach > 0.0) {
                if (is_slow_as_a_whole(runs, i, bound, reach, reach + AT(runs->head, i)))
                    AT(runs->top, i) = bound;
                else
                    AT(runs->tail, i) = greater(AT(runs->tail, i), reach);
                if (reach >= AT(runs->length, i))
                    AT(runs->vertex, i) = lesser(AT(runs->vertex, i), bound);
            }
            way += AT(runs->length, j + 1);
            if (way > AT(runs->blend, j) + 0.5 * AT(runs->top, i) * runs->k_s)
                break;
        }
    }
}

/* Write head, tail and top of each run: the lengths at the speeds of its ends, and its own top speed.

   Slowing down ends where the corner begins, speeding up begins where it ends; v·k/2 is the length over
   which the last average spreads that point. A margin longer than the run reaches into the next; `vertex` is
   lowered there. bound: the vertex speeds as they come; head and tail come as zeros, top as the programmed speeds. */
EXPORT void krc4_margins(Floats length, Floats blend, Bools stop, Floats bound, double k_s, Floats vertex,
                         Floats head, Floats tail, Floats top) {
    const Runs runs = {length, blend, stop, bound, vertex, head, tail, top, k_s};
    keep_behind_slow_places(&runs);
    slow_down_before_slow_places(&runs);
    for (int64_t i = 0; i < length.rows; i++) {
        if (AT(top, i) <= AT(vertex, i))
            AT(head, i) = 0.0;
        if (AT(top, i) <= AT(vertex, i + 1))
            AT(tail, i) = 0.0;
        if (AT(head, i) + AT(tail, i) > ROOM * AT(length, i))
            AT(head, i) = AT(tail, i) = 0.0;
        AT(vertex, i) = lesser(AT(vertex, i), AT(top, i));
        AT(vertex, i + 1) = lesser(AT(vertex, i + 1), AT(top, i));
    }
}

/* Lower the vertex speeds to those that can be reached and braked with a. */
EXPORT void krc4_reachable(Floats length, Floats vertex, Floats a) {
    for (int64_t i = length.rows - 1; i >= 0; i--) {
        const double gain = 2.0 * AT(a, i) * greater(AT(length, i), 0.0);
        AT(vertex, i) = lesser(AT(vertex, i), sqrt(squared(AT(vertex, i + 1)) + gain));
    }
    for (int64_t i = 0; i < length.rows; i++) {
        const double gain = 2.0 * AT(a, i) * greater(AT(length, i), 0.0);
        AT(vertex, i + 1) = lesser(AT(vertex, i + 1), sqrt(squared(AT(vertex, i)) + gain));
    }
}

/* Durations of running up, constant speed and slowing down. */
typedef struct {
    double up, constant, down;
} Phases;

/* Return the phases of a move from u0 to u1 at most at v. */
static Phases phases(double length, double v, double u0, double u1, double a, bool averages) {
    if (averages) {
        const double up = (v - u0) / a, down = (v - u1) / a;
        const double total = (length + 0.5 * (v - u0) * up + 0.5 * (v - u1) * down) / v;
        if (total >= up && total >= down) {
            if (total >= up + down)
                return (Phases){up, total - up - down, down};
            return (Phases){total - down, up + down - total, total - up}; /* the ramps overlap and add */
        }
    }
    double top = lesser(v, sqrt(0.5 * (2.0 * a * length + u0 * u0 + u1 * u1)));
    top = greater(greater(top, u0), u1);
    const double ramps = (top * top - u0 * u0) / (2.0 * a), brakes = (top * top - u1 * u1) / (2.0 * a);
    return (Phases){(top - u0) / a, greater(0.0, (length - ramps - brakes) / top), (top - u1) / a};
}

/* The end of the pieces written so far: their number, time, path and its integral over time; the last one's
   speed and acceleration. */
typedef struct {
    Floats out;
    int64_t used;
    double t, s, area, speed, acceleration;
} Pieces;

enum { TIME, PATH, SPEED, ACCELERATION, INTEGRAL };

static void write_piece(Pieces *pieces, double speed, double acceleration) {
    if (pieces->out.columns > 0) {
        CELL(pieces->out, TIME, pieces->used) = pieces->t;
        CELL(pieces->out, PATH, pieces->used) = pieces->s;
        CELL(pieces->out, SPEED, pieces->used) = speed;
        CELL(pieces->out, ACCELERATION, pieces->used) = acceleration;
        CELL(pieces->out, INTEGRAL, pieces->used) = pieces->area;
    }
    pieces->speed = speed;
    pieces->acceleration = acceleration;
    pieces->used++;
}

/* Go on for a while from a speed, in a piece of its own unless the last one is the same constant speed. */
static void go_on(Pieces *pieces, double duration, double v, double acceleration) {
    if (duration <= 0.0)
        return;
    const bool constant = acceleration == 0.0 && pieces->acceleration == 0.0;
    const bool same = pieces->used > 0 && constant && pieces->speed == v;
    if (!same)
        write_piece(pieces, v, acceleration);
    const double duration2 = squared(duration), duration3 = duration * duration2;
    pieces->area += pieces->s * duration + v * duration2 / 2.0 + acceleration * duration3 / 6.0;
    pieces->s += v * duration + acceleration * duration2 / 2.0;
    pieces->t += duration;
}

static void rest(Pieces *pieces, double duration) {
    if (!(duration > 0.0))
        return;
    write_piece(pieces, 0.0, 0.0);
    pieces->area += pieces->s * duration;
    pieces->t += duration;
}

/* Write the pieces of all runs as rows time, path, speed, acceleration, integral, where there is room for any,
   and the total time; return how many pieces. */
EXPORT int64_t krc4_pieces(Floats length, Floats speed, Bools stop, Floats wait_s, Floats vertex, Floats head,
                           Floats tail, Floats a_mm_s2, double k_s, int64_t averages, Floats out,
                           Floats total_s) {
    Pieces pieces = {.out = out};
    const int64_t count = length.rows;
    for (int64_t i = 0; i < count; i++) {
        const double u0 = AT(vertex, i), u1 = AT(vertex, i + 1), a = AT(a_mm_s2, i);
        const double end = pieces.s + AT(length, i), main = AT(length, i) - AT(head, i) - AT(tail, i);
        Phases run = {0.0, 0.0, 0.0};
        if (main > 0.0)
            run = phases(main, AT(speed, i), u0, u1, a, averages);
        const double top = u0 + a * run.up;
        go_on(&pieces, AT(head, i) > 0.0 ? AT(head, i) / u0 : 0.0, u0, 0.0);
        go_on(&pieces, run.up, u0, a);
        go_on(&pieces, run.constant, top, 0.0);
        go_on(&pieces, run.down, top, -a);
        go_on(&pieces, AT(tail, i) > 0.0 ? AT(tail, i) / u1 : 0.0, u1, 0.0);
        if (fabs(end - pieces.s) > ROUNDING_MM)
            pieces.s = end;
        if (AT(stop, i) || i == count - 1) {
            const double smoothing = AT(length, i) > 0.0 ? k_s : 0.0; /* a standstill has nothing to smooth */
            rest(&pieces, smoothing + (i < count - 1 ? AT(wait_s, i) : 0.0));
        }
    }
    write_piece(&pieces, 0.0, 0.0);
    AT(total_s, 0) = pieces.t;
    return pieces.used;
}

/* Write the time at which each move ends, before the last average. */
EXPORT void krc4_move_ends(Floats path_end, Floats time, Floats path, Floats speed, Floats acceleration,
                           Floats move_end) {
    const int64_t last = time.rows - 1;
    int64_t piece = 0;
    for (int64_t i = 0; i < path_end.rows; i++) {
        while (piece < last && AT(path, piece + 1) < AT(path_end, i) - ROUNDING_MM)
            piece++;
        const double way = greater(0.0, AT(path_end, i) - AT(path, piece));
        const double v = AT(speed, piece), a = AT(acceleration, piece);
        const double faster = v + sqrt(greater(0.0, v * v + 2.0 * a * way));
        AT(move_end, i) = AT(time, piece) + (faster > 0.0 ? 2.0 * way / faster : 0.0);
    }
}
