/* Corners that a dialect has rounded or chamfered between two straight moves: RND=, CHF=, CHR=, ,R and ,C. */

#ifndef GCODE_CORNERS_H
#define GCODE_CORNERS_H

#include "gcode/block.h"

void begin_corner(Block *block, const double from_mm[3], bool by_machine, double mm_s);
bool may_round(const Block *block, const double to_mm[3], bool by_machine, double mm_s);
bool round_corner(Block *block, const double to_mm[3]);
void refuse_open_corner(Block *block, int32_t before_line);

#endif
