/* Rotations that the program itself sets: ROT and AROT of a Sinumerik, G68 and G69 of a Fanuc. */

#ifndef GCODE_PROGRAM_TURN_H
#define GCODE_PROGRAM_TURN_H

#include "gcode/block.h"

bool turn_frame(Block *block);
bool may_stay_turned(Block *block);
bool names_both(Block *block);

#endif
