/* Work offsets and shifts in force, and the codes that set them: G52, G92 to G92.3, G10 L2 and L20. */

#include "gcode/offsets.h"

#include "gcode/reporting.h"
#include "gcode/rotary.h"
#include "gcode/tool_lengths.h"

enum { WORK_OFFSETS = 9, ALL_OF_X_AND_Y = 3 };

/* --- the zero in force ---------------------------------------------------------------------------------- */

/* Rotate a place back about the work offset in force. */
void unrotate(const State *s, double mm[3]) {
    const double x = mm[0] - s->pivot_mm[0], y = mm[1] - s->pivot_mm[1];
    if (!s->rotated)
        return;
    const double u = s->rotation_cos * x + s->rotation_sin * y, v = s->rotation_cos * y - s->rotation_sin * x;
    mm[0] = s->pivot_mm[0] + (s->flipped & MIRROR_X ? -u : u);
    mm[1] = s->pivot_mm[1] + (s->flipped & MIRROR_Y ? -v : v);
}

void stand_with_tip_at(State *s, const double tip_mm[3]) {
    double mm[3] = {tip_mm[0], tip_mm[1], tip_mm[2]};
    unrotate(s, mm);
    s->x = mm[0];
    s->y = mm[1];
    s->z = mm[2];
}

static double *offset_of(const Machine *machine, int32_t system) {
    return &CELL(machine->offsets, system, 0);
}

static double in_rad(double deg) { return deg * (PI / 180.0); }

/* Return the place of the work offset of a code, G54 to G59.3. */
int32_t offset_of_code(int32_t code) { return code <= V_G59 ? (code - V_G54) / V_TENFOLD : code - V_G59 + 5; }

/* Tell whether the work offset that a block selects is rotated. */
bool turns_itself(const Block *b) {
    const int32_t place = b->offset_code ? b->offset : offset_of_code(b->g[V_WORK_OFFSET]);
    return offset_of(b->machine, place)[OFFSET_ROTATION] != 0.0;
}

/* Take over the offsets in force; the tip stands still. */
void take_offsets(Machine *machine) {
    State *s = machine->state.at;
    const double *offset_mm = offset_of(machine, s->work_offset);
    const double deg = s->turned_deg != 0.0 ? s->turned_deg : offset_mm[OFFSET_ROTATION];
    const double angle = in_rad(deg), rotation_cos = cos(angle), rotation_sin = sin(angle);
    const bool turned = s->turned_deg != 0.0 || s->mirrored, rotates = deg != 0.0 || turned;
    double tip_mm[3];
    tip_position(s, tip_mm);
    for (int axis = 0; axis < 3; axis++)
        s->base_mm[axis] = offset_mm[axis] + s->shift_mm[axis];
    if (!rotates && !s->rotated)
        return;
    if (!s->rotated || !rotates || s->mirrored != s->flipped || rotation_cos != s->rotation_cos || rotation_sin != s->rotation_sin)
        s->known_x = s->known_y = s->known_x && s->known_y; /* one axis of the other frame alone is not known */
    s->rotated = rotates;
    s->flipped = s->mirrored;
    s->rotation_cos = rotation_cos;
    s->rotation_sin = rotation_sin;
    for (int axis = 0; axis < 2; axis++)
        s->pivot_mm[axis] = turned ? s->base_mm[axis] + s->turned_about_mm[axis] : offset_mm[axis];
    stand_with_tip_at(s, tip_mm);
}

/* Note how far the zero was moved; the first of each kind is kept. */
static void note_moved(Block *b, int which, const double before_mm[3], const double after_mm[3]) {
    State *s = b->state;
    double *moved_mm = &s->moved_mm[3 * (which - S_NOTE_LOCAL)];
    if (before_mm[0] == after_mm[0] && before_mm[1] == after_mm[1] && before_mm[2] == after_mm[2])
        return;
    for (int axis = 0; axis < 3 && s->note_count[which] == 0; axis++)
        moved_mm[axis] = after_mm[axis] - before_mm[axis];
    note(b, which, b->shift ? 0 : b->g[V_NON_MODAL]);
}

/* --- what is set by the position ------------------------------------------------------------------------ */

/* Report axes by whose unknown position the zero is set; before any move a zero that stays is the usual header. */
static void report_unknown(Block *b, int32_t unknown, bool stays) {
    const Says says = {.a = b->g[V_NON_MODAL], .b = unknown << V_WORD_X};
    if (unknown == 0)
        return;
    report_unless(b, S_DOUBT_POSITION, stays && b->counts->rows == 1 ? FO_AT_START : FO_FROM_UNKNOWN, says);
}

/* Bits of the named axes whose programmed position is not known; X and Y depend on each other if `together`. */
static int32_t unknown_axes(const Block *b, bool together) {
    const State *s = b->state;
    const int32_t known = s->known_x | s->known_y << 1 | s->known_z << 2;
    const int32_t named = b->has[V_WORD_X] | b->has[V_WORD_Y] << 1 | b->has[V_WORD_Z] << 2;
    const bool plane = together && (named & ALL_OF_X_AND_Y);
    return (named | (plane ? ALL_OF_X_AND_Y : 0)) & ~known;
}

/* --- G52 and G92 ---------------------------------------------------------------------------------------- */

/* Return the shift that an axis has behind the block without a word of its own: TRANS clears it. */
static double shift_without_word(const Block *b, int axis) {
    return b->shift == D_SHIFT_SET ? 0.0 : b->state->shift_mm[axis];
}

/* G52 and TRANS shift the zero by the words, ATRANS further by them, G92 so that the tool stands at the words. */
static void shift_by_words(Block *b, bool by_position) {
    State *s = b->state;
    const double *offset_mm = offset_of(b->machine, s->work_offset), here_mm[3] = {s->x, s->y, s->z};
    double shift_mm[3];
    bool stays = true;
    for (int axis = 0; axis < 3; axis++) {
        shift_mm[axis] = shift_without_word(b, axis);
        if (!b->has[V_WORD_X + axis])
            continue;
        const double value_mm = b->word[V_WORD_X + axis] * s->unit_mm;
        shift_mm[axis] = by_position ? here_mm[axis] - offset_mm[axis] - value_mm : value_mm;
        if (b->shift == D_SHIFT_ADD)
            shift_mm[axis] += s->shift_mm[axis];
        stays = stays && shift_mm[axis] == s->shift_mm[axis];
    }
    if (by_position)
        report_unknown(b, unknown_axes(b, false), stays);
    if (b->shift == D_SHIFT_SET) /* TRANS stands for the whole frame of the program */
        s->turned_deg = 0.0, s->mirrored = 0;
    note_moved(b, by_position ? S_NOTE_SHIFT : S_NOTE_LOCAL, s->shift_mm, shift_mm);
    for (int axis = 0; axis < 3; axis++)
        s->shift_mm[axis] = s->shift_kept_mm[axis] = shift_mm[axis];
}

/* G92.1 clears the shift, G92.2 suspends it, G92.3 restores what was suspended. */
void shift_by_code(Block *b) {
    State *s = b->state;
    const int32_t code = b->g[V_SHIFT_STATE];
    for (int axis = 0; axis < 3; axis++) {
        s->shift_mm[axis] = code == V_G92_3 ? s->shift_kept_mm[axis] : 0.0;
        if (code == V_G92_1)
            s->shift_kept_mm[axis] = 0.0;
    }
    s->shift_line = b->line;
    take_offsets(b->machine);
}

/* --- G10 L2 and L20 ------------------------------------------------------------------------------------- */

/* Find where the tip stands in a work offset, the shift taken off. */
static void position_in(const Block *b, const double *offset_mm, double mm[3]) {
    const State *s = b->state;
    const double angle = in_rad(offset_mm[OFFSET_ROTATION]);
    double tip_mm[3];
    tip_position(s, tip_mm);
    const double x = tip_mm[0] - offset_mm[0], y = tip_mm[1] - offset_mm[1];
    mm[0] = cos(angle) * x + sin(angle) * y - s->shift_mm[0];
    mm[1] = cos(angle) * y - sin(angle) * x - s->shift_mm[1];
    mm[2] = tip_mm[2] - offset_mm[2] - s->shift_mm[2];
}

/* Move a work offset so that the tool stands at the words in it. */
static void set_by_position(Block *b, double *offset_mm) {
    const State *s = b->state;
    const double angle = in_rad(offset_mm[OFFSET_ROTATION]);
    double here_mm[3], by_mm[3];
    position_in(b, offset_mm, here_mm);
    bool stays = true;
    for (int axis = 0; axis < 3; axis++) {
        const bool named = b->has[V_WORD_X + axis];
        by_mm[axis] = named ? here_mm[axis] - b->word[V_WORD_X + axis] * s->unit_mm : 0.0;
        stays = stays && by_mm[axis] == 0.0;
    }
    report_unknown(b, unknown_axes(b, s->rotated || offset_mm[OFFSET_ROTATION] != 0.0), stays);
    offset_mm[0] += cos(angle) * by_mm[0] - sin(angle) * by_mm[1];
    offset_mm[1] += sin(angle) * by_mm[0] + cos(angle) * by_mm[1];
    offset_mm[2] += by_mm[2];
}

/* Move a work offset to the words, and rotate it by R degrees. */
static void set_by_words(const Block *b, double *offset_mm) {
    for (int axis = 0; axis < 3; axis++)
        if (b->has[V_WORD_X + axis])
            offset_mm[axis] = b->word[V_WORD_X + axis] * b->state->unit_mm;
    if (b->has[V_WORD_R])
        offset_mm[OFFSET_ROTATION] = b->word[V_WORD_R];
}

/* Tell whether R turns the work offset in force while G52 or G92 shifts it: LinuxCNC then takes the tool to stand
   elsewhere than it does. */
static bool turns_under_shift(const Block *b, int32_t system) {
    const State *s = b->state;
    return b->has[V_WORD_R] && system == s->work_offset && (s->shift_mm[0] != 0.0 || s->shift_mm[1] != 0.0) &&
           b->word[V_WORD_R] != offset_of(b->machine, system)[OFFSET_ROTATION];
}

static void set_offset(Block *b, int32_t l, int32_t p) {
    State *s = b->state;
    if (p == NOT_WHOLE || p > WORK_OFFSETS || !b->has[V_WORD_P]) {
        report(b, FO_WRONG_SYSTEM, (Says){.a = l});
        s->doubt |= S_DOUBT_POSITION;
        return;
    }
    if (l == V_L_OFFSET_FROM_POSITION && b->has[V_WORD_R]) {
        report(b, FO_ROTATION_BY_POSITION, (Says){0});
        return;
    }
    if (b->has[V_WORD_R] && b->word[V_WORD_R] != 0.0 && b->machine->rotary_axes) {
        report(b, FO_ROTATION_WITH_ROTARY, (Says){.a = b->word[V_WORD_R]});
        return;
    }
    const int32_t system = p == 0 ? s->work_offset : p - 1;
    double *offset_mm = offset_of(b->machine, system);
    const double before_mm[3] = {offset_mm[0], offset_mm[1], offset_mm[2]};
    const double rotation = offset_mm[OFFSET_ROTATION];
    if (turns_under_shift(b, system)) {
        s->known_x = s->known_y = 0;
        s->turned_under_shift = 1;
    }
    if (l == V_L_OFFSET)
        set_by_words(b, offset_mm);
    else
        set_by_position(b, offset_mm);
    if (offset_mm[OFFSET_ROTATION] != rotation)
        note(b, S_NOTE_TABLE, V_G10);
    else
        note_moved(b, S_NOTE_TABLE, before_mm, offset_mm);
    AT(b->machine->offset_known, system) = true;
}

static void g10(Block *b) {
    const int32_t l = whole(b->word[V_WORD_L]), p = whole(b->word[V_WORD_P]);
    b->used[V_WORD_L] = b->used[V_WORD_P] = true;
    if (!b->has[V_WORD_L]) {
        report(b, FO_WITHOUT_L, (Says){0});
    } else if (l == V_L_OFFSET || l == V_L_OFFSET_FROM_POSITION) {
        b->used[V_WORD_R] = true;
        set_offset(b, l, p);
        return;
    } else if (l == V_L_TOOL || l == V_L_TOOL_FROM_POSITION || l == V_L_TOOL_FROM_FIXTURE) {
        b->used[V_WORD_R] = b->used[V_WORD_Q] = b->used[V_WORD_I] = b->used[V_WORD_J] = true; /* of a lathe's tools */
        set_tool(b, l, b->has[V_WORD_P] ? p : NOT_WHOLE);
        return;
    } else {
        report(b, FO_UNKNOWN_L, (Says){.a = b->word[V_WORD_L]});
    }
    b->used[V_WORD_R] = b->used[V_WORD_Q] = b->used[V_WORD_I] = b->used[V_WORD_J] = true;
    b->state->doubt |= S_DOUBT_POSITION;
}

/* --- the block ------------------------------------------------------------------------------------------ */

/* Report rotary axes in a block that sets an offset; return whether there are any. */
bool offsets_rotary(Block *b) {
    int32_t named = 0;
    for (int k = 0; k < V_ROTARY_AXES; k++)
        if (is_declared(b->machine, k) && b->has[V_WORD_A + k])
            named |= 1 << (V_WORD_A + k);
    if (named == 0)
        return false;
    const int32_t length = b->g[V_LENGTH_OFFSET];
    const bool by_length = length == V_G43_1 || length == V_G43_2;
    report(b, FO_ROTARY, (Says){.a = named, .b = by_length ? length : b->g[V_NON_MODAL]});
    return true;
}

/* Tell whether the axis words of a block belong to a code that sets an offset. */
bool takes_axes(const Block *b, bool any_axis) {
    const int32_t special = b->g[V_NON_MODAL], length = b->g[V_LENGTH_OFFSET];
    return special == V_G10 || special == V_G52 || special == V_G92 || length == V_G43_1 ||
           (length == V_G43_2 && any_axis);
}

/* Carry out G10, G52 and G92; the tip stands still. */
void offset_codes(Block *b, bool any_axis) {
    State *s = b->state;
    const int32_t code = b->g[V_NON_MODAL];
    if ((code == V_G52 || code == V_G92) && !any_axis && b->shift != D_SHIFT_SET) {
        report(b, FO_NO_AXES, (Says){.a = code});
        return;
    }
    switch (code) {
    case V_G10: g10(b); break;
    case V_G52: shift_by_words(b, false); break;
    case V_G92: shift_by_words(b, true); break;
    default: return;
    }
    if (code != V_G10)
        s->shift_line = b->line;
    take_offsets(b->machine);
}
