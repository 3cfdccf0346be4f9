/* Jumps, loops and calls of a Fanuc's custom macro B: IF, GOTO, WHILE; G65, M98, M99. */

#include "gcode/macro_flow.h"

#include "gcode/expressions.h"
#include "gcode/macro_values.h"
#include "gcode/program_line.h"

/* --- jumps ---------------------------------------------------------------------------------------------- */

/* Return the first label that does not stand before one of a segment, a number and a word. */
static int64_t label_from(const Program *program, int64_t segment, int64_t number, int64_t word) {
    int64_t low = 0, high = program->labels.rows;
    while (low < high) {
        const int64_t middle = low + (high - low) / 2;
        const Label *at = &AT(program->labels, middle);
        const bool before = at->segment != segment ? at->segment < segment
                            : at->number != number ? at->number < number
                                                   : at->word < word;
        if (before)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Find the line N of a number: the next one forwards, else the first of the program; NULL = none. */
static const Label *label_of(const Run *run, int64_t segment, int64_t number) {
    const Program *program = run->program;
    for (int pass = 0; pass < 2; pass++) {
        const int64_t row = label_from(program, segment, number, pass == 0 ? run->word + 1 : 0);
        if (row >= program->labels.rows)
            continue;
        const Label *found = &AT(program->labels, row);
        if (found->segment == segment && found->number == number)
            return found;
    }
    return NULL;
}

/* Go on at the line whose number stands at i, behind GOTO. */
static int64_t go_to(Run *run, const MarkedLine *marked, Evaluation *e, int64_t i, int64_t next) {
    const double value = value_at(e, &i);
    int64_t number;
    if (!line_ends(e, i))
        return stop_wrong(run, e, marked->start, next);
    const Label *label = !e->is_null && whole_number(value, &number) ? label_of(run, marked->segment, number) : NULL;
    if (label == NULL)
        return stop_at_fault(run, PF_FAULT_NO_LABEL, next);
    if (label->loop_first >= 0 && (run->word < label->loop_first || run->word > label->loop_last))
        return stop_at_fault(run, PF_FAULT_INTO_LOOP, next);
    return label->word;
}

static int64_t go_to_number(Run *run, const MarkedLine *marked, int64_t next) {
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    return go_to(run, marked, &e, marked->expression, next);
}

/* THEN and one calculation. */
static int64_t calculate(Run *run, const MarkedLine *marked, Evaluation *e, int64_t i, int64_t next) {
    const Bytes text = e->program->text;
    i = after_blanks(text, i, e->end);
    if (i >= e->end || AT(text, i) != '#')
        wrong(e, F_EXPRESSION, PF_MACRO_BEHIND_THEN, 0.0, least(i, e->end - 1));
    else
        assignment_at(e, &i);
    if (!line_ends(e, i))
        return stop_wrong(run, e, marked->start, next);
    assign(run->program);
    return next;
}

/* IF [...] GOTO n, IF [...] THEN #1 = 2. */
static int64_t macro_if(Run *run, const MarkedLine *marked, int64_t next) {
    const Bytes text = run->program->text;
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    int64_t i = marked->expression;
    const double test = bracket_value(&e, &i);
    i = after_blanks(text, i, e.end);
    const int64_t behind_goto = after_word(text, i, e.end, "goto"), behind_then = after_word(text, i, e.end, "then");
    if (e.finding == F_OK && behind_goto == i && behind_then == i)
        wrong(&e, F_EXPRESSION, PF_MACRO_BEHIND_IF, 0.0, least(i, e.end - 1));
    if (e.finding != F_OK)
        return stop_wrong(run, &e, marked->start, next);
    if (test == 0.0)
        return next;
    return behind_goto > i ? go_to(run, marked, &e, behind_goto, next) : calculate(run, marked, &e, behind_then, next);
}

/* WHILE [...] DO1: behind END1 where the test fails. */
static int64_t macro_while(Run *run, const MarkedLine *marked, int64_t next) {
    Evaluation e = evaluation_of(run->machine, run->program, marked->start, run->line, false);
    int64_t i = marked->expression;
    const double test = bracket_value(&e, &i);
    if (e.finding == F_OK && after_word(run->program->text, i, e.end, "do") == i)
        wrong(&e, F_EXPRESSION, PF_MACRO_BEHIND_WHILE, 0.0, least(i, e.end - 1));
    if (e.finding != F_OK)
        return stop_wrong(run, &e, marked->start, next);
    return test != 0.0 ? next : jump(run, marked->target);
}

/* Execute a jump, a test or a loop; return the word at which to go on. */
int64_t macro_flow(Run *run, const MarkedLine *marked, int64_t next) {
    switch (marked->kind) {
    case P_KIND_GOTO: return go_to_number(run, marked, next);
    case P_KIND_MACRO_IF: return macro_if(run, marked, next);
    default: return macro_while(run, marked, next);
    }
}

/* --- G65 ------------------------------------------------------------------------------------------------ */

/* Return the variable of an argument, 0 where the letter is none. */
static int variable_of(uint8_t letter) {
    static const uint8_t VARIABLE[] = {1, 2, 3, 7, 8, 9, 0, 11, 4, 5, 6, 0, 13, 0, 0, 0, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26};
    return letter >= 'A' && letter <= 'Z' ? VARIABLE[letter - 'A'] : 0;
}

/* Take one word behind G65: P or an argument; return a fault, -1 = none. */
static int take_argument(uint8_t letter, double value, double *p, double arguments[P_MACRO_LOCALS]) {
    enum { NO_FAULT = -1, FIRST_OF_CENTRE = 4, LAST_OF_CENTRE = 6 };
    if (letter == '(')
        return NO_FAULT;
    if (letter == D_NEXT_POINTLESS)
        return PF_FAULT_MACRO_POINT;
    if (letter == 'P' && isnan(*p)) {
        *p = value;
        return NO_FAULT;
    }
    const int variable = variable_of(letter);
    if (variable == 0 || arguments[variable - 1] != VACANT)
        return PF_FAULT_MACRO_WORDS;
    for (int later = variable + 1; variable >= FIRST_OF_CENTRE && later <= LAST_OF_CENTRE; later++)
        if (arguments[later - 1] != VACANT)
            return PF_FAULT_MACRO_WORDS;
    arguments[variable - 1] = value;
    return NO_FAULT;
}

/* G65 P and arguments; the words behind G65 are `from` to `to`. */
static int64_t call_macro(Run *run, const Words *words, int64_t from, int64_t to, int64_t next) {
    double arguments[P_MACRO_LOCALS], p = NAN;
    int64_t number, given = 0;
    for (int k = 0; k < P_MACRO_LOCALS; k++)
        arguments[k] = VACANT;
    for (int64_t k = from; k < to; k++) {
        const int fault = take_argument(AT(words->letter, k), AT(words->value, k), &p, arguments);
        if (fault >= 0)
            return stop_at_fault(run, fault, next);
    }
    if (!whole_number(p, &number) || number < 1)
        return stop_at_fault(run, PF_FAULT_MACRO_WORDS, next);
    for (int k = 0; k < P_MACRO_LOCALS; k++)
        given |= (int64_t)(arguments[k] != VACANT) << (k + 1);
    const int64_t row = row_of_number(run, number);
    return row == WANTED_BY_NUMBER ? WAIT : call(run, row, arguments, given, 1, next);
}

/* --- M98 and M99 ---------------------------------------------------------------------------------------- */

/* Find which program M98 calls and how often: P1234 L3, or P31234; of M97 P is a line's number as a whole. Return false
   where that is not said. */
static bool called(const Words *words, int64_t from, int64_t to, bool local, int64_t *number, int64_t *times) {
    enum { OF_A_NUMBER = 10000 };
    double p = NAN, l = NAN;
    for (int64_t k = from; k < to; k++) {
        const uint8_t letter = AT(words->letter, k);
        if (letter == 'P' && isnan(p))
            p = AT(words->value, k);
        else if (letter == 'L' && isnan(l))
            l = AT(words->value, k);
        else if (letter != '(')
            return false;
    }
    *times = 1;
    if (!whole_number(p, number) || *number < 1 || (!isnan(l) && (!whole_number(l, times) || *times < 0)))
        return false;
    if (local || *number < OF_A_NUMBER)
        return true;
    if (!isnan(l))
        return false;
    *times = *number / OF_A_NUMBER;
    *number %= OF_A_NUMBER;
    return *number > 0;
}

/* Find the only line N of a number in all programs; NULL where there is none, or another. */
static const Label *only_label(const Program *program, int64_t number) {
    const Label *found = NULL;
    for (int64_t row = 0; row < program->labels.rows; row++) {
        if (AT(program->labels, row).number != number)
            continue;
        if (found != NULL)
            return NULL;
        found = &AT(program->labels, row);
    }
    return found;
}

/* M98, and M97 of a Haas, behind the words `from` to `at`, which are carried out before the call. */
static int64_t call_behind(Run *run, const Words *words, int64_t from, int64_t at, int64_t to, int64_t next) {
    int64_t number, times;
    if (run->machine->counts.at->errors > 0) {
        run->course->is_stopped = 1;
        return next;
    }
    const bool local = AT(words->value, at) == V_M97;
    if (!called(words, at + 1, to, local, &number, &times))
        return stop_at_fault(run, PF_FAULT_M98_MACRO, next);
    const Label *label = local ? only_label(run->program, number) : NULL;
    if (local && (label == NULL || label->loop_first >= 0))
        return stop_at_fault(run, PF_FAULT_LOCAL, next);
    const int64_t row = local ? 0 : row_of_number(run, number);
    if (!local && (row == WANTED_BY_NUMBER || !is_ready(run, row)))
        return WAIT;
    if (at > from && block_of_words(run, words, from, at, next) == WAIT)
        return WAIT;
    if (run->machine->counts.at->errors > 0 || run->machine->state.at->ended || run->course->is_stopped || times == 0)
        return next;
    return local ? call_lines(run, label->word, times, next) : call(run, row, NULL, 0, times, next);
}

/* M99, behind the words `from` to `at`, which are carried out before. */
static int64_t end_behind(Run *run, const Words *words, int64_t from, int64_t at, int64_t to, int64_t next) {
    if (at + 1 < to)
        return stop_at_fault(run, PF_FAULT_M99_WORDS, next);
    if (run->course->frame > 0 && at > from) {
        const int64_t errors = run->machine->counts.at->errors;
        if (block_of_words(run, words, from, at, next) == WAIT)
            return WAIT;
        if (run->machine->counts.at->errors > errors || run->machine->state.at->ended || run->course->is_stopped)
            return next;
    }
    return end_program(run, true, next);
}

/* --- blocks --------------------------------------------------------------------------------------------- */

/* Execute a block of known words, which may call a program or end one. */
int64_t macro_block(Run *run, const Words *words, int64_t from, int64_t to, int64_t next) {
    enum { G65 = 65 };
    for (int64_t k = from; k < to; k++) {
        const uint8_t letter = AT(words->letter, k);
        const double value = AT(words->value, k);
        if (letter == 'G' && value == G65)
            return k == from ? call_macro(run, words, k + 1, to, next) : stop_at_fault(run, PF_FAULT_MACRO_WORDS, next);
        if (letter == 'M' && (value == V_M98 || value == V_M97))
            return call_behind(run, words, from, k, to, next);
        if (letter == 'M' && value == V_M99)
            return end_behind(run, words, from, k, to, next);
    }
    return from < to ? block_of_words(run, words, from, to, next) : next;
}
