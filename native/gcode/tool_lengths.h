/* Lengths that a program gives to tools: G43.1, G43.2, G10 L1, L10 and L11. */

#ifndef GCODE_TOOL_LENGTHS_H
#define GCODE_TOOL_LENGTHS_H

#include "gcode/block.h"

double length_of(const Machine *machine, int32_t tool);
void set_length_offset(State *s, double length_mm);
void length_by_words(Block *b);
void length_added(Block *b);
void set_tool(Block *b, int32_t l, int32_t tool);

#endif
