/* Rotary words, tool vectors and their feeds: values of axes, which gcode2krl/gcode/rotary.py understands. */

#ifndef GCODE_ROTARY_H
#define GCODE_ROTARY_H

#include "gcode/block.h"

/* Tell whether the cell's machine has the k-th of the other axes, A first. */
static inline bool is_declared(const Machine *machine, int k) {
    return k < V_ROTARY_AXES && machine->rotary_axes >> k & 1;
}

/* Tell whether a rotary axis is not at zero, or nobody knows. */
static inline bool is_turned(const State *s) {
    return s->rotary_deg[0] != 0.0 || s->rotary_deg[1] != 0.0 || s->rotary_deg[2] != 0.0 || s->rotary_unknown;
}

/* What X, Y, Z and the turn of the next row mean. */
static inline int32_t turn_mode(const Machine *machine) {
    const State *s = machine->state.at;
    if ((s->length_code == V_G43_5 || s->traori) && s->has_vector)
        return V_TURN_VECTOR;
    const bool tip = machine->tcpm || s->traori || s->length_code == V_G43_4 || s->length_code == V_G43_5;
    return tip ? V_TURN_TIP : V_TURN_MACHINE;
}

/* Write the rotary columns of a row. */
static inline void emit_turn(Machine *machine, int64_t row) {
    const State *s = machine->state.at;
    const Rows *rows = &machine->rows;
    const int32_t mode = turn_mode(machine);
    for (int k = 0; k < V_ROTARY_AXES; k++)
        CELL(rows->turn, row, k) = mode == V_TURN_VECTOR ? s->tool_vector[k] : s->rotary_deg[k];
    AT(rows->turn_mode, row) = mode;
    AT(rows->time_s, row) = NAN;
}

/* Write the rotary columns of a row again, as those of another one. */
static inline void copy_turn(const Rows *rows, int64_t from, int64_t to) {
    for (int k = 0; k < V_ROTARY_AXES; k++)
        CELL(rows->turn, to, k) = CELL(rows->turn, from, k);
    AT(rows->turn_mode, to) = AT(rows->turn_mode, from);
    AT(rows->time_s, to) = AT(rows->time_s, from);
}

static inline void stand_turned(State *s, const double turn_deg[V_ROTARY_AXES]) {
    for (int k = 0; k < V_ROTARY_AXES; k++)
        s->rotary_deg[k] = turn_deg[k];
}

/* Stand at a part of the way between two turns. */
static inline void stand_turned_between(State *s, const double from_deg[V_ROTARY_AXES],
                                        const double to_deg[V_ROTARY_AXES], double part) {
    for (int k = 0; k < V_ROTARY_AXES; k++)
        s->rotary_deg[k] = part < 1.0 ? from_deg[k] + (to_deg[k] - from_deg[k]) * part : to_deg[k];
}

int32_t rotary_words(const Block *b);
bool take_turn(Block *b, bool by_machine);
void follow_rotary(Block *b);
void rotary_home(Block *b, bool any_axis);
void use_vector(Block *b);
bool may_cycle(Block *b);
void take_tip_code(Block *b);
bool take_length_code(Block *b, int32_t code);
void check_turn_feed(Block *b, double length_mm);
double feed_time_s(const Block *b, double length_mm, int64_t chords);
void note_time(Block *b, double time_s);
void note_staying(Block *b);

#endif
