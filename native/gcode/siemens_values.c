/* R parameters, variables, arrays and expressions of a Sinumerik: X=R1+5, R2=SIN(R3)*4, DEF REAL WIDTH=20, DEPTH[3].

   What is not named here ends the expression, and what then follows is refused with its line. One comparison stands in
   a bracket, and AND, OR, XOR take what is true or false: they go before comparisons on this control (SINUMERIK 840D sl,
   Programming Manual, Job Planning: priority of the operations). */

#include "gcode/siemens_values.h"

#include "gcode/expressions.h"
#include "gcode/numbers.h"

enum { MOST_DEPTH = 100 };
static const double NEAR = 1e-6; /* share in which numbers that are compared must differ, or be equal */

static double expression(Evaluation *e, int64_t *i);

static bool stands_at(const Evaluation *e, int64_t i, uint8_t c) { return i < e->end && AT(e->program->text, i) == c; }

static int64_t behind_blanks(const Evaluation *e, int64_t i) { return after_blanks(e->program->text, i, e->end); }

/* Return the place behind the name that stands at i. */
static int64_t after_names(Bytes text, int64_t i) {
    while (i < text.rows && is_of_name(AT(text, i)))
        i++;
    return i;
}

/* Return the place behind a name of small letters that stands at i, i where it does not. */
static int64_t behind_keyword(const Evaluation *e, int64_t i, const char *name) {
    int64_t k = i;
    for (; *name && k < e->end && (AT(e->program->text, k) | CH_CASE_BIT) == (uint8_t)*name; name++)
        k++;
    return *name || (k < e->end && is_of_name(AT(e->program->text, k))) ? i : k;
}

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

static bool is_assigned_here(const Evaluation *e, int64_t number) {
    for (int64_t k = 0; k < e->program->course.at->assignments; k++)
        if (AT(e->program->assignments, k).number == number)
            return true;
    return false;
}

/* Return the value of an R parameter or a variable: an R that nothing has set is 0. */
static double value_of(Evaluation *e, int64_t number, int64_t place) {
    if (is_assigned_here(e, number))
        return wrong(e, F_EXPRESSION, PF_SIEMENS_SAME_BLOCK, 0.0, place);
    const double value = AT(e->program->parameters, number);
    if (!isnan(value))
        return value;
    if (number >= P_FIRST_REAL)
        return wrong(e, F_EXPRESSION, PF_SIEMENS_UNDEFINED, 0.0, place);
    note_unset(e, number);
    return 0.0;
}

/* Return a value as the type of its variable holds it. */
static double of_type(int64_t number, double value) {
    if (number < P_FIRST_INT)
        return value;
    return number < P_FIRST_BOOL ? floor(value + 0.5) : value != 0.0;
}

/* Keep that an R parameter or a variable gets a value. */
static void keep(Evaluation *e, int64_t number, double value, int64_t place) {
    Course *at = e->program->course.at;
    if (is_assigned_here(e, number))
        wrong(e, F_EXPRESSION, PF_SIEMENS_SAME_BLOCK, 0.0, place);
    if (at->assignments >= e->program->assignments.rows)
        wrong(e, F_EXPRESSION, PF_SIEMENS_DEF, 0.0, place);
    if (e->finding == F_OK)
        AT(e->program->assignments, at->assignments++) = (Assignment){NO_NAME, number, of_type(number, value)};
}

/* --- arrays --------------------------------------------------------------------------------------------- */

/* Go behind the character that must stand at i. */
static void require(Evaluation *e, int64_t *i, uint8_t c, int fault) {
    *i = behind_blanks(e, *i);
    if (e->finding == F_OK && !stands_at(e, *i, c))
        wrong(e, F_EXPRESSION, fault, 0.0, least(*i, e->end - 1));
    ++*i;
}

/* Read an index that is a whole number from 0 to below `count`. */
static int64_t index_at(Evaluation *e, int64_t *i, int64_t count) {
    const int64_t place = *i;
    int64_t index = 0;
    const double value = siemens_value(e, i);
    if (e->finding == F_OK && (!whole_number(value, &index) || index < 0 || index >= count))
        return (int64_t)wrong(e, F_EXPRESSION_VALUE, PF_SIEMENS_INDEX, value, place);
    return index;
}

static int64_t last_of(const Array *array) { return array->first + array->rows * most(1, array->columns) - 1; }

/* Return the array whose name stands at `place` with its [ before `behind`, NULL for none. */
static const Array *array_at(const Evaluation *e, int64_t place, int64_t behind) {
    const Program *p = e->program;
    const int32_t kind = statement_kind(p->text, p->statement_names, p->statement_kinds, place, behind);
    return kind >= 0 && kind % D_KIND_STEP == D_ARRAY ? &AT(p->arrays, kind / D_KIND_STEP) : NULL;
}

/* Return the number of the element whose array is named at `place` and whose [ stands at i, and go behind its ]. */
static int64_t element_at(Evaluation *e, int64_t place, int64_t *i) {
    const Array *array = array_at(e, place, ++*i);
    const bool of_r = *i == place + 2 && (AT(e->program->text, place) & ~CH_CASE_BIT) == 'R';
    if (array == NULL && !of_r)
        return (int64_t)wrong(e, F_EXPRESSION, PF_SIEMENS_VALUE, 0.0, place);
    int64_t row = index_at(e, i, of_r ? P_MOST_R : array->rows);
    if (!of_r && array->columns > 0) {
        require(e, i, ',', PF_SIEMENS_INDICES);
        row = row * array->columns + index_at(e, i, array->columns);
    }
    require(e, i, ']', PF_SIEMENS_INDICES);
    return of_r ? row : array->first + row;
}

/* --- variables ------------------------------------------------------------------------------------------ */

/* Return the kind of the statement whose name stands from i to end, -1 for none; names end with their line. */
int32_t statement_kind(Bytes text, Bytes names, Ints32 kinds, int64_t i, int64_t end) {
    int64_t at = 0;
    for (int64_t k = 0; k < kinds.rows; k++) {
        int64_t n = 0;
        while (i + n < end && (AT(text, i + n) & ~(is_letter(AT(text, i + n)) ? CH_CASE_BIT : 0)) == AT(names, at + n))
            n++;
        if (i + n == end && AT(names, at + n) == '\n')
            return AT(kinds, k);
        while (AT(names, at) != '\n')
            at++;
        at++;
    }
    return -1;
}

/* Return the number of the R parameter, variable or element whose name stands at i, and go behind it; -1 for none. */
static int64_t variable_at(Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    const int64_t place = *i;
    int64_t behind = place;
    if (place + 1 < e->end && (AT(text, place) & ~CH_CASE_BIT) == 'R' && is_digit(AT(text, place + 1))) {
        for (behind = place + 1; behind < e->end && is_digit(AT(text, behind)); behind++)
            ;
        *i = behind;
        return r_number(e, place + 1, behind, place);
    }
    behind = after_names(text, place);
    if (stands_at(e, behind, '[')) {
        *i = behind;
        return element_at(e, place, i);
    }
    const int32_t kind = statement_kind(text, e->program->statement_names, e->program->statement_kinds, place, behind);
    if (behind == place || kind < 0 || kind % D_KIND_STEP != D_VARIABLE)
        return -1;
    *i = behind;
    return kind / D_KIND_STEP;
}

/* Return the place behind a name of small letters and its ( that stand at i, i where they do not. */
static int64_t behind_call(const Evaluation *e, int64_t i, const char *name) {
    const int64_t open = behind_blanks(e, behind_keyword(e, i, name));
    return open > i && stands_at(e, open, '(') ? open + 1 : i;
}

/* Give an element and those behind it up to `last` the values at i, SET(1,2,3) or REP(0); return how many have got one, 0
   where neither stands there, and go behind it. */
static int64_t values_of_array(Evaluation *e, int64_t *i, int64_t first, int64_t last) {
    const int64_t place = *i, set = behind_call(e, place, "set"), rep = behind_call(e, place, "rep");
    int64_t number = first;
    *i = most(set, rep);
    for (bool more = *i > place; more && e->finding == F_OK; ++*i) {
        const double value = siemens_value(e, i);
        *i = behind_blanks(e, *i);
        more = set > place && stands_at(e, *i, ',');
        const int64_t until = rep > place ? last : number;
        if (until > last || (!more && !stands_at(e, *i, ')')))
            wrong(e, F_EXPRESSION, PF_SIEMENS_INDICES, 0.0, place);
        for (; number <= until && e->finding == F_OK; number++)
            keep(e, number, value, place);
    }
    return number - first;
}

/* WIDTH=..., R1=..., DEPTH[2]=..., DEPTH[0]=SET(1,2); return the place behind. */
int64_t assign_variable(Evaluation *e, int64_t i) {
    const int64_t place = i, number = variable_at(e, &i);
    if (e->finding == F_OK && number < 0)
        wrong(e, F_EXPRESSION, PF_SIEMENS_VALUE, 0.0, place);
    require(e, &i, '=', PF_SIEMENS_VALUE);
    i = behind_blanks(e, i);
    const Array *array = NULL;
    for (int64_t k = 0; k < e->program->arrays.rows; k++)
        if (number >= AT(e->program->arrays, k).first && number <= last_of(&AT(e->program->arrays, k)))
            array = &AT(e->program->arrays, k);
    if (e->finding == F_OK && array != NULL && values_of_array(e, &i, number, last_of(array)) > 0)
        return i;
    const double result = e->finding == F_OK ? siemens_value(e, &i) : 0.0;
    keep(e, number, result, place);
    return i;
}

/* Define the array whose name stands at `place` with its [ before i: its elements get the values behind =, else 0; return the
   place behind. */
static int64_t define_array(Evaluation *e, int64_t place, int64_t i) {
    const Array *array = array_at(e, place, i);
    int64_t given = 0;
    if (array == NULL)
        return wrong(e, F_EXPRESSION, PF_SIEMENS_DEF, 0.0, place), e->end;
    while (i < e->end && AT(e->program->text, i) != ']')
        i++;
    i = behind_blanks(e, i + 1);
    if (stands_at(e, i, '=')) {
        i = behind_blanks(e, i + 1);
        given = values_of_array(e, &i, array->first, last_of(array));
        if (given == 0)
            wrong(e, F_EXPRESSION, PF_SIEMENS_INDICES, 0.0, least(i, e->end - 1));
    }
    for (int64_t number = array->first + given; number <= last_of(array) && e->finding == F_OK; number++)
        keep(e, number, 0.0, place);
    return i;
}

/* DEF REAL WIDTH=20, DEPTH: each variable of the line from i on gets its value, 0 where none is stated; return the place
   behind. */
int64_t define_variables(Evaluation *e, int64_t i) {
    const Bytes text = e->program->text;
    for (i = behind_blanks(e, i); i < e->end && is_letter(AT(text, i)); i++)
        ; /* the type */
    do {
        const int64_t place = i = behind_blanks(e, i), name = after_names(text, i);
        if (stands_at(e, name, '[')) {
            i = behind_blanks(e, define_array(e, place, name + 1));
            continue;
        }
        const int64_t number = variable_at(e, &i);
        double value = 0.0;
        if (number < P_FIRST_REAL)
            return wrong(e, F_EXPRESSION, PF_SIEMENS_DEF, 0.0, least(place, e->end - 1)), e->end;
        i = behind_blanks(e, i);
        if (stands_at(e, i, '=')) {
            i++;
            value = siemens_value(e, &i);
        }
        keep(e, number, value, place);
        i = behind_blanks(e, i);
    } while (e->finding == F_OK && stands_at(e, i++, ','));
    i--;
    if (e->finding == F_OK && i < e->end && AT(text, i) != ';')
        wrong(e, F_EXPRESSION, PF_SIEMENS_DEF, 0.0, i);
    return e->end;
}

/* --- functions ------------------------------------------------------------------------------------------ */

typedef enum { SIN, COS, TAN, ASIN, ACOS, SQRT, ABS, TRUNC, ROUND, LN, EXP, POT, ATAN2, MINVAL, MAXVAL, FUNCTIONS } Function;
static const char *const FUNCTION[] = {"sin",   "cos", "tan", "asin", "acos",  "sqrt",   "abs",   "trunc",
                                       "round", "ln",  "exp", "pot",  "atan2", "minval", "maxval"};

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

static double call_at(Evaluation *e, int64_t *i, Function function, int64_t place) {
    const double first = expression(e, i);
    double second = 0.0;
    if (function >= ATAN2) {
        require(e, i, ',', PF_SIEMENS_TWO);
        if (e->finding == F_OK)
            second = expression(e, i);
    }
    require(e, i, ')', PF_SIEMENS_BRACKET);
    if (e->finding != F_OK)
        return 0.0;
    switch (function) {
    case ATAN2: return degrees(atan2(first + 0.0, second));
    case MINVAL: return lesser(first, second);
    case MAXVAL: return greater(first, second);
    default: return function_of(e, function, first, place);
    }
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
    const int64_t number_of_variable = *i < e->end && is_of_name(AT(text, *i)) ? variable_at(e, i) : -1;
    if (number_of_variable >= 0)
        return value_of(e, number_of_variable, place);
    const int64_t truth = behind_keyword(e, *i, "true"), lie = behind_keyword(e, *i, "false");
    if (truth > *i || lie > *i) {
        *i = most(truth, lie);
        return truth > lie;
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

/* Tell whether a value is true or false; it is wrong where it is neither. */
static bool is_truth(Evaluation *e, double value, int64_t place) {
    if (e->finding == F_OK && value != 0.0 && value != 1.0)
        wrong(e, F_EXPRESSION, PF_SIEMENS_TRUTH, 0.0, least(place, e->end - 1));
    return e->finding == F_OK;
}

static double value_behind_signs(Evaluation *e, int64_t *i) {
    bool negative = false;
    const int64_t behind_not = behind_keyword(e, behind_blanks(e, *i), "not");
    if (behind_not > behind_blanks(e, *i) && e->depth < MOST_DEPTH) {
        const int64_t place = *i;
        *i = behind_not;
        e->depth++;
        const double value = value_behind_signs(e, i);
        e->depth--;
        return is_truth(e, value, place) ? value == 0.0 : 0.0;
    }
    for (*i = behind_blanks(e, *i); *i < e->end && is_sign(AT(e->program->text, *i)); *i = behind_blanks(e, *i + 1))
        negative ^= AT(e->program->text, *i) == '-';
    if (e->depth >= MOST_DEPTH)
        return wrong(e, F_EXPRESSION, PF_TOO_DEEP, 0.0, least(*i, e->end - 1));
    e->depth++;
    const double value = unsigned_at(e, i);
    e->depth--;
    return negative ? -value : value;
}

static double quotient(Evaluation *e, double left, double right, bool whole, int64_t place) {
    if (right == 0.0 && e->finding == F_OK)
        return wrong(e, F_EXPRESSION_VALUE, PF_DIVISION_BY_ZERO, 0.0, place);
    return whole ? trunc(left / right) : left / right;
}

static double remainder_of(Evaluation *e, double left, double right, int64_t place) {
    if (floor(left) != left || floor(right) != right)
        return wrong(e, F_EXPRESSION_VALUE, PF_MACRO_REMAINDER, floor(left) != left ? left : right, place);
    return right == 0.0 ? wrong(e, F_EXPRESSION_VALUE, PF_DIVISION_BY_ZERO, 0.0, place) : fmod(left, right);
}

static double product(Evaluation *e, int64_t *i) {
    double left = value_behind_signs(e, i);
    while (e->finding == F_OK) {
        const int64_t place = behind_blanks(e, *i);
        const int64_t div = behind_keyword(e, place, "div"), mod = behind_keyword(e, place, "mod");
        const bool times = stands_at(e, place, '*'), over = stands_at(e, place, '/');
        if (!times && !over && div == place && mod == place)
            break;
        *i = times || over ? place + 1 : most(div, mod);
        const double right = value_behind_signs(e, i);
        left = times ? left * right : mod > place ? remainder_of(e, left, right, place) : quotient(e, left, right, !over, place);
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

/* --- AND, XOR, OR --------------------------------------------------------------------------------------- */

enum { MOST_RANK = 2 };

/* AND goes before XOR, and that before OR. */
static double joined(Evaluation *e, int64_t *i, int rank) {
    static const char *const NAME[] = {"and", "xor", "or"};
    double left = rank == 0 ? sum(e, i) : joined(e, i, rank - 1);
    while (e->finding == F_OK) {
        const int64_t place = behind_blanks(e, *i), behind = behind_keyword(e, place, NAME[rank]);
        if (behind == place)
            break;
        *i = behind;
        const double right = rank == 0 ? sum(e, i) : joined(e, i, rank - 1);
        if (!is_truth(e, left, place) || !is_truth(e, right, place))
            return 0.0;
        left = rank == 0 ? left * right : rank == 1 ? left != right : greater(left, right);
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
    const double left = joined(e, i, MOST_RANK);
    const int64_t place = *i;
    const Comparison comparison = e->finding == F_OK ? comparison_at(e, i) : NONE;
    if (comparison == NONE)
        return left;
    const double right = joined(e, i, MOST_RANK), apart = fabs(left - right);
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

/* --- FOR ------------------------------------------------------------------------------------------------ */

/* Read the head of a loop from i on, R1=1 TO 5: the number of the variable, -1 for none, its first value and its last. */
int64_t loop_head(Evaluation *e, int64_t i, double *first, double *last) {
    const int64_t place = i = behind_blanks(e, i), number = variable_at(e, &i);
    const bool counts = number >= 0 && (number < P_FIRST_REAL || (number >= P_FIRST_INT && number < P_FIRST_BOOL));
    i = behind_blanks(e, i);
    if (!counts || !stands_at(e, i, '='))
        return (int64_t)wrong(e, F_EXPRESSION, PF_SIEMENS_FOR, 0.0, least(place, e->end - 1)) - 1;
    i++;
    *first = of_type(number, siemens_value(e, &i));
    i = behind_blanks(e, i);
    const int64_t to = behind_keyword(e, i, "to");
    if (e->finding == F_OK && to == i)
        wrong(e, F_EXPRESSION, PF_SIEMENS_FOR, 0.0, least(i, e->end - 1));
    i = to;
    if (e->finding == F_OK)
        *last = siemens_value(e, &i);
    siemens_line_ends(e, i);
    return number;
}

/* Give a variable a value, once the line is read, and tell it as the variable holds it. */
double set_variable(Evaluation *e, int64_t number, double value) {
    keep(e, number, value, 0);
    return of_type(number, value);
}

/* Tell whether nothing but a comment stands from i on; else that is wrong. */
bool siemens_line_ends(Evaluation *e, int64_t i) {
    i = behind_blanks(e, i);
    if (e->finding == F_OK && i < e->end && AT(e->program->text, i) != ';')
        wrong(e, F_EXPRESSION, PF_SIEMENS_BEHIND, 0.0, i);
    return e->finding == F_OK;
}
