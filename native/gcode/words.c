/* Bytes to words: the scanner of G-code text. What goes where in its columns says gcode2krl/gcode/words.py. */

#include "constants.h"
#include "core.h"

/* The text, the columns of its words, and how many there are; as in gcode2krl/gcode/words.py. */
/* Kinds of an item that makes no word: a comment; a line or program number. Other kinds are letters. */
enum { NOTHING = -1, LINE_NUMBER = 0 };
/* Instead of a lost letter: the one of the word before in the line has lost its value. */
enum { LETTER_BEFORE = -1 };

/* What stands at a place: its kind, which goes into the column of letters; a finding and what was found; the
   letter whose value is lost, 0 = none; the place behind. */
typedef struct {
    int kind, finding;
    double found;
    int lost;
    int64_t end;
} Item;

enum { MOST_DIGITS = 15, MOST_DECIMALS = 18 };
static const double TEN_TO[MOST_DECIMALS + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8, 1e9,
                                                 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18};

/* A number: `plain` is a whole one without a minus sign. */
typedef struct {
    int finding;
    double value;
    int64_t digits, decimals;
    bool plain;
    int64_t end;
} Number;

/* --- characters ----------------------------------------------------------------------------------------- */

static inline bool is_space(uint8_t c) { return c == CH_SPACE || c == CH_TAB; }
static inline bool is_blank(uint8_t c) { return is_space(c) || c == CH_RETURN; }
static inline bool is_digit(uint8_t c) { return (uint8_t)(c - CH_DIGIT_0) <= CH_DIGIT_9 - CH_DIGIT_0; }
static inline bool is_sign(uint8_t c) { return c == CH_MINUS || c == CH_PLUS; }
static inline bool is_letter(uint8_t c) {
    return (uint8_t)((c | CH_CASE_BIT) - CH_SMALL_A) <= CH_SMALL_Z - CH_SMALL_A;
}

/* Return the code point of the UTF-8 character at i, the byte itself where it is none. */
static int character(Bytes text, int64_t i) {
    const int first = AT(text, i);
    const int more = first >= 0xC2 && first < 0xE0 ? 1 : first >= 0xE0 && first < 0xF0 ? 2 : 3;
    if (first < 0xC2 || first > 0xF4 || i + more >= text.rows)
        return first;
    int code = first & (0x3F >> more);
    for (int64_t k = i + 1; k < i + 1 + more; k++) {
        if ((AT(text, k) & 0xC0) != 0x80)
            return first;
        code = code << 6 | (AT(text, k) & 0x3F);
    }
    return code;
}

static int64_t line_end(Bytes text, int64_t i) {
    while (i < text.rows && AT(text, i) != CH_NEWLINE)
        i++;
    return i;
}

/* --- expressions, which are not read but passed over whole ------------------------------------------------ */

/* Tell whether a function with its argument stands at i, as in XABS[#1]. */
static bool is_function(Bytes text, int64_t i) {
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
static int64_t after_value(Bytes text, int64_t i, int64_t end) {
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
static int64_t after_assignment(Bytes text, int64_t i) {
    const int64_t end = line_end(text, i);
    i = after_value(text, i, end);
    while (i < end && is_blank(AT(text, i)))
        i++;
    return i < end && AT(text, i) == CH_EQUALS ? after_value(text, i + 1, end) : i;
}

/* --- comments ------------------------------------------------------------------------------------------- */

/* Tell whether a comment's content begins with MSG, as (MSG, …) does. */
static bool is_message(Bytes text, int64_t i, int64_t end) {
    while (i < end && is_space(AT(text, i)))
        i++;
    return i + 3 <= end && (AT(text, i) | CH_CASE_BIT) == CH_SMALL_M &&
           (AT(text, i + 1) | CH_CASE_BIT) == CH_SMALL_S && (AT(text, i + 2) | CH_CASE_BIT) == CH_SMALL_G;
}

/* Return the item of the comment that opens at i. */
static Item comment(Bytes text, int64_t i) {
    int64_t end = i + 1;
    int depth = 1;
    bool nested = false;
    for (; end < text.rows && AT(text, end) != CH_NEWLINE && depth > 0; end++) {
        nested |= AT(text, end) == CH_PAREN_OPEN;
        depth += (AT(text, end) == CH_PAREN_OPEN) - (AT(text, end) == CH_PAREN_CLOSE);
    }
    if (nested || depth > 0)
        return (Item){V_MARK, nested ? F_COMMENT_NESTED : F_COMMENT_OPEN, CH_PAREN_OPEN, 0, end};
    return (Item){is_message(text, i + 1, end - 1) ? CH_PAREN_OPEN : NOTHING, F_OK, 0.0, 0, end};
}

/* --- numbers -------------------------------------------------------------------------------------------- */

/* Read the number from i on, whatever it looks like. Blanks inside it mean nothing; digits beyond what a float
   holds are dropped behind the point. */
static Number any_number(Bytes text, int64_t i) {
    Number read = {F_OK, 0.0, 0, 0, false, i};
    int64_t mantissa = 0, significant = 0;
    bool negative = false, point = false, started = false;
    for (; i < text.rows; i++) {
        const uint8_t c = AT(text, i);
        if (is_digit(c)) {
            started = true;
            read.digits++;
            significant += significant > 0 || c != CH_DIGIT_0;
            if (significant <= MOST_DIGITS) {
                mantissa = mantissa * 10 + (c - CH_DIGIT_0);
                read.decimals += point;
            } else if (!point) {
                read.finding = F_NUMBER_TOO_LONG;
            }
        } else if (c == CH_POINT && !point) {
            point = started = true;
        } else if (is_sign(c) && !started) {
            started = true;
            negative = c == CH_MINUS;
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

/* Add the digits from i on to a mantissa; return the place behind. */
static inline int64_t add_digits(Bytes text, int64_t i, int64_t *mantissa) {
    for (; i < text.rows && is_digit(AT(text, i)); i++)
        *mantissa = (int64_t)((uint64_t)*mantissa * 10 + (AT(text, i) - CH_DIGIT_0));
    return i;
}

/* Read the number from i on: at once what most look like, a sign, digits, a point, digits. */
static inline Number number(Bytes text, int64_t i) {
    const int64_t start = i;
    int64_t mantissa = 0, decimals = 0;
    const bool negative = i < text.rows && AT(text, i) == CH_MINUS;
    const int64_t first_digit = i += negative;
    i = add_digits(text, i, &mantissa);
    int64_t digits = i - first_digit;
    const bool point = i < text.rows && AT(text, i) == CH_POINT;
    if (point) {
        const int64_t behind = i + 1;
        i = add_digits(text, behind, &mantissa);
        decimals = i - behind;
        digits += decimals;
    }
    while (i < text.rows && is_space(AT(text, i)))
        i++;
    const bool goes_on = i < text.rows && (is_digit(AT(text, i)) || AT(text, i) == CH_POINT);
    if (digits == 0 || digits > MOST_DIGITS || goes_on)
        return any_number(text, start);
    const double value = (negative ? -(double)mantissa : (double)mantissa) / TEN_TO[decimals];
    return (Number){F_OK, value, digits, decimals, !point && !negative, i};
}

/* Tell whether N is followed by digits, or digits.digits: what LinuxCNC reads as a line number. */
static bool is_line_number(Bytes text, int64_t i, int64_t end) {
    int64_t before = 0, behind = 0;
    bool point = false;
    for (; i < end; i++) {
        const uint8_t c = AT(text, i);
        if (is_sign(c))
            return false;
        if (c == CH_POINT) {
            point = true;
        } else if (!is_blank(c)) {
            before += !point;
            behind += point;
        }
    }
    return before > 0 && (behind > 0 || !point);
}

/* --- items ---------------------------------------------------------------------------------------------- */

/* Return the item of a letter with no number behind it; it ends at i. */
static Item without_number(Bytes text, int64_t i, int letter) {
    if (letter == CH_LETTER_O)
        return (Item){V_MARK, F_O_WORD, letter, letter, line_end(text, i)};
    if (letter == CH_LETTER_N)
        return (Item){V_MARK, F_BAD_LINE_NUMBER, letter, 0, i};
    if (i < text.rows &&
        (AT(text, i) == CH_HASH || AT(text, i) == CH_BRACKET_OPEN || is_function(text, i)))
        return (Item){V_MARK, F_EXPRESSION, letter, letter, after_value(text, i, line_end(text, i))};
    if (i < text.rows && AT(text, i) >= CH_FIRST_FOREIGN)
        return (Item){V_MARK, F_BAD_CHARACTER, character(text, i), letter, i};
    return (Item){V_MARK, F_NO_NUMBER, letter, letter, i};
}

/* Return the item of O and its number, which ends at i: alone in its line it says nothing. */
static Item program_number(Bytes text, int64_t i, bool may_be_one) {
    while (i < text.rows && is_blank(AT(text, i)))
        i++;
    const bool alone = i >= text.rows || AT(text, i) == CH_NEWLINE || AT(text, i) == CH_PAREN_OPEN ||
                       AT(text, i) == CH_SEMICOLON;
    if (may_be_one && alone)
        return (Item){LINE_NUMBER, F_OK, 0.0, 0, i};
    return (Item){V_MARK, F_O_WORD, CH_LETTER_O, CH_LETTER_O, line_end(text, i)};
}

/* Return the item of the letter at i that makes no plain word with the number behind it. */
static Item odd_word(Bytes text, int64_t i, int letter, const Number *behind, bool first) {
    if (behind->digits == 0)
        return without_number(text, behind->end, letter);
    if (behind->finding != F_OK)
        return (Item){V_MARK, behind->finding, letter, letter, behind->end};
    if (letter == CH_LETTER_O)
        return program_number(text, behind->end, first && behind->plain);
    if (!first)
        return (Item){V_MARK, F_N_NOT_FIRST, letter, 0, behind->end};
    if (!is_line_number(text, i + 1, behind->end))
        return (Item){V_MARK, F_BAD_LINE_NUMBER, letter, 0, behind->end};
    return (Item){LINE_NUMBER, F_OK, 0.0, 0, behind->end};
}

/* Return the item that stands at i and is no letter; `first` where the line has no word before. */
static Item other_item(Bytes text, int64_t i, bool first) {
    const uint8_t c = AT(text, i);
    if (c == CH_SEMICOLON)
        return (Item){NOTHING, F_OK, 0.0, 0, line_end(text, i)};
    if (c == CH_PAREN_OPEN)
        return comment(text, i);
    if (c == CH_PERCENT || (c == CH_SLASH && first))
        return (Item){c, F_OK, 0.0, 0, i + 1};
    if (c == CH_HASH) /* #1 = value: an assignment; what is no assignment is a lone parameter */
        return (Item){V_MARK, F_EXPRESSION, c, 0, after_assignment(text, i)};
    if (c == CH_BRACKET_OPEN || c == CH_BRACKET_CLOSE || c == CH_EQUALS)
        return (Item){V_MARK, F_EXPRESSION, c, LETTER_BEFORE, i + 1};
    return (Item){V_MARK, F_BAD_CHARACTER, character(text, i), LETTER_BEFORE, i + 1};
}

/* --- the columns ---------------------------------------------------------------------------------------- */

static inline void put(Scan *scan, int letter, double value, int64_t line) {
    AT(scan->letter, scan->words) = (uint8_t)letter;
    AT(scan->value, scan->words) = value;
    AT(scan->line, scan->words) = (int32_t)line;
    scan->words++;
}

/* Write a mark, and what was found while there is room. */
static void put_mark(Scan *scan, int finding, double found, int64_t line) {
    if (scan->marks < scan->extra.rows)
        AT(scan->extra, scan->marks) = found;
    put(scan, V_MARK, finding, line);
    scan->marks++;
}

/* Return the letter whose value is lost, that of the word before for LETTER_BEFORE; 0 = none. */
static int lost_letter(const Scan *scan, int lost, int64_t line) {
    if (lost != LETTER_BEFORE)
        return lost;
    if (scan->words == 0 || AT(scan->line, scan->words - 1) != line)
        return 0;
    const int letter = AT(scan->letter, scan->words - 1);
    return letter >= CH_LETTER_A && letter <= CH_LETTER_Z ? letter : 0;
}

/* Write what an item from `start` on makes; a line has one mark of its characters at most. */
static void put_item(Scan *scan, const Item *item, int64_t start, int64_t line, bool marked) {
    if (item->kind == V_MARK) {
        const int lost = lost_letter(scan, item->lost, line);
        if (!marked)
            put_mark(scan, item->finding, item->found, line);
        if (lost > 0)
            put(scan, lost + V_UNREAD_NUMBER, 0.0, line);
    } else if (item->kind == CH_PAREN_OPEN) {
        put(scan, item->kind, (double)scan->messages, line);
        CELL(scan->message_span, scan->messages, 0) = start + 1;
        CELL(scan->message_span, scan->messages, 1) = item->end - 1;
        scan->messages++;
    } else if (item->kind > LINE_NUMBER) {
        put(scan, item->kind, 0.0, line);
    }
}

/* Fill the columns from whole lines of text. */
EXPORT void gcode_scan(Scan *scan) {
    const Bytes text = scan->text;
    int64_t line = scan->first_line, line_start = 0, marked_line = 0, most_decimals = 0;
    bool first = true; /* no word before in this line */
    for (int64_t i = 0; i < text.rows;) {
        const uint8_t c = AT(text, i);
        if (c == CH_NEWLINE) {
            if (i - line_start > V_LINE_LIMIT)
                put_mark(scan, F_LINE_TOO_LONG, V_LINE_LIMIT, line);
            line++;
            line_start = ++i;
            first = true;
            continue;
        }
        if (is_blank(c) || c == CH_END_OF_TAPE) {
            i++;
            continue;
        }
        Item item;
        if (is_letter(c)) {
            const int letter = c & ~CH_CASE_BIT;
            const Number behind = number(text, i + 1);
            if (behind.digits > 0 && behind.finding == F_OK && letter != CH_LETTER_N &&
                letter != CH_LETTER_O) {
                put(scan, letter, behind.value, line);
                if (letter >= CH_LETTER_X)
                    most_decimals = most(most_decimals, behind.decimals);
                i = behind.end;
                first = false;
                continue;
            }
            item = odd_word(text, i, letter, &behind, first);
        } else {
            item = other_item(text, i, first);
        }
        put_item(scan, &item, i, line, marked_line == line);
        if (item.kind == V_MARK)
            marked_line = line;
        first = first && item.kind != V_MARK && item.kind != LINE_NUMBER;
        i = item.end;
    }
    scan->most_decimals = most_decimals;
}
