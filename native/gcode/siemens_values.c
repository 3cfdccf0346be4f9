/* R parameters and expressions of a Sinumerik: X=R1+5, R2=SIN(R3)*4.

   What is not named here ends the expression, and what then follows is refused with its line. One comparison stands in
   a bracket: between comparisons the control has ranks that are easily taken for others. */

#include "gcode/siemens_values.h"

#include "gcode/expressions.h"
#include "gcode/numbers.h"

enum { MOST_DEPTH = 100 };
static const double NEAR = 1e-6; /* share in which numbers that are compared must differ, or be equal */

static double expression(Evaluation *e, int64_t *i);

static bool stands_at(const Evaluation *e, int64_t i, uint8_t c) { return i < e->end && AT(e->program->text, i) == c; }

static int64_t behind_blanks(const Evaluation *e, int64_t i) { return after_blanks(e->program->text, i, e->end); }

/* --- R parameters --------------------------------------------------------------------------------------- */

/* Return the number of the parameter whose digits stand from i to `behind`. */
static int64_t r_number(Evaluation *e, int64_t i, int64_t behind, int64_t place) {
    int64_t number = 0;
    for (int64_t k = i; k < behind && number <= P_MOST_R; k++)
        number = number * 10 + (AT(e->program->text, k) - '0');
    if (number >= P_MOST_R)
        wrong(e, F_EXPRESSION_VALUE, PF_SIEMENS_R, (double)number, place);
    return number < P_MOST_R ? number : 0;
}

static double r_value(Evaluation *e, int64_t number, int64_t place) {
    const Program *program = e->program;
    for (int64_t k = 0; k < program->course.at->assignments; k++)
        if (AT(program->assignments, k).number == number)
            return wrong(e, F_EXPRESSION, PF_SIEMENS_SAME_BLOCK, 0.0, place);
    const double value = AT(program->parameters, number);
    if (!isnan(value))
        return value;
    note_unset(e, number);
    return 0.0;
}

/* R1=..., whose R stands at `place`, with its digits before `behind` and its value from `value` on; return the place
   behind. */
int64_t assign_r(Evaluation *e, int64_t place, int64_t behind, int64_t value) {
    Course *at = e->program->course.at;
    const int64_t number = r_number(e, place + 1, behind, place);
    for (int64_t k = 0; k < at->assignments; k++)
        if (AT(e->program->assignments, k).number == number)
            wrong(e, F_EXPRESSION, PF_SIEMENS_SAME_BLOCK, 0.0, place);
    const double result = siemens_value(e, &value);
    if (e->finding == F_OK)
        AT(e->program->assignments, at->assignments++) = (Assignment){NO_NAME, number, result};
    return value;
}

/* --- functions ------------------------------------------------------------------------------------------ */

typedef enum { SIN, COS, TAN, ASIN, ACOS, SQRT, ABS, TRUNC, ROUND, LN, EXP, POT, ATAN2, FUNCTIONS } Function;
static const char *const FUNCTION[] = {"sin", "cos", "tan",   "asin",  "acos", "sqrt", "abs",
                                       "trunc", "round", "ln", "exp", "pot",  "atan2"};

/* Return the function whose name and ( stand at i, and go behind the (; FUNCTIONS for none. */
static Function function_at(const Evaluation *e, int64_t *i) {
    for (Function function = SIN; function < FUNCTIONS; function++) {
        int64_t k = *i;
        const char *name = FUNCTION[function];
        for (; *name && k < e->end; name++, k++)
            if ((is_digit((uint8_t)*name) ? AT(e->program->text, k) : AT(e->program->text, k) | CH_CASE_BIT) != (uint8_t)*name)
                break;
        k = behind_blanks(e, k);
        if (*name || !stands_at(e, k, '('))
            continue;
        *i = k + 1;
        return function;
    }
    return FUNCTIONS;
}

static double function_of(Evaluation *e, Function function, double x, int64_t place) {
    switch (function) {
    case SIN: return sine(x);
    case COS: return cosine(x);
    case TAN: return tangent(x);
    case ASIN: return fabs(x) > 1.0 ? wrong(e, F_EXPRESSION_VALUE, PF_ARC_SINE, x, place) : degrees(asin(x));
    case ACOS: return fabs(x) > 1.0 ? wrong(e, F_EXPRESSION_VALUE, PF_ARC_COSINE, x, place) : degrees(acos(x));
    case SQRT: return x < 0.0 ? wrong(e, F_EXPRESSION_VALUE, PF_SQUARE_ROOT, x, place) : sqrt(x);
    case ABS: return fabs(x);
    case TRUNC: return trunc(x);
    case ROUND: return x < 0.0 ? ceil(x - 0.5) : floor(x + 0.5);
    case LN: return x <= 0.0 ? wrong(e, F_EXPRESSION_VALUE, PF_LOGARITHM, x, place) : log(x);
    case EXP: return exp(x);
    default: return x * x; /* POT */
    }
}

/* Go behind the character that must stand at i. */
static void require(Evaluation *e, int64_t *i, uint8_t c, int fault) {
    *i = behind_blanks(e, *i);
    if (e->finding == F_OK && !stands_at(e, *i, c))
        wrong(e, F_EXPRESSION, fault, 0.0, least(*i, e->end - 1));
    ++*i;
}

static double call_at(Evaluation *e, int64_t *i, Function function, int64_t place) {
    const double first = expression(e, i);
    double second = 0.0;
    if (function == ATAN2) {
        require(e, i, ',', PF_SIEMENS_ATAN2);
        if (e->finding == F_OK)
            second = expression(e, i);
    }
    require(e, i, ')', PF_SIEMENS_BRACKET);
    if (e->finding != F_OK)
        return 0.0;
    return function == ATAN2 ? degrees(atan2(first + 0.0, second)) : function_of(e, function, first, place);
}

/* --- values --------------------------------------------------------------------------------------------- */

static double unsigned_at(Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    const int64_t place = *i;
    if (stands_at(e, *i, '(')) {
        ++*i;
        const double value = expression(e, i);
        require(e, i, ')', PF_SIEMENS_BRACKET);
        return value;
    }
    if (*i + 1 < e->end && (AT(text, *i) & ~CH_CASE_BIT) == 'R' && is_digit(AT(text, *i + 1))) {
        int64_t behind = *i + 1;
        while (behind < e->end && is_digit(AT(text, behind)))
            behind++;
        *i = behind;
        return r_value(e, r_number(e, place + 1, behind, place), place);
    }
    const Function function = *i < e->end && is_letter(AT(text, *i)) ? function_at(e, i) : FUNCTIONS;
    if (function != FUNCTIONS)
        return call_at(e, i, function, place);
    if (*i >= e->end || !(is_digit(AT(text, *i)) || AT(text, *i) == '.'))
        return wrong(e, F_EXPRESSION, PF_SIEMENS_VALUE, 0.0, least(*i, e->end - 1));
    const Number read = number(text, *i);
    if (read.digits == 0 || read.finding != F_OK)
        return wrong(e, F_EXPRESSION, PF_SIEMENS_VALUE, 0.0, place);
    *i = read.end;
    return read.value;
}

static double value_behind_signs(Evaluation *e, int64_t *i) {
    bool negative = false;
    for (*i = behind_blanks(e, *i); *i < e->end && is_sign(AT(e->program->text, *i)); *i = behind_blanks(e, *i + 1))
        negative ^= AT(e->program->text, *i) == '-';
    if (e->depth >= MOST_DEPTH)
        return wrong(e, F_EXPRESSION, PF_TOO_DEEP, 0.0, least(*i, e->end - 1));
    e->depth++;
    const double value = unsigned_at(e, i);
    e->depth--;
    return negative ? -value : value;
}

static double product(Evaluation *e, int64_t *i) {
    double left = value_behind_signs(e, i);
    while (e->finding == F_OK) {
        const int64_t place = behind_blanks(e, *i);
        const bool times = stands_at(e, place, '*'), over = stands_at(e, place, '/');
        if (!times && !over)
            break;
        *i = place + 1;
        const double right = value_behind_signs(e, i);
        if (over && right == 0.0 && e->finding == F_OK)
            return wrong(e, F_EXPRESSION_VALUE, PF_DIVISION_BY_ZERO, 0.0, place);
        left = times ? left * right : left / right;
    }
    return left;
}

static double sum(Evaluation *e, int64_t *i) {
    double left = product(e, i);
    while (e->finding == F_OK) {
        const int64_t place = behind_blanks(e, *i);
        const bool plus = stands_at(e, place, '+'), minus = stands_at(e, place, '-');
        if (!plus && !minus)
            break;
        *i = place + 1;
        const double right = product(e, i);
        left = plus ? left + right : left - right;
    }
    return left;
}

/* --- comparisons ---------------------------------------------------------------------------------------- */

typedef enum { NONE, EQUAL, UNEQUAL, LESS, LESS_OR_EQUAL, GREATER, GREATER_OR_EQUAL } Comparison;

static Comparison comparison_at(const Evaluation *e, int64_t *i) {
    const int64_t place = behind_blanks(e, *i);
    const bool equals = stands_at(e, place + 1, '=');
    Comparison found = NONE;
    if (stands_at(e, place, '=') && equals)
        found = EQUAL;
    else if (stands_at(e, place, '<'))
        found = stands_at(e, place + 1, '>') ? UNEQUAL : equals ? LESS_OR_EQUAL : LESS;
    else if (stands_at(e, place, '>'))
        found = equals ? GREATER_OR_EQUAL : GREATER;
    if (found != NONE)
        *i = place + (found == LESS || found == GREATER ? 1 : 2);
    return found;
}

static double compared(Comparison comparison, double a, double b) {
    switch (comparison) {
    case EQUAL: return a == b;
    case UNEQUAL: return a != b;
    case LESS: return a < b;
    case LESS_OR_EQUAL: return a <= b;
    case GREATER: return a > b;
    default: return a >= b;
    }
}

static double expression(Evaluation *e, int64_t *i) {
    const double left = sum(e, i);
    const int64_t place = *i;
    const Comparison comparison = e->finding == F_OK ? comparison_at(e, i) : NONE;
    if (comparison == NONE)
        return left;
    const double right = sum(e, i), apart = fabs(left - right);
    if (e->finding == F_OK && apart != 0.0 && apart < NEAR * greater(1.0, greater(fabs(left), fabs(right))))
        return wrong(e, F_EXPRESSION_VALUE, PF_MACRO_NEAR, apart, place);
    int64_t more = *i;
    if (e->finding == F_OK && comparison_at(e, &more) != NONE)
        return wrong(e, F_EXPRESSION, PF_SIEMENS_COMPARISONS, 0.0, *i);
    return compared(comparison, left, right);
}

/* Work out the value at i: it ends where something else begins. */
double siemens_value(Evaluation *e, int64_t *i) {
    const int64_t place = *i;
    const double value = expression(e, i);
    if (isnan(value) || isinf(value))
        return wrong(e, F_EXPRESSION_VALUE, isnan(value) ? PF_NOT_A_NUMBER : PF_INFINITE, 0.0, place);
    return value;
}
