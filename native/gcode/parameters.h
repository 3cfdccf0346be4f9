/* The parameters of a program: numbered and named, its own and those that show the state of the machine. */

#ifndef GCODE_PARAMETERS_H
#define GCODE_PARAMETERS_H

#include "gcode/characters.h"

/* What an expression is worked out with. `dry`: only its form is looked at. The first thing that is wrong is
   kept: finding, what it says, and where in the text. */
typedef struct {
    Machine *machine;
    Program *program;
    int64_t end; /* of the line */
    int32_t line;
    bool dry;
    int finding;
    double a, b;
    int64_t place;
    int depth; /* of values within values */
    bool is_null;  /* the value is that of a Fanuc's variable that is empty */
    bool is_open;  /* the expression at hand stands in no bracket and ends with its line */
    bool in_word;  /* it is the value of a word */
    bool is_condition; /* of an if, which may ask whether an argument was given */
    int brackets;  /* that are open */
} Evaluation;

/* Keep what is wrong, if it is the first; return 0 as the value. */
static inline double wrong(Evaluation *e, int finding, double a, double b, int64_t place) {
    if (e->finding == F_OK) {
        e->finding = finding;
        e->a = a;
        e->b = b;
        e->place = place;
    }
    return 0.0;
}

/* Return the place of the first character from i on that is no blank, at most the line's end. */
static inline int64_t after_blanks(Bytes text, int64_t i, int64_t end) {
    while (i < end && is_blank(AT(text, i)))
        i++;
    return i;
}

/* Return the place of the first character from i on that is no blank and in no comment ( ), at most the line's end; a
   line whose comments do not close is never read so far. */
static inline int64_t after_comments(Bytes text, int64_t i, int64_t end) {
    for (i = after_blanks(text, i, end); i < end && AT(text, i) == '('; i = after_blanks(text, i, end))
        while (i < end && AT(text, i++) != ')')
            ;
    return i;
}

/* Tell whether nothing but comments stands in a line from i on. */
static inline bool is_rest_comment(Bytes text, int64_t i, int64_t end) {
    i = after_comments(text, i, end);
    return i >= end || AT(text, i) == ';';
}

/* Tell whether a word stands at i, such as X5 or X#1: behind ; it is the next block on a Fanuc, and prose is not. */
static inline bool is_word_behind(Bytes text, int64_t i) {
    const int64_t end = line_end(text, i);
    i = after_comments(text, i, end);
    if (i >= end || !is_letter(AT(text, i)))
        return false;
    i = after_blanks(text, i + 1, end);
    return i < end && (is_digit(AT(text, i)) || is_sign(AT(text, i)) || AT(text, i) == '.' ||
                       AT(text, i) == '#' || AT(text, i) == '[');
}

enum { NO_NAME = -1 };
double numbered_parameter(const Evaluation *e, int64_t number);
/* Tell whether a program is a Fanuc's, whose variables and operators are others. */
static inline bool is_macro(const Evaluation *e) { return e->program->language == D_PROGRAMS_FANUC; }

void note_unset(const Evaluation *e, int64_t number);
bool is_read_only(int64_t number);
enum { KNOWN = -1 };
int fault_of_number(const Machine *machine, int64_t number);
int fault_of_name(const Machine *machine, int64_t name);
bool is_of_cutter(const Machine *machine, int64_t number);
bool is_name_of_cutter(const Machine *machine, int64_t name);
int64_t name_at(Evaluation *e, int64_t *i);
bool is_name_set(const Evaluation *e, int64_t name);
double named_parameter(const Evaluation *e, int64_t name);
void assign(Program *program);

/* Find the whole number that a value stands for; LinuxCNC lets it be off by 0.0001. */
static inline bool whole_number(double value, int64_t *number) {
    static const double SLACK = 0.0001, LARGEST = 1e9;
    const double below = floor(value), part = value - below;
    if (!(fabs(value) < LARGEST) || (part > SLACK && part <= 1.0 - SLACK))
        return false;
    *number = (int64_t)below + (part > 0.5);
    return true;
}

#endif
