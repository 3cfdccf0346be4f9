/* The characters of G-code. */

#ifndef GCODE_CHARACTERS_H
#define GCODE_CHARACTERS_H

#include "constants.h"

static inline bool is_space(uint8_t c) { return c == CH_SPACE || c == CH_TAB; }
static inline bool is_blank(uint8_t c) { return is_space(c) || c == CH_RETURN; }
static inline bool is_digit(uint8_t c) { return (uint8_t)(c - CH_DIGIT_0) <= CH_DIGIT_9 - CH_DIGIT_0; }
static inline bool is_sign(uint8_t c) { return c == CH_MINUS || c == CH_PLUS; }
static inline bool is_letter(uint8_t c) {
    return (uint8_t)((c | CH_CASE_BIT) - CH_SMALL_A) <= CH_SMALL_Z - CH_SMALL_A;
}

/* Tell whether @ or ^, which stand before the value of a polar word as a letter does. */
static inline bool is_polar_sign(uint8_t c) { return c == CH_AT_SIGN || c == CH_CARET; }
static inline bool begins_word(uint8_t c) { return is_letter(c) || is_polar_sign(c); }

/* Return the end of the line that i is in. */
static inline int64_t line_end(Bytes text, int64_t i) {
    while (i < text.rows && AT(text, i) != CH_NEWLINE)
        i++;
    return i;
}

#endif
