/* What a dialect writes beside plain words; see gcode2krl/gcode/dialects.py. */

#include "gcode/dialect_text.h"

#include "gcode/numbers.h"
#include "gcode/scan_columns.h"
#include "gcode/siemens_values.h"

/* --- characters ----------------------------------------------------------------------------------------- */

static int64_t behind_blanks(Bytes text, int64_t i) {
    while (i < text.rows && is_blank(AT(text, i)))
        i++;
    return i;
}

static bool stands_at(Bytes text, int64_t i, uint8_t c) { return i < text.rows && AT(text, i) == c; }

static int64_t after_name(Bytes text, int64_t i) {
    while (i < text.rows && is_of_name(AT(text, i)))
        i++;
    return i;
}

/* Return the place behind the text that opens at i, the line's end where it does not close. */
static int64_t after_quotes(Bytes text, int64_t i) {
    for (i++; i < text.rows && AT(text, i) != '\n'; i++)
        if (AT(text, i) == '"')
            return i + 1;
    return i;
}

/* Return the place behind the parentheses that open at i. */
static int64_t after_arguments(Bytes text, int64_t i) {
    int64_t depth = 0;
    while (i < text.rows && AT(text, i) != '\n') {
        const uint8_t c = AT(text, i);
        i = c == '"' ? after_quotes(text, i) : i + 1;
        depth += (c == '(') - (c == ')');
        if (depth == 0)
            return i;
    }
    return i;
}

/* Tell whether DIV or MOD stands at i. */
static bool is_operator(Bytes text, int64_t i) {
    static const char *const NAME[] = {"DIV", "MOD"};
    for (size_t k = 0; k < sizeof NAME / sizeof *NAME; k++) {
        int n = 0;
        while (i + n < text.rows && NAME[k][n] != 0 && (AT(text, i + n) & ~CH_CASE_BIT) == NAME[k][n])
            n++;
        if (NAME[k][n] == 0 && !(i + n < text.rows && is_of_name(AT(text, i + n))))
            return true;
    }
    return false;
}

/* Tell whether nothing of a value follows a number that ends at i: no operator, no bracket. */
static bool ends_value(Bytes text, int64_t i) {
    i = behind_blanks(text, i);
    if (i >= text.rows)
        return true;
    const uint8_t c = AT(text, i);
    if (is_operator(text, i))
        return false;
    return c == '\n' || c == ';' || c == ')' || c == '(' || is_letter(c);
}

/* Write a refusal for a reason and leave out the rest of the line; in a program that computes it is reported when the
   line is executed. */
static int64_t refuse(Scan *scan, Evaluation *e, int64_t i, int64_t line, int reason) {
    if (e != NULL)
        wrong(e, F_DIALECT_STATEMENT, reason, 0.0, i);
    else if (scan->whole_program)
        return NEEDS_LINE;
    if (e != NULL)
        return line_end(scan->text, i);
    put_mark(scan, F_DIALECT_STATEMENT, reason, line);
    return line_end(scan->text, i);
}

/* Tell whether R or C follows a comma: the corner to the next block. */
static bool names_corner(Bytes text, int64_t i) {
    i = behind_blanks(text, i);
    const int letter = i < text.rows ? AT(text, i) & ~CH_CASE_BIT : 0;
    return letter == 'R' || letter == 'C';
}

/* Write the corner to the next block whose comma stands at i: ,R2. or ,C1. */
static int64_t comma_corner(Scan *scan, Evaluation *e, int64_t i, int64_t line) {
    const int64_t at = behind_blanks(scan->text, i + 1);
    const Number size = number(scan->text, at + 1);
    if (size.digits == 0 || size.finding != F_OK)
        return refuse(scan, e, i, line, DR_REASON_CORNER);
    if (scan->syntax & D_POINTS && lacks_point(scan->text, at))
        put(scan, D_NEXT_POINTLESS, 0.0, line);
    put(scan, (AT(scan->text, at) & ~CH_CASE_BIT) == 'R' ? D_CORNER_ROUND : D_CORNER_SIDE, size.value, line);
    return size.end;
}

/* --- lines of other kinds ------------------------------------------------------------------------------- */

/* Return the place behind :1234 or the name behind %, i where neither begins there. */
static int64_t head_line(Scan *scan, int64_t i, int64_t line) {
    const Bytes text = scan->text;
    if (AT(text, i) == '%') {
        const int64_t behind = behind_blanks(text, i + 1);
        if (behind >= text.rows || AT(text, behind) == '\n')
            return i;
        put(scan, '%', 0.0, line);
        return line_end(text, i);
    }
    int64_t end = i + 1;
    while (end < text.rows && is_digit(AT(text, end)))
        end++;
    if (end == i + 1 || (scan->syntax & D_MACROS && scan->whole_program))
        return i;
    if (scan->syntax & D_MACROS)
        put(scan, D_PROGRAM_NUMBER, 0.0, line);
    return end;
}

/* A line that begins with $ sets up, homes, jogs or asks; ? and ~ alone ask and go on. */
static int64_t dollar_line(Scan *scan, Evaluation *e, int64_t i, int64_t line, bool first) {
    const Bytes text = scan->text;
    const uint8_t c = AT(text, i);
    if (c == '?' || c == '~') {
        put(scan, D_SKIPPED, 0.0, line);
        return i + 1;
    }
    if (c != '$' || !first)
        return i;
    const int64_t end = line_end(text, i);
    for (int64_t k = i; k < end; k++)
        if (AT(text, k) == '=')
            return refuse(scan, e, i, line,
                          (AT(text, i + 1) & ~CH_CASE_BIT) == 'J' ? DR_REASON_JOG : DR_REASON_SETTING);
    put(scan, D_SKIPPED, 0.0, line);
    return end;
}

/* --- statements ----------------------------------------------------------------------------------------- */

static int32_t kind_of(const Scan *scan, int64_t i, int64_t end) {
    return statement_kind(scan->text, scan->statement_names, scan->statement_kinds, i, end);
}

enum { UNKNOWN_COUNTING = 1 }; /* a name in its place that is none of them */

static bool is_of_turn(int kind) {
    return kind == D_NEXT_SHORTEST || kind == D_NEXT_FORWARD || kind == D_NEXT_BACKWARD;
}

/* Return the mark of AC, IC, DC, ACP or ACN, which stands from i to end; 0 where no such name does. */
static int counting(Bytes text, int64_t i, int64_t end) {
    static const struct {
        const char *name;
        int mark;
    } KINDS[] = {{"AC", D_NEXT_ABSOLUTE},
                 {"IC", D_NEXT_INCREMENTAL},
                 {"DC", D_NEXT_SHORTEST},
                 {"ACP", D_NEXT_FORWARD},
                 {"ACN", D_NEXT_BACKWARD}};
    for (size_t k = 0; k < sizeof KINDS / sizeof *KINDS; k++) {
        int64_t n = 0;
        while (i + n < end && KINDS[k].name[n] != 0 && (AT(text, i + n) & ~CH_CASE_BIT) == KINDS[k].name[n])
            n++;
        if (i + n == end && KINDS[k].name[n] == 0)
            return KINDS[k].mark;
    }
    return end == i + 2 && (AT(text, i + 1) & ~CH_CASE_BIT) == 'C' ? UNKNOWN_COUNTING : 0;
}

/* Write a word whose value stands behind =, i being the place behind it; its value gets `more`. */
static int64_t assigned(Scan *scan, Evaluation *e, int letter, int64_t i, int64_t line, double more) {
    const Bytes text = scan->text;
    i = behind_blanks(text, i);
    const int64_t name_end = after_name(text, i);
    const int kind = stands_at(text, behind_blanks(text, name_end), '(') ? counting(text, i, name_end) : 0;
    const bool counted = kind > 0;
    if (counted)
        i = behind_blanks(text, name_end) + 1;
    const Number plain = number(text, behind_blanks(text, i));
    int64_t end = plain.end;
    double value = plain.value;
    const bool is_plain = plain.digits > 0 && plain.finding == F_OK && ends_value(text, end);
    if (kind == UNKNOWN_COUNTING || (is_of_turn(kind) && letter > 'C'))
        return refuse(scan, e, i, line, DR_REASON_VALUES);
    if (!is_plain) {
        if (e == NULL)
            return NEEDS_LINE;
        end = i;
        value = siemens_value(e, &end);
    }
    end = behind_blanks(text, end);
    if (counted && !stands_at(text, end, ')'))
        return refuse(scan, e, i, line, DR_REASON_VALUES);
    if (counted)
        put(scan, kind, 0.0, line);
    put(scan, letter, value + more, line);
    return end + counted;
}

/* MSG("text"); MSG() clears what is shown. */
static int64_t message(Scan *scan, int64_t i, int64_t line) {
    const Bytes text = scan->text;
    const int64_t open = behind_blanks(text, i);
    if (!stands_at(text, open, '('))
        return i;
    const int64_t quote = behind_blanks(text, open + 1), end = after_arguments(text, open);
    if (stands_at(text, quote, '"'))
        put_message(scan, i - 3, after_quotes(text, quote) - 1, line); /* MSG("text */
    return end;
}

/* Leave out what belongs to a statement that says nothing: its arguments or its value. */
static int64_t after_harmless(Bytes text, int64_t i) {
    const int64_t behind = behind_blanks(text, i);
    if (stands_at(text, behind, '[')) {
        while (i < text.rows && AT(text, i) != '\n' && AT(text, i) != ']')
            i++;
        return after_harmless(text, i + stands_at(text, i, ']'));
    }
    if (stands_at(text, behind, '('))
        return after_arguments(text, behind);
    if (!stands_at(text, behind, '='))
        return i;
    const int64_t value = behind_blanks(text, behind + 1);
    const Number number_behind = number(text, value);
    return number_behind.digits > 0 ? number_behind.end : after_name(text, value);
}

/* Tell whether nothing or (1) stands behind TRAORI, at i. */
static bool is_first_one(Bytes text, int64_t i) {
    i = behind_blanks(text, i);
    if (!stands_at(text, i, '('))
        return true;
    const int64_t first = behind_blanks(text, i + 1);
    return stands_at(text, first, ')') ||
           (stands_at(text, first, '1') && stands_at(text, behind_blanks(text, first + 1), ')'));
}

/* Tell whether the axes in the parentheses at i are X, Y and Z, some of them or none. */
static bool are_linear(Bytes text, int64_t i) {
    i = behind_blanks(text, i);
    for (const int64_t end = after_arguments(text, i); i < end; i++)
        if (is_of_name(AT(text, i)) && (AT(text, i) & ~CH_CASE_BIT) < 'X')
            return false;
    return true;
}

static bool ends_argument(Bytes text, int64_t i) {
    i = behind_blanks(text, i);
    return stands_at(text, i, ',') || stands_at(text, i, ')');
}

/* Write a cycle and its arguments, whose parentheses open behind i. */
static int64_t cycle_call(Scan *scan, Evaluation *e, int64_t i, int64_t number_of_cycle, int64_t line) {
    const Bytes text = scan->text;
    int64_t at = behind_blanks(text, i);
    if (!stands_at(text, at, '('))
        return refuse(scan, e, i, line, DR_REASON_HEIGHTS);
    const int64_t end = after_arguments(text, at);
    if (end == at || AT(text, end - 1) != ')')
        return refuse(scan, e, i, line, DR_REASON_VALUES);
    put(scan, D_CYCLE, (double)number_of_cycle, line);
    for (at = behind_blanks(text, at + 1); at < end; at = behind_blanks(text, at + 1)) {
        double value = NAN;
        const int64_t behind_text = stands_at(text, at, '"') ? after_quotes(text, at) : at;
        const bool names_nothing = behind_text == at + 2 || number_of_cycle == V_CYCLE_SWIVEL;
        if (behind_text > at && names_nothing && ends_argument(text, behind_text))
            at = behind_blanks(text, behind_text);
        if (AT(text, at) != ',' && AT(text, at) != ')') {
            const Number plain = number(text, at);
            const bool is_plain = plain.digits > 0 && plain.finding == F_OK && ends_argument(text, plain.end);
            if (!is_plain && e == NULL)
                return NEEDS_LINE;
            int64_t behind = is_plain ? plain.end : at;
            value = is_plain ? plain.value : siemens_value(e, &behind);
            if (!ends_argument(text, behind))
                return refuse(scan, e, i, line, DR_REASON_VALUES);
            at = behind_blanks(text, behind);
        }
        put(scan, D_ARGUMENT, value, line);
    }
    return end;
}

/* Write what the statement makes whose name stands from i to end. */
static int64_t statement(Scan *scan, Evaluation *e, int64_t i, int64_t end, int64_t line) {
    const Bytes text = scan->text;
    int32_t kind = stands_at(text, end, '[') ? kind_of(scan, i, end + 1) : -1; /* an array's name has its [ */
    if (kind < 0)
        kind = kind_of(scan, i, end);
    const int64_t behind = behind_blanks(text, end);
    const bool is_assigned = stands_at(text, behind, '=');
    switch (kind < 0 ? -1 : kind % D_KIND_STEP) {
    case D_HARMLESS: put(scan, D_SKIPPED, 0.0, line); return after_harmless(text, end);
    case D_WHOLE_LINE: put(scan, D_SKIPPED, 0.0, line); return line_end(text, i);
    case D_RADIUS:
        if (is_assigned)
            return assigned(scan, e, 'R', behind + 1, line, 0.0);
        break;
    case D_TURNS: /* full circles beside the arc itself, which P counts too */
        if (is_assigned)
            return assigned(scan, e, 'P', behind + 1, line, 1.0);
        break;
    case D_JUMP: return e == NULL ? NEEDS_LINE : refuse(scan, e, i, line, DR_REASON_FLOW);
    case D_DEFINE: return e == NULL ? NEEDS_LINE : define_variables(e, end);
    case D_ARRAY: return e == NULL ? NEEDS_LINE : assign_variable(e, i);
    case D_VARIABLE:
        if (is_assigned)
            return e == NULL ? NEEDS_LINE : assign_variable(e, i);
        break;
    case D_MESSAGE:
        if (e != NULL)
            return refuse(scan, e, i, line, DR_REASON_MESSAGE);
        return message(scan, end, line);
    case D_CODE: put(scan, 'G', kind / D_KIND_STEP, line); return end;
    case D_ENDS: put(scan, 'M', V_M17, line); return end;
    case D_TIP:
        put(scan, kind / D_KIND_STEP == 0 ? D_TIP_OFF : is_first_one(text, end) ? D_TIP_ON : D_OTHER_TIP, 0.0, line);
        return after_harmless(text, end);
    case D_FEED_AXES:
        if (!are_linear(text, end))
            return refuse(scan, e, i, line, DR_REASON_FEED_AXES);
        put(scan, D_SKIPPED, 0.0, line);
        return after_harmless(text, end);
    case D_SHIFT:
        put(scan, kind / D_KIND_STEP == 0 ? D_SHIFT_SET : D_SHIFT_ADD, 0.0, line);
        return end;
    case D_APPROACH: put(scan, kind / D_KIND_STEP == 0 ? D_APPROACH_CONTOUR : D_APPROACH_NORMAL, 0.0, line); return end;
    case D_NAMED_ARC: put(scan, kind / D_KIND_STEP == 0 ? D_ARC_VIA : D_ARC_TANGENT, 0.0, line); return end;
    case D_TURN: {
        static const int MARK[] = {D_TURN_SET, D_TURN_ADD, D_MIRROR_SET, D_MIRROR_ADD};
        put(scan, MARK[kind / D_KIND_STEP], 0.0, line);
        return end;
    }
    case D_MARKED:
        if (is_assigned)
            return assigned(scan, e, D_CORNER_ROUND + kind / D_KIND_STEP, behind + 1, line, 0.0);
        break;
    case D_CYCLE_CALL: return cycle_call(scan, e, end, kind / D_KIND_STEP, line);
    case D_MODAL_CALL: put(scan, D_MODAL, 0.0, line); return end;
    case D_REFUSED: return refuse(scan, e, i, line, kind / D_KIND_STEP);
    }
    if (stands_at(text, behind, ':')) {
        put(scan, D_LABEL, 0.0, line);
        return behind + 1;
    }
    return e == NULL && kind < 0 ? NEEDS_LINE : refuse(scan, e, i, line, DR_REASON_FLOW); /* a subprogram's name? */
}

/* Write the tool whose name opens at i, T="MILL10". */
static int64_t named_tool(Scan *scan, Evaluation *e, int64_t i, int64_t line) {
    const int64_t end = after_quotes(scan->text, i);
    const int32_t kind = kind_of(scan, i, end);
    if (kind < 0)
        return refuse(scan, e, i, line, DR_REASON_TOOL_NAME);
    put(scan, 'T', kind / D_KIND_STEP, line);
    return end;
}

/* X=5, S1=8000, M1=3: a word with its value behind =; i where none stands there. */
static int64_t word_with_equals(Scan *scan, Evaluation *e, int64_t i, int64_t line) {
    const Bytes text = scan->text;
    int64_t behind = i + 1;
    while (behind < text.rows && is_digit(AT(text, behind)))
        behind++;
    const int64_t equals = behind_blanks(text, behind);
    const int letter = AT(text, i) & ~CH_CASE_BIT;
    if (letter == 'R' && behind == i + 1 && stands_at(text, behind, '['))
        return e == NULL ? NEEDS_LINE : assign_variable(e, i);
    if (!stands_at(text, equals, '='))
        return i;
    const bool numbered = behind > i + 1;
    const bool first_one = behind == i + 2 && AT(text, i + 1) == '1';
    if (letter == 'T' && !numbered && stands_at(text, behind_blanks(text, equals + 1), '"'))
        return named_tool(scan, e, behind_blanks(text, equals + 1), line);
    if (letter == 'T' && numbered)
        return refuse(scan, e, i, line, DR_REASON_VALUES);
    if (numbered && letter <= 'C') {
        if (behind != i + 2 || AT(text, i + 1) != '3')
            return refuse(scan, e, i, line, DR_REASON_VECTORS);
        put(scan, D_NEXT_VECTOR, 0.0, line);
        return assigned(scan, e, letter, equals + 1, line, 0.0);
    }
    if (first_one && letter >= 'I' && letter <= 'K') {
        put(scan, D_NEXT_VIA, 0.0, line);
        return assigned(scan, e, letter, equals + 1, line, 0.0);
    }
    if (letter == 'R' && numbered)
        return e == NULL ? NEEDS_LINE : assign_variable(e, i);
    if (letter == 'R' || letter == 'N' || letter == 'O' ||
        (numbered && !(first_one && (letter == 'S' || letter == 'M'))))
        return refuse(scan, e, i, line, DR_REASON_VALUES);
    return assigned(scan, e, letter, equals + 1, line, 0.0);
}

/* Return the place behind a statement or a word with =, i where the letter at i begins a plain word. */
static int64_t statement_item(Scan *scan, Evaluation *e, int64_t i, int64_t line) {
    const int64_t end = after_name(scan->text, i);
    if ((AT(scan->text, i) & ~CH_CASE_BIT) == 'L' && end > i + 1 && is_digit(AT(scan->text, i + 1))) /* a subprogram */
        return e == NULL ? NEEDS_LINE : refuse(scan, e, i, line, DR_REASON_FLOW);
    if (AT(scan->text, i) == '_')
        return statement(scan, e, i, end, line);
    if (end > i + 1 && (is_letter(AT(scan->text, i + 1)) || AT(scan->text, i + 1) == '_'))
        return statement(scan, e, i, end, line);
    return word_with_equals(scan, e, i, line);
}

/* --- numbers without a point ---------------------------------------------------------------------------- */

/* Tell whether a letter's numbers are lengths, angles or feeds, which Fanuc reads by their point. */
static bool has_point_rule(int letter) {
    return letter >= 'X' || (letter >= 'I' && letter <= 'K') || letter == 'F' ||
           letter == 'R' || letter == 'R' - 1 || letter <= 'C' || letter == 'E' ||
           (letter > 'T' && letter < 'X');
}

/* Tell whether the number of the word at i goes by its point, and, other than 0, has none. */
bool lacks_point(Bytes text, int64_t i) {
    if (!has_point_rule(AT(text, i) & ~CH_CASE_BIT))
        return false;
    bool zero = true;
    for (i++; i < text.rows && (is_digit(AT(text, i)) || is_sign(AT(text, i)) || is_space(AT(text, i))); i++)
        zero = zero && !(is_digit(AT(text, i)) && AT(text, i) != '0');
    return !zero && !stands_at(text, i, '.');
}

/* Return the place behind the digit of /2, whose / stands before i. */
int64_t after_skip_level(Bytes text, int64_t i) { return i < text.rows && is_digit(AT(text, i)) ? i + 1 : i; }

/* --- all ------------------------------------------------------------------------------------------------ */

/* Write what a dialect has at i beside plain words; return the place behind, i where a plain word stands there, and
   NEEDS_LINE where the line has to be read when it is executed: then with an evaluation, else without. */
int64_t dialect_item(Scan *scan, Evaluation *e, int64_t i, int64_t line, bool first) {
    const Bytes text = scan->text;
    const uint8_t c = AT(text, i);
    const int64_t syntax = scan->syntax;
    if (is_letter(c) || (c == '_' && syntax & D_STATEMENTS)) {
        if (syntax & D_POINTS && lacks_point(text, i))
            put(scan, D_NEXT_POINTLESS, 0.0, line);
        return syntax & D_STATEMENTS ? statement_item(scan, e, i, line) : i;
    }
    if (syntax & D_MACROS && c == ';' && !first && is_word_behind(text, i + 1))
        return refuse(scan, e, i, line, DR_REASON_SEMICOLON);
    if (syntax & D_MACROS && c == ',' && names_corner(text, i + 1))
        return comma_corner(scan, e, i, line);
    if (syntax & D_STATEMENTS && c == '(') /* behind no name: a comment elsewhere, an alarm on this control */
        return refuse(scan, e, i, line, DR_REASON_PARENTHESES);
    if (syntax & D_SKIP_LEVEL && c == '/' && first && i + 1 < text.rows && is_digit(AT(text, i + 1))) {
        put(scan, '/', 0.0, line);
        return i + 2;
    }
    if (syntax & D_HEAD_LINES && first && (c == '%' || c == ':'))
        return head_line(scan, i, line);
    return syntax & D_DOLLAR_LINES ? dollar_line(scan, e, i, line, first) : i;
}
