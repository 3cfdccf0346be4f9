/* Jumps, loops that count, repeated sections and subprograms of a Sinumerik.

   IF with a block, WHILE, LOOP and REPEAT with UNTIL are the O-words of native/gcode/flow.c; where each leads has been
   found by gcode2krl/gcode/siemens_words.py. */

#include "gcode/siemens_flow.h"

#include "gcode/expressions.h"
#include "gcode/program_line.h"
#include "gcode/siemens_values.h"

/* IF condition GOTOF label. */
static int64_t siemens_if(Run *run, const MarkedLine *marked, int64_t next) {
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    int64_t i = marked->expression;
    const double test = siemens_value(&e, &i);
    i = after_blanks(run->program->text, i, e.end);
    if (e.finding == F_OK && after_word(run->program->text, i, e.end, "goto") == i)
        wrong(&e, F_EXPRESSION, PF_SIEMENS_GOTO, 0.0, least(i, e.end - 1));
    if (e.finding != F_OK)
        return stop_wrong(run, &e, marked->start, next);
    return test != 0.0 ? jump(run, marked->target) : next;
}

/* Let the variable of the loop whose head is at hand have a value; go on in the loop, or behind it. */
static int64_t pass(Run *run, const MarkedLine *marked, bool first, int64_t inside, int64_t behind) {
    Evaluation e = evaluation_of(run->machine, run->program, marked->expression, run->line, false);
    double from = 0.0, to = 0.0;
    const int64_t number = loop_head(&e, marked->expression, &from, &to);
    if (e.finding != F_OK)
        return stop_wrong(run, &e, marked->expression, behind);
    const double value = set_variable(&e, number, first ? from : AT(run->program->parameters, number) + 1.0);
    assign(run->program);
    return value <= to ? jump(run, inside) : jump(run, behind);
}

/* FOR R1=1 TO 5. */
static int64_t begin_counting(Run *run, const MarkedLine *marked, int64_t next) {
    return pass(run, marked, true, next, marked->target);
}

/* ENDFOR: its expression is that of its FOR. */
static int64_t count_on(Run *run, const MarkedLine *marked, int64_t next) {
    return pass(run, marked, false, marked->target, next);
}

/* --- subprograms ---------------------------------------------------------------------------------------- */

static int64_t level_of_calls(const Run *run) {
    int64_t level = run->course->frame;
    while (level > 0 && AT(run->program->frames, level).until > 0) /* of a section that is repeated */
        level--;
    return level;
}

/* Read the arguments in the parentheses at i into the variables of a subprogram, 0 where one is left out; go behind. */
static void pass_arguments(Evaluation *e, const Subprogram *called, int64_t *i) {
    const Bytes text = e->program->text;
    double values[P_MOST_FORMALS] = {0};
    int64_t count = 0, at = *i;
    for (bool more = at < e->end && AT(text, at) == '('; more && e->finding == F_OK; count++) {
        at = after_blanks(text, at + 1, e->end);
        const uint8_t c = at < e->end ? AT(text, at) : '\n';
        if (c != ',' && c != ')') {
            const double value = siemens_value(e, &at);
            if (count < called->formals)
                values[count] = value;
            at = after_blanks(text, at, e->end);
        } else if (c == ')' && count == 0) {
            count--; /* NAME() */
        }
        more = at < e->end && AT(text, at) == ',';
        if (!more && (at >= e->end || AT(text, at) != ')'))
            wrong(e, F_EXPRESSION, PF_SIEMENS_BRACKET, 0.0, least(at, e->end - 1));
        at += !more;
    }
    if (count > called->formals)
        wrong(e, F_O_WORD, PF_FAULT_SIEMENS_CALL, 0.0, *i);
    for (int k = 0; k < called->formals && e->finding == F_OK; k++)
        set_variable(e, called->formal[k], values[k]);
    *i = after_blanks(text, at, e->end);
}

/* NAME(10,R1), NAME P3, L6. */
static int64_t call_by_name(Run *run, const MarkedLine *marked, int64_t next) {
    if (!is_ready(run, marked->subprogram))
        return WAIT;
    const Subprogram *called = &AT(run->program->subprograms, marked->subprogram);
    if (called->fault != 0)
        return stop_at_fault(run, called->fault, next);
    for (int64_t level = 1; level <= run->course->frame; level++)
        if (AT(run->program->frames, level).until == 0 && AT(run->program->frames, level).subprogram == marked->subprogram)
            return stop_at_fault(run, PF_FAULT_RECURSION, next);
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    const Bytes text = run->program->text;
    int64_t i = after_blanks(text, marked->expression, e.end), times = 1;
    const int64_t arguments = i;
    pass_arguments(&e, called, &i);
    const int64_t behind_p = after_word(text, i, e.end, "p");
    if (e.finding == F_OK && behind_p > i) {
        i = after_blanks(text, behind_p, e.end);
        i += i < e.end && AT(text, i) == '=';
        const bool has_arguments = arguments < e.end && AT(text, arguments) == '(';
        if (!whole_number(siemens_value(&e, &i), &times) || times < 1 || has_arguments)
            wrong(&e, F_O_WORD, PF_FAULT_SIEMENS_CALL, 0.0, arguments);
    }
    if (!siemens_line_ends(&e, i))
        return stop_wrong(run, &e, marked->start, next);
    return call(run, marked->subprogram, NULL, 0, times, next);
}

/* Execute a block of known words, which may end a subprogram. */
int64_t siemens_block(Run *run, const Words *words, int64_t from, int64_t to, int64_t next) {
    int64_t end = to;
    const int64_t level = level_of_calls(run);
    for (int64_t k = from; level > 0 && k < to; k++) {
        const double m = AT(words->letter, k) == 'M' ? AT(words->value, k) : 0.0;
        const bool is_last = k + 1 == to;
        if (m == V_M2 || m == V_M30 || (m == V_M17 && !is_last))
            return stop_at_fault(run, PF_FAULT_SUB_END, next);
        end = m == V_M17 ? k : end;
    }
    if (end == to)
        return block_of_words(run, words, from, to, next);
    if (level < run->course->frame)
        return stop_at_fault(run, PF_FAULT_SECTION, next);
    const int64_t errors = run->machine->counts.at->errors;
    if (end > from && block_of_words(run, words, from, end, next) == WAIT)
        return WAIT;
    if (run->machine->counts.at->errors > errors || run->course->is_stopped)
        return next;
    return end_program(run, true, next);
}

/* --- CASE ----------------------------------------------------------------------------------------------- */

/* CASE R1 OF 1 GOTOF FIRST DEFAULT GOTOF OTHER: its numbers are labels in a segment of its own, DEFAULT is its target. */
static int64_t select_case(Run *run, const MarkedLine *marked, int64_t next) {
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    int64_t i = marked->expression, number;
    const double value = siemens_value(&e, &i);
    if (e.finding != F_OK)
        return stop_wrong(run, &e, marked->start, next);
    if (!whole_number(value, &number))
        return stop_at_fault(run, PF_FAULT_CASE, next);
    for (int64_t k = 0; k < run->program->labels.rows; k++) {
        const Label *label = &AT(run->program->labels, k);
        if (label->segment == marked->segment && label->number == number)
            return jump(run, label->word);
    }
    return marked->target >= 0 ? jump(run, marked->target) : next;
}

/* REPEAT START P=3, REPEATB, REPEAT START STOP: run the lines from the target up to the end so often more. */
static int64_t repeat_section(Run *run, const MarkedLine *marked, int64_t next) {
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    int64_t i = marked->expression, times = 1;
    const bool stated = marked->expression > marked->start;
    const double value = stated ? siemens_value(&e, &i) : 1.0;
    if (stated)
        siemens_line_ends(&e, i);
    if (e.finding != F_OK)
        return stop_wrong(run, &e, marked->start, next);
    if (!whole_number(value, &times) || times < 0)
        return stop_at_fault(run, PF_FAULT_SECTION_TIMES, next);
    if (times == 0)
        return next;
    const int64_t begin = call_lines(run, marked->target, times, next);
    if (!run->course->is_stopped)
        frame_of(run)->until = marked->end;
    return begin;
}

/* Execute a marked line of a Sinumerik; return the word at which to go on. */
int64_t siemens_flow(Run *run, const MarkedLine *marked, int64_t next) {
    switch (marked->kind) {
    case P_KIND_SIEMENS_IF: return siemens_if(run, marked, next);
    case P_KIND_FOR: return begin_counting(run, marked, next);
    case P_KIND_ENDFOR: return count_on(run, marked, next);
    case P_KIND_SECTION: return repeat_section(run, marked, next);
    case P_KIND_SIEMENS_CALL: return call_by_name(run, marked, next);
    case P_KIND_CASE: return select_case(run, marked, next);
    }
    return flow(run, marked, next);
}
