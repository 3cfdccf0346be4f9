/* Distances of a segment, a capsule without its radius, from other shapes. */

#ifndef COLLISION_SHAPES_H
#define COLLISION_SHAPES_H

#include "collision/vectors.h"

/* A segment: its ends one behind the other. Squared distances; `place` gets the nearest point of the other. */
double segment_segment(const double *segment, const double *other, double *place);
double segment_triangle(const double *segment, const double *corners, double *place);

/* Of a box with its sides along the axes, which is solid: 0 inside. `place` may be NULL. */
double segment_box(const double *segment, const double *low, const double *high, double *place);

#endif
