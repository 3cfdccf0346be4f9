/* An arc of the program: its ends, its centre, its chords. */

#ifndef GCODE_ARC_MOTION_H
#define GCODE_ARC_MOTION_H

#include "gcode/arcs.h"
#include "gcode/block.h"

Arc arc_of(const Block *block);
bool arc_move(Block *block, Arc *arc);

#endif
