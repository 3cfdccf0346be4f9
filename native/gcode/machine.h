/* One block of words at a time. */

#ifndef GCODE_MACHINE_H
#define GCODE_MACHINE_H

#include "gcode/block.h"

bool has_room(Machine *machine, int64_t words);
bool run_block(Machine *machine, const Words *words, int64_t from, int64_t to);

#endif
