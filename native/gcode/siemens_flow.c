/* Jumps, loops that count and repeated sections of a Sinumerik.

   IF with a block, WHILE, LOOP and REPEAT with UNTIL are the O-words of native/gcode/flow.c; where each leads has been
   found by gcode2krl/gcode/siemens_words.py. */

#include "gcode/siemens_flow.h"

#include "gcode/expressions.h"
#include "gcode/program_line.h"
#include "gcode/siemens_values.h"

/* IF condition GOTOF label. */
int64_t siemens_if(Run *run, const MarkedLine *marked, int64_t next) {
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
    const double value = set_counter(&e, number, first ? from : AT(run->program->parameters, number) + 1.0);
    assign(run->program);
    return value <= to ? jump(run, inside) : jump(run, behind);
}

/* FOR R1=1 TO 5. */
int64_t begin_counting(Run *run, const MarkedLine *marked, int64_t next) {
    return pass(run, marked, true, next, marked->target);
}

/* ENDFOR: its expression is that of its FOR. */
int64_t count_on(Run *run, const MarkedLine *marked, int64_t next) {
    return pass(run, marked, false, marked->target, next);
}

/* REPEAT START P=3, REPEATB, REPEAT START STOP: run the lines from the target up to the end so often more. */
int64_t repeat_section(Run *run, const MarkedLine *marked, int64_t next) {
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
