/* Jumps, loops and calls of a Fanuc's custom macro B. */

#ifndef GCODE_MACRO_FLOW_H
#define GCODE_MACRO_FLOW_H

#include "gcode/flow.h"

int64_t go_to_number(Run *run, const MarkedLine *marked, int64_t next);
int64_t macro_if(Run *run, const MarkedLine *marked, int64_t next);
int64_t macro_while(Run *run, const MarkedLine *marked, int64_t next);
int64_t macro_block(Run *run, const Words *words, int64_t from, int64_t to, int64_t next);

#endif
