/* Cut the body of a cutter, in any direction and while it turns, out of three fields of dexels.

What a step sweeps on a ray is the union of what the body covers from its first pose to its last. A convex body that goes
straight covers [s_in(t), s_out(t)] with s_in convex and s_out concave in t, so the ends of the union are found from the
slopes at both poses; the turn within a step is so small that this holds for it too. Blocks of rays are left alone where
a plane parts them from the body at both poses. */

#include "cutting/dexels.h"

#include "collision/shapes.h"

#define NEAR_MM 2e-6       /* a place is on a body */
#define THIN_MM 1e-4       /* a stretch that is shorter is none; an end that moves by less stays */
#define PARTED_MM 1e-5     /* a plane parts where it does so by no less than minus this */
#define FINE 0.02          /* of a cell: where a swept surface may be beside the true one */
#define PARALLEL 1e-6      /* cosine between ray and surface below which its slope says nothing of the step */
#define ROOM 0.577          /* of how far rays are free along all three axes: where a plane that passes one of them may be */
#define FREE_MM 1e3         /* as far as a ray without an end is free */
#define GRAZES 1e-9        /* cosine between ray and surface below which it has no slope */

enum { SIDE = TD_SIDE, MOST_NEWTON = 40, MOST_HALVINGS = 10 };

typedef struct {
    const Stock *stock;
    const Body *body;
    const Step *step;
    const Field *field;
    Pose first, middle, last;
    bool turns;
    double low[3], high[3]; /* how far it reaches */
    double way[2], per_across, per_square; /* of the tip as seen along the rays: see nearest_share */
    double fine_mm;         /* where a surface may be beside the swept one */
} Cut;

/* Where a ray enters and leaves a body: the place on it, and how that moves with the step. */
typedef struct {
    bool hits;
    double at[2], slope[2], normal[2][3];
} Hit;

Stock stock_of(const Dexels *dexels) {
    Stock stock = {.of = dexels};
    int64_t blocks = 0;
    for (int axis = 0; axis < 3; axis++) {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const int64_t columns = AT(dexels->cells, u), rows = AT(dexels->cells, v);
        const int64_t block_columns = (columns + SIDE - 1) / SIDE;
        stock.fields[axis] = (Field){axis, u, v, columns, rows, block_columns, blocks};
        stock.low[axis] = AT(dexels->low_mm, axis);
        stock.cell[axis] = AT(dexels->cell_mm, axis);
        stock.cells[axis] = AT(dexels->cells, axis);
        blocks += block_columns * ((rows + SIDE - 1) / SIDE);
    }
    return stock;
}

Pose pose_at(const Step *step, double share) {
    Pose pose;
    double square = 0.0;
    for (int k = 0; k < 3; k++) {
        pose.tip[k] = step->from.tip[k] + share * step->way[k];
        pose.axis[k] = step->from.axis[k] + share * step->turn[k];
        square += squared(pose.axis[k]);
    }
    const double unit = 1.0 / sqrt(square);
    for (int k = 0; k < 3; k++)
        pose.axis[k] *= unit;
    return pose;
}

double outside_of(const Body *body, double radius, double height, double away[2]) {
    const double x = radius - body->bottom, y = height - body->corner;
    const double side = x * body->sin_kappa - y * body->cos_kappa - body->corner, under = -height;
    double most = under;
    away[0] = 0.0;
    away[1] = -1.0;
    if (x > 0.0 && x * body->cos_kappa + y * body->sin_kappa < 0.0) {
        const double distance = sqrt(x * x + y * y);
        most = distance - body->corner;
        away[0] = x / distance;
        away[1] = y / distance;
    } else if (side > under) {
        most = side;
        away[0] = body->sin_kappa;
        away[1] = -body->cos_kappa;
    }
    if (radius - body->radius > most) {
        most = radius - body->radius;
        away[0] = 1.0;
        away[1] = 0.0;
    }
    if (height - body->top > most) {
        most = height - body->top;
        away[0] = 0.0;
        away[1] = 1.0;
    }
    return most;
}

double outside_at(const Body *body, const Pose *pose, const double *place) {
    double off[3], away[2];
    minus3(place, pose->tip, off);
    const double height = dot3(off, pose->axis), square = dot3(off, off) - height * height;
    return outside_of(body, sqrt(greater(square, 0.0)), height, away);
}

double reach_of(const Body *body, const Pose *pose, const double *along) {
    const double up = dot3(along, pose->axis), aside = sqrt(greater(1.0 - up * up, 0.0));
    double reach = body->bottom * aside + body->corner * (up + 1.0);
    if (body->cos_kappa > GRAZES) {
        const double rise = (body->radius - body->bottom) * body->sin_kappa - body->corner;
        reach = greater(reach, body->radius * aside + (body->corner + rise / body->cos_kappa) * up);
    }
    return dot3(along, pose->tip) + greater(reach, body->radius * aside + body->top * up);
}

/* A ray seen from a body: along it, height = height + s·climb and radius² = a·s² + 2·b·s + c, s counted from the tip. */
typedef struct {
    double off[3], height, climb, a, b, c;
} Seen;

/* A place on a ray near a body: how far along, its height and radius there, the direction away from the surface. */
typedef struct {
    double at, height, radius, away[2];
} Met;

/* Move a place on a ray towards the body, from outside of it, until it is on its surface; returns false where it is
   passed by. How far outside is convex along the ray, so that Newton's steps never go too far. */
static bool approach(const Body *body, const Seen *seen, double sense, double limit, Met *met) {
    for (int round = 0; round < MOST_NEWTON; round++) {
        const double s = met->at;
        met->height = seen->height + s * seen->climb;
        met->radius = sqrt(greater((seen->a * s + 2.0 * seen->b) * s + seen->c, 1e-18));
        const double outside = outside_of(body, met->radius, met->height, met->away);
        if (outside <= NEAR_MM)
            return true;
        const double slope = met->away[0] * (seen->a * s + seen->b) / met->radius + met->away[1] * seen->climb;
        if (slope * sense >= -GRAZES)
            return false;
        met->at = s - outside / slope;
        if ((met->at - limit) * sense > 0.0)
            return false;
    }
    return true;
}

/* Move the ends of a ray that lie below the rim of a ball onto it; returns false where it is passed by. */
static bool begin_on_ball(const Body *body, const Seen *seen, double *ends) {
    const double up = body->corner - seen->height; /* the middle, from the place at s = 0 */
    const double rim = body->corner * (1.0 - body->cos_kappa);
    const double along = body->corner * seen->climb;
    const double root = along * along - seen->c - up * up + squared(body->corner);
    for (int end = 0; end < 2; end++) {
        if (seen->height + ends[end] * seen->climb >= rim)
            continue;
        if (root <= 0.0)
            return false;
        const double at = along + (end == 0 ? -sqrt(root) : sqrt(root));
        if (seen->height + at * seen->climb < rim)
            ends[end] = at;
    }
    return ends[0] < ends[1];
}

/* Move the ends of a ray to the cone that the side of a body lies on; returns false where it is passed by. */
static bool begin_on_cone(const Body *body, const Seen *seen, double *ends) {
    const double widens = body->cos_kappa / body->sin_kappa;
    const double at_tip = body->bottom + body->corner * (1.0 / body->sin_kappa - widens);
    const double first = at_tip + widens * seen->height, change = widens * seen->climb;
    const double a = seen->a - change * change, b = seen->b - first * change, c = seen->c - first * first;
    const double root = b * b - a * c;
    if (fabs(a) < 1e-9)
        return true; /* along the side */
    if (root <= 0.0)
        return a < 0.0;
    const double low = (-b - sqrt(root)) / a, high = (-b + sqrt(root)) / a;
    if (a > 0.0) {
        ends[0] = greater(ends[0], low);
        ends[1] = lesser(ends[1], high);
        return ends[0] < ends[1] && first + low * change > 0.0;
    }
    /* steeper than the side: it is passed once on each half of the cone */
    if (change > 0.0)
        ends[0] = greater(ends[0], greater(low, high));
    else
        ends[1] = lesser(ends[1], lesser(low, high));
    return ends[0] < ends[1];
}

/* Narrow [low, high] to where a quantity that changes evenly, first at s = 0, is between 0 and a limit. */
static bool narrow(double first, double change, double limit, double *low, double *high) {
    if (fabs(change) < 1e-12)
        return first >= -NEAR_MM && first <= limit;
    const double slow = 1.0 / change, a = -first * slow, b = (limit - first) * slow;
    *low = greater(*low, lesser(a, b));
    *high = lesser(*high, greater(a, b));
    return *low < *high;
}

/* Hold a ray, through `place` across its axis, against the body at a share of the step. */
static void hold(const Cut *cut, const double *place, double share, Hit *hit) {
    const Body *body = cut->body;
    const int axis = cut->field->axis, u = cut->field->u, v = cut->field->v;
    Pose pose = share == 0.0 ? cut->first : cut->last;
    if (share > 0.0 && share < 1.0 && cut->turns)
        pose = pose_at(cut->step, share);
    else if (share > 0.0 && share < 1.0)
        between3(cut->first.tip, cut->last.tip, share, pose.tip);
    hit->hits = false;
    Seen seen;
    seen.off[axis] = 0.0;
    seen.off[u] = place[u] - pose.tip[u];
    seen.off[v] = place[v] - pose.tip[v];
    const double square = squared(seen.off[u]) + squared(seen.off[v]);
    seen.climb = pose.axis[axis];
    seen.height = seen.off[u] * pose.axis[u] + seen.off[v] * pose.axis[v];
    seen.a = 1.0 - squared(seen.climb);
    seen.b = -seen.height * seen.climb;
    seen.c = square - squared(seen.height);
    double ends[2] = {-INFINITY, INFINITY};
    if (!narrow(seen.height, seen.climb, body->top, &ends[0], &ends[1]))
        return;
    const double over = seen.c - squared(body->radius);
    if (seen.a > 1e-12) {
        const double root = seen.b * seen.b - seen.a * over;
        if (root <= 0.0)
            return;
        const double wide = sqrt(root), longer = 1.0 / seen.a;
        ends[0] = greater(ends[0], (-seen.b - wide) * longer);
        ends[1] = lesser(ends[1], (-seen.b + wide) * longer);
    } else if (over >= 0.0) {
        return;
    }
    if (!(ends[0] < ends[1]))
        return;
    if (body->cos_kappa > 0.0 && !begin_on_cone(body, &seen, ends))
        return;
    if (body->bottom == 0.0 && body->corner > 0.0 && !begin_on_ball(body, &seen, ends))
        return;
    Met met[2] = {{.at = ends[0]}, {.at = ends[1]}};
    if (!approach(body, &seen, 1.0, met[1].at, &met[0]) || !approach(body, &seen, -1.0, met[0].at, &met[1]))
        return;
    hit->hits = true;
    for (int end = 0; end < 2; end++) {
        double *normal = hit->normal[end], move = 0.0;
        seen.off[axis] = met[end].at;
        const double height = met[end].height, aside = met[end].away[0] / met[end].radius;
        const double turns = dot3(cut->step->turn, seen.off), along = met[end].away[1] - aside * height;
        for (int k = 0; k < 3; k++) {
            normal[k] = aside * seen.off[k] + along * pose.axis[k];
            move += normal[k] * (cut->step->way[k] + cut->step->turn[k] * height - pose.axis[k] * turns);
        }
        hit->at[end] = pose.tip[axis] + met[end].at;
        hit->slope[end] = fabs(normal[axis]) < GRAZES ? 0.0 : move / normal[axis];
    }
}

/* Write the normal of the surface that a step leaves between two poses: that of the two normals there which is across the
   way. A sharp edge leaves a surface that is neither of its own sides. */
static void face(const Cut *cut, int end, const Hit *from, const Hit *to, double *normal) {
    const int axis = cut->field->axis;
    const double *a = from->normal[end], *b = to->normal[end];
    const double of_b = fabs(from->slope[end] * a[axis]), of_a = fabs(to->slope[end] * b[axis]);
    if (!(of_a + of_b > 0.0) || (from->slope[end] > 0.0) == (to->slope[end] > 0.0))
        return;
    double square = 0.0;
    for (int k = 0; k < 3; k++) {
        normal[k] = of_a * a[k] + of_b * b[k];
        square += squared(normal[k]);
    }
    for (int k = 0; k < 3; k++)
        normal[k] /= sqrt(square);
}

/* Tell whether a ray has material between two places on it, in either order. */
static bool has_between(const Cut *cut, const Ray *ray, double a, double b) {
    const double low = lesser(a, b) - cut->fine_mm, high = greater(a, b) + cut->fine_mm;
    for (int64_t k = 0; k < ray->filled; k++)
        if (end_at(cut->stock, ray, 2 * k)->at < high && end_at(cut->stock, ray, 2 * k + 1)->at > low)
            return true;
    return false;
}

/* Return where a step leads to at most on a ray, by the tangent at a pose: entry (0) comes no earlier, exit (1) no later than
   that, a share of the step `ahead` of the pose (behind it: negative). */
static double bound_of(const Cut *cut, const Hit *hit, int end, double ahead) {
    const double sense = end == 0 ? 1.0 : -1.0;
    if (fabs(hit->normal[end][cut->field->axis]) < PARALLEL)
        return -sense * INFINITY;
    return hit->at[end] + sense * lesser(sense * hit->slope[end] * ahead, 0.0);
}

/* Tell whether there is something to gain between the end that is known and a bound of it. */
static bool may_gain(const Cut *cut, const Ray *ray, int end, double known, double bound) {
    const double sense = end == 0 ? 1.0 : -1.0;
    return (known - bound) * sense >= cut->fine_mm && has_between(cut, ray, bound, known);
}

static void gain(const Hit *here, int end, Hit *best) {
    const double sense = end == 0 ? 1.0 : -1.0;
    if ((here->at[end] - best->at[end]) * sense < 0.0) {
        best->at[end] = here->at[end];
        copy3(here->normal[end], best->normal[end]);
    }
}

/* Widen `best` to the end of what the part of the step from a to b covers on a ray, entry (0) or exit (1): between two poses
   whose slopes say that it lies between them. A pose that misses has none. */
static void widen(const Cut *cut, const Ray *ray, const double *place, int end, double a, const Hit *at_a, double b,
                  const Hit *at_b, Hit *best) {
    const double sense = end == 0 ? 1.0 : -1.0;
    Hit room[3]; /* two poses that are held against the ray, and the one that is tried */
    const Hit *from = at_a, *to = at_b;
    Hit *here = &room[0];
    bool is_between = false;
    for (int round = 0; round < MOST_HALVINGS; round++) {
        if ((from->hits && from->slope[end] * sense >= 0.0) || (to->hits && to->slope[end] * sense <= 0.0))
            break;
        double share = 0.5 * (a + b);
        if (from->hits && to->hits) { /* where the tangents meet: none is beyond */
            const double steeper = from->slope[end] - to->slope[end];
            const double meets = (to->at[end] - from->at[end] - to->slope[end] * (b - a)) / steeper;
            if (!may_gain(cut, ray, end, best->at[end], from->at[end] + from->slope[end] * clamped(meets, 0.0, b - a)))
                break;
            /* that is the place on a kink; on a parabola it is where the slope, which changes evenly, is 0 */
            const double after = round % 2 ? meets : (b - a) * from->slope[end] / steeper;
            share = a + clamped(after, 0.02 * (b - a), 0.98 * (b - a));
        } else if (from->hits || to->hits) {
            const Hit *known = from->hits ? from : to;
            if (!may_gain(cut, ray, end, best->at[end], bound_of(cut, known, end, from->hits ? b - a : a - b)))
                break;
        }
        hold(cut, place, share, here);
        if (here->hits) {
            is_between = true;
            gain(here, end, best);
        }
        if (here->hits ? here->slope[end] * sense < 0.0 : !from->hits) {
            a = share;
            from = here;
        } else {
            b = share;
            to = here;
        }
        for (int k = 0; k < 3; k++)
            if (&room[k] != from && &room[k] != to)
                here = &room[k];
    }
    if (is_between && from->hits && to->hits)
        face(cut, end, from, to, best->normal[end]);
}

/* Take what nearest_share needs of a field. */
static void look_along(Cut *cut) {
    const int u = cut->field->u, v = cut->field->v;
    const double way_u = cut->last.tip[u] - cut->first.tip[u], way_v = cut->last.tip[v] - cut->first.tip[v];
    const double across = way_u * cut->middle.axis[v] - way_v * cut->middle.axis[u], square = way_u * way_u + way_v * way_v;
    const bool is_level = square < 1e-12 || fabs(across) < 1e-6 * sqrt(square);
    cut->way[0] = way_u;
    cut->way[1] = way_v;
    cut->per_across = is_level ? 0.0 : 1.0 / across;
    cut->per_square = is_level ? 0.0 : 1.0 / square;
}

/* Return the share of the step at which the axis of the body, as seen along the rays, is nearest to a ray; its end where that is
   the same all the way. */
static double nearest_share(const Cut *cut, const double *place) {
    if (cut->per_square == 0.0)
        return 1.0;
    const int u = cut->field->u, v = cut->field->v;
    const Pose *middle = &cut->middle;
    const double off_u = place[u] - middle->tip[u], off_v = place[v] - middle->tip[v];
    const double up = clamped((cut->way[0] * off_v - cut->way[1] * off_u) * cut->per_across, cut->body->corner, cut->body->top);
    const double along = (off_u - up * middle->axis[u]) * cut->way[0] + (off_v - up * middle->axis[v]) * cut->way[1];
    return clamped(0.5 + along * cut->per_square, 0.0, 1.0);
}

/* Write what the whole step covers on a ray, as far as there is material: the pose whose axis is nearest to it is held against it
   first, and its first and last pose only where the tangents there leave something to gain. */
static void swept(const Cut *cut, const Ray *ray, const double *place, Hit *best) {
    const double share = nearest_share(cut, place);
    Hit near, outer[2];
    hold(cut, place, share, best);
    if (!best->hits) {
        hold(cut, place, 0.0, &outer[0]);
        hold(cut, place, 1.0, &outer[1]);
        if (outer[0].hits || outer[1].hits)
            *best = outer[outer[0].hits ? 0 : 1];
        for (int end = 0; end < 2 && best->hits; end++) {
            if (outer[1].hits)
                gain(&outer[1], end, best);
            widen(cut, ray, place, end, 0.0, &outer[0], 1.0, &outer[1], best);
        }
        return;
    }
    bool is_copied = false, is_held[2] = {false, false};
    for (int end = 0; end < 2; end++)
        for (int side = 0; side < 2; side++) {
            const double ahead = (double)side - share;
            const Hit *known = is_copied ? &near : best;
            if (ahead == 0.0 || !may_gain(cut, ray, end, best->at[end], bound_of(cut, known, end, ahead)))
                continue;
            if (!is_copied)
                near = *best;
            is_copied = true;
            if (!is_held[side])
                hold(cut, place, (double)side, &outer[side]);
            is_held[side] = true;
            if (outer[side].hits)
                gain(&outer[side], end, best);
            if (side == 0)
                widen(cut, ray, place, end, 0.0, &outer[0], share, &near, best);
            else
                widen(cut, ray, place, end, share, &near, 1.0, &outer[1], best);
        }
}

static int32_t packed(const double *normal, int32_t stamp) {
    uint32_t bits = (uint32_t)stamp << 24;
    for (int k = 0; k < 3; k++)
        bits |= (uint32_t)((int32_t)lrint(-normal[k] * TD_SHORTENED) & 0xff) << (8 * k);
    return (int32_t)bits;
}

/* Make two stretches of one on a ray, which is moved behind all others where it has no room; return false where there is none. */
static bool split(const Dexels *dexels, Ray *ray, int64_t k, RayEnd end, RayEnd begin) {
    const int64_t filled = 2 * (int64_t)ray->filled, room = 2 * (int64_t)ray->room, used = AT(dexels->used, 0);
    int64_t first = ray->first;
    if (filled == room) {
        if (ray->filled >= TD_MOST || used + 2 * room > dexels->ends.rows)
            return false;
        first = used;
        AT(dexels->used, 0) = used + 2 * room;
        ray->room *= 2;
    }
    for (int64_t j = filled - 1; j > 2 * k; j--)
        AT(dexels->ends, first + j + 2) = AT(dexels->ends, ray->first + j);
    for (int64_t j = 0; j <= 2 * k && first != ray->first; j++)
        AT(dexels->ends, first + j) = AT(dexels->ends, ray->first + j);
    AT(dexels->ends, first + 2 * k + 1) = end;
    AT(dexels->ends, first + 2 * k + 2) = begin;
    ray->first = (int32_t)first;
    ray->filled++;
    return true;
}

/* Take what is covered out of a ray, and put a stamp on the ends that it gets; return false where it has no room. */
static bool take(const Stock *stock, Ray *ray, const Hit *hit, int32_t stamp, double *longest) {
    const float low = (float)hit->at[0], high = (float)hit->at[1];
    int64_t left = 0;
    for (int64_t k = 0; k < ray->filled; k++) {
        RayEnd *a = end_at(stock, ray, 2 * k), *b = end_at(stock, ray, 2 * k + 1);
        const bool is_before = low - a->at > (float)THIN_MM, is_behind = b->at - high > (float)THIN_MM;
        const float cut = (b->at < high ? b->at : high) - (a->at > low ? a->at : low);
        if (cut > (float)THIN_MM) {
            *longest = greater(*longest, cut);
            const RayEnd end = {low, is_before ? packed(hit->normal[0], stamp) : 0};
            const RayEnd begin = {high, is_behind ? packed(hit->normal[1], stamp) : 0};
            if (is_before && is_behind)
                return split(stock->of, ray, k, end, begin);
            if (is_before)
                *b = end;
            else if (is_behind)
                *a = begin;
            else
                continue;
        }
        if (left < k) {
            *end_at(stock, ray, 2 * left) = *a;
            *end_at(stock, ray, 2 * left + 1) = *b;
        }
        left++;
    }
    ray->filled = (uint8_t)left;
    return true;
}

/* Tell whether a plane parts a box from the body at both poses: across the way from its axis to the box. */
static bool is_parted(const Cut *cut, const double *low, const double *high) {
    const Body *body = cut->body;
    const Pose *middle = &cut->middle;
    double on_axis[3], near[3], off[3], away[2];
    for (int k = 0; k < 3; k++)
        near[k] = 0.5 * (low[k] + high[k]);
    for (int round = 0; round < 3; round++) {
        minus3(near, middle->tip, off);
        const double up = clamped(dot3(off, middle->axis), lesser(body->corner + body->radius, 0.5 * body->top), body->top);
        for (int k = 0; k < 3; k++) {
            on_axis[k] = middle->tip[k] + up * middle->axis[k];
            near[k] = clamped(on_axis[k], low[k], high[k]);
        }
    }
    minus3(near, middle->tip, off);
    const double height = dot3(off, middle->axis), radius = sqrt(greater(dot3(off, off) - height * height, 1e-18));
    outside_of(body, radius, height, away);
    double normal[3], nearest = 0.0;
    for (int k = 0; k < 3; k++) {
        normal[k] = away[0] * (off[k] - height * middle->axis[k]) / radius + away[1] * middle->axis[k];
        nearest += normal[k] * (normal[k] > 0.0 ? low[k] : high[k]);
    }
    return nearest >= greater(reach_of(body, &cut->first, normal), reach_of(body, &cut->last, normal)) - PARTED_MM;
}

/* A range of cells along an axis: those whose middle lies between two coordinates. */
static void cells_in(const Stock *stock, int axis, double low, double high, int64_t *first, int64_t *after) {
    const double origin = stock->low[axis], size = stock->cell[axis];
    *first = most((int64_t)ceil((low - origin) / size - 0.5), 0);
    *after = least((int64_t)floor((high - origin) / size - 0.5) + 1, stock->cells[axis]);
}

/* Compute the bound of a block again: lowest and highest end. */
static void bound_block(const Stock *stock, const Field *field, int64_t row, int64_t column) {
    float low = INFINITY, high = -INFINITY;
    for (int64_t i = row * SIDE; i < least((row + 1) * SIDE, field->rows); i++)
        for (int64_t j = column * SIDE; j < least((column + 1) * SIDE, field->columns); j++) {
            const Ray *ray = ray_at(stock, field, i, j);
            if (ray->filled == 0)
                continue;
            const float first = end_at(stock, ray, 0)->at, last = end_at(stock, ray, 2 * ray->filled - 1)->at;
            low = first < low ? first : low;
            high = last > high ? last : high;
        }
    const int64_t block = field->first_block + row * field->block_columns + column;
    CELL(stock->of->bound, block, 0) = low;
    CELL(stock->of->bound, block, 1) = high;
}

/* Return whether a ray has material where the body reaches; widen the bounds of it. */
static bool is_reached(const Cut *cut, const Ray *ray, double *low, double *high) {
    const int axis = cut->field->axis;
    bool is = false;
    for (int64_t k = 0; k < ray->filled; k++) {
        const double a = greater(end_at(cut->stock, ray, 2 * k)->at, cut->low[axis]);
        const double b = lesser(end_at(cut->stock, ray, 2 * k + 1)->at, cut->high[axis]);
        if (b - a > THIN_MM) {
            *low = lesser(*low, a);
            *high = greater(*high, b);
            is = true;
        }
    }
    return is;
}

/* Cut the rays of a block within ranges of cells; return false where one has no room. */
static bool cut_block(const Cut *cut, int64_t row, int64_t column, const int64_t *u, const int64_t *v, double *longest) {
    const Stock *stock = cut->stock;
    const Field *field = cut->field;
    const int64_t block = field->first_block + row * field->block_columns + column;
    const int64_t i0 = most(row * SIDE, v[0]), i1 = least((row + 1) * SIDE, v[1]);
    const int64_t j0 = most(column * SIDE, u[0]), j1 = least((column + 1) * SIDE, u[1]);
    if (CELL(stock->of->bound, block, 0) >= cut->high[field->axis] || CELL(stock->of->bound, block, 1) <= cut->low[field->axis])
        return true;
    double low[3], high[3], place[3] = {0.0, 0.0, 0.0};
    bool is_in[SIDE * SIDE], has_room = true;
    low[field->axis] = INFINITY;
    high[field->axis] = -INFINITY;
    for (int64_t i = i0, at = 0; i < i1; i++)
        for (int64_t j = j0; j < j1; j++)
            is_in[at++] = is_reached(cut, ray_at(stock, field, i, j), &low[field->axis], &high[field->axis]);
    low[field->u] = middle_of(stock, field->u, j0);
    high[field->u] = middle_of(stock, field->u, j1 - 1);
    low[field->v] = middle_of(stock, field->v, i0);
    high[field->v] = middle_of(stock, field->v, i1 - 1);
    if (!(low[field->axis] < high[field->axis]) || is_parted(cut, low, high))
        return true;
    for (int64_t i = i0, at = 0; i < i1; i++)
        for (int64_t j = j0; j < j1 && has_room; j++) {
            if (!is_in[at++])
                continue;
            place[field->u] = middle_of(stock, field->u, j);
            place[field->v] = middle_of(stock, field->v, i);
            Ray *ray = ray_at(stock, field, i, j);
            Hit hit;
            swept(cut, ray, place, &hit);
            if (hit.hits)
                has_room = take(stock, ray, &hit, cut->step->stamp, longest);
        }
    bound_block(stock, field, row, column);
    return has_room;
}

/* Take a step out of the stock: see dexels.h. */
bool cut_out(const Stock *stock, const Body *body, const Step *step, double *removed_mm) {
    Cut cut = {.stock = stock, .body = body, .step = step, .fine_mm = FINE * stock->cell[0]};
    cut.first = pose_at(step, 0.0);
    cut.middle = pose_at(step, 0.5);
    cut.last = pose_at(step, 1.0);
    cut.turns = dot3(step->turn, step->turn) > 0.0;
    int64_t cells[3][2];
    for (int axis = 0; axis < 3; axis++) {
        double along[3] = {0.0, 0.0, 0.0};
        along[axis] = 1.0;
        cut.high[axis] = greater(reach_of(body, &cut.first, along), reach_of(body, &cut.last, along));
        along[axis] = -1.0;
        cut.low[axis] = -greater(reach_of(body, &cut.first, along), reach_of(body, &cut.last, along));
        cells_in(stock, axis, cut.low[axis], cut.high[axis], &cells[axis][0], &cells[axis][1]);
    }
    for (int axis = 0; axis < 3; axis++) {
        cut.field = &stock->fields[axis];
        look_along(&cut);
        const int64_t *u = cells[cut.field->u], *v = cells[cut.field->v];
        if (u[0] >= u[1] || v[0] >= v[1])
            continue;
        for (int64_t row = v[0] / SIDE; row <= (v[1] - 1) / SIDE; row++)
            for (int64_t column = u[0] / SIDE; column <= (u[1] - 1) / SIDE; column++)
                if (!cut_block(&cut, row, column, u, v, &removed_mm[axis]))
                    return false;
    }
    return true;
}

/* The cell of a coordinate, the nearest one where it lies outside. */
static int64_t cell_of(const Stock *stock, int axis, double at) {
    const double cell = floor((at - stock->low[axis]) / stock->cell[axis]);
    return (int64_t)clamped(cell, 0.0, (double)(stock->cells[axis] - 1));
}

double depth_at(const Stock *stock, const double *place, double near_mm) {
    double best = 0.0, nearest_square = INFINITY, beyond = -INFINITY; /* of the box */
    double free = FREE_MM;
    int inside = 0;
    int64_t cell[3];
    for (int axis = 0; axis < 3; axis++) {
        const double low = stock->low[axis], size = stock->cell[axis] * (double)stock->cells[axis];
        beyond = greater(beyond, greater(low - place[axis], place[axis] - low - size));
        if (beyond > near_mm)
            return -beyond;
        cell[axis] = cell_of(stock, axis, place[axis]);
    }
    const Ray *rays[3];
    for (int axis = 0; axis < 3; axis++) {
        const Field *field = &stock->fields[axis];
        rays[axis] = ray_at(stock, field, cell[field->v], cell[field->u]);
        __builtin_prefetch(rays[axis]); /* what it takes is to wait for memory */
    }
    for (int axis = 0; axis < 3; axis++)
        __builtin_prefetch(end_at(stock, rays[axis], 0));
    for (int axis = 0; axis < 3; axis++) {
        const Field *field = &stock->fields[axis];
        const Ray *ray = rays[axis];
        int64_t after = 0; /* the first end behind the place */
        while (after < 2 * ray->filled && end_at(stock, ray, after)->at <= (float)place[axis])
            after++;
        inside += after % 2;
        double own = 0.0, own_square = INFINITY;
        for (int64_t end = after - 1; end <= after; end++) {
            if (end < 0 || end >= 2 * ray->filled)
                continue;
            double off[3], depth = 0.0;
            off[axis] = place[axis] - end_at(stock, ray, end)->at;
            free = lesser(free, fabs(off[axis]));
            const int32_t facing = end_at(stock, ray, end)->facing;
            const double steep = fabs(unpacked(facing, axis));
            if (fabs(off[axis]) * steep > 1.5 * near_mm)
                continue;
            off[field->u] = place[field->u] - middle_of(stock, field->u, cell[field->u]);
            off[field->v] = place[field->v] - middle_of(stock, field->v, cell[field->v]);
            for (int k = 0; k < 3; k++)
                depth -= unpacked(facing, k) * off[k];
            if (fabs(depth) > near_mm)
                continue;
            /* of a thin layer both sides count, of a thin gap either */
            own = own_square == INFINITY ? depth : after % 2 ? lesser(own, depth) : greater(own, depth);
            own_square = lesser(own_square, dot3(off, off));
        }
        /* beside an edge the plane of the farther side goes on where there is no surface of it */
        if (own_square < nearest_square) {
            nearest_square = own_square;
            best = own;
        }
    }
    if (nearest_square == INFINITY)
        best = (inside >= 2 ? 1.0 : -1.0) * greater(ROOM * free, near_mm);
    return beyond > 0.0 ? lesser(best, -beyond) : best;
}

double highest_near(const Stock *stock, double x, double y, double radius) {
    const Field *field = &stock->fields[2];
    int64_t u[2], v[2];
    const double wide_x = radius + stock->cell[0], wide_y = radius + stock->cell[1];
    cells_in(stock, 0, x - wide_x, x + wide_x, &u[0], &u[1]);
    cells_in(stock, 1, y - wide_y, y + wide_y, &v[0], &v[1]);
    float top = -INFINITY;
    if (u[0] >= u[1] || v[0] >= v[1])
        return top;
    for (int64_t row = v[0] / SIDE; row <= (v[1] - 1) / SIDE; row++)
        for (int64_t column = u[0] / SIDE; column <= (u[1] - 1) / SIDE; column++) {
            const float high = CELL(stock->of->bound, field->first_block + row * field->block_columns + column, 1);
            top = high > top ? high : top;
        }
    return top;
}

/* Compute the bounds of all blocks. */
EXPORT void cutting_bound_dexels(const Dexels *dexels) {
    const Stock stock = stock_of(dexels);
    for (int axis = 0; axis < 3; axis++) {
        const Field *field = &stock.fields[axis];
        for (int64_t row = 0; row * SIDE < field->rows; row++)
            for (int64_t column = 0; column * SIDE < field->columns; column++)
                bound_block(&stock, field, row, column);
    }
}

/* Return the volume of the material: of each cell the share below the surface next to its middle. */
EXPORT double cutting_dexel_volume(const Dexels *dexels) {
    const Stock all = stock_of(dexels), *stock = &all;
    const double size = lesser(stock->cell[0], lesser(stock->cell[1], stock->cell[2]));
    const double cell = stock->cell[0] * stock->cell[1] * stock->cell[2];
    double cells = 0.0;
    for (int64_t k = 0; k < stock->cells[2]; k++)
        for (int64_t j = 0; j < stock->cells[1]; j++)
            for (int64_t i = 0; i < stock->cells[0]; i++) {
                const double middle[3] = {middle_of(stock, 0, i), middle_of(stock, 1, j), middle_of(stock, 2, k)};
                cells += clamped(0.5 + depth_at(stock, middle, 2.0 * size) / size, 0.0, 1.0);
            }
    return cells * cell;
}

/* Write how deep capsules (n, 6), radii (n), are in the material at most, 0 where they are not, and where. */
EXPORT void cutting_bodies_dexels(const Dexels *dexels, Floats ends_mm, Floats radius_mm, Floats depth_mm, Floats place_mm) {
    const Stock all = stock_of(dexels), *stock = &all;
    const Field *field = &stock->fields[2];
    for (int64_t n = 0; n < ends_mm.rows; n++) {
        const double *a = &CELL(ends_mm, n, 0), *b = a + 3, wide = AT(radius_mm, n);
        int64_t u[2], v[2];
        cells_in(stock, 0, lesser(a[0], b[0]) - wide, greater(a[0], b[0]) + wide, &u[0], &u[1]);
        cells_in(stock, 1, lesser(a[1], b[1]) - wide, greater(a[1], b[1]) + wide, &v[0], &v[1]);
        AT(depth_mm, n) = 0.0;
        for (int k = 0; k < 3; k++)
            CELL(place_mm, n, k) = NAN;
        for (int64_t i = v[0]; i < v[1]; i++)
            for (int64_t j = u[0]; j < u[1]; j++) {
                const Ray *ray = ray_at(stock, field, i, j);
                const double x = middle_of(stock, 0, j), y = middle_of(stock, 1, i);
                for (int64_t k = 0; k < ray->filled; k++) {
                    const double low = end_at(stock, ray, 2 * k)->at, high = end_at(stock, ray, 2 * k + 1)->at;
                    if (high <= lesser(a[2], b[2]) - wide || low >= greater(a[2], b[2]) + wide)
                        continue;
                    const double stretch[6] = {x, y, low, x, y, high};
                    double place[3];
                    const double depth = wide - sqrt(segment_segment(a, stretch, place));
                    if (depth > AT(depth_mm, n)) {
                        AT(depth_mm, n) = depth;
                        copy3(place, &CELL(place_mm, n, 0));
                    }
                }
            }
    }
}

/* Write how deep places (n, 3) are in material, to `near_mm`. */
EXPORT void cutting_depths(const Dexels *dexels, Floats places_mm, double near_mm, Floats depth_mm) {
    const Stock stock = stock_of(dexels);
    for (int64_t i = 0; i < places_mm.rows; i++)
        AT(depth_mm, i) = clamped(depth_at(&stock, &CELL(places_mm, i, 0), near_mm), -near_mm, near_mm);
}
