/* An arc of the program: its ends, its centre, its chords. */

#ifndef GCODE_ARC_MOTION_H
#define GCODE_ARC_MOTION_H

#include "gcode/arcs.h"
#include "gcode/block.h"

/* An arc: its axes in the order u, v, w, its ends, its centre, and on what it rests that may be in doubt. */
typedef struct {
    int first, second, third;
    Point from, to, centre;
    double from_w, to_w, to_mm[3];
    double from_radius_mm, to_radius_mm;
    int32_t rests_on;
} Arc;

Arc arc_of(const Block *block);
bool arc_move(Block *block, Arc *arc);
void emit_chords(Block *block, const Arc *arc, double angle, double sweep, int64_t chords, double mm_s);

#endif
