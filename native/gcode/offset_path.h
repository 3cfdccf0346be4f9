/* The path of the tool's centre beside a contour: pieces, and where two of them meet at a corner.

   All in the axes (u, v) of the plane. A side is 1 where the tool is left of the path and -1 where it is right. */

#ifndef GCODE_OFFSET_PATH_H
#define GCODE_OFFSET_PATH_H

#include "gcode/arcs.h"

/* A line through `at` along a unit vector, or an arc about a centre: turn is 1 ccw, -1 cw, 0 for a line. */
typedef struct {
    int turn;
    Point at, along, centre;
    double radius_mm;
} Piece;

/* A turn of less than this (rad) is no corner: LinuxCNC's bound. */
static const double SMALLEST_CORNER_RAD = 0.05;

typedef enum { SMOOTH, OUTSIDE, INSIDE } Corner;

static inline Point plus(Point a, double factor, Point b) {
    return (Point){a.u + factor * b.u, a.v + factor * b.v};
}
static inline Point minus(Point a, Point b) { return (Point){a.u - b.u, a.v - b.v}; }
static inline double dot(Point a, Point b) { return a.u * b.u + a.v * b.v; }
static inline double cross(Point a, Point b) { return a.u * b.v - a.v * b.u; }
/* A quarter turn to the left (1) or to the right (-1). */
static inline Point quarter(Point a, int turn) { return (Point){-turn * a.v, turn * a.u}; }
static inline Point unit(Point a) {
    const double length = hypot(a.u, a.v);
    return (Point){a.u / length, a.v / length};
}

Corner corner_between(Point before, Point after, int side, bool cusp_is_inside, double smallest_rad);
bool meeting_point(const Piece *before, const Piece *after, int side, Point *at);
double angle_past(Point centre, int turn, Point from, Point to);

#endif
