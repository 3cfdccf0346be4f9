/* Cutter radius compensation: a filter between the motion of a block and its rows. */

#ifndef GCODE_COMPENSATE_H
#define GCODE_COMPENSATE_H

#include "gcode/arc_motion.h"

/* Tell whether moves are shifted: compensation by a radius of 0 is on and moves nothing. */
static inline bool compensates(const State *s) {
    return s->cutter_mode & S_CUTTER_ON && s->cutter_radius_mm > 0.0;
}

void end_compensation(Block *block);
void stand_beside(State *s);
bool lead_out(Block *block, const double to_mm[3], double mm_s);
bool compensated_line(Block *block, const double to_mm[3], double mm_s);
bool compensated_arc(Block *block, const Arc *arc, int64_t turns, double mm_s);

#endif
