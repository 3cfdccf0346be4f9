/* Where the zero of the programmed numbers lies: work offset, its rotation, and the shift of G52 and G92.

   tip = R (programmed + shift) + work offset, R being a rotation about Z, or a mirror and a rotation. The state keeps programmed + shift + work offset, which is the tip
   as it would be without the rotation R; only rows, machine coordinates and changes of R see the tip itself. */

#ifndef GCODE_OFFSETS_H
#define GCODE_OFFSETS_H

#include "gcode/block.h"

enum { OFFSET_ROTATION = 3 }; /* column of the work offsets, degrees about Z */

enum { MIRROR_X = 1, MIRROR_Y = 2 };

/* Mirror a place at the pivot of the zero in force, and rotate it about that. */
static inline void rotate(const State *s, double mm[3]) {
    const double x = s->flipped & MIRROR_X ? s->pivot_mm[0] - mm[0] : mm[0] - s->pivot_mm[0];
    const double y = s->flipped & MIRROR_Y ? s->pivot_mm[1] - mm[1] : mm[1] - s->pivot_mm[1];
    mm[0] = s->pivot_mm[0] + (s->rotation_cos * x - s->rotation_sin * y);
    mm[1] = s->pivot_mm[1] + (s->rotation_sin * x + s->rotation_cos * y);
}

/* Where the tip stands. */
static inline void tip_position(const State *s, double tip_mm[3]) {
    tip_mm[0] = s->x;
    tip_mm[1] = s->y;
    tip_mm[2] = s->z;
    if (s->rotated)
        rotate(s, tip_mm);
}

void unrotate(const State *s, double mm[3]);
void stand_with_tip_at(State *s, const double tip_mm[3]);
void take_offsets(Machine *machine);
int32_t offset_of_code(int32_t code);
bool turns_itself(const Block *block);
bool offsets_rotary(Block *b);
bool takes_axes(const Block *b, bool any_axis);
void offset_codes(Block *b, bool any_axis);
void shift_by_code(Block *b);

/* Where the programmed numbers have their zero: work offset and shift. */
static inline const double *work_offset_mm(const Block *block) { return block->state->base_mm; }

/* The tip at programmed coordinates, and the other way round; both may be one array. */
static inline void tip_of(const Block *block, const double programmed_mm[3], double tip_mm[3]) {
    const double *base_mm = work_offset_mm(block);
    for (int axis = 0; axis < 3; axis++)
        tip_mm[axis] = programmed_mm[axis] + base_mm[axis];
}

static inline void programmed_of(const Block *block, const double tip_mm[3], double programmed_mm[3]) {
    const double *base_mm = work_offset_mm(block);
    for (int axis = 0; axis < 3; axis++)
        programmed_mm[axis] = tip_mm[axis] - base_mm[axis];
}

#endif
