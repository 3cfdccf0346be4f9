/* Clearances along a way of the arm, continuous between its rows (collision/along.py says by what bound). */

#include "collision/links.h"
#include "collision/tree.h"

enum { DEEPEST_HALVING = 40 };

/* Rows that a leap should pass by: for less a gap is not computed again. */
enum { WORTH_ROWS = 4 };

/* Rows that have been passed by, from which on it is worth looking whether the leap may go on. */
enum { WORTH_LOOKING = 4 };

/* What is remembered of a pair since the pose at which its gap was computed last. */
typedef struct {
    uint8_t *known;
    double *gap, *limit, *own, *other; /* `limit`: the gap, and what the ends had gone until then */
    double *inside;                    /* 1: inside a mesh without touching its surface */
    double *triangle;
} Pair;

typedef struct {
    const Bodies *bodies;
    const Obstacles *obstacles;
    Arm arm;
    Ends now[SCENE_MOST_BODIES], before[SCENE_MOST_BODIES];
    Stance stands, stood;            /* now, and in the row before */
    double bulge[SCENE_MOST_BODIES]; /* how far the real way may be from the way of the joints */
    double slack[SCENE_MOST_BODIES]; /* and from the chord */
    double gone[SCENE_MOST_BODIES];  /* no end has moved farther, since the way began */
    double share[AXES];              /* of the levers in a sagitta */
} Walk;

typedef struct {
    double mm, place[3];
} Gap;

/* Return the tree of an obstacle that is a mesh. */
static Tree tree_of(const Obstacles *obstacles, int64_t of) {
    const Tree tree = {obstacles->triangles,         obstacles->boxes,
                       CELL(obstacles->tree, of, 0), CELL(obstacles->tree, of, 1),
                       CELL(obstacles->tree, of, 2), CELL(obstacles->tree, of, 3)};
    return tree;
}

static double segment_from_obstacle(const Walk *walk, int64_t of, const double *segment, double radius,
                                    double *inside, double *triangle, bool may_be_inside, double *place) {
    const Obstacles *obstacles = walk->obstacles;
    const double *number = &CELL(obstacles->numbers, of, 0);
    if (AT(obstacles->kind, of) == SCENE_PLANE) {
        double least = INFINITY;
        for (int end = 0; end < 2; end++) {
            const double height = dot3(number, segment + 3 * end) - number[3];
            if (height < least) {
                least = height;
                for (int k = 0; k < 3; k++)
                    place[k] = segment[3 * end + k] - height * number[k];
            }
        }
        return least - radius;
    }
    if (AT(obstacles->kind, of) == SCENE_BOX) {
        double local[6], near[3];
        for (int end = 0; end < 2; end++)
            for (int row = 0; row < 3; row++) {
                double way[3];
                minus3(segment + 3 * end, number + 9, way);
                local[3 * end + row] = dot3(number + 3 * row, way);
            }
        const double square = segment_box(local, number + 12, number + 15, near);
        for (int k = 0; k < 3; k++)
            place[k] = number[9 + k] + number[k] * near[0] + number[3 + k] * near[1] + number[6 + k] * near[2];
        return sqrt(square) - radius;
    }
    const Tree tree = tree_of(obstacles, of);
    int64_t nearest = (int64_t)*triangle;
    const double far = tree_distance(&tree, segment, &nearest, place);
    *triangle = (double)nearest;
    *inside = may_be_inside && far > 0.0 && tree_holds(&tree, segment) ? 1.0 : 0.0;
    return *inside > 0.0 ? -far - radius : far - radius;
}

/* The gap of a pair whose ends are these: less than 0 where they overlap. */
static Gap gap_at(const Walk *walk, const int32_t *pair, const Pair *state, const double *own, const double *other,
                  bool may_be_inside) {
    Gap gap;
    const double radius = AT(walk->bodies->radius_mm, pair[0]);
    if (pair[1] < 0) {
        const double square = segment_segment(own, other, gap.place);
        gap.mm = sqrt(square) - radius - AT(walk->bodies->radius_mm, pair[2]);
        return gap;
    }
    gap.mm = segment_from_obstacle(walk, pair[1], own, radius, state->inside, state->triangle, may_be_inside,
                                   gap.place);
    return gap;
}

static Gap gap_of(const Walk *walk, const int32_t *pair, const Pair *state, const Ends *ends, bool may_be_inside) {
    return gap_at(walk, pair, state, ends[pair[0]], ends[pair[1] < 0 ? pair[2] : 0], may_be_inside);
}

static double ends_moved(const double *from, const double *to) {
    return greater(distance3(from, to), distance3(from + 3, to + 3));
}

/* Write by how much of each lever an end may be from its chord: an eighth of the second derivative, whose terms
   are gathered by the outer one of their two axes. */
static void sagitta_shares(const double *from, const double *to, double *share) {
    double inner = 0.0;
    for (int j = 0; j < AXES; j++) {
        const double turned = fabs(to[j] - from[j]);
        share[j] = 0.125 * turned * (turned + 2.0 * inner);
        inner += turned;
    }
}

static double sagitta(const Walk *walk, int64_t body) {
    const double *lever = &CELL(walk->bodies->lever_mm, body, 0);
    double sum = 0.0;
    for (int j = 0; j < AXES; j++)
        sum += walk->share[j] * lever[j];
    return sum;
}

static double of_both(const double *values, const int32_t *pair) {
    return pair[1] < 0 ? values[pair[0]] + values[pair[2]] : values[pair[0]];
}

static double pair_moved(const int32_t *pair, const Ends *from, const Ends *to) {
    const double own = ends_moved(from[pair[0]], to[pair[0]]);
    return pair[1] < 0 ? own + ends_moved(from[pair[2]], to[pair[2]]) : own;
}

/* How far a pair has moved since its gap was computed. */
static double moved_since(const int32_t *pair, const Pair *state, const Ends *to) {
    const double own = ends_moved(state->own, to[pair[0]]);
    return pair[1] < 0 ? own + ends_moved(state->other, to[pair[2]]) : own;
}

/* A part of the way between two rows, from u to u + wide: the ends of both bodies and the gaps at its borders. */
typedef struct {
    double u, wide, gap[2];
    Ends ends[2][2]; /* border, body */
} Stretch;

static void copy_ends(const Ends *from, Ends *to) {
    for (int k = 0; k < 6; k++) {
        to[0][k] = from[0][k];
        to[1][k] = from[1][k];
    }
}

/* Return the least gap between two rows whose gaps are known, where it may be below `allowed`.

   Halves the way where the bound allows less than `allowed`, or once less was found, clearly less than that. A
   way so short that it cannot be told from touching counts as its bound. */
static Gap least_between(const Walk *walk, const int32_t *pair, const Pair *state, double gap_before, Gap now,
                         double allowed) {
    Gap least = now;
    const bool both = pair[1] < 0;
    const double bulge = of_both(walk->bulge, pair), slack_of_all = of_both(walk->slack, pair) - bulge;
    Stretch open[DEEPEST_HALVING];
    int depth = 1;
    open[0].u = 0.0;
    open[0].wide = 1.0;
    open[0].gap[0] = gap_before;
    open[0].gap[1] = now.mm;
    for (int k = 0; k < 6; k++) {
        open[0].ends[0][0][k] = walk->before[pair[0]][k];
        open[0].ends[1][0][k] = walk->now[pair[0]][k];
        open[0].ends[0][1][k] = both ? walk->before[pair[2]][k] : 0.0;
        open[0].ends[1][1][k] = both ? walk->now[pair[2]][k] : 0.0;
    }
    while (depth > 0 && least.mm > 0.0) {
        Stretch *first = &open[--depth];
        double chord = ends_moved(first->ends[0][0], first->ends[1][0]);
        if (both)
            chord += ends_moved(first->ends[0][1], first->ends[1][1]);
        const double slack = squared(first->wide) * slack_of_all + bulge;
        const double bound = 0.5 * (first->gap[0] + first->gap[1] - chord) - slack; /* eq. 2 */
        const double clearly = greater(ADVANCE_EXACT_MM, ADVANCE_EXACT_SHARE * least.mm);
        if (bound > allowed || (bound > 0.0 && least.mm <= allowed && bound > least.mm - clearly))
            continue;
        Stance between;
        Ends ends[2] = {{0.0}, {0.0}};
        for (int j = 0; j < STANCE; j++)
            between[j] = walk->stood[j] + (first->u + 0.5 * first->wide) * (walk->stands[j] - walk->stood[j]);
        place_two(between, &walk->arm, walk->bodies, pair, ends);
        Gap middle = gap_at(walk, pair, state, ends[0], ends[1], false);
        const double gap = middle.mm;
        middle.mm -= bulge;
        if (middle.mm < least.mm)
            least = middle;
        if (chord < ADVANCE_SHORT_MM || depth + 2 > DEEPEST_HALVING) {
            if (bound < least.mm)
                least.mm = bound;
            continue;
        }
        Stretch *second = first + 1;
        first->wide *= 0.5;
        *second = *first;
        second->u += first->wide;
        first->gap[1] = second->gap[0] = gap;
        copy_ends((const Ends *)ends, first->ends[1]);
        copy_ends((const Ends *)ends, second->ends[0]);
        depth += 2;
    }
    return least;
}

static Pair pair_state(Floats states, Bools known, int64_t pair) {
    double *at = &CELL(states, pair, 0);
    const Pair state = {&AT(known, pair), at, at + 1, at + 2, at + 8, at + 14, at + 15};
    return state;
}

static void remember(const Walk *walk, const Pair *state, const int32_t *pair, double gap) {
    const Ends *ends = walk->now;
    *state->known = true;
    *state->gap = gap;
    *state->limit = gap > 0.0 ? gap + of_both(walk->gone, pair) : -INFINITY;
    for (int k = 0; k < 6; k++) {
        state->own[k] = ends[pair[0]][k];
        state->other[k] = pair[1] < 0 ? ends[pair[2]][k] : 0.0;
    }
}

/* Return the least gap of a pair since the row before, or more than `allowed` where it is above that. */
static Gap judged(const Walk *walk, const int32_t *pair, const Pair *state, bool has_before, double allowed,
                  double near_mm) {
    const Ends *now = walk->now, *before = walk->before;
    const double slack = of_both(walk->slack, pair), gone = of_both(walk->gone, pair);
    const Gap far = {INFINITY, {NAN, NAN, NAN}};
    double gap_before = 0.0; /* no more than it was */
    if (*state->known && has_before) {
        if (*state->limit - gone > allowed) /* eq. 1 by all that the ends have gone, which is no less */
            return far;
        const double moved_before = moved_since(pair, state, before), moved = moved_since(pair, state, now);
        const double room = fabs(*state->gap) - greater(moved_before, moved) - slack; /* eq. 1 */
        gap_before = *state->gap - moved_before;
        if (*state->gap > 0.0 && room > allowed) {
            *state->limit = *state->gap - moved + gone;
            return far;
        }
        if (*state->inside > 0.0 && room > 2.0 * AT(walk->bodies->radius_mm, pair[0])) {
            const Gap within = {*state->gap + moved, {NAN, NAN, NAN}};
            return within;
        }
    }
    const bool may_be_inside = !*state->known || *state->gap <= 0.0;
    Gap gap = gap_of(walk, pair, state, now, may_be_inside);
    if (has_before && gap.mm > 0.0) {
        const double chord = pair_moved(pair, before, now);
        Gap least = {gap_before, {NAN, NAN, NAN}};
        if (gap_before <= 0.0 || !*state->known || 0.5 * (gap_before + gap.mm - chord) - slack <= near_mm)
            least = gap_of(walk, pair, state, before, false);
        if (least.mm > 0.0) /* else it begins where it touches */
            least = least_between(walk, pair, state, least.mm, gap, near_mm);
        remember(walk, state, pair, least.mm > 0.0 ? gap.mm : least.mm); /* behind a surface it may be inside */
        return least;
    }
    remember(walk, state, pair, gap.mm);
    return gap;
}

/* What tells that no pair can come as near as it is asked for, without placing a body: eq. 1 with the longest levers. */
typedef struct {
    double lever[AXES];  /* no body has a longer one */
    double step[STANCE]; /* from the row before */
    double sagitta;      /* of no body is it more on that way */
    double farthest;     /* no body goes farther on that way, with what it may be off the chord */
    double room;         /* every pair may still move so far */
    double used;         /* no body has gone farther since the rows were looked at one by one */
    int64_t passed;      /* rows since then */
} Leap;

static Leap no_leap(const Bodies *bodies) {
    Leap leap = {.room = -INFINITY};
    for (int64_t body = 0; body < bodies->link.rows; body++)
        for (int j = 0; j < AXES; j++)
            leap.lever[j] = greater(leap.lever[j], CELL(bodies->lever_mm, body, j));
    return leap;
}

/* Go on by a row. The samples of a controller may be off the chord by an eighth of the second difference, which is no
   more than the levers times that of the joints and four sagittae of either way. */
static void step_on(Leap *leap, const double *stood, const double *stands) {
    double turned = 0.0, bent = 0.0, shifted = 0.0, shift_bent = 0.0, share[AXES];
    const double sagitta = leap->sagitta;
    sagitta_shares(stood, stands, share);
    leap->sagitta = 0.0;
    for (int j = 0; j < AXES; j++) {
        const double step = stands[j] - stood[j];
        turned += leap->lever[j] * fabs(step);
        bent += leap->lever[j] * fabs(step - leap->step[j]);
        leap->sagitta += leap->lever[j] * share[j];
        leap->step[j] = step;
    }
    for (int j = AXES; j < STANCE; j++) {
        const double step = stands[j] - stood[j];
        shifted += fabs(step);
        shift_bent += fabs(step - leap->step[j]);
        leap->step[j] = step;
    }
    leap->farthest =
        turned + shifted + leap->sagitta + 0.125 * (bent + shift_bent + 4.0 * (sagitta + leap->sagitta));
}

/* Write the stance of a row. */
static void stance_of(Floats q_rad, Floats shift_mm, int64_t row, double *stance) {
    for (int j = 0; j < AXES; j++)
        stance[j] = CELL(q_rad, row, j);
    for (int j = AXES; j < STANCE; j++)
        stance[j] = CELL(shift_mm, row, j - AXES);
}

/* How far every pair may still move before it has to be looked at. Where that is less than half the gap, it is
   counted from where the pair is now; where it is less than `worth`, the gap is computed again. */
static double room_of_all(const Walk *walk, const Watched *watched, double horizon_mm, double worth) {
    double least = INFINITY;
    for (int64_t each = 0; each < watched->pairs.rows && least > 0.0; each++) {
        const int32_t *pair = &CELL(watched->pairs, each, 0);
        const Pair state = pair_state(watched->states, watched->known, each);
        if (!*state.known || *state.gap <= 0.0)
            return -INFINITY;
        const double gone = of_both(walk->gone, pair);
        double room = *state.limit - gone - horizon_mm;
        if (room < 0.5 * *state.gap) {
            const double moved = moved_since(pair, &state, walk->now);
            *state.limit = *state.gap - moved + gone;
            room = *state.limit - gone - horizon_mm;
            if (room < worth) {
                remember(walk, &state, pair, gap_of(walk, pair, &state, walk->now, false).mm);
                room = *state.limit - gone - horizon_mm;
            }
        }
        least = lesser(least, pair[1] < 0 ? 0.5 * room : room);
    }
    return least;
}

/* Place the bodies in the rows before one, which have been passed by. */
static void place_past(Walk *walk, const Leap *leap, Floats q_rad, Floats shift_mm, int64_t row, Floats past) {
    for (int back = leap->passed > 1 ? 2 : 1; back > 0; back--) {
        Stance stance;
        stance_of(q_rad, shift_mm, row - back, stance);
        place_bodies(stance, &walk->arm, walk->bodies, walk->now);
        for (int64_t body = 0; body < walk->bodies->link.rows; body++)
            for (int k = 0; k < 6; k++) {
                CELL(past, body, 6 + k) = CELL(past, body, k);
                CELL(past, body, k) = walk->now[body][k];
            }
    }
}

/* Count all that has been used as gone by every body. */
static void count_gone(Walk *walk, Leap *leap, Floats past) {
    for (int64_t body = 0; body < walk->bodies->link.rows; body++)
        walk->gone[body] = CELL(past, body, 12) += leap->used;
    leap->used = 0.0;
}

/* Look where the bodies are now; tell whether they all still had room on the way to this row. */
static bool may_leap_on(Walk *walk, Leap *leap, const Watched *watched, double horizon_mm) {
    place_bodies(walk->stands, &walk->arm, walk->bodies, walk->now);
    leap->room = room_of_all(walk, watched, horizon_mm, WORTH_ROWS * leap->farthest);
    return leap->room > leap->farthest;
}

/* Walk along rows of angles (n, 6), and of shifts of the robot root (n, 3), from `first` on, until the notes are full; return the row that comes next.

   Writes the least gap (n) up to `horizon_mm` since the row before, and of which pair (n), -1: none is as near.
   Gaps up to `near_mm` are noted with row and pair, and with gap and place. A row of NaN begins a new way. */
EXPORT int64_t collision_along(Floats q_rad, Floats shift_mm, int64_t first, Floats geometry, const Bodies *bodies,
                               const Obstacles *obstacles, const Watched *watched, double horizon_mm, double near_mm,
                               int64_t is_sampled, Floats gap_mm, Ints32 nearest, Ints notes, Floats note_values,
                               Ints noted) {
    Walk walk;
    walk.bodies = bodies;
    walk.obstacles = obstacles;
    walk.arm = arm_of(geometry);
    const int64_t count = bodies->link.rows, pairs = watched->pairs.rows;
    int64_t steps = first > 0 ? AT(watched->steps, 0) : 0; /* rows without a break up to the last one */
    Floats past = watched->ends_mm;                         /* of the last row and the one before it; way gone */
    Leap leap = no_leap(bodies);
    for (int64_t i = first; i < q_rad.rows; i++) {
        if (AT(noted, 0) + pairs > notes.rows) {
            AT(watched->steps, 0) = steps;
            return i;
        }
        AT(gap_mm, i) = horizon_mm;
        AT(nearest, i) = -1;
        if (isnan(CELL(q_rad, i, 0))) {
            steps = 0;
            AT(gap_mm, i) = NAN;
            leap.room = -INFINITY;
            leap.used = 0.0;
            leap.passed = 0;
            continue;
        }
        stance_of(q_rad, shift_mm, i, walk.stands);
        if (leap.passed == 0)
            stance_of(q_rad, shift_mm, steps > 0 ? i - 1 : i, walk.stood);
        if (steps > 0)
            step_on(&leap, walk.stood, walk.stands);
        if (steps > 1 && i + 1 < q_rad.rows) {
            leap.used += leap.farthest;
            bool may_leap = leap.used < leap.room;
            if (!may_leap && leap.passed >= WORTH_LOOKING) {
                count_gone(&walk, &leap, past);
                may_leap = may_leap_on(&walk, &leap, watched, horizon_mm);
            }
            if (may_leap) {
                leap.passed++;
                steps++;
                for (int j = 0; j < STANCE; j++)
                    walk.stood[j] = walk.stands[j];
                continue;
            }
        }
        if (leap.passed > 0) {
            place_past(&walk, &leap, q_rad, shift_mm, i, past);
            count_gone(&walk, &leap, past);
        }
        leap.used = 0.0;
        leap.passed = 0;
        place_bodies(walk.stands, &walk.arm, bodies, walk.now);
        sagitta_shares(walk.stood, walk.stands, walk.share);
        for (int64_t body = 0; body < count; body++) {
            walk.bulge[body] = 0.0;
            double square[2] = {0.0, 0.0};
            for (int k = 0; k < 6; k++) {
                const double last = CELL(past, body, k), earlier = CELL(past, body, 6 + k);
                walk.before[body][k] = last;
                if (is_sampled && steps > 1)
                    square[k / 3] += squared(walk.now[body][k] - 2.0 * last + earlier);
                CELL(past, body, 6 + k) = last;
                CELL(past, body, k) = walk.now[body][k];
            }
            walk.bulge[body] = 0.125 * sqrt(greater(square[0], square[1]));
            walk.slack[body] = walk.bulge[body] + sagitta(&walk, body);
            if (steps > 0)
                CELL(past, body, 12) += ends_moved(walk.before[body], walk.now[body]) + walk.slack[body];
            walk.gone[body] = CELL(past, body, 12);
        }
        for (int64_t each = 0; each < pairs; each++) {
            const int32_t *pair = &CELL(watched->pairs, each, 0);
            const Pair state = pair_state(watched->states, watched->known, each);
            if (steps == 0)
                *state.known = false;
            const double allowed = lesser(horizon_mm, greater(AT(gap_mm, i), near_mm));
            const Gap gap = judged(&walk, pair, &state, steps > 0, allowed, near_mm);
            if (gap.mm < AT(gap_mm, i)) {
                AT(gap_mm, i) = gap.mm;
                AT(nearest, i) = (int32_t)each;
            }
            if (gap.mm < near_mm) {
                const int64_t note = AT(noted, 0)++;
                CELL(notes, note, 0) = i;
                CELL(notes, note, 1) = each;
                CELL(note_values, note, 0) = gap.mm;
                for (int k = 0; k < 3; k++)
                    CELL(note_values, note, 1 + k) = gap.place[k];
            }
        }
        steps++;
        leap.room = steps > 1 ? room_of_all(&walk, watched, horizon_mm, WORTH_ROWS * leap.farthest) : -INFINITY;
    }
    AT(watched->steps, 0) = steps;
    return q_rad.rows;
}

/* Write the gaps (n) of segments (n, 6) with a radius from the first obstacle, and the nearest places (n, 3). */
EXPORT void collision_gaps(Floats segments, double radius_mm, const Obstacles *obstacles, Floats gap_mm, Floats place) {
    Walk walk;
    walk.obstacles = obstacles;
    double inside = 0.0, triangle = 0.0;
    for (int64_t i = 0; i < segments.rows; i++)
        AT(gap_mm, i) = segment_from_obstacle(&walk, 0, &CELL(segments, i, 0), radius_mm, &inside, &triangle, true,
                                              &CELL(place, i, 0));
}

/* Write the distances (n) of pairs of segments (n, 12). */
EXPORT void collision_segments(Floats segments, Floats far_mm) {
    for (int64_t i = 0; i < segments.rows; i++) {
        double place[3];
        AT(far_mm, i) = sqrt(segment_segment(&CELL(segments, i, 0), &CELL(segments, i, 6), place));
    }
}

/* Write the nearest places (n, 3) on the surface of the first obstacle, a mesh, of places (n, 3). */
EXPORT void collision_nearest(Floats places, const Obstacles *obstacles, Floats nearest) {
    const Tree tree = tree_of(obstacles, 0);
    int64_t triangle = 0; /* a place is near the one before it */
    for (int64_t i = 0; i < places.rows; i++) {
        const double *place = &CELL(places, i, 0);
        const double segment[6] = {place[0], place[1], place[2], place[0], place[1], place[2]};
        tree_distance(&tree, segment, &triangle, &CELL(nearest, i, 0));
    }
}
