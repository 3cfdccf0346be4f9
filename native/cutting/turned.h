/* Points of a path whose axis turns, and the way from one to another; Turned is declared in gcode2krl/cutting/turned.py. */

#ifndef CUTTING_TURNED_H
#define CUTTING_TURNED_H

#include "cutting/dexels.h"

static inline const double *row3(Floats table, int64_t i) { return &CELL(table, i, 0); }

static inline double length3(const double *a) { return sqrt(dot3(a, a)); }

static inline const Body *body_of(const Turned *points, int64_t tool) {
    return (const Body *)&CELL(points->bodies, tool, 0);
}

static inline Pose pose_of(const Turned *points, int64_t i) {
    Pose pose;
    copy3(row3(points->position_mm, i), pose.tip);
    copy3(row3(points->axis, i), pose.axis);
    return pose;
}

/* Cut the way from one point to another, with a stamp (see Step); raise removed_mm as cut_out does. Returns false where a ray
   has no room. */
bool cut_way(const Stock *stock, const Turned *points, int64_t from, int64_t to, int32_t stamp, double *removed_mm);

#endif
