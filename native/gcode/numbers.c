/* Numbers that do not look like most, and line numbers. */

#include "gcode/numbers.h"

/* Read the number from i on, whatever it looks like. Blanks inside it mean nothing; digits beyond what a float
   holds are dropped behind the point. */
Number any_number(Bytes text, int64_t i) {
    Number read = {F_OK, 0.0, 0, 0, false, i};
    int64_t mantissa = 0, significant = 0;
    bool negative = false, point = false, started = false;
    for (; i < text.rows; i++) {
        const uint8_t c = AT(text, i);
        if (is_digit(c)) {
            started = true;
            read.digits++;
            significant += significant > 0 || c != '0';
            if (significant <= MOST_DIGITS) {
                mantissa = mantissa * 10 + (c - '0');
                read.decimals += point;
            } else if (!point) {
                read.finding = F_NUMBER_TOO_LONG;
            }
        } else if (c == '.' && !point) {
            point = started = true;
        } else if (is_sign(c) && !started) {
            started = true;
            negative = c == '-';
        } else if (!is_space(c)) {
            break;
        }
    }
    read.decimals = least(read.decimals, MOST_DECIMALS);
    read.value = (negative ? -(double)mantissa : (double)mantissa) / TEN_TO[read.decimals];
    read.plain = !point && !negative;
    read.end = i;
    return read;
}

/* Tell whether N is followed by digits, or digits.digits: what LinuxCNC reads as a line number. */
bool is_line_number(Bytes text, int64_t i, int64_t end) {
    int64_t before = 0, behind = 0;
    bool point = false;
    for (; i < end; i++) {
        const uint8_t c = AT(text, i);
        if (is_sign(c))
            return false;
        if (c == '.') {
            point = true;
        } else if (!is_blank(c)) {
            before += !point;
            behind += point;
        }
    }
    return before > 0 && (behind > 0 || !point);
}
