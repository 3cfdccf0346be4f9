/* Loops that change nothing: they have no end. */

#ifndef GCODE_LAPS_H
#define GCODE_LAPS_H

#include "gcode/flow.h"

bool repeats_itself(Run *run, int64_t word);

#endif
