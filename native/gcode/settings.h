/* Everything of a block before its motion, in the order of RS274/NGC. */

#ifndef GCODE_SETTINGS_H
#define GCODE_SETTINGS_H

#include "gcode/block.h"

bool stops(int32_t m);
void apply_settings(Block *block);

#endif
