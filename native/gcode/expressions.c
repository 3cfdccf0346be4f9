/* Expressions: [#1 + 2 * SIN[30]], as LinuxCNC reads them.

   They are read and worked out in one pass, from the text, each time their line is executed: it takes no longer
   than a step of a compiled form, and a file of a million expressions needs no compiler. A sign belongs to the
   value behind it, so -2**2 is 4; operators of one rank go from left to right. */

#include "gcode/expressions.h"

#include "gcode/macro_values.h"
#include "gcode/numbers.h"

enum { MOST_DEPTH = 200 }; /* of values within values */
static const double PI_REST = 1.2246467991473532e-16; /* pi minus the float that is nearest to it */
static const double EQUAL = 1e-6;                     /* LinuxCNC takes numbers this near as equal */

/* --- functions ------------------------------------------------------------------------------------------ */

typedef enum { ABS, ACOS, ASIN, ATAN, COS, EXISTS, EXP, FIX, FUP, LN, ROUND, SIN, SQRT, TAN, FUNCTIONS } Function;
static const char *const FUNCTION[] = {"abs", "acos", "asin", "atan", "cos",   "exists", "exp",
                                       "fix", "fup",  "ln",   "round", "sin", "sqrt",   "tan"};

/* Return degrees in radians, and what the float leaves over: FIX[10 * SIN[30]] and FIX[10 * COS[60]] are 5. */
static double radians(double degrees, double *left_over) {
    const double product = degrees * PI;
    const double rest = fma(degrees, PI, -product) + degrees * PI_REST;
    const double quotient = product / 180.0;
    *left_over = (fma(-quotient, 180.0, product) + rest) / 180.0;
    return quotient;
}

/* Return radians in degrees, rounded once behind the product. */
double degrees(double radian) {
    const double product = radian * 180.0, quotient = product / PI;
    return quotient + (fma(-quotient, PI, product) - quotient * PI_REST) / PI;
}

double sine(double degrees) {
    double left_over;
    const double angle = radians(degrees, &left_over);
    return sin(angle) + left_over * cos(angle);
}

double cosine(double degrees) {
    double left_over;
    const double angle = radians(degrees, &left_over);
    return cos(angle) - left_over * sin(angle);
}

double tangent(double degrees) {
    double left_over;
    const double angle = radians(degrees, &left_over), t = tan(angle);
    return t + left_over * (1.0 + t * t);
}

static double function_of(Evaluation *e, Function function, double x, int64_t place) {
    if (is_macro(e)) {
        if (function == FIX || function == FUP)
            return function == FIX ? trunc(x) : x < 0.0 ? floor(x) : ceil(x);
        if (function == ASIN && x < 0.0)
            return wrong(e, F_EXPRESSION_VALUE, PF_MACRO_ASIN, x, place);
        if (function == ROUND && e->in_word)
            return wrong(e, F_EXPRESSION_VALUE, PF_MACRO_ROUND, x, place);
    }
    switch (function) {
    case ABS: return fabs(x);
    case ACOS:
        return fabs(x) > 1.0 ? wrong(e, F_EXPRESSION_VALUE, PF_ARC_COSINE, x, place) : degrees(acos(x));
    case ASIN:
        return fabs(x) > 1.0 ? wrong(e, F_EXPRESSION_VALUE, PF_ARC_SINE, x, place) : degrees(asin(x));
    case COS: return cosine(x);
    case EXP: return exp(x);
    case FIX: return floor(x);
    case FUP: return ceil(x);
    case LN: return x <= 0.0 ? wrong(e, F_EXPRESSION_VALUE, PF_LOGARITHM, x, place) : log(x);
    case ROUND: return x < 0.0 ? ceil(x - 0.5) : floor(x + 0.5);
    case SIN: return sine(x);
    case SQRT: return x < 0.0 ? wrong(e, F_EXPRESSION_VALUE, PF_SQUARE_ROOT, x, place) : sqrt(x);
    case TAN: return tangent(x);
    default: return 0.0;
    }
}

/* Return the place behind a word of letters that stands at i, blanks in it or not; i itself where it does not. */
int64_t after_word(Bytes text, int64_t i, int64_t end, const char *word) {
    int64_t at = i;
    for (; *word; word++, at++) {
        at = after_blanks(text, at, end);
        if (at >= end || (AT(text, at) | CH_CASE_BIT) != (uint8_t)*word || !is_letter(AT(text, at)))
            return i;
    }
    return at;
}

/* Return the function whose name stands at i, FUNCTIONS for none, and go to its [. */
static Function function_at(const Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    for (Function function = ABS; function < FUNCTIONS; function++) {
        int64_t behind = after_word(text, *i, e->end, FUNCTION[function]);
        if (behind == *i)
            continue;
        behind = after_blanks(text, behind, e->end);
        if ((behind < e->end && is_letter(AT(text, behind))) || (function == EXISTS && is_macro(e)))
            continue;
        *i = behind;
        return function;
    }
    return FUNCTIONS;
}

/* --- operators ------------------------------------------------------------------------------------------ */

typedef struct {
    const char *word;
    Kind kind;
    int rank;
} Operator;
enum { LOWEST = 1, ANY = 0, POINT_RANK = 4, LINE_RANK = 3 };
static const Operator WORDS[] = {{"mod", MODULO, 4}, {"eq", EQ, 2}, {"ne", NE, 2},   {"gt", GT, 2}, {"ge", GE, 2},
                                 {"lt", LT, 2},      {"le", LE, 2}, {"and", AND, 1}, {"or", OR, 1}, {"xor", XOR, 1}};
enum { WORDS_COUNT = sizeof WORDS / sizeof *WORDS };

/* Return the operator at i, or the closing bracket, and the place behind it. */
static Operator operator_at(Evaluation *e, int64_t i, int64_t *behind) {
    static const Operator CLOSES = {"]", CLOSING, ANY};
    const Bytes text = e->program->text;
    *behind = i + 1;
    if (e->is_open && e->brackets == 0 &&
        (i >= e->end || AT(text, i) == '(' || AT(text, i) == ';'))
        return CLOSES;
    if (i >= e->end) {
        wrong(e, F_EXPRESSION, PF_UNCLOSED_BRACKET, 0.0, least(i, e->end - 1));
        return CLOSES;
    }
    switch (AT(text, i)) {
    case ']': return CLOSES;
    case '+': return (Operator){"+", PLUS, 3};
    case '-': return (Operator){"-", MINUS, 3};
    case '/': return (Operator){"/", OVER, 4};
    case '*': {
        const int64_t second = after_blanks(text, i + 1, e->end);
        if (second >= e->end || AT(text, second) != '*' || is_macro(e))
            return (Operator){"*", TIMES, 4};
        *behind = second + 1;
        return (Operator){"**", POWER, 5};
    }
    }
    for (int k = 0; k < WORDS_COUNT; k++) {
        *behind = after_word(text, i, e->end, WORDS[k].word);
        if (*behind == i)
            continue;
        Operator found = WORDS[k];
        if (is_macro(e) && found.kind >= AND) /* on a Fanuc they go with * and +, before comparisons */
            found.rank = found.kind == AND ? POINT_RANK : LINE_RANK;
        return found;
    }
    wrong(e, F_EXPRESSION, PF_UNKNOWN_OPERATOR, 0.0, i);
    return CLOSES;
}

/* Return the positive remainder. */
static double modulo(double a, double b) {
    const double rest = fmod(a, b);
    return rest < 0.0 ? rest + fabs(b) : rest;
}

static double apply(Evaluation *e, Kind kind, double a, double b, int64_t place) {
    switch (kind) {
    case POWER:
        if (a < 0.0 && floor(b) != b)
            return wrong(e, F_EXPRESSION_VALUE, PF_POWER, a, place);
        return pow(a, b);
    case TIMES: return a * b;
    case OVER: return b == 0.0 ? wrong(e, F_EXPRESSION_VALUE, PF_DIVISION_BY_ZERO, 0.0, place) : a / b;
    case MODULO: return modulo(a, b);
    case PLUS: return a + b;
    case MINUS: return a - b;
    case EQ: return fabs(a - b) < EQUAL;
    case NE: return fabs(a - b) >= EQUAL;
    case GT: return a > b;
    case GE: return fabs(a - b) < EQUAL || a >= b;
    case LT: return a < b;
    case LE: return fabs(a - b) < EQUAL || a <= b;
    case AND: return a != 0.0 && b != 0.0;
    case OR: return a != 0.0 || b != 0.0;
    case XOR: return (a != 0.0) != (b != 0.0);
    case CLOSING: break;
    }
    return 0.0;
}

/* Work out values and operators of at least a rank. */
static double operation(Evaluation *e, int64_t *i, int rank) {
    double left = value_at(e, i);
    bool compared = false;
    while (e->finding == F_OK) {
        int64_t behind;
        *i = after_blanks(e->program->text, *i, e->end);
        const Operator found = operator_at(e, *i, &behind);
        if (e->finding != F_OK || found.kind == CLOSING || found.rank < rank)
            break;
        const int64_t place = *i;
        *i = behind;
        const bool left_is_null = e->is_null;
        const double right = operation(e, i, found.rank + 1);
        if (e->finding != F_OK)
            break;
        if (is_macro(e) && compared && is_comparison(found.kind))
            return wrong(e, F_EXPRESSION, PF_MACRO_COMPARISONS, 0.0, place);
        compared |= is_comparison(found.kind);
        const Operands two = {left, right, left_is_null, e->is_null};
        if (is_macro(e) && is_macro_operator(found.kind))
            left = apply_in_macro(e, found.kind, &two, place);
        else
            left = e->dry ? 1.0 : apply(e, found.kind, left, right, place);
        e->is_null = false;
    }
    return left;
}

/* Work out the expression whose [ stands at i, and go behind its ]. */
double bracket_at(Evaluation *e, int64_t *i) {
    ++*i;
    e->brackets++;
    const double value = operation(e, i, LOWEST);
    e->brackets--;
    if (e->finding == F_OK)
        ++*i; /* the closing bracket */
    return value;
}

/* Work out an expression without a bracket around it, as a Fanuc has it behind =. */
double open_value(Evaluation *e, int64_t *i) {
    e->is_open = true;
    const double value = operation(e, i, LOWEST);
    e->is_open = false;
    return value;
}

/* --- values --------------------------------------------------------------------------------------------- */

/* Return the number of the parameter whose # stands before i, which goes behind it; 0 where it is none. */
static int64_t parameter_number(Evaluation *e, int64_t *i) {
    const int64_t place = *i;
    const double value = value_at(e, i);
    int64_t number;
    if (e->finding != F_OK)
        return 0;
    if (e->dry)
        return 1;
    const bool exists = whole_number(value, &number) && number >= 1 && number < P_MOST_PARAMETERS;
    if (!exists) {
        wrong(e, F_PARAMETER_NUMBER, value, 0.0, place);
        return 0;
    }
    return number;
}

/* Return the number of a Fanuc's variable, as `parameter_number` does; 0 for #0 too. */
static int64_t number_of_variable(Evaluation *e, int64_t *i, int64_t place) {
    if (*i < e->end && AT(e->program->text, *i) == '<') {
        wrong(e, F_EXPRESSION, PF_MACRO_NAME, 0.0, place);
        return 0;
    }
    const bool in_word = e->in_word;
    e->in_word = false;
    const double value = value_at(e, i);
    e->in_word = in_word;
    return e->finding == F_OK ? variable_number(e, value, place) : 0;
}

/* Read a Fanuc's variable whose # stands at i. */
static double variable_at(Evaluation *e, int64_t *i) {
    const int64_t place = *i;
    *i = after_blanks(e->program->text, *i + 1, e->end);
    const int64_t number = number_of_variable(e, i, place);
    e->is_null = e->finding == F_OK && number == 0;
    if (e->finding != F_OK || number == 0)
        return 0.0;
    const double value = AT(e->program->parameters, number);
    if (isnan(value))
        note_unset(e, number);
    e->is_null = isnan(value) || isinf(value);
    return e->is_null ? 0.0 : value;
}

/* Read the parameter whose # stands at i: its value, or whether there is one. */
static double parameter_at(Evaluation *e, int64_t *i, bool exists) {
    const Bytes text = e->program->text;
    const int64_t place = *i;
    if (is_macro(e))
        return variable_at(e, i);
    *i = after_blanks(text, *i + 1, e->end);
    if (*i < e->end && AT(text, *i) == '<') {
        const int64_t name = name_at(e, i);
        if (name == NO_NAME)
            return 0.0;
        if (exists || e->dry)
            return e->dry || is_name_set(e, name);
        if (!is_name_set(e, name))
            return wrong(e, F_PARAMETER_UNDEFINED, 0.0, 0.0, place);
        if (is_name_of_cutter(e->machine, name))
            return wrong(e, F_CUTTER_PARAMETER, 0.0, 0.0, place);
        const int fault = fault_of_name(e->machine, name);
        return fault == KNOWN ? named_parameter(e, name) : wrong(e, F_EXPRESSION_VALUE, fault, 0.0, place);
    }
    if (!exists) {
        const int64_t number = parameter_number(e, i);
        if (number == 0 || e->dry)
            return 1.0;
        if (is_of_cutter(e->machine, number))
            return wrong(e, F_CUTTER_PARAMETER, 0.0, 0.0, place);
        const int fault = fault_of_number(e->machine, number);
        return fault == KNOWN ? numbered_parameter(e, number)
                              : wrong(e, F_EXPRESSION_VALUE, fault, (double)number, place);
    }
    const double value = value_at(e, i);
    int64_t number;
    return whole_number(value, &number) && number >= 1 && number < P_MOST_PARAMETERS;
}

/* EXISTS[#…], whose [ stands at i. */
static double exists_at(Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    const int64_t inside = after_blanks(text, *i + 1, e->end);
    if (inside >= e->end || AT(text, inside) != '#')
        return wrong(e, F_EXPRESSION, PF_NO_PARAMETER, 0.0, inside);
    *i = inside;
    const double value = parameter_at(e, i, true);
    *i = after_blanks(text, *i, e->end);
    if (e->finding == F_OK && (*i >= e->end || AT(text, *i) != ']'))
        return wrong(e, F_EXPRESSION, PF_UNCLOSED_BRACKET, 0.0, least(*i, e->end - 1));
    ++*i;
    return value;
}

/* ATAN[y]/[x] in degrees; i is behind the first bracket. */
static double arc_tangent(Evaluation *e, int64_t *i, double y) {
    const Bytes text = e->program->text;
    const int64_t slash = after_blanks(text, *i, e->end);
    if (slash >= e->end || AT(text, slash) != '/')
        return wrong(e, F_EXPRESSION, PF_NO_SLASH, 0.0, least(slash, e->end - 1));
    *i = after_blanks(text, slash + 1, e->end);
    if (*i >= e->end || AT(text, *i) != '[')
        return wrong(e, F_EXPRESSION, PF_NO_SLASH, 0.0, slash);
    if (is_macro(e) && y < 0.0)
        return wrong(e, F_EXPRESSION_VALUE, PF_MACRO_ATAN, y, slash);
    return degrees(atan2(y + 0.0, bracket_at(e, i)));
}

static double call_at(Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    const int64_t place = *i;
    const Function function = function_at(e, i);
    if (function == FUNCTIONS)
        return wrong(e, F_EXPRESSION, PF_UNKNOWN_FUNCTION, 0.0, place);
    if (*i >= e->end || AT(text, *i) != '[')
        return wrong(e, F_EXPRESSION, PF_NO_BRACKET, 0.0, place);
    if (function == EXISTS)
        return exists_at(e, i);
    const double argument = bracket_at(e, i);
    if (e->finding != F_OK)
        return 0.0;
    if (function == ATAN)
        return arc_tangent(e, i, argument);
    return e->dry ? 1.0 : function_of(e, function, argument, place);
}

/* Tell whether a value that is no number stands at i: a sign before something else, #, [ or a function. */
bool begins_value(Bytes text, int64_t i, int64_t end) {
    while (i < end && (is_blank(AT(text, i)) || is_sign(AT(text, i))))
        i++;
    if (i >= end)
        return false;
    if (AT(text, i) == '#' || AT(text, i) == '[')
        return true;
    int64_t letters = 0;
    for (; i < end && (is_letter(AT(text, i)) || is_blank(AT(text, i))); i++)
        letters += is_letter(AT(text, i));
    return letters > 1 && i < end && AT(text, i) == '[';
}

/* A value behind its signs. */
static double unsigned_value(Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    const uint8_t c = AT(text, *i);
    e->is_null = false;
    if (c == '[')
        return bracket_at(e, i);
    if (c == '#')
        return parameter_at(e, i, false);
    if (is_letter(c)) {
        const double value = call_at(e, i);
        e->is_null = false;
        return value;
    }
    if (!is_digit(c) && c != '.')
        return wrong(e, F_EXPRESSION, PF_NO_VALUE, 0.0, *i);
    const Number read = number(text, *i);
    if (read.digits == 0)
        return wrong(e, F_EXPRESSION, PF_NO_VALUE, 0.0, *i);
    if (read.finding != F_OK)
        return wrong(e, read.finding, '#', 0.0, *i);
    *i = read.end;
    return read.value;
}

/* Work out the value at i: a number, a parameter, a function or a bracket; go behind it. */
double value_at(Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    const int64_t place = *i;
    bool negative = false;
    for (*i = after_blanks(text, *i, e->end); *i < e->end && is_sign(AT(text, *i));
         *i = after_blanks(text, *i + 1, e->end))
        negative ^= AT(text, *i) == '-';
    if (*i >= e->end)
        return wrong(e, F_EXPRESSION, PF_NO_VALUE, 0.0, least(place, e->end - 1));
    if (e->depth >= MOST_DEPTH)
        return wrong(e, F_EXPRESSION, PF_TOO_DEEP, 0.0, *i);
    e->depth++;
    const double value = unsigned_value(e, i);
    e->depth--;
    e->is_null = e->is_null && !negative;
    if (isnan(value))
        return wrong(e, F_EXPRESSION_VALUE, PF_NOT_A_NUMBER, 0.0, place);
    if (isinf(value))
        return wrong(e, F_EXPRESSION_VALUE, PF_INFINITE, 0.0, place);
    return negative ? -value : value;
}

/* Read "#1 = value" or "#<name> = value", whose # stands at i; it is kept until the line has been read. */
void assignment_at(Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    const int64_t place = *i;
    Assignment made = {NO_NAME, 0, 0.0};
    *i = after_blanks(text, *i + 1, e->end);
    if (is_macro(e))
        made.number = number_of_variable(e, i, place);
    else if (*i < e->end && AT(text, *i) == '<')
        made.name = name_at(e, i);
    else
        made.number = parameter_number(e, i);
    *i = after_blanks(text, *i, e->end);
    if (e->finding == F_OK && (*i >= e->end || AT(text, *i) != '='))
        wrong(e, F_EXPRESSION, PF_NO_EQUALS, 0.0, place);
    if (e->finding != F_OK)
        return;
    if (is_macro(e) && made.number == 0) {
        wrong(e, F_EXPRESSION, PF_MACRO_NULL, 0.0, place);
        return;
    }
    if (!e->dry && !is_macro(e) && (made.name == NO_NAME ? is_read_only(made.number) : made.name < N_PREDEFINED)) {
        wrong(e, F_PARAMETER_READ_ONLY, 0.0, 0.0, place);
        return;
    }
    ++*i;
    made.value = is_macro(e) ? open_value(e, i) : value_at(e, i);
    if (e->is_null)
        made.value = VACANT;
    Course *at = e->program->course.at;
    if (e->finding == F_OK && !e->dry)
        AT(e->program->assignments, at->assignments++) = made;
}
