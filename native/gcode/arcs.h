/* Arcs: centre from R, and the chords that replace an arc.

   Everything is in the arc's own axes: (u, v) span the plane, w is the axis of a helix. The planes are the
   right-handed pairs of RS274/NGC: G17 X Y (Z), G18 Z X (Y), G19 Y Z (X). */

#ifndef GCODE_ARCS_H
#define GCODE_ARCS_H

#include "core.h"

/* LinuxCNC's 0.00005 inch: a smaller radius is zero, and R may miss half the chord by as much. */
#define SMALLEST_RADIUS_MM 0.00127

/* An arc of more chords is a mistake: at 0.01 mm one of 1000 m radius takes 22,000 a turn. */
enum { MOST_CHORDS = 1000000 };

typedef enum { FITS, SPIRAL, MISFIT } Fit;
typedef struct {
    double u, v;
} Point;

/* An arc: its axes in the order u, v, w, its ends, its centre, and on what it rests that may be in doubt. */
typedef struct {
    int first, second, third;
    Point from, to, centre;
    double from_w, to_w, to_mm[3];
    double from_radius_mm, to_radius_mm;
    int32_t rests_on;
} Arc;

Fit radii_fit(double start_mm, double end_mm, double unit_mm);
int centre_from_radius(Point start, Point end, double radius, bool ccw, Point *centre);
double sweep_angle(Point start, Point end, Point centre, bool ccw, int64_t turns, double *from_rad);
int64_t chord_count(double radius_mm, double sweep_rad, double tolerance_mm);
static inline double distance(Point a, Point b) { return hypot(a.u - b.u, a.v - b.v); }

#endif
