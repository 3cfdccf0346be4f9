/* Expressions and parameters, which are not read but passed over whole. */

#include "gcode/expressions.h"

#include "gcode/characters.h"

/* Tell whether a function with its argument stands at i, as in XABS[#1]. */
bool is_function(Bytes text, int64_t i) {
    const int64_t start = i;
    while (i < text.rows && is_letter(AT(text, i)))
        i++;
    return i > start + 1 && i < text.rows && AT(text, i) == CH_BRACKET_OPEN;
}

/* Return the place behind the bracket expression that opens at i. */
static int64_t after_bracket(Bytes text, int64_t i, int64_t end) {
    int64_t depth = 0;
    for (; i < end; i++) {
        depth += AT(text, i) == CH_BRACKET_OPEN;
        if (AT(text, i) == CH_BRACKET_CLOSE && --depth == 0)
            return i + 1;
    }
    return end;
}

/* Tell whether [, or the /[ of ATAN, stands at i. */
static bool opens_bracket(Bytes text, int64_t i, int64_t end) {
    if (AT(text, i) == CH_SLASH && i + 1 < end)
        return AT(text, i + 1) == CH_BRACKET_OPEN;
    return AT(text, i) == CH_BRACKET_OPEN;
}

static bool precedes_value(uint8_t c) { return is_blank(c) || is_sign(c) || c == CH_HASH; }

/* Return the place behind a number, parameter, function or bracket expression that begins at i. */
int64_t after_value(Bytes text, int64_t i, int64_t end) {
    while (i < end && precedes_value(AT(text, i)))
        i++;
    if (i < end && AT(text, i) == CH_LESS) { /* <name> */
        while (i < end && AT(text, i) != CH_GREATER)
            i++;
        return least(i + 1, end);
    }
    while (i < end && is_letter(AT(text, i))) /* a function: its name, its argument */
        i++;
    while (i < end && (AT(text, i) == CH_POINT || is_digit(AT(text, i))))
        i++;
    while (i < end && opens_bracket(text, i, end))
        i = after_bracket(text, i + (AT(text, i) == CH_SLASH), end);
    return i;
}

/* Return the place behind "#1 = value" or a lone parameter. */
int64_t after_assignment(Bytes text, int64_t i) {
    const int64_t end = line_end(text, i);
    i = after_value(text, i, end);
    while (i < end && is_blank(AT(text, i)))
        i++;
    return i < end && AT(text, i) == CH_EQUALS ? after_value(text, i + 1, end) : i;
}
