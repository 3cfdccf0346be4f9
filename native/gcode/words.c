/* Bytes to words: the scanner of G-code text. What goes where in its columns says gcode2krl/gcode/words.py. */

#include "gcode/words.h"

#include "gcode/dialect_text.h"
#include "gcode/scan_columns.h"

/* Instead of a lost letter: the one of the word before in the line has lost its value. */
enum { LETTER_BEFORE = -1 };

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

/* --- comments ------------------------------------------------------------------------------------------- */

/* Tell whether a comment's content begins with MSG, as (MSG, …) does. */
static bool is_message(Bytes text, int64_t i, int64_t end) {
    while (i < end && is_space(AT(text, i)))
        i++;
    return i + 3 <= end && (AT(text, i) | CH_CASE_BIT) == 'm' &&
           (AT(text, i + 1) | CH_CASE_BIT) == 's' && (AT(text, i + 2) | CH_CASE_BIT) == 'g';
}

/* Return the item of the comment that opens at i. */
static Item comment(Bytes text, int64_t i) {
    int64_t end = i + 1;
    int depth = 1;
    bool nested = false;
    for (; end < text.rows && AT(text, end) != '\n' && depth > 0; end++) {
        nested |= AT(text, end) == '(';
        depth += (AT(text, end) == '(') - (AT(text, end) == ')');
    }
    if (nested || depth > 0)
        return (Item){V_MARK, nested ? F_COMMENT_NESTED : F_COMMENT_OPEN, '(', 0, end};
    return (Item){is_message(text, i + 1, end - 1) ? '(' : NOTHING, F_OK, 0.0, 0, end};
}

/* --- items ---------------------------------------------------------------------------------------------- */

/* Return the item of a line that has to be read when it is executed: with an expression or an O-word. */
static Item whole_line(Bytes text, int64_t i) {
    return (Item){V_PROGRAM_LINE, F_OK, 0.0, 0, line_end(text, i)};
}

/* Return the item of a letter at `start` with no number behind it; it ends at i. */
static Item without_number(Bytes text, int64_t i, int64_t start, int letter) {
    if (letter == 'O')
        return whole_line(text, i);
    if (letter == 'N')
        return (Item){V_MARK, F_BAD_LINE_NUMBER, letter, 0, i};
    if (begins_value(text, start + 1, line_end(text, start)))
        return whole_line(text, i);
    if (i < text.rows && AT(text, i) >= CH_FIRST_FOREIGN)
        return (Item){V_MARK, F_BAD_CHARACTER, character(text, i), letter, i};
    return (Item){V_MARK, F_NO_NUMBER, letter, letter, i};
}

/* Return the item of O and its number, which ends at i: alone in its line it says nothing. */
static Item program_number(Bytes text, int64_t i, bool may_be_one) {
    if (may_be_one && is_rest_comment(text, i, line_end(text, i)))
        return (Item){LINE_NUMBER, F_OK, 0.0, 0, i};
    return whole_line(text, i);
}

/* Return the item of the letter at i that makes no plain word with the number behind it. */
Item odd_word(Bytes text, int64_t i, int letter, const Number *behind, bool first) {
    if (behind->digits == 0)
        return without_number(text, behind->end, i, letter);
    if (behind->finding != F_OK)
        return (Item){V_MARK, behind->finding, letter, letter, behind->end};
    if (letter == 'O')
        return program_number(text, behind->end, first && behind->plain);
    if (!first)
        return (Item){V_MARK, F_N_NOT_FIRST, letter, 0, behind->end};
    if (!is_line_number(text, i + 1, behind->end))
        return (Item){V_MARK, F_BAD_LINE_NUMBER, letter, 0, behind->end};
    return (Item){LINE_NUMBER, F_OK, 0.0, 0, behind->end};
}

/* Return the item that stands at i and is no letter; `first` where the line has no word before. */
Item other_item(Bytes text, int64_t i, bool first) {
    const uint8_t c = AT(text, i);
    if (c == ';')
        return (Item){NOTHING, F_OK, 0.0, 0, line_end(text, i)};
    if (c == '(')
        return comment(text, i);
    if (c == '%' || (c == '/' && first))
        return (Item){c, F_OK, 0.0, 0, i + 1};
    if (c == '#') /* #1 = value */
        return whole_line(text, i);
    return (Item){V_MARK, F_BAD_CHARACTER, character(text, i), LETTER_BEFORE, i + 1};
}

/* --- the columns ---------------------------------------------------------------------------------------- */

/* Return the letter whose value is lost, that of the word before for LETTER_BEFORE; 0 = none. */
static int lost_letter(const Scan *scan, int lost, int64_t line) {
    if (lost != LETTER_BEFORE)
        return lost;
    if (scan->words == 0 || AT(scan->line, scan->words - 1) != line)
        return 0;
    const int letter = AT(scan->letter, scan->words - 1);
    return (letter >= 'A' && letter <= 'Z') || is_polar_sign((uint8_t)letter) ? letter : 0;
}

/* Tell whether a statement of a macro begins at i, such as IF or GOTO: two letters where a word has one. */
static bool begins_statement(Bytes text, int64_t i, int64_t end) {
    if (i >= end || !is_letter(AT(text, i)))
        return false;
    const int64_t behind = after_blanks(text, i + 1, end);
    return behind < end && is_letter(AT(text, behind));
}

/* Return what a line is that begins at i: one with an O-word or a statement, or a block. */
static int32_t kind_of_line(const Scan *scan, int64_t i) {
    const Bytes text = scan->text;
    const int64_t end = line_end(text, i);
    i = after_blanks(text, i, end);
    if (i < end && AT(text, i) == '/')
        i = after_blanks(text, scan->syntax & D_MACROS ? after_skip_level(text, i + 1) : i + 1, end);
    if (i < end && (AT(text, i) & ~CH_CASE_BIT) == 'N')
        i = after_blanks(text, number(text, i + 1).end, end);
    if (scan->syntax == 0) /* an O-word behind a comment is refused, but it is none of those that may be passed over */
        i = after_comments(text, i, end);
    if (scan->syntax & D_MACROS && (begins_statement(text, i, end) || (i < end && AT(text, i) == ':')))
        return P_KIND_O_WORD;
    return i < end && (AT(text, i) & ~CH_CASE_BIT) == 'O' ? P_KIND_O_WORD : P_KIND_BLOCK;
}

/* Write the line that begins at `start` as one word; what has been read of it is dropped, but for messages. */
static void put_line(Scan *scan, int64_t start, int64_t line) {
    int64_t first_message = scan->messages;
    for (; scan->words > 0 && AT(scan->line, scan->words - 1) == line; scan->words--) {
        const uint8_t c = AT(scan->letter, scan->words - 1);
        scan->marks -= c == V_MARK;
        first_message -= c == '(';
    }
    if (scan->program_lines < scan->lines.rows)
        AT(scan->lines, scan->program_lines) =
            (MarkedLine){.start = start,
                         .target = -1,
                         .kind = kind_of_line(scan, start),
                         .first_message = (int32_t)first_message};
    put(scan, V_PROGRAM_LINE, (double)scan->program_lines++, line);
}

/* Keep the spans of the message comments from i to the end of the line; return what is wrong with a comment. */
static int put_messages(Scan *scan, int64_t i, int64_t end) {
    for (; i < end; i++) {
        if (AT(scan->text, i) == ';')
            return scan->syntax & D_MACROS && is_word_behind(scan->text, i + 1) ? F_DIALECT_STATEMENT : F_OK;
        if (AT(scan->text, i) != '(')
            continue;
        const Item item = comment(scan->text, i);
        if (item.kind == V_MARK)
            return item.finding;
        if (item.kind == '(') {
            CELL(scan->message_span, scan->messages, 0) = i + 1;
            CELL(scan->message_span, scan->messages, 1) = item.end - 1;
            scan->messages++;
        }
        i = item.end - 1;
    }
    return F_OK;
}

/* Keep the messages of the line that was put last, from i to its end. Where a comment does not end in it, nothing else
   of the line is read: each reader of it may take comments as closed. */
static void put_comments(Scan *scan, int64_t i, int64_t end) {
    const int finding = put_messages(scan, i, end);
    const int64_t row = scan->program_lines - 1;
    if (finding == F_OK || scan->syntax & D_STATEMENTS || row >= scan->lines.rows) /* a Sinumerik calculates in ( ) */
        return;
    AT(scan->lines, row).kind = P_KIND_BLOCK;
    AT(scan->lines, row).fault = finding;
}

/* Write what an item from `start` on makes; a line has one mark of its characters at most. */
static void put_item(Scan *scan, const Item *item, int64_t start, int64_t line, bool marked) {
    if (item->kind == V_MARK) {
        const int lost = lost_letter(scan, item->lost, line);
        if (!marked)
            put_mark(scan, item->finding, item->found, line);
        if (lost > 0)
            put(scan, lost + V_UNREAD_NUMBER, 0.0, line);
    } else if (item->kind == '(') {
        put_message(scan, start + 1, item->end - 1, line);
    } else if (item->kind > LINE_NUMBER) {
        put(scan, item->kind, 0.0, line);
    }
}

/* Tell whether a line is to be read when it is executed; in a whole program every odd one, and O1000 alone. */
static bool belongs_to_program(const Scan *scan, const Item *item, uint8_t c) {
    if (item->kind == V_PROGRAM_LINE)
        return true;
    const bool program_number = item->kind == LINE_NUMBER && (c & ~CH_CASE_BIT) == 'O';
    return scan->whole_program && (item->kind == V_MARK || program_number);
}

/* Fill the columns from whole lines of text. */
EXPORT void gcode_scan(Scan *scan) {
    const Bytes text = scan->text;
    int64_t line = scan->first_line, line_start = 0, marked_line = 0, most_decimals = 0;
    bool first = true; /* no word before in this line */
    /* For LinuxCNC, N and / stand behind a comment no more; in a program that jumps, no control's line is found so. */
    const bool comments_count = scan->syntax == 0 || scan->whole_program;
    for (int64_t i = 0; i < text.rows;) {
        const uint8_t c = AT(text, i);
        if (c == '\n') {
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
        bool needs_line = false;
        if (scan->syntax != 0) {
            const int64_t words = scan->words, behind = dialect_item(scan, NULL, i, line, first);
            needs_line = behind == NEEDS_LINE;
            if (behind > i) {
                first = first && (scan->words == words || AT(scan->letter, words) == '/');
                i = behind;
                continue;
            }
        }
        Item item;
        if (needs_line || (scan->syntax & D_MACROS && begins_statement(text, i, text.rows))) {
            item = whole_line(text, i);
        } else if (begins_word(c)) {
            const int letter = c & ~CH_CASE_BIT;
            const Number behind = number(text, i + 1);
            if (behind.digits > 0 && behind.finding == F_OK && letter != 'N' &&
                letter != 'O') {
                put(scan, letter, behind.value, line);
                if (letter >= 'X' && letter <= 'Z')
                    most_decimals = most(most_decimals, behind.decimals);
                i = behind.end;
                first = false;
                continue;
            }
            item = odd_word(text, i, letter, &behind, first);
        } else {
            item = other_item(text, i, first);
        }
        if (belongs_to_program(scan, &item, c)) {
            put_line(scan, line_start, line);
            item.end = line_end(text, i);
            put_comments(scan, i, item.end);
        } else {
            put_item(scan, &item, i, line, marked_line == line);
            if (scan->syntax & D_MACROS && item.kind == LINE_NUMBER && (c & ~CH_CASE_BIT) == 'O')
                put(scan, D_PROGRAM_NUMBER, 0.0, line);
        }
        if (item.kind == V_MARK)
            marked_line = line;
        first = first && item.kind != V_MARK && item.kind != LINE_NUMBER && !(c == '(' && comments_count);
        i = item.end;
    }
    scan->most_decimals = most_decimals;
}
