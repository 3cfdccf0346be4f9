/* Variables and operators of a Fanuc's custom macro B, where they are others than LinuxCNC's. */

#ifndef GCODE_MACRO_VALUES_H
#define GCODE_MACRO_VALUES_H

#include "gcode/parameters.h"

typedef enum { CLOSING, POWER, TIMES, OVER, MODULO, PLUS, MINUS, EQ, NE, GT, GE, LT, LE, AND, OR, XOR } Kind;

/* What stands on the two sides of an operator; a variable that is empty counts as 0 but for EQ and NE. */
typedef struct {
    double left, right;
    bool left_is_null, right_is_null;
} Operands;

/* What a variable holds that is known to be empty: an argument that was not passed, or #0. */
#define VACANT INFINITY

static inline bool is_comparison(Kind kind) { return kind >= EQ && kind <= LE; }
static inline bool is_macro_operator(Kind kind) { return kind == MODULO || kind >= EQ; }

int64_t variable_number(Evaluation *e, double value, int64_t place);
double apply_in_macro(Evaluation *e, Kind kind, const Operands *two, int64_t place);

#endif
