/* Cutter radius compensation: a filter between the motion of a block and its rows. */

#ifndef GCODE_COMPENSATE_H
#define GCODE_COMPENSATE_H

#include "gcode/arcs.h"
#include "gcode/block.h"

void end_compensation(Block *block);
void shift_back(Block *block, double mm_s);
void stand_beside(State *s);
bool contour_direction(const State *s, Point *along);
bool lead_out(Block *block, const double to_mm[3], double mm_s);
bool compensated_line(Block *block, const double to_mm[3], double mm_s);
bool compensated_arc(Block *block, const Arc *arc, bool ccw, int64_t turns, double mm_s);
bool compensated_corner(Block *block, const Arc *arc, double bend_rad, double mm_s);

#endif
