/* A whole program with parameters and O-words: its lines in the order in which it runs them.

   Plain blocks go to the interpreter of blocks as they are; a marked line is read from the text each time. The
   jumps of O-words have been found by gcode2krl/gcode/o_words.py, as words at which to go on. */

#include "gcode/flow.h"
#include "gcode/laps.h"
#include "gcode/macro_flow.h"
#include "gcode/machine.h"
#include "gcode/program_line.h"
#include "gcode/siemens_flow.h"

/* Execute a block whose words are known; return the word at which to go on. */
static int64_t known_block(Run *run, const Words *words, int64_t from, int64_t to, int64_t next) {
    const bool deletable = AT(words->letter, from) == '/';
    if (deletable && run->machine->block_delete)
        return next;
    if (run->program->language == D_PROGRAMS_FANUC)
        return macro_block(run, words, from + deletable, to, next);
    if (run->program->language == D_PROGRAMS_SINUMERIK)
        return siemens_block(run, words, from + deletable, to, next);
    if (run->program->language == D_PROGRAMS_LINUXCNC && from + deletable < to && AT(words->letter, from + deletable) == 'M') {
        const double m = AT(words->value, from + deletable);
        if (m == V_M98)
            return call_program(run, words, from + deletable + 1, to, next);
        if (m == V_M99)
            return end_program(run, from + deletable + 1 == to, next);
    }
    return block_of_words(run, words, from, to, next);
}

/* Execute a block with an expression, a parameter or an assignment. */
static int64_t computed_block(Run *run, const MarkedLine *marked, int64_t next) {
    Program *program = run->program;
    Evaluation e = evaluation_of(run->machine, program, marked->start, run->line, false);
    if (marked->fault != F_OK) /* of a comment */
        wrong(&e, marked->fault, marked->fault == F_DIALECT_STATEMENT ? DR_REASON_SEMICOLON : '(', 0.0,
              marked->start);
    else
        read_line(&e, marked->start, marked->first_message);
    if (e.finding != F_OK) { /* plain blocks behind it are still looked at, O-words are not */
        report_unless_caused(run, &e, marked->start);
        run->machine->state.at->doubt |= S_DOUBT_ALL;
        return next;
    }
    const int64_t count = run->course->words;
    if (count > 0) {
        const Words words = {{program->letter.at, count, 1},
                             {program->value.at, count, 1},
                             {program->extra.at, run->course->marks, 1},
                             {program->line.at, count, 1}};
        next = known_block(run, &words, 0, count, next);
    }
    if (next != WAIT)
        assign(program);
    return next;
}

static int64_t marked_line(Run *run, int64_t row, int64_t next) {
    const MarkedLine *marked = &AT(run->program->lines, row);
    if (is_deleted(run->machine, run->program->text, marked->start))
        return next;
    if (marked->kind == P_KIND_BLOCK)
        return computed_block(run, marked, next);
    if (run->machine->counts.at->errors > 0) { /* where to go on may depend on what was wrong */
        run->course->is_stopped = 1;
        return next;
    }
    return is_of_macro(marked->kind) ? macro_flow(run, marked, next) : siemens_flow(run, marked, next);
}

/* Execute a program from a word on; return the word at which to go on where room or a subprogram is wanted. */
EXPORT int64_t gcode_execute(Machine *machine, Program *program, Bytes letter, Floats value, Floats extra,
                             Ints32 line, int64_t from) {
    const Words words = {letter, value, extra, line};
    Course *course = program->course.at;
    Run run = {.machine = machine, .program = program, .course = course};
    course->wanted = NOTHING_WANTED;
    while (from < letter.rows && !machine->state.at->ended && !course->is_stopped) {
        if (frame_of(&run)->until == from && from > 0) {
            run.word = from;
            from = end_section(&run);
            continue;
        }
        int64_t to = from + 1;
        while (to < letter.rows && AT(line, to) == AT(line, from))
            to++;
        run.word = from;
        run.line = AT(line, from);
        if (course->steps >= course->most_steps) {
            stop_with(&run, F_TOO_MANY_STEPS, (double)course->steps, from);
            break;
        }
        const int64_t next = AT(letter, from) == V_PROGRAM_LINE
                                 ? marked_line(&run, (int64_t)AT(value, from), to)
                                 : known_block(&run, &words, from, to, to);
        if (next == WAIT)
            break;
        course->steps++;
        if (next <= from && repeats_itself(&run, next))
            stop_with(&run, F_LOOP_WITHOUT_CHANGE, 0.0, next);
        from = next;
    }
    return from;
}
