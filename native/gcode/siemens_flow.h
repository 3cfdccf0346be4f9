/* Jumps, loops that count and repeated sections of a Sinumerik. */

#ifndef GCODE_SIEMENS_FLOW_H
#define GCODE_SIEMENS_FLOW_H

#include "gcode/flow.h"

int64_t siemens_if(Run *run, const MarkedLine *marked, int64_t next);
int64_t begin_counting(Run *run, const MarkedLine *marked, int64_t next);
int64_t count_on(Run *run, const MarkedLine *marked, int64_t next);
int64_t repeat_section(Run *run, const MarkedLine *marked, int64_t next);

#endif
