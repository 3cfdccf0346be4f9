/* Drilling cycles of a Sinumerik, at once or behind each move (MCALL). */

#ifndef GCODE_SIEMENS_CYCLES_H
#define GCODE_SIEMENS_CYCLES_H

#include "gcode/block.h"

bool cycle_call(Block *block);
bool hole_behind(Block *b);
bool modal_cycle(Block *block);

#endif
