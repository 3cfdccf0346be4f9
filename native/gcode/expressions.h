/* Expressions: [#1 + 2 * SIN[30]], as LinuxCNC reads them. */

#ifndef GCODE_EXPRESSIONS_H
#define GCODE_EXPRESSIONS_H

#include "gcode/parameters.h"

int64_t after_word(Bytes text, int64_t i, int64_t end, const char *word);
bool begins_value(Bytes text, int64_t i, int64_t end);
double open_value(Evaluation *e, int64_t *i);
double sine(double degrees);
double cosine(double degrees);
double tangent(double degrees);
double degrees(double radian);
double value_at(Evaluation *e, int64_t *i);
double bracket_at(Evaluation *e, int64_t *i);
void assignment_at(Evaluation *e, int64_t *i);

#endif
