/* R parameters, variables, arrays and expressions of a Sinumerik: X=R1+5, R2=SIN(R3)*4, DEPTH[2]=5. */

#ifndef GCODE_SIEMENS_VALUES_H
#define GCODE_SIEMENS_VALUES_H

#include "gcode/parameters.h"

double siemens_value(Evaluation *e, int64_t *i);
int64_t assign_variable(Evaluation *e, int64_t i);
int64_t define_variables(Evaluation *e, int64_t i);
int64_t loop_head(Evaluation *e, int64_t i, double *first, double *last);
double set_variable(Evaluation *e, int64_t number, double value);
bool siemens_line_ends(Evaluation *e, int64_t i);

#endif
