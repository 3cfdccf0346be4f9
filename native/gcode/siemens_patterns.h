/* HOLES1, HOLES2 and CYCLE801 of a Sinumerik: the places at which a modal cycle drills. */

#ifndef GCODE_SIEMENS_PATTERNS_H
#define GCODE_SIEMENS_PATTERNS_H

#include "gcode/block.h"

bool is_pattern(int32_t cycle);
bool drill_pattern(Block *block);

#endif
