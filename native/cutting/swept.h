/* A sweep as the field is lowered below it: its place in double precision, its shape in single. */

#ifndef CUTTING_SWEPT_H
#define CUTTING_SWEPT_H

#include "cutting/sweep.h"

/* Room for rounding in a bound of the height below a sweep: ten times that of coordinates of a metre. */
#define ROUNDING_MM 1e-3f

/* What Grid.counted holds. */
enum { LOOKED_AT, LOWERED };

/* A sweep from (ax, ay, az): its direction and length in plan, its slope in plan and along the path. */
typedef struct {
    const Outline *outline;
    double ax, ay, az, ex, ey, length, slope, sink;
    bool follows;      /* the sweep before has cut what is below the cutter at the start */
    bool goes_on;      /* the next sweep cuts what is ahead of a ball's end, what is below another cutter's end */
    double next_sink;  /* of the next sweep, if it goes on */
    double wedge;      /* between the planes across both at their joint, in plan, which this sweep cuts */
} Sweep;

/* A sweep and its cutter in single precision: 1 µm at the size of a cutter. */
typedef struct {
    float z, slope, sink, length, square, towards;
    float bottom, corner, arc_radius, arc_top, steep;
    float lowest; /* no point of the cutter gets below it */
} Sweep32;

static inline float clamp32(float x, float low, float high) {
    x = x > low ? x : low;
    return x < high ? x : high;
}

static inline float root32(float x) { return sqrtf(x > 0.0f ? x : 0.0f); }

static inline float min32(float a, float b) { return a < b ? a : b; }

static inline float max32(float a, float b) { return a > b ? a : b; }

/* Return the part of a cell that a coordinate lies behind the middle of the one that it is counted from. */
static inline float place_in(double at, double origin, double size, int64_t shift, int64_t *to_grid) {
    const double cells = (at - origin) / size - 0.5, whole = floor(cells);
    *to_grid = (int64_t)whole - shift;
    return (float)(cells - whole);
}

static inline Sweep32 in_single(const Sweep *sweep) {
    const Outline *outline = sweep->outline;
    const double z = outline->kind == SW_BALL ? sweep->az + outline->radius : sweep->az;
    return (Sweep32){
        .z = (float)z,
        .slope = (float)sweep->slope,
        .sink = (float)sweep->sink,
        .length = (float)sweep->length,
        .square = (float)(outline->radius * outline->radius),
        .towards = sweep->slope > 0.0 ? -1.0f : 1.0f,
        .bottom = (float)outline->bottom,
        .corner = (float)outline->corner,
        .arc_radius = outline->steep > 0.0 ? (float)outline->arc_radius : INFINITY,
        .arc_top = (float)outline->arc_top,
        .steep = (float)outline->steep,
        .lowest = (float)(sweep->az + lesser(sweep->slope * sweep->length, 0.0)) - ROUNDING_MM,
    };
}

/* Lower the field below a ball's sweep. */
void lower_below_ball(const Grid *grid, const Sweep *sweep);

/* Lower the field below a sweep of any other cutter, row by row between two heights in y. */
void lower_below_other(const Grid *grid, const Sweep *sweep, Cells rows);

/* Return the largest height that a sweep cuts off. */
double cut_off_by(const Grid *grid, const Sweep *sweep, Cells rows);

#endif
