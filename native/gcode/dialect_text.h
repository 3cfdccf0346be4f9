/* What a dialect writes beside plain words; see gcode2krl/gcode/dialects.py. */

#ifndef GCODE_DIALECT_TEXT_H
#define GCODE_DIALECT_TEXT_H

#include "gcode/parameters.h"

bool lacks_point(Bytes text, int64_t i);
int64_t after_skip_level(Bytes text, int64_t i);
enum { NEEDS_LINE = -1 };
int64_t dialect_item(Scan *scan, Evaluation *e, int64_t i, int64_t line, bool first);

#endif
