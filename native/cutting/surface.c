/* How a surface comes about under a tool whose axis turns, coarse enough to be shown.

Eight neighbouring middles of cells are a cube; one layer of middles is around the stock. A middle is solid where two of its
three rays say so. A cube whose middles are not alike has one point of the surface, where the planes of the ends on its edges
meet best (dual contouring, Ju et al. 2002), so that edges of the part stay sharp. The four cubes round an edge from a solid
middle to another one make a square. What happens to a cube within one slot of time is one event, by the last point of the path
that left an end there: it is known by the stamps on the ends. At the end of a slot they all become the same one. */

#include <stdlib.h>

#include "cutting/turned.h"

#define HELD 0.05       /* by which the point is held at the mean of the ends, beside the pull of one plane */
#define NEAR_CELLS 1e-3 /* an end that lies so far beyond an edge is on it */

/* A point that moves by fewer shares of its cube is not what a later pass left: swept surfaces are known to 2 % of a cell. */
enum { OF_RAW = 0, OF_EARLIER = 1, STAMPS = 254, SHARES = 255, MOVED = 13, HAS_POINT = 16, MOST_ENDS = 12 };

/* Events that have been written. */
typedef struct {
    Ints32 cube, slot, shape, point;
    int64_t count;
} Events;

/* Cubes from first to last along each axis, both included. */
typedef struct {
    int64_t first[3], last[3];
} Range;

/* An end on an edge of a cube; the normal is 0 where it is not known. */
typedef struct {
    double place[3], normal[3];
    int32_t facing, stamp;
} End;

static int64_t number_of(const Stock *stock, const int64_t *at, int64_t more) {
    return at[0] + (stock->cells[0] + more) * (at[1] + (stock->cells[1] + more) * at[2]);
}

static uint8_t *solid_at(const Stock *stock, const Surface *surface, const int64_t *middle) {
    return &AT(surface->solid, number_of(stock, middle, 2));
}

/* Return the ray along an axis through a middle, of which those in the stock are counted from 1. */
static const Ray *ray_of(const Stock *stock, int axis, const int64_t *middle) {
    const Field *field = &stock->fields[axis];
    return ray_at(stock, field, middle[field->v] - 1, middle[field->u] - 1);
}

static bool has_at(const Stock *stock, const Ray *ray, double place) {
    for (int64_t k = 0; k < ray->filled; k++)
        if (end_at(stock, ray, 2 * k)->at <= place && place < end_at(stock, ray, 2 * k + 1)->at)
            return true;
    return false;
}

/* Find out again which middles around the cubes of a range are solid. */
static void renew_middles(const Stock *stock, const Surface *surface, const Range *range) {
    int64_t from[3], to[3], at[3];
    for (int k = 0; k < 3; k++) {
        from[k] = most(range->first[k], 1);
        to[k] = least(range->last[k] + 1, stock->cells[k]);
    }
    for (at[2] = from[2]; at[2] <= to[2]; at[2]++)
        for (at[1] = from[1]; at[1] <= to[1]; at[1]++)
            for (at[0] = from[0]; at[0] <= to[0]; at[0]++) {
                int votes = 0;
                for (int axis = 0; axis < 3; axis++)
                    votes += has_at(stock, ray_of(stock, axis, at), middle_of(stock, axis, at[axis] - 1));
                *solid_at(stock, surface, at) = votes >= 2;
            }
}

/* Return the end on the edge from a middle, which is solid or not, to the next one along an axis, which is the other; half way
   where its ray has none, as the three rays do not agree. */
static End end_on(const Stock *stock, int axis, const int64_t *middle, bool is_solid) {
    End end = {.facing = 0, .stamp = 0};
    const double size = stock->cell[axis];
    for (int k = 0; k < 3; k++)
        end.place[k] = middle_of(stock, k, middle[k] - 1);
    const double low = end.place[axis] - NEAR_CELLS * size, high = end.place[axis] + (1.0 + NEAR_CELLS) * size;
    end.place[axis] += 0.5 * size;
    const Ray *ray = ray_of(stock, axis, middle);
    for (int64_t k = is_solid; k < 2 * ray->filled; k += 2) {
        const RayEnd *here = end_at(stock, ray, k);
        if (here->at < low || here->at > high)
            continue;
        end.place[axis] = here->at;
        end.facing = here->facing;
        end.stamp = stamp_of(here->facing);
        for (int m = 0; m < 3; m++)
            end.normal[m] = unpacked(end.facing, m);
        break;
    }
    return end;
}

/* Write the place at which the planes of ends meet best: least squares, held at their mean. */
static void meet(const End *ends, int count, double *place) {
    double mean[3] = {0.0, 0.0, 0.0}, square[3][3] = {{0.0}}, right[3] = {0.0, 0.0, 0.0};
    for (int n = 0; n < count; n++)
        for (int k = 0; k < 3; k++)
            mean[k] += ends[n].place[k] / count;
    for (int k = 0; k < 3; k++)
        square[k][k] = HELD;
    for (int n = 0; n < count; n++) {
        const double *normal = ends[n].normal, away = dot3(normal, ends[n].place) - dot3(normal, mean);
        for (int k = 0; k < 3; k++) {
            right[k] += normal[k] * away;
            for (int m = 0; m < 3; m++)
                square[k][m] += normal[k] * normal[m];
        }
    }
    double inverse[3][3]; /* rows, times the determinant */
    for (int k = 0; k < 3; k++)
        cross3(square[(k + 1) % 3], square[(k + 2) % 3], inverse[k]);
    const double determinant = dot3(square[0], inverse[0]);
    for (int k = 0; k < 3; k++)
        place[k] = mean[k] + dot3(inverse[k], right) / determinant;
}

/* Return the normal of the end that was cut and is most like all others: the end of a step may be on the front of a cutter. */
static int32_t usual_facing(const End *ends, int count) {
    int32_t facing = 0;
    double most_alike = -INFINITY;
    for (int n = 0; n < count; n++) {
        double alike = 0.0;
        for (int m = 0; m < count; m++)
            alike += ends[m].stamp == OF_RAW ? 0.0 : dot3(ends[n].normal, ends[m].normal);
        if (ends[n].stamp != OF_RAW && alike > most_alike) {
            most_alike = alike;
            facing = ends[n].facing;
        }
    }
    return facing;
}

/* Tell whether two shapes of a cube are nearly the same. */
static bool are_alike(int32_t a, int32_t b) {
    for (int shift = 0; shift < 24; shift += 8)
        if (abs((int)(a >> shift & 0xff) - (int)(b >> shift & 0xff)) > MOVED)
            return false;
    return a >> 24 == b >> 24;
}

/* Find out again what the surface is in a cube; return true where it has changed. */
static bool renew_cube(const Stock *stock, const Surface *surface, const int64_t *cube, int64_t point, int64_t stride) {
    End ends[MOST_ENDS];
    int count = 0, solids = 0, state = HAS_POINT;
    for (int corner = 0; corner < 8; corner++) {
        const int64_t middle[3] = {cube[0] + (corner & 1), cube[1] + (corner >> 1 & 1), cube[2] + (corner >> 2)};
        const bool is_solid = *solid_at(stock, surface, middle);
        solids += is_solid;
        if (is_solid && (corner == 0 || corner == 1 || corner == 2 || corner == 4))
            state |= corner == 0 ? 1 : corner << 1;
    }
    const int64_t number = number_of(stock, cube, 1);
    int32_t *shape = &AT(surface->shape, number), before = *shape, latest = OF_EARLIER;
    *shape = 0;
    if (solids == 0 || solids == 8)
        return before != 0;
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 4; side++) {
            int64_t middle[3], next[3];
            middle[axis] = cube[axis];
            middle[(axis + 1) % 3] = cube[(axis + 1) % 3] + (side & 1);
            middle[(axis + 2) % 3] = cube[(axis + 2) % 3] + (side >> 1);
            for (int k = 0; k < 3; k++)
                next[k] = middle[k] + (k == axis);
            const bool is_solid = *solid_at(stock, surface, middle);
            if (is_solid != *solid_at(stock, surface, next))
                ends[count++] = end_on(stock, axis, middle, is_solid);
        }
    double place[3];
    meet(ends, count, place);
    for (int k = 0; k < 3; k++) {
        const double share = (place[k] - middle_of(stock, k, cube[k] - 1)) / stock->cell[k];
        *shape |= (int32_t)lrint(SHARES * clamped(share, 0.0, 1.0)) << (8 * k);
    }
    *shape |= state << 24;
    for (int n = 0; n < count; n++)
        latest = ends[n].stamp > latest ? ends[n].stamp : latest;
    AT(surface->facing, number) = usual_facing(ends, count);
    if (latest > OF_EARLIER && !are_alike(*shape, AT(surface->shape_left, number))) {
        AT(surface->point, number) = (int32_t)(point + (latest - OF_EARLIER - 1) * stride);
        AT(surface->shape_left, number) = *shape;
    }
    return *shape != before;
}

/* Turn the stamps of a slot into that of an earlier one. */
static void age_stamps(const Stock *stock, const Range *range) {
    for (int axis = 0; axis < 3; axis++) {
        const Field *field = &stock->fields[axis];
        for (int64_t v = most(range->first[field->v] - 1, 0); v < least(range->last[field->v] + 1, field->rows); v++)
            for (int64_t u = most(range->first[field->u] - 1, 0); u < least(range->last[field->u] + 1, field->columns); u++) {
                const Ray *ray = ray_at(stock, field, v, u);
                for (int64_t k = 0; k < 2 * ray->filled; k++) {
                    int32_t *facing = &end_at(stock, ray, k)->facing;
                    if (stamp_of(*facing) != OF_RAW)
                        *facing = with_stamp(*facing, OF_EARLIER);
                }
            }
    }
}

/* Renew the cubes of a range, and write what has changed as events of a slot whose path begins at a point. */
static void renew(const Stock *stock, const Surface *surface, const Range *range, int64_t slot, int64_t point, int64_t stride,
                  Events *events) {
    int64_t at[3];
    renew_middles(stock, surface, range);
    for (at[2] = range->first[2]; at[2] <= range->last[2]; at[2]++)
        for (at[1] = range->first[1]; at[1] <= range->last[1]; at[1]++)
            for (at[0] = range->first[0]; at[0] <= range->last[0]; at[0]++) {
                if (!renew_cube(stock, surface, at, point, stride))
                    continue;
                const int64_t number = number_of(stock, at, 1);
                AT(events->cube, events->count) = (int32_t)number;
                AT(events->slot, events->count) = (int32_t)slot;
                AT(events->shape, events->count) = AT(surface->shape, number);
                AT(events->point, events->count++) = AT(surface->point, number);
            }
    age_stamps(stock, range);
}

/* Return the cubes that the way between points can change; none where first is behind last. */
static Range reached(const Stock *stock, const Turned *points, int64_t from, int64_t to) {
    Range range;
    for (int axis = 0; axis < 3; axis++) {
        double low = INFINITY, high = -INFINITY, along[3] = {0.0, 0.0, 0.0};
        for (int64_t k = from; k <= to; k++) {
            const Pose pose = pose_of(points, k);
            const Body *body = body_of(points, AT(points->tool, k));
            along[axis] = 1.0;
            high = greater(high, reach_of(body, &pose, along));
            along[axis] = -1.0;
            low = lesser(low, -reach_of(body, &pose, along));
        }
        const double origin = stock->low[axis], size = stock->cell[axis];
        const double cells = (double)stock->cells[axis];
        range.first[axis] = (int64_t)clamped(floor((low - origin) / size - 1.0), 0.0, cells + 1.0);
        range.last[axis] = (int64_t)clamped(ceil((high - origin) / size + 1.0), -1.0, cells);
    }
    return range;
}

static int64_t size_of(const Range *range) {
    int64_t size = 1;
    for (int k = 0; k < 3; k++)
        size *= most(range->last[k] - range->first[k] + 1, 0);
    return size;
}

/* Write the surface of the raw part as events of slot -1; return how many there are. */
EXPORT int64_t cutting_raw_surface(const Dexels *dexels, const Surface *surface, Ints32 cube, Ints32 slot, Ints32 shape,
                                   Ints32 point) {
    const Stock all_of = stock_of(dexels), *stock = &all_of;
    Events events = {cube, slot, shape, point, 0};
    const Range all = {{0, 0, 0}, {stock->cells[0], stock->cells[1], stock->cells[2]}};
    renew(stock, surface, &all, -1, -1, 1, &events);
    return events.count;
}

/* Cut a path out of the stock from point `from` on, where a slot of time begins; slot_of (p,) is the slot of each point.
   Returns the point to go on with, all of them where it is their number: it stops early where the events might not suffice for
   another slot, or where a ray has no room, which done[1] says; done[0] gets how many events there are. */
EXPORT int64_t cutting_surface(const Dexels *dexels, const Turned *points, Ints32 slot_of, int64_t from, const Surface *surface,
                               Ints32 cube, Ints32 slot, Ints32 shape, Ints32 point, Ints done) {
    const Stock all_of = stock_of(dexels), *stock = &all_of;
    Events events = {cube, slot, shape, point, 0};
    const int64_t count = points->position_mm.rows;
    int64_t begin = from, after = from;
    AT(done, 1) = 0;
    for (; begin < count && !AT(done, 1); begin = AT(done, 1) ? begin : after) {
        while (after < count && AT(slot_of, after) == AT(slot_of, begin))
            after++;
        const Range range = reached(stock, points, most(begin - 1, 0), after - 1);
        if (events.count + size_of(&range) > cube.rows)
            break;
        const int64_t stride = (after - begin + STAMPS - 1) / STAMPS;
        double removed_mm[3] = {0.0, 0.0, 0.0};
        for (int64_t k = most(begin, 1); k < after && !AT(done, 1); k++)
            if (!AT(points->first, k))
                AT(done, 1) = !cut_way(stock, points, k - 1, k, (int32_t)(OF_EARLIER + 1 + (k - begin) / stride), removed_mm);
        if (removed_mm[0] + removed_mm[1] + removed_mm[2] > 0.0)
            renew(stock, surface, &range, AT(slot_of, begin), begin, stride, &events);
    }
    AT(done, 0) = events.count;
    return begin;
}
