/* What the interpreter hands over beside rows: findings, consequences, notes and events. */

#ifndef GCODE_REPORTING_H
#define GCODE_REPORTING_H

#include "gcode/block.h"

/* What a finding says beside its number: up to three numbers. */
typedef struct {
    double a, b, c;
} Says;

void report(Block *block, int32_t number, Says says);
void report_at(Block *block, int32_t line, int32_t number, Says says);
bool rests_on_doubt(Block *block, int32_t doubt);
void report_unless(Block *block, int32_t doubt, int32_t number, Says says);
void note(Block *block, int which, int32_t word);
void event(Block *block, int32_t kind, double a, double b);
void event_of_words(Block *block, int32_t m);

#endif
