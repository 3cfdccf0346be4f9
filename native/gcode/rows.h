/* Rows of straight moves, those of an arc among them, and where the axis words of a block lead. */

#ifndef GCODE_ROWS_H
#define GCODE_ROWS_H

#include "gcode/arcs.h"
#include "gcode/offsets.h"
#include "gcode/rotary.h"

enum { NO_ARC = -1 };
static const double RAPID_MM_S = INFINITY;

/* Write what the rotation of the work offset makes of a row. */
static inline void emit_rotated(const Rows *rows, int64_t row, const State *s) {
    double tip_mm[3];
    tip_position(s, tip_mm);
    for (int axis = 0; axis < 2; axis++) {
        CELL(rows->position_mm, row, axis) = tip_mm[axis];
        CELL(rows->known, row, axis) = s->known_x && s->known_y;
    }
}

/* Write the next row: it ends at the state's position. */
static inline void emit(Machine *machine, int32_t line, double feed_mm_s, bool rapid, bool by_machine,
                        int32_t arc) {
    const State *s = machine->state.at;
    const Rows *rows = &machine->rows;
    const int64_t row = machine->counts.at->rows++;
    CELL(rows->position_mm, row, 0) = s->x;
    CELL(rows->position_mm, row, 1) = s->y;
    CELL(rows->position_mm, row, 2) = s->z;
    AT(rows->feed_mm_s, row) = feed_mm_s;
    AT(rows->spindle_rad_s, row) = s->rpm * s->direction * 2.0 * PI / U_S_PER_MIN;
    AT(rows->tolerance_mm, row) = s->tolerance;
    AT(rows->dwell_s, row) = 0.0;
    AT(rows->length_offset_mm, row) = s->length_offset;
    AT(rows->length_offset_tool, row) = s->offset_tool;
    AT(rows->tool, row) = s->tool;
    AT(rows->source_line, row) = line;
    AT(rows->arc, row) = arc;
    AT(rows->rapid, row) = rapid;
    AT(rows->exact_stop, row) = s->exact_stop != 0;
    AT(rows->machine, row) = by_machine;
    CELL(rows->known, row, 0) = s->known_x != 0;
    CELL(rows->known, row, 1) = s->known_y != 0;
    CELL(rows->known, row, 2) = s->known_z != 0;
    if (s->rotated)
        emit_rotated(rows, row, s);
    if (machine->rotary_axes)
        emit_turn(machine, row);
}

/* Write the columns of a row again, as another one. */
static inline void copy_row(const Machine *machine, int64_t from, int64_t to) {
    const Rows *rows = &machine->rows;
    for (int axis = 0; axis < 3; axis++) {
        CELL(rows->position_mm, to, axis) = CELL(rows->position_mm, from, axis);
        CELL(rows->known, to, axis) = CELL(rows->known, from, axis);
    }
    AT(rows->feed_mm_s, to) = AT(rows->feed_mm_s, from);
    AT(rows->spindle_rad_s, to) = AT(rows->spindle_rad_s, from);
    AT(rows->tolerance_mm, to) = AT(rows->tolerance_mm, from);
    AT(rows->dwell_s, to) = AT(rows->dwell_s, from);
    AT(rows->length_offset_mm, to) = AT(rows->length_offset_mm, from);
    AT(rows->length_offset_tool, to) = AT(rows->length_offset_tool, from);
    AT(rows->tool, to) = AT(rows->tool, from);
    AT(rows->source_line, to) = AT(rows->source_line, from);
    AT(rows->arc, to) = AT(rows->arc, from);
    AT(rows->rapid, to) = AT(rows->rapid, from);
    AT(rows->exact_stop, to) = AT(rows->exact_stop, from);
    AT(rows->machine, to) = AT(rows->machine, from);
    if (machine->rotary_axes)
        copy_turn(rows, from, to);
}

static inline void stand_at(State *s, const double position_mm[3]) {
    s->x = position_mm[0];
    s->y = position_mm[1];
    s->z = position_mm[2];
}

void target(const Block *block, double to_mm[3]);
void learn(Block *block);
void follow(Block *block);
void emit_chords(Block *block, const Arc *arc, double angle, double sweep, int64_t chords, double mm_s);

#endif
