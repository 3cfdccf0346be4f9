/* Loops that change nothing: they have no end. */

#ifndef GCODE_LAPS_H
#define GCODE_LAPS_H

#include "gcode/flow.h"

bool repeats_itself(Run *run, int64_t word);
bool writes_tables(const Words *words, int64_t from, int64_t to);

#endif
