/* A line with an expression, read when it is executed. */

#ifndef GCODE_PROGRAM_LINE_H
#define GCODE_PROGRAM_LINE_H

#include "gcode/parameters.h"

Evaluation evaluation_of(Machine *machine, Program *program, int64_t start, int32_t line, bool dry);
void read_line(Evaluation *e, int64_t start, int64_t first_message);
bool is_deleted(const Machine *machine, Bytes text, int64_t start);
void report_wrong(Machine *machine, const Evaluation *e, int64_t start);

#endif
