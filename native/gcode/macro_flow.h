/* Jumps, loops and calls of a Fanuc's custom macro B. */

#ifndef GCODE_MACRO_FLOW_H
#define GCODE_MACRO_FLOW_H

#include "gcode/flow.h"

static inline bool is_of_macro(int32_t kind) {
    return kind == P_KIND_GOTO || kind == P_KIND_MACRO_IF || kind == P_KIND_MACRO_WHILE;
}

int64_t macro_flow(Run *run, const MarkedLine *marked, int64_t next);
int64_t macro_block(Run *run, const Words *words, int64_t from, int64_t to, int64_t next);

#endif
