/* Canned cycles: G73, G74, G81 to G86 and G89 as the straight moves that they stand for. */

#ifndef GCODE_CYCLES_H
#define GCODE_CYCLES_H

#include "gcode/cycle_words.h"

/* Tell whether a motion mode of the state is a canned cycle. */
static inline bool is_cycle(int32_t motion) { return motion >= V_FIRST_CYCLE; }

void use_cycle_words(Block *block);
bool cycle_move(Block *block);
bool drill_here(Block *block, const Cycle *cycle);

#endif
