/* The speed of a feed move. */

#ifndef GCODE_FEED_H
#define GCODE_FEED_H

#include "gcode/block.h"

int feed_speed(const Block *block, double length_mm, double *mm_s);
void report_speed(Block *block, int finding);

#endif
