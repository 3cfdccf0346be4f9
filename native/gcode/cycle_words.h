/* What the words of a canned cycle say, those of this block and those that hold from the blocks before. */

#ifndef GCODE_CYCLE_WORDS_H
#define GCODE_CYCLE_WORDS_H

#include "gcode/block.h"

/* A cycle: its axes, the holes across the tool in programmed mm, the heights along it in programmed units. */
typedef struct {
    int32_t motion;
    int first, second, third;
    double u_mm, v_mm, u_from_mm, v_from_mm, u_step_mm, v_step_mm;
    double height, level, r, bottom, clear; /* where the tool stands, where the cycles began, R, depth, end */
    bool height_known, level_known, r_known;
    double peck, clearance, dwell_s, mm_s;
    int64_t repeats;
    int32_t rests_on;
} Cycle;

Cycle cycle_of(const Block *block);
void go_along(Block *block, const Cycle *cycle, double along, bool known, double mm_s);
void wait_here(Block *block, double seconds);
void turn_spindle(Block *block, const Cycle *cycle, int32_t direction);
bool has_cycle_room(Block *block, int64_t rows, int64_t events);
bool cycle_words(Block *block, Cycle *cycle);
void learn_across(Block *block, const Cycle *cycle);
void remember_cycle(Block *block, const Cycle *cycle);

#endif
