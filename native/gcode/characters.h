/* The characters of G-code. */

#ifndef GCODE_CHARACTERS_H
#define GCODE_CHARACTERS_H

#include "constants.h"

static inline bool is_space(uint8_t c) { return c == ' ' || c == '\t'; }
static inline bool is_blank(uint8_t c) { return is_space(c) || c == '\r'; }
static inline bool is_digit(uint8_t c) { return (uint8_t)(c - '0') <= '9' - '0'; }
static inline bool is_sign(uint8_t c) { return c == '-' || c == '+'; }
static inline bool is_letter(uint8_t c) {
    return (uint8_t)((c | CH_CASE_BIT) - 'a') <= 'z' - 'a';
}

/* Tell whether @ or ^, which stand before the value of a polar word as a letter does. */
static inline bool is_polar_sign(uint8_t c) { return c == '@' || c == '^'; }
static inline bool begins_word(uint8_t c) { return is_letter(c) || is_polar_sign(c); }

/* Return the end of the line that i is in. */
static inline int64_t line_end(Bytes text, int64_t i) {
    while (i < text.rows && AT(text, i) != '\n')
        i++;
    return i;
}

#endif
