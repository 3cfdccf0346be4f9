/* The motion of a block: straight moves, arcs as chords, machine moves. */

#ifndef GCODE_MOTION_H
#define GCODE_MOTION_H

#include "gcode/block.h"

/* No coordinate of a part is larger. */
#define FAR_MM 1e6

bool move(Block *block);
void machine_home(Block *block, bool any_axis);

#endif
