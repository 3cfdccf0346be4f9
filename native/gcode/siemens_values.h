/* R parameters, variables, arrays and expressions of a Sinumerik: X=R1+5, R2=SIN(R3)*4, DEPTH[2]=5. */

#ifndef GCODE_SIEMENS_VALUES_H
#define GCODE_SIEMENS_VALUES_H

#include "gcode/parameters.h"

/* Tell whether a character is one of a Sinumerik's names. */
static inline bool is_of_name(uint8_t c) { return is_letter(c) || is_digit(c) || c == '_'; }

int32_t statement_kind(Bytes text, Bytes names, Ints32 kinds, int64_t i, int64_t end);
double siemens_value(Evaluation *e, int64_t *i);
int64_t assign_variable(Evaluation *e, int64_t i);
int64_t define_variables(Evaluation *e, int64_t i);
int64_t loop_head(Evaluation *e, int64_t i, double *first, double *last);
double set_variable(Evaluation *e, int64_t number, double value);
bool siemens_line_ends(Evaluation *e, int64_t i);

#endif
