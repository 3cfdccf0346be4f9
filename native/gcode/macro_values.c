/* Variables and operators of a Fanuc's custom macro B, where they are others than LinuxCNC's.

   A variable that was never set is empty, and so is an argument that was not passed: a word whose value is empty is
   left out, EQ and NE tell it from 0, anything else takes it as 0. What a variable holds that nothing in the program
   has set only the control knows: that is kept, and refused in translation. */

#include "gcode/macro_values.h"

static const double NEAR = 1e-6;          /* share in which numbers that are compared must differ, or be equal */
static const double MOST_BITS = 4294967295.0; /* 32 bits */

/* --- variables ------------------------------------------------------------------------------------------ */

static bool is_between(int64_t number, const int64_t ends[2]) { return number >= ends[0] && number <= ends[1]; }

static bool is_variable(int64_t number) {
    static const int64_t LOCAL[] = {0, P_MACRO_LOCALS}, COMMON[] = P_MACRO_COMMON, KEPT[] = P_MACRO_KEPT;
    return is_between(number, LOCAL) || is_between(number, COMMON) || is_between(number, KEPT);
}

static int fault_of(int64_t number) {
    enum { ALARM = 3000 };
    if (number == ALARM)
        return PF_MACRO_ALARM;
    return number >= P_MACRO_END ? PF_MACRO_OF_CONTROL : PF_MACRO_UNKNOWN;
}

/* Return the number of a variable that an expression names; 0 for #0 and where it is wrong. */
int64_t variable_number(Evaluation *e, double value, int64_t place) {
    int64_t number = 0;
    if (!whole_number(value, &number))
        wrong(e, F_PARAMETER_NUMBER, value, 0.0, place);
    else if (number < 0 || !is_variable(number))
        wrong(e, F_EXPRESSION_VALUE, fault_of(number), (double)number, place);
    return e->finding == F_OK ? number : 0;
}

/* --- operators ------------------------------------------------------------------------------------------ */

static double compared(Kind kind, double a, double b) {
    switch (kind) {
    case EQ: return a == b;
    case NE: return a != b;
    case GT: return a > b;
    case GE: return a >= b;
    case LT: return a < b;
    default: return a <= b;
    }
}

static double compare(Evaluation *e, Kind kind, const Operands *two, int64_t place) {
    const double a = two->left, b = two->right, apart = fabs(a - b);
    if ((kind == EQ || kind == NE) && (two->left_is_null || two->right_is_null))
        return (two->left_is_null && two->right_is_null) == (kind == EQ);
    if (apart != 0.0 && apart < NEAR * greater(1.0, greater(fabs(a), fabs(b))))
        return wrong(e, F_EXPRESSION_VALUE, PF_MACRO_NEAR, apart, place);
    return compared(kind, a, b);
}

static double of_bits(Kind kind, double a, double b) {
    const uint64_t left = (uint64_t)a, right = (uint64_t)b;
    return (double)(kind == AND ? left & right : kind == OR ? left | right : left ^ right);
}

static bool is_bits(double value) { return value >= 0.0 && value <= MOST_BITS && floor(value) == value; }

/* Apply a comparison, AND, OR, XOR (of bits) or MOD (with the sign of its left side). */
double apply_in_macro(Evaluation *e, Kind kind, const Operands *two, int64_t place) {
    const double a = two->left, b = two->right;
    if (is_comparison(kind))
        return compare(e, kind, two, place);
    if (kind == MODULO) {
        if (floor(a) != a || floor(b) != b)
            return wrong(e, F_EXPRESSION_VALUE, PF_MACRO_REMAINDER, floor(a) != a ? a : b, place);
        return b == 0.0 ? wrong(e, F_EXPRESSION_VALUE, PF_DIVISION_BY_ZERO, 0.0, place) : fmod(a, b);
    }
    if (!is_bits(a) || !is_bits(b))
        return wrong(e, F_EXPRESSION_VALUE, PF_MACRO_BITS, is_bits(a) ? b : a, place);
    return of_bits(kind, a, b);
}
