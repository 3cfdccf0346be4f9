/* Targets to KRL motion lines, and numbers with fixed decimals: the same bytes on any processor. */

#include "krl/number_text.h"

#include "constants.h"

static const int64_t TEN_TO[] = {1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000, 1000000000};
enum { NANO_DECIMALS = 9, SPEED_DECIMALS = 7, MM_DECIMALS = 3, DEG_DECIMALS = 4 };

static uint8_t *put_digits(uint8_t *to, int64_t value, int digits) {
    for (int k = digits - 1; k >= 0; k--) {
        to[k] = (uint8_t)('0' + value % 10);
        value /= 10;
    }
    return to + digits;
}

uint8_t *put_integer(uint8_t *to, int64_t value) {
    int digits = 1;
    for (int64_t power = 10; power <= value; power *= 10)
        digits++;
    return put_digits(to, value, digits);
}

uint8_t *put_fixed(uint8_t *to, double value, int decimals) {
    const int64_t ten = TEN_TO[decimals];
    const int64_t scaled = in_last_decimal(fabs(value), TEN_TO[NANO_DECIMALS - decimals]);
    if (value < 0 && scaled > 0)
        *to++ = '-';
    to = put_integer(to, scaled / ten);
    if (decimals == 0)
        return to;
    *to++ = '.';
    return put_digits(to, scaled % ten, decimals);
}

/* Write one number; return the length of its text. */
EXPORT int64_t krl_fixed(Bytes text, double value, int64_t decimals) {
    return put_fixed(text.at, value, (int)decimals) - text.at;
}

/* Write numbers as whole numbers of their last decimal; one that is none is 0. */
EXPORT void krl_in_decimals(Floats values, int64_t decimals, Ints whole) {
    const int64_t unit = TEN_TO[NANO_DECIMALS - decimals];
    for (int64_t i = 0; i < values.rows; i++) {
        const double value = AT(values, i);
        const int64_t scaled = isnan(value) ? 0 : in_last_decimal(fabs(value), unit);
        AT(whole, i) = value < 0 ? -scaled : scaled;
    }
}

static uint8_t *put_pose(uint8_t *to, const double *position_mm, const double *abc_deg) {
    to = put_fixed(PUT(to, W_LIN " {X "), position_mm[0], MM_DECIMALS);
    to = put_fixed(PUT(to, ",Y "), position_mm[1], MM_DECIMALS);
    to = put_fixed(PUT(to, ",Z "), position_mm[2], MM_DECIMALS);
    to = put_fixed(PUT(to, ",A "), abc_deg[0], DEG_DECIMALS);
    to = put_fixed(PUT(to, ",B "), abc_deg[1], DEG_DECIMALS);
    return put_fixed(PUT(to, ",C "), abc_deg[2], DEG_DECIMALS);
}

/* Write the external axes of a motion, those of the bits of `axes`. */
static uint8_t *put_external(uint8_t *to, Floats external, int64_t row, int64_t axes) {
    for (int64_t k = 0; axes >> k; k++) {
        if (!(axes >> k & 1))
            continue;
        to = PUT(to, ",E");
        *to++ = (uint8_t)('1' + k);
        *to++ = ' ';
        to = put_fixed(to, CELL(external, row, k), MM_DECIMALS);
    }
    return to;
}

/* Write the lines of LIN motions; return the length of the text.

   state: speed and CDIS in force, motions since the last comment. before: text that stands right before
   motions, that of motion i from start[i] to start[i + 1]. external: E1 to E6, of which those in `axes` are
   written, bit 0 = E1. */
EXPORT int64_t krl_motion_lines(Floats position_mm, Floats abc_deg, Floats speed_m_s, Floats cdis_mm,
                                Ints32 source_line, Floats external, int64_t axes, Floats state,
                                int64_t comment_every, Bytes before, Ints start, Bytes text) {
    uint8_t *to = text.at;
    double *speed = &AT(state, 0), *cdis = &AT(state, 1), *uncommented = &AT(state, 2);
    for (int64_t i = 0; i < position_mm.rows; i++) {
        *uncommented += 1;
        if (comment_every > 0 && *uncommented >= (double)comment_every && AT(source_line, i) > 0) {
            to = PUT(put_integer(PUT(to, "; line "), AT(source_line, i)), "\r\n");
            *uncommented = 0;
        }
        if (AT(speed_m_s, i) != *speed) {
            *speed = AT(speed_m_s, i);
            to = PUT(put_fixed(PUT(to, W_VEL_CP "="), *speed, SPEED_DECIMALS), "\r\n");
        }
        if (AT(cdis_mm, i) > 0 && AT(cdis_mm, i) != *cdis) {
            *cdis = AT(cdis_mm, i);
            to = PUT(put_fixed(PUT(to, W_APO_CDIS "="), *cdis, MM_DECIMALS), "\r\n");
        }
        if (before.rows > 0)
            to = put(to, before.at + AT(start, i), (size_t)(AT(start, i + 1) - AT(start, i)));
        to = put_pose(to, &CELL(position_mm, i, 0), &CELL(abc_deg, i, 0));
        if (axes)
            to = put_external(to, external, i, axes);
        to = AT(cdis_mm, i) > 0 ? PUT(to, "} " W_C_DIS "\r\n") : PUT(to, "}\r\n");
    }
    return to - text.at;
}
