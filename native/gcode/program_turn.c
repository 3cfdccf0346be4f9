/* Rotations and mirrors that the program itself sets: ROT, AROT, MIRROR and AMIRROR of a Sinumerik, G68, G69, G51.1 and
   G50.1 of a Fanuc.

   ROT puts a rotation in place of all that TRANS, ROT and AROT have set, AROT adds to it (SINUMERIK, Programming Manual,
   Fundamentals: frames). G68 X Y R turns about a point of the coordinates in force; its X and Y are absolute, and under
   G90 so is R (Fanuc, Operator's Manual, coordinate system rotation; parameter 5400 RIN is for G91). MIRROR stands in
   place of the same, AMIRROR adds to it; its words only name axes. G51.1 mirrors each axis named at that place. */

#include "gcode/program_turn.h"

#include "gcode/offsets.h"
#include "gcode/reporting.h"

/* Refuse a block, which is not carried out; where it leads is in doubt. */
static bool refuse(Block *b, int reason) {
    report_unless(b, S_DOUBT_PLANE | S_DOUBT_DISTANCE | S_DOUBT_UNIT, F_DIALECT_STATEMENT, (Says){.a = reason});
    b->state->doubt |= S_DOUBT_POSITION;
    return false;
}

static bool is_turned_by_program(const State *s) { return s->turned_deg != 0.0 || s->mirrored; }

static void drop_words(Block *b) {
    for (int index = 0; index < V_LETTERS; index++)
        b->has[index] = false;
}

/* Tell whether a block has no words but those of some letters, and no codes but that of G17 and G90. */
static bool has_only(const Block *b, int32_t letters) {
    for (int index = 0; index < V_LETTERS; index++)
        if (b->has[index] && !(letters >> index & 1))
            return false;
    for (int group = 0; group < V_GROUPS; group++)
        if (b->g[group] >= 0 && b->g[group] != V_PLANE_XY * V_TENFOLD && b->g[group] != V_G90)
            return false;
    return b->m_codes[0] < 0 && !b->corner && !b->tip && !b->shift;
}

/* Turn the coordinates by an angle about a programmed point, and mirror axes there, which are named by bits. */
static void turn_to(Block *b, double deg, int32_t mirrored, double x_mm, double y_mm) {
    State *s = b->state;
    s->turned_deg = deg;
    s->mirrored = mirrored;
    s->turned_about_mm[0] = x_mm;
    s->turned_about_mm[1] = y_mm;
    take_offsets(b->machine);
}

/* ROT, ROT RPL=30, ROT Z30, AROT; in the shift that TRANS has set. */
static bool turn_siemens(Block *b) {
    State *s = b->state;
    const bool by_z = b->has[V_WORD_Z], adds = b->turn == D_TURN_ADD;
    const double deg = by_z ? b->word[V_WORD_Z] : b->turn_stated ? b->turned_deg : 0.0;
    if (!has_only(b, 1 << V_WORD_Z) || (by_z && b->turn_stated) || (adds && !by_z && !b->turn_stated) || b->incremental | b->absolute)
        return refuse(b, DR_REASON_TURN);
    if (adds && s->mirrored)
        return refuse(b, DR_REASON_TURNED);
    for (int axis = 0; axis < 3 && !adds; axis++)
        s->shift_mm[axis] = s->shift_kept_mm[axis] = 0.0;
    b->used[V_WORD_Z] = true;
    turn_to(b, deg + (adds ? s->turned_deg : 0.0), 0, 0.0, 0.0);
    return true;
}

/* G68 X Y R. */
static bool turn_fanuc(Block *b) {
    State *s = b->state;
    const int32_t words = 1 << V_WORD_X | 1 << V_WORD_Y | 1 << V_WORD_R;
    const bool absolute = s->absolute || b->g[V_DISTANCE] >= 0;
    if (!has_only(b, words) || !b->has[V_WORD_X] || !b->has[V_WORD_Y] || !b->has[V_WORD_R] || !absolute ||
        is_turned_by_program(s))
        return refuse(b, DR_REASON_TURN);
    turn_to(b, b->word[V_WORD_R], 0, b->word[V_WORD_X] * s->unit_mm, b->word[V_WORD_Y] * s->unit_mm);
    s->turned_anew = 1;
    drop_words(b);
    return true;
}

/* --- mirrors -------------------------------------------------------------------------------------------- */

static int32_t axes_named(const Block *b) {
    return b->has[V_WORD_X] * MIRROR_X | b->has[V_WORD_Y] * MIRROR_Y;
}

/* MIRROR, MIRROR X0 Y0, AMIRROR X0. */
static bool mirror_siemens(Block *b) {
    State *s = b->state;
    const bool adds = b->turn == D_MIRROR_ADD;
    const int32_t axes = axes_named(b);
    if (!has_only(b, 1 << V_WORD_X | 1 << V_WORD_Y) || (adds && (!axes || s->mirrored)) || b->incremental | b->absolute)
        return refuse(b, DR_REASON_MIRROR);
    for (int axis = 0; axis < 3 && !adds; axis++)
        s->shift_mm[axis] = s->shift_kept_mm[axis] = 0.0;
    turn_to(b, adds ? s->turned_deg : 0.0, axes, 0.0, 0.0);
    drop_words(b);
    return true;
}

/* G51.1 X10. and G50.1 X0. Y0. */
static bool mirror_fanuc(Block *b) {
    State *s = b->state;
    const int32_t axes = axes_named(b);
    const bool absolute = s->absolute || b->g[V_DISTANCE] >= 0, off = b->turn == D_MIRROR_OFF;
    if (!has_only(b, 1 << V_WORD_X | 1 << V_WORD_Y | off << V_WORD_Z) || !axes || (!off && (!absolute || is_turned_by_program(s))))
        return refuse(b, DR_REASON_MIRROR);
    if (off)
        turn_to(b, 0.0, s->mirrored & ~axes, s->turned_about_mm[0], s->turned_about_mm[1]);
    else
        turn_to(b, 0.0, axes, b->word[V_WORD_X] * s->unit_mm, b->word[V_WORD_Y] * s->unit_mm);
    s->turned_anew = s->turned_anew || !off || s->mirrored;
    drop_words(b);
    return true;
}

/* Carry out the rotation or mirror of a block; return false, with a finding, where it is none that is read. */
bool turn_frame(Block *b) {
    State *s = b->state;
    const bool mirrors = b->turn == D_MIRROR_SET || b->turn == D_MIRROR_ADD || b->turn == D_MIRROR_OFF;
    const bool fanuc = b->machine->programs == D_PROGRAMS_FANUC;
    const bool in_xy = b->g[V_PLANE] >= 0 ? b->g[V_PLANE] == V_PLANE_XY * V_TENFOLD : s->plane == V_PLANE_XY;
    if (b->turn == D_TURN_OFF) {
        turn_to(b, 0.0, s->mirrored, 0.0, 0.0);
        s->turned_anew = 1;
        return true;
    }
    if (b->turn == D_MIRROR_OFF && !s->mirrored) { /* its words only name axes */
        note(b, S_NOTE_STATEMENT, 0);
        if (b->g[V_MOTION] >= 0 && (axes_named(b) || b->has[V_WORD_Z]))
            return refuse(b, DR_REASON_MIRROR);
        b->has[V_WORD_X] = b->has[V_WORD_Y] = b->has[V_WORD_Z] = false;
        return true;
    }
    if (!in_xy || b->machine->rotary_axes || (s->rotated && !is_turned_by_program(s)))
        return refuse(b, mirrors ? DR_REASON_MIRROR : DR_REASON_TURN);
    if (mirrors)
        return fanuc ? mirror_fanuc(b) : mirror_siemens(b);
    if (fanuc)
        return turn_fanuc(b);
    const bool turned = turn_siemens(b);
    b->has[V_WORD_Z] = b->has[V_WORD_Z] && !turned;
    return turned;
}

/* Tell whether a block under a rotation keeps what the rotation rests on; report it where not. */
bool may_stay_turned(Block *b) {
    const State *s = b->state;
    const int32_t special = b->g[V_NON_MODAL];
    if (!is_turned_by_program(s))
        return true;
    const bool fanuc = b->machine->programs == D_PROGRAMS_FANUC;
    const bool plane = b->g[V_PLANE] >= 0 && b->g[V_PLANE] != V_PLANE_XY * V_TENFOLD;
    const bool zero = fanuc ? b->g[V_WORK_OFFSET] >= 0 || (special >= 0 && special != V_G4) : b->shift == D_SHIFT_ADD;
    const bool turned_zero = b->g[V_WORK_OFFSET] >= 0 && turns_itself(b);
    return !(plane || zero || turned_zero) || refuse(b, DR_REASON_TURNED);
}

/* Tell whether a block names X and Y under G90, or neither of them; report it where not. */
bool names_both(Block *b) {
    State *s = b->state;
    const bool x = b->has[V_WORD_X], y = b->has[V_WORD_Y];
    if (!x && !y)
        return true;
    s->turned_anew = 0;
    return (x && y && s->absolute) || refuse(b, DR_REASON_FIRST_TURNED);
}
