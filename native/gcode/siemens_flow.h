/* Jumps, loops that count, repeated sections and subprograms of a Sinumerik. */

#ifndef GCODE_SIEMENS_FLOW_H
#define GCODE_SIEMENS_FLOW_H

#include "gcode/flow.h"

int64_t siemens_block(Run *run, const Words *words, int64_t from, int64_t to, int64_t next);
int64_t siemens_flow(Run *run, const MarkedLine *marked, int64_t next);

#endif
