/* G40 to G42.1: side and radius of cutter compensation, and what is refused while it is on. */

#ifndef GCODE_CUTTER_SETTINGS_H
#define GCODE_CUTTER_SETTINGS_H

#include "gcode/block.h"

void cutter_compensation(Block *block);
void refuse_before_compensation(Block *block);
void refuse_under_compensation(Block *block, int32_t code);
void tell_other_diameter(Block *block);

#endif
