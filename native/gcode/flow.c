/* O-words and M98, M99: where a program goes on. */

#include "gcode/flow.h"

#include "gcode/expressions.h"
#include "gcode/program_line.h"
#include "gcode/machine.h"
#include "gcode/reporting.h"
#include "gcode/saved_modes.h"
#include "gcode/settings.h"
#include "gcode/siemens_values.h"

/* --- the end of a program that cannot go on ------------------------------------------------------------- */

/* Report a finding of the line at hand and go no further: what follows may depend on it. */
int64_t stop_with(Run *run, int finding, double a, int64_t next) {
    Block block = {.machine = run->machine, .counts = run->machine->counts.at, .line = run->line};
    report(&block, finding, (Says){.a = a, .c = -1.0});
    run->course->is_stopped = 1;
    return next;
}

int64_t stop_at_fault(Run *run, int fault, int64_t next) { return stop_with(run, F_O_WORD, fault, next); }

/* Report what is wrong with an expression; behind another error its value may be a consequence. */
void report_unless_caused(Run *run, const Evaluation *e, int64_t start) {
    Counts *counts = run->machine->counts.at;
    if (counts->errors > 0 && e->finding != F_EXPRESSION)
        counts->consequences++;
    else
        report_wrong(run->machine, e, start);
}

/* The same, and go no further. */
int64_t stop_wrong(Run *run, const Evaluation *e, int64_t start, int64_t next) {
    report_unless_caused(run, e, start);
    run->course->is_stopped = 1;
    return next;
}

/* --- expressions of O-lines ----------------------------------------------------------------------------- */

/* Tell whether nothing but comments stands from i on; else that is wrong. */
bool line_ends(Evaluation *e, int64_t i) {
    const Bytes text = e->program->text;
    if (e->finding == F_OK && !is_rest_comment(text, i, e->end))
        wrong(e, F_EXPRESSION, PF_BEHIND_O_WORD, 0.0, after_comments(text, i, e->end));
    return e->finding == F_OK;
}

/* Work out the bracket at i. */
double bracket_value(Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    *i = after_blanks(text, *i, e->end);
    if (*i >= e->end || AT(text, *i) != '[')
        return wrong(e, F_EXPRESSION, PF_NO_BRACKET, 0.0, least(*i, e->end - 1));
    return value_at(e, i);
}

/* Find the value of the only bracket of an O-line, or of a Sinumerik's condition; without one the program stops. */
static bool only_value(Run *run, const MarkedLine *marked, double *value) {
    const bool siemens = run->program->language == D_PROGRAMS_SINUMERIK;
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    int64_t i = marked->expression;
    e.is_condition = marked->kind == P_KIND_IF || marked->kind == P_KIND_ELSEIF;
    *value = siemens ? siemens_value(&e, &i) : bracket_value(&e, &i);
    if (siemens ? siemens_line_ends(&e, i) : line_ends(&e, i))
        return true;
    stop_wrong(run, &e, marked->start, 0);
    return false;
}

/* --- jumps ---------------------------------------------------------------------------------------------- */

/* Go on at a word: repeat loops that it is outside of are over. */
int64_t jump(Run *run, int64_t word) {
    Course *at = run->course;
    const Frame *frame = frame_of(run);
    const int32_t base = frame->repeats;
    if (frame->until > 0 && (word < frame->entry || word > frame->until))
        return stop_at_fault(run, PF_FAULT_SECTION, word);
    while (at->repeats > base) {
        const Repeat *inner = &AT(run->program->repeats, at->repeats - 1);
        if (word >= inner->word && word < inner->end)
            break;
        at->repeats--;
    }
    return word;
}

static int64_t branch(Run *run, const MarkedLine *marked, int64_t next) {
    double test;
    if (!only_value(run, marked, &test))
        return next;
    run->course->is_testing = test == 0.0;
    return test != 0.0 ? next : jump(run, marked->target);
}

/* elseif and else: behind a test that failed they are tried, behind a branch that ran they are passed over. */
static int64_t next_branch(Run *run, const MarkedLine *marked, int64_t next) {
    if (!run->course->is_testing) {
        Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, true);
        int64_t i = marked->expression;
        if (marked->kind == P_KIND_ELSEIF)
            bracket_value(&e, &i);
        if (marked->kind == P_KIND_ELSEIF && !line_ends(&e, i))
            return stop_wrong(run, &e, marked->start, next);
        return jump(run, marked->end);
    }
    if (marked->kind == P_KIND_ELSEIF)
        return branch(run, marked, next);
    run->course->is_testing = 0;
    return next;
}

static int64_t loop(Run *run, const MarkedLine *marked, int64_t next) {
    double test;
    if (!only_value(run, marked, &test))
        return next;
    const bool jumps = marked->kind == P_KIND_DO_WHILE ? test != 0.0 : test == 0.0;
    return jumps ? jump(run, marked->target) : next; /* behind endwhile; back to do, or to REPEAT of UNTIL */
}

static int64_t repeat(Run *run, const MarkedLine *marked, int64_t next) {
    Course *at = run->course;
    const bool is_inside = at->repeats > frame_of(run)->repeats;
    if (!is_inside || AT(run->program->repeats, at->repeats - 1).word != run->word) {
        double count;
        if (!only_value(run, marked, &count))
            return next;
        if (at->repeats >= run->program->repeats.rows)
            return stop_at_fault(run, PF_FAULT_REPEATS, next);
        const double whole = floor(lesser(greater(count, 0.0), 1e15) + 0.5);
        AT(run->program->repeats, at->repeats++) = (Repeat){run->word, marked->target, (int64_t)whole};
    }
    at->changes++;
    Repeat *inner = &AT(run->program->repeats, at->repeats - 1);
    if (inner->left-- > 0)
        return next;
    return jump(run, marked->target);
}

/* Let rows and events of another file say the line of the main program that called it. */
void name_caller(const Run *run, int64_t first_row, int64_t first_event) {
    const int32_t main_line = frame_of(run)->main_line;
    if (main_line == 0)
        return;
    Machine *machine = run->machine;
    const Counts *counts = machine->counts.at;
    for (int64_t row = first_row; row < counts->rows; row++)
        AT(machine->rows.source_line, row) = main_line;
    for (int64_t k = first_event; k < counts->events; k++)
        AT(machine->events, k).line = main_line;
    if (machine->state.at->ended)
        machine->state.at->end_line = main_line;
}

/* --- calls ---------------------------------------------------------------------------------------------- */

/* Begin the next run of a program that M98 calls several times: its names are new, no modes are saved in it. */
static int64_t enter(Run *run, Frame *frame) {
    run->machine->state.at->level = (int32_t)run->course->frame;
    forget_modes(run->machine);
    frame->generation = ++run->course->generation;
    return frame->entry;
}

/* Return the line of the main program's file that rows of a subprogram name, 0 = each its own. */
static int32_t main_line_of(const Run *run, int64_t entry) {
    if (entry < run->course->main_words)
        return 0;
    const int32_t callers = frame_of(run)->main_line;
    return callers != 0 ? callers : run->line;
}

/* Tell whether the subprogram of a row can be entered; else it is wanted. */
bool is_ready(Run *run, int64_t row) {
    if (AT(run->program->subprograms, row).is_ready)
        return true;
    run->course->wanted = row;
    run->course->wanted_word = run->word;
    return false;
}

/* Return how many parameters each call has of its own. */
static int locals_of(const Program *program) {
    return program->language == D_PROGRAMS_FANUC ? P_MACRO_LOCALS : P_LOCAL_PARAMETERS;
}

/* Call the lines from a word of the program at hand on, with its parameters. */
int64_t call_lines(Run *run, int64_t word, int64_t times, int64_t next) {
    Course *at = run->course;
    if (at->frame + 1 >= run->program->frames.rows)
        return stop_with(run, F_CALLS_TOO_DEEP, P_FRAMES - 1, next);
    assign(run->program);
    const Frame caller = *frame_of(run);
    at->changes++;
    at->frame++;
    Frame *frame = frame_of(run);
    *frame = (Frame){.return_to = next, .times = times - 1, .entry = word, .is_program = 1, .main_line = caller.main_line,
                     .given = caller.given, .assigned = caller.assigned, .subprogram = caller.subprogram,
                     .call_line = run->line, .repeats = (int32_t)at->repeats};
    return enter(run, frame);
}

/* Call the subprogram of a row; `arguments` are none for M98, which keeps the caller's, and `given` their bits. */
int64_t call(Run *run, int64_t row, const double *arguments, int64_t given, int64_t times, int64_t next) {
    Course *at = run->course;
    Subprogram *subprogram = &AT(run->program->subprograms, row);
    if (!is_ready(run, row))
        return WAIT;
    if (run->program->language != D_PROGRAMS_FANUC && (subprogram->is_program != 0) != (arguments == NULL))
        return stop_at_fault(run, PF_FAULT_TWO_STYLES, next);
    if (at->frame + 1 >= run->program->frames.rows)
        return stop_with(run, F_CALLS_TOO_DEEP, P_FRAMES - 1, next);
    assign(run->program);
    const int32_t main_line = main_line_of(run, subprogram->entry);
    at->changes++;
    at->frame++;
    Frame *frame = frame_of(run);
    frame->return_to = next;
    frame->times = times - 1;
    frame->entry = subprogram->entry;
    frame->until = 0;
    frame->is_program = subprogram->is_program;
    frame->has_arguments = arguments != NULL;
    frame->main_line = main_line;
    frame->given = given;
    frame->assigned = 0;
    frame->subprogram = (int32_t)row;
    frame->call_line = run->line;
    if (given & ~subprogram->given)
        subprogram->given_line = run->line;
    subprogram->given |= given;
    frame->repeats = (int32_t)at->repeats;
    for (int k = 0; arguments != NULL && k < locals_of(run->program); k++) {
        frame->parameters[k] = AT(run->program->parameters, k + 1);
        AT(run->program->parameters, k + 1) = arguments[k];
    }
    return enter(run, frame);
}

/* Find the row of the subprogram with a number; else it is wanted. */
int64_t row_of_number(Run *run, int64_t number) {
    for (int64_t row = 0; row < run->course->subprograms; row++)
        if (AT(run->program->subprograms, row).number == number)
            return row;
    run->course->wanted = WANTED_BY_NUMBER;
    run->course->wanted_number = number;
    run->course->wanted_word = run->word;
    return WANTED_BY_NUMBER;
}

/* O… call: go behind its computed number, or else to where its arguments begin; return the row. */
static int64_t called_row(Run *run, Evaluation *e, const MarkedLine *marked, int64_t *i) {
    *i = marked->expression;
    if (marked->subprogram >= 0)
        return marked->subprogram;
    const double value = value_at(e, i);
    int64_t number;
    const int64_t behind = after_word(run->program->text, *i, e->end, "call");
    if (behind == *i) /* where the line says it, it is in a comment */
        wrong(e, F_O_WORD, PF_FAULT_WORD, 0.0, *i);
    *i = behind;
    if (e->finding != F_OK)
        return NOTHING_WANTED;
    if (whole_number(value, &number) && number >= 0)
        return row_of_number(run, number);
    wrong(e, F_O_WORD, PF_FAULT_CALL_NUMBER, 0.0, marked->expression);
    return NOTHING_WANTED;
}

static int64_t call_subprogram(Run *run, const MarkedLine *marked, int64_t next) {
    double arguments[P_LOCAL_PARAMETERS] = {0};
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    int64_t i, count = 0;
    const int64_t row = called_row(run, &e, marked, &i);
    const Bytes text = run->program->text;
    for (i = after_comments(text, i, e.end); e.finding == F_OK && i < e.end && AT(text, i) == '[';
         i = after_comments(text, i, e.end)) {
        if (count == P_LOCAL_PARAMETERS)
            wrong(&e, F_O_WORD, PF_FAULT_ARGUMENTS, 0.0, i);
        else
            arguments[count++] = value_at(&e, &i);
    }
    if (!line_ends(&e, i))
        return stop_wrong(run, &e, marked->start, next);
    return row == WANTED_BY_NUMBER ? WAIT : call(run, row, arguments, ((int64_t)2 << count) - 2, 1, next);
}

/* M98 P… L…: the words behind M98 are `from` to `to`. */
int64_t call_program(Run *run, const Words *words, int64_t from, int64_t to, int64_t next) {
    double p = NAN, l = 1.0;
    if (run->machine->counts.at->errors > 0) {
        run->course->is_stopped = 1;
        return next;
    }
    for (int64_t k = from; k < to; k++) {
        const uint8_t letter = AT(words->letter, k);
        if (letter == 'P' && isnan(p))
            p = AT(words->value, k);
        else if (letter == 'L')
            l = AT(words->value, k);
        else if (letter != '(')
            return stop_at_fault(run, PF_FAULT_M98_WORDS, next);
    }
    int64_t number, times;
    if (!whole_number(p, &number) || number < 0 || !whole_number(l, &times) || times < 0)
        return stop_at_fault(run, PF_FAULT_M98_WORDS, next);
    if (times == 0)
        return next;
    const int64_t row = row_of_number(run, number);
    return row == WANTED_BY_NUMBER ? WAIT : call(run, row, NULL, 0, times, next);
}

/* Restore what M73 has saved in the subprogram that ends; return false where room is wanted, or with a finding. */
static bool restore_on_return(Run *run) {
    Machine *machine = run->machine;
    if (!restores_on_return(machine))
        return true;
    if (!has_room(machine, 0))
        return false;
    const int64_t rows = machine->counts.at->rows, first_event = machine->counts.at->events;
    Block block = {.machine = machine, .state = machine->state.at, .counts = machine->counts.at, .line = run->line};
    const bool restored = restore_modes(&block);
    if (!restored)
        run->course->is_stopped = 1;
    name_caller(run, rows, first_event);
    return restored;
}

/* Go back to behind the call. */
static int64_t leave(Run *run) {
    Course *at = run->course;
    const Frame *frame = frame_of(run);
    if (!restore_on_return(run))
        return at->is_stopped ? frame->return_to : WAIT;
    at->repeats = frame->repeats;
    for (int k = 0; frame->has_arguments && k < locals_of(run->program); k++)
        AT(run->program->parameters, k + 1) = frame->parameters[k];
    at->frame--;
    run->machine->state.at->level = (int32_t)at->frame;
    return frame->return_to;
}

/* M99; `is_alone`: no word stands behind it. */
int64_t end_program(Run *run, bool is_alone, int64_t next) {
    Frame *frame = frame_of(run);
    if (run->course->frame == 0)
        return stop_at_fault(run, PF_FAULT_M99_IN_MAIN, next);
    if (!is_alone)
        return stop_at_fault(run, PF_FAULT_NOT_FIRST, next);
    if (!frame->is_program)
        return stop_at_fault(run, PF_FAULT_TWO_STYLES, next);
    if (frame->times <= 0)
        return leave(run);
    if (!restore_on_return(run))
        return run->course->is_stopped ? next : WAIT;
    run->course->changes++;
    frame->times--;
    run->course->repeats = frame->repeats;
    return enter(run, frame);
}

/* The end of a section that REPEAT repeats: once more, or go on behind REPEAT. */
int64_t end_section(Run *run) {
    Frame *frame = frame_of(run);
    if (frame->times <= 0)
        return leave(run);
    run->course->changes++;
    frame->times--;
    run->course->repeats = frame->repeats;
    return enter(run, frame);
}

/* endsub and return, with a value or without. */
static int64_t return_from(Run *run, const MarkedLine *marked, int64_t next) {
    Course *at = run->course;
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    if (at->frame == 0)
        return stop_at_fault(run, PF_FAULT_NOT_IN_SUB, next);
    if (frame_of(run)->is_program)
        return stop_at_fault(run, PF_FAULT_TWO_STYLES, next);
    const Bytes text = run->program->text;
    int64_t i = after_blanks(text, marked->expression, e.end);
    const bool has_value = i < e.end && AT(text, i) == '[';
    const double value = has_value ? value_at(&e, &i) : 0.0;
    if (!line_ends(&e, i))
        return stop_wrong(run, &e, marked->start, next);
    at->return_value = value;
    at->value_returned = has_value;
    return leave(run);
}

/* sub in the course of the program: from now on it can be called. */
static int64_t define(Run *run, const MarkedLine *marked, int64_t next) {
    if (run->course->frame > 0)
        return stop_at_fault(run, PF_FAULT_NESTED_SUB, next);
    Subprogram *subprogram = &AT(run->program->subprograms, marked->subprogram);
    if (subprogram->is_ready && subprogram->entry != next)
        return stop_at_fault(run, PF_FAULT_SUB_TWICE, next);
    subprogram->entry = next;
    subprogram->is_ready = 1;
    subprogram->is_program = 0;
    return marked->target;
}

static int64_t end_of_file(Run *run, int64_t next) {
    if (run->course->frame > 0)
        return stop_at_fault(run, PF_FAULT_FILE_ENDS, next);
    run->course->is_stopped = 1;
    return next;
}

/* Execute an O-line; return the word at which to go on. */
int64_t flow(Run *run, const MarkedLine *marked, int64_t next) {
    switch (marked->kind) {
    case P_KIND_IF: return branch(run, marked, next);
    case P_KIND_ELSEIF:
    case P_KIND_ELSE: return next_branch(run, marked, next);
    case P_KIND_ENDIF: run->course->is_testing = 0; return next;
    case P_KIND_WHILE:
    case P_KIND_UNTIL:
    case P_KIND_DO_WHILE: return loop(run, marked, next);
    case P_KIND_JUMP: return jump(run, marked->target);
    case P_KIND_REPEAT: return repeat(run, marked, next);
    case P_KIND_CALL: return call_subprogram(run, marked, next);
    case P_KIND_ENDSUB:
    case P_KIND_RETURN: return return_from(run, marked, next);
    case P_KIND_SUB: return define(run, marked, next);
    case P_KIND_END_OF_FILE: return end_of_file(run, next);
    case P_KIND_FAULT: return stop_at_fault(run, marked->fault, next);
    }
    return next;
}

/* --- blocks --------------------------------------------------------------------------------------------- */

/* Tell whether a block writes into a table that is kept beside the modes: offsets, saved modes. */
static bool writes_tables(const Words *words, int64_t from, int64_t to) {
    for (int64_t k = from; k < to; k++) {
        const double value = AT(words->value, k);
        if (AT(words->letter, k) == 'G' && value >= V_G10 / V_TENFOLD && value < V_G10 / V_TENFOLD + 1.0)
            return true;
        if (AT(words->letter, k) == 'M' && value >= V_M70 && value <= V_M73)
            return true;
    }
    return false;
}

/* Execute a block that calls nothing; return the word at which to go on. */
int64_t block_of_words(Run *run, const Words *words, int64_t from, int64_t to, int64_t next) {
    Counts *counts = run->machine->counts.at;
    const State *s = run->machine->state.at;
    const int64_t first_row = counts->rows + s->cutter_rows_removed, first_event = counts->events;
    counts->marks = counts->program_wanted = 0;
    if (!run_block(run->machine, words, from, to))
        return counts->program_wanted ? stop_with(run, F_O_WORD, PF_FAULT_NOT_FIRST, next) : WAIT;
    name_caller(run, first_row - s->cutter_rows_removed, first_event);
    if (counts->rows > run->course->most_rows)
        return stop_with(run, F_TOO_MANY_ROWS, (double)counts->rows, next);
    run->course->changes += writes_tables(words, from, to);
    return next;
}
