/* Jumps, loops that count, repeated sections and subprograms of a Sinumerik. */

#ifndef GCODE_SIEMENS_FLOW_H
#define GCODE_SIEMENS_FLOW_H

#include "gcode/flow.h"

int64_t siemens_if(Run *run, const MarkedLine *marked, int64_t next);
int64_t begin_counting(Run *run, const MarkedLine *marked, int64_t next);
int64_t count_on(Run *run, const MarkedLine *marked, int64_t next);
int64_t call_by_name(Run *run, const MarkedLine *marked, int64_t next);
int64_t siemens_block(Run *run, const Words *words, int64_t from, int64_t to, int64_t next);
int64_t select_case(Run *run, const MarkedLine *marked, int64_t next);
int64_t repeat_section(Run *run, const MarkedLine *marked, int64_t next);

#endif
