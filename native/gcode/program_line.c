/* A line with an expression, read when it is executed: its words and assignments, with their values. */

#include "gcode/program_line.h"

#include "gcode/dialect_text.h"
#include "gcode/expressions.h"
#include "gcode/reporting.h"
#include "gcode/words.h"

/* Begin to work out what stands in the line from `start` on; nothing is assigned yet. */
Evaluation evaluation_of(Machine *machine, Program *program, int64_t start, int32_t line, bool dry) {
    Course *at = program->course.at;
    at->assignments = at->words = at->marks = 0;
    return (Evaluation){.machine = machine,
                        .program = program,
                        .end = line_end(program->text, start),
                        .line = line,
                        .dry = dry};
}

static void put(const Evaluation *e, int letter, double value) {
    Program *p = e->program;
    const int64_t k = p->course.at->words++;
    AT(p->letter, k) = (uint8_t)letter;
    AT(p->value, k) = value;
    AT(p->line, k) = e->line;
}

static void put_item(const Evaluation *e, const Item *item, int64_t *message) {
    Course *at = e->program->course.at;
    if (item->kind == V_MARK) {
        AT(e->program->extra, at->marks++) = item->found;
        put(e, V_MARK, item->finding);
        if (item->lost > 0)
            put(e, item->lost + V_UNREAD_NUMBER, 0.0);
    } else if (item->kind == '(') {
        put(e, '(', (double)(*message)++);
    } else if (item->kind > LINE_NUMBER) {
        put(e, item->kind, 0.0);
    }
}

/* Read the letter at i and its value; return what it is, where it is no word. */
static Item letter_at(Evaluation *e, int64_t *i, bool first) {
    static const Item DONE = {.kind = NOTHING};
    const Bytes text = e->program->text;
    const int letter = AT(text, *i) & ~CH_CASE_BIT;
    const Number behind = number(text, *i + 1);
    if (letter != 'N' && letter != 'O') {
        if (behind.digits > 0 && behind.finding == F_OK) {
            if (is_macro(e) && lacks_point(text, *i))
                put(e, D_NEXT_POINTLESS, 0.0);
            put(e, letter, behind.value);
            *i = behind.end;
            return DONE;
        }
        if (behind.digits == 0 && begins_value(text, *i + 1, e->end)) {
            ++*i;
            e->in_word = true;
            const double value = value_at(e, i);
            e->in_word = false;
            if (!e->is_null) /* else the word is left out */
                put(e, letter, value);
            return DONE;
        }
    }
    const Item item = odd_word(text, *i, letter, &behind, first);
    *i = item.end;
    return item;
}

/* Read a Fanuc's calculation at i, which stands alone; return the place behind. */
static int64_t calculation_at(Evaluation *e, int64_t i) {
    const Course *at = e->program->course.at;
    const int64_t place = i;
    const bool is_alone = at->words == 0 || (at->words == 1 && AT(e->program->letter, 0) == '/');
    if (is_alone)
        assignment_at(e, &i);
    if (!is_alone || (e->finding == F_OK && !is_rest_comment(e->program->text, i, e->end)))
        wrong(e, F_EXPRESSION, PF_MACRO_ALONE, 0.0, place);
    return i;
}

/* Read the words of a Sinumerik's line from `start` on, with their values, and its assignments to R parameters. */
static void read_siemens_line(Evaluation *e, int64_t start) {
    Program *p = e->program;
    Course *at = p->course.at;
    Scan scan = {.text = p->text,
                 .statement_names = p->statement_names,
                 .statement_kinds = p->statement_kinds,
                 .syntax = p->syntax,
                 .letter = p->letter,
                 .value = p->value,
                 .line = p->line,
                 .extra = p->extra,
                 .whole_program = 1};
    bool first = true;
    for (int64_t i = start; i < e->end && e->finding == F_OK;) {
        const uint8_t c = AT(p->text, i);
        if (is_blank(c) || c == CH_END_OF_TAPE) {
            i++;
            continue;
        }
        const int64_t words = scan.words = at->words, behind = dialect_item(&scan, e, i, e->line, first);
        at->words = scan.words;
        if (behind > i) {
            first = first && (at->words == words || AT(p->letter, words) == '/');
            i = behind;
            continue;
        }
        const bool is_word = begins_word(c);
        if (c == '#' || (is_word && number(p->text, i + 1).digits == 0 && begins_value(p->text, i + 1, e->end))) {
            wrong(e, F_DIALECT_STATEMENT, DR_REASON_VALUES, 0.0, i);
            return;
        }
        Item item = is_word ? letter_at(e, &i, first) : other_item(p->text, i, first);
        if (!is_word)
            i = item.end;
        int64_t no_message = 0;
        if (item.kind == V_PROGRAM_LINE)
            wrong(e, F_DIALECT_STATEMENT, DR_REASON_PROGRAM, 0.0, i);
        else if (item.kind != '(')
            put_item(e, &item, &no_message);
        first = first && item.kind != V_MARK && item.kind != LINE_NUMBER && !is_word;
    }
}

/* Read the words and assignments of the line from `start` on, with their values; its message comments are
   numbered from `first_message` on. */
void read_line(Evaluation *e, int64_t start, int64_t first_message) {
    const Bytes text = e->program->text;
    bool first = true;
    int64_t i = start;
    if (e->end - start > V_LINE_LIMIT) {
        wrong(e, F_LINE_TOO_LONG, V_LINE_LIMIT, 0.0, start);
        return;
    }
    if (e->program->language == D_PROGRAMS_SINUMERIK) {
        read_siemens_line(e, start);
        return;
    }
    while (i < e->end && e->finding == F_OK) {
        const uint8_t c = AT(text, i);
        if (is_blank(c) || c == CH_END_OF_TAPE) {
            i++;
            continue;
        }
        Item item = {.kind = NOTHING};
        if (c == ',' && is_macro(e)) {
            wrong(e, F_DIALECT_STATEMENT, DR_REASON_CORNER, 0.0, i);
        } else if (c == '#' && is_macro(e)) {
            i = calculation_at(e, i);
        } else if (c == '#') {
            assignment_at(e, &i);
        } else if (begins_word(c)) {
            item = letter_at(e, &i, first);
        } else {
            item = other_item(text, i, first);
            i = item.kind == '/' && is_macro(e) ? after_skip_level(text, item.end) : item.end;
        }
        if (item.kind == V_PROGRAM_LINE)
            wrong(e, F_O_WORD, PF_FAULT_NOT_FIRST, 0.0, i);
        put_item(e, &item, &first_message);
        first = first && c != '#' && c != '(' && item.kind != V_MARK && item.kind != LINE_NUMBER &&
                !begins_word(c);
    }
}

/* Tell whether a line begins with / and such lines are left out. */
bool is_deleted(const Machine *machine, Bytes text, int64_t start) {
    const int64_t i = after_blanks(text, start, text.rows);
    return machine->block_delete && i < text.rows && AT(text, i) == '/';
}

/* Report what is wrong with the line from `start` on. */
void report_wrong(Machine *machine, const Evaluation *e, int64_t start) {
    Block block = {.machine = machine, .counts = machine->counts.at, .line = e->line};
    report(&block, e->finding, (Says){e->a, e->b, (double)(e->place - start)});
}
