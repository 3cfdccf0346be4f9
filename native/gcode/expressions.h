/* Expressions and parameters, which are not read but passed over whole. */

#ifndef GCODE_EXPRESSIONS_H
#define GCODE_EXPRESSIONS_H

#include "core.h"

bool is_function(Bytes text, int64_t i);
int64_t after_value(Bytes text, int64_t i, int64_t end);
int64_t after_assignment(Bytes text, int64_t i);

#endif
