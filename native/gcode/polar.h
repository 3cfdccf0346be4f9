/* Polar words: @ is the distance from the zero of the programmed coordinates, ^ the angle from X in degrees. */

#ifndef GCODE_POLAR_H
#define GCODE_POLAR_H

#include "gcode/block.h"

static inline bool is_polar(const Block *block) {
    return block->has[V_WORD_RADIUS] || block->has[V_WORD_ANGLE];
}

void polar_point(const Block *block, double programmed_mm[2]);
bool polar_is_sound(Block *block);
void learn_polar(State *state, const Block *block);

#endif
