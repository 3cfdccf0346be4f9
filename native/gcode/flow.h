/* O-words and M98, M99: where a program goes on. */

#ifndef GCODE_FLOW_H
#define GCODE_FLOW_H

#include "gcode/block.h"
#include "gcode/parameters.h"

/* A program that runs, and the line at hand. */
typedef struct {
    Machine *machine;
    Program *program;
    Course *course;
    int64_t word; /* at which the line begins */
    int32_t line;
} Run;

enum { WAIT = -1 }; /* instead of a word at which to go on: room or a subprogram is wanted */
enum { NOTHING_WANTED = -1, WANTED_BY_NUMBER = -2 };

static inline Frame *frame_of(const Run *run) { return &AT(run->program->frames, run->course->frame); }

void name_caller(const Run *run, int64_t first_row, int64_t first_event);
int64_t stop_with(Run *run, int finding, double a, int64_t next);
void report_unless_caused(Run *run, const Evaluation *e, int64_t start);
int64_t stop_at_fault(Run *run, int fault, int64_t next);
int64_t stop_wrong(Run *run, const Evaluation *e, int64_t start, int64_t next);
bool line_ends(Evaluation *e, int64_t i);
double bracket_value(Evaluation *e, int64_t *i);
int64_t jump(Run *run, int64_t word);
int64_t row_of_number(Run *run, int64_t number);
bool is_ready(Run *run, int64_t row);
int64_t call_lines(Run *run, int64_t word, int64_t times, int64_t next);
int64_t call(Run *run, int64_t row, const double *arguments, int64_t given, int64_t times, int64_t next);
int64_t block_of_words(Run *run, const Words *words, int64_t from, int64_t to, int64_t next);
int64_t end_section(Run *run);
int64_t flow(Run *run, const MarkedLine *marked, int64_t next);
int64_t call_program(Run *run, const Words *words, int64_t from, int64_t to, int64_t next);
int64_t end_program(Run *run, bool is_alone, int64_t next);

#endif
