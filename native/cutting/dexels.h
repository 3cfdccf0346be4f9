/* Material as three fields of dexels, and the body of a cutter in any direction.

A dexel is a ray along an axis of `$BASE` through the middle of a cell, with the stretches of it that are material. Each
end of a stretch bears the normal of the surface there, so that a surface is known between the rays too: to the second
order in a cell, not the first. Dexels and Turned are declared in gcode2krl/cutting/dexels.py and turned.py. */

#ifndef CUTTING_DEXELS_H
#define CUTTING_DEXELS_H

#include "collision/vectors.h"
#include "constants.h"
#include "core.h"

/* A row of Turned.bodies: a flat bottom, a corner arc, a side at an angle kappa up to a radius, a cylinder up to the
   top. It is convex. Lengths in mm, heights from the tip. */
typedef struct {
    double bottom, corner, sin_kappa, cos_kappa, radius, top;
} Body;

typedef struct {
    double tip[3], axis[3];
} Pose;

/* A motion of a body from a pose: the tip goes straight, the axis turns evenly. It `follows` where what the body covers in
   that pose has been cut. Its stamp, 0 to 255, is put on the ends that it leaves. */
typedef struct {
    Pose from;
    double way[3], turn[3];
    bool follows;
    int32_t stamp;
} Step;

/* Rays along an axis, columns along `u`, rows along `v`, in blocks; the first of their blocks. */
typedef struct {
    int axis, u, v;
    int64_t columns, rows, block_columns, first_block;
} Field;

/* Dexels with what is looked up for each ray: the three fields, the low corner, the size of a cell and their number. */
typedef struct {
    const Dexels *of;
    Field fields[3];
    double low[3], cell[3];
    int64_t cells[3];
} Stock;

Stock stock_of(const Dexels *dexels);

/* Return a coordinate of the middle of a cell. */
static inline double middle_of(const Stock *stock, int axis, int64_t cell) {
    return stock->low[axis] + ((double)cell + 0.5) * stock->cell[axis];
}

/* Return a ray of a field: those of a block are together, as what is read and cut is. */
static inline Ray *ray_at(const Stock *stock, const Field *field, int64_t row, int64_t column) {
    const uint64_t side = TD_SIDE, i = (uint64_t)row, j = (uint64_t)column;
    const uint64_t block = (uint64_t)field->first_block + i / side * (uint64_t)field->block_columns + j / side;
    return &AT(stock->of->rays, (block * side + i % side) * side + j % side);
}

/* Return an end on a ray. */
static inline RayEnd *end_at(const Stock *stock, const Ray *ray, int64_t k) { return &AT(stock->of->ends, ray->first + k); }

/* Return a coordinate of the normal at an end of a ray, and its stamp. */
static inline double unpacked(int32_t facing, int k) {
    return (double)(int8_t)((uint32_t)facing >> (8 * k)) / TD_SHORTENED;
}
static inline int32_t stamp_of(int32_t facing) { return (int32_t)((uint32_t)facing >> 24); }
static inline int32_t with_stamp(int32_t facing, int32_t stamp) {
    return (int32_t)(((uint32_t)facing & 0xffffff) | (uint32_t)stamp << 24);
}

/* Return the pose at a share of a step. */
Pose pose_at(const Step *step, double share);

/* Return how far a point at a radius and a height is outside a body, negative inside; write the direction away. */
double outside_of(const Body *body, double radius, double height, double away[2]);

/* Return how far a place is outside a body in a pose. */
double outside_at(const Body *body, const Pose *pose, const double *place);

/* Return how far a body in a pose reaches along a unit vector. */
double reach_of(const Body *body, const Pose *pose, const double *along);

/* Take a step of a body out of the stock; raise `removed_mm` (3) to the longest stretch taken from a ray of each field. Returns
   false where a ray has no room for another stretch: the step is then to be done again. */
bool cut_out(const Stock *stock, const Body *body, const Step *step, double *removed_mm);

/* Return how deep a place is in material, negative outside; beyond `near_mm` only on which side, and so deep that the rays there
   leave room for a ball of that radius. */
double depth_at(const Stock *stock, const double *place, double near_mm);

/* Return a height that no material within a radius in plan is above. */
double highest_near(const Stock *stock, double x, double y, double radius);

#endif
