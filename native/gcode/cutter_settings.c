/* G40 to G42.1: side and radius of cutter compensation, and what is refused while it is on. */

#include "gcode/cutter_settings.h"

#include "gcode/compensate.h"
#include "gcode/feed.h"
#include "gcode/reporting.h"
#include "gcode/rotary.h"
#include "gcode/tool_lengths.h"

/* From this difference on the diameter is not that of the tool in the spindle. */
static const double OTHER_DIAMETER_MM = 1e-6;

/* Refuse a code, ten times its number, that must not stand while compensation is on; an M-code is below 0. */
void refuse_under_compensation(Block *b, int32_t code) {
    const State *s = b->state;
    report(b, F_CUTTER_ON, (Says){.a = code, .b = s->cutter_code, .c = s->cutter_line});
}

/* --- what is refused ------------------------------------------------------------------------------------ */

/* Refuse what comes before G40 in the order of execution: a tool change, another plane. */
void refuse_before_compensation(Block *b) {
    State *s = b->state;
    const int32_t plane = b->g[V_PLANE];
    if (!(s->cutter_mode & S_CUTTER_ON))
        return;
    for (int k = 0; k < V_M_CODES; k++)
        if (b->m_codes[k] == V_M6)
            refuse_under_compensation(b, -V_M6 * V_TENFOLD);
    if (plane >= 0 && plane / V_TENFOLD != s->plane) {
        refuse_under_compensation(b, plane);
        s->cutter_mode = 0;
    }
}

/* Refuse what comes behind G40: everything that moves or measures the coordinates anew. */
static void refuse_behind_compensation(Block *b) {
    static const int32_t GROUPS[] = {V_LENGTH_OFFSET, V_WORK_OFFSET, V_PATH_CONTROL, V_RETRACT, V_NON_MODAL,
                                     V_SHIFT_STATE};
    if (!(b->state->cutter_mode & S_CUTTER_ON))
        return;
    for (size_t k = 0; k < sizeof GROUPS / sizeof *GROUPS; k++) {
        const int32_t code = b->g[GROUPS[k]];
        if (code >= 0 && code != V_G4 && code != V_G53) /* G53 where it moves */
            refuse_under_compensation(b, code);
    }
}

/* --- the diameter --------------------------------------------------------------------------------------- */

/* Find the diameter for G41 and G42: that of tool D, or of the tool in the spindle; NaN after a report. */
static double tool_diameter(Block *b, int32_t code) {
    const int32_t there = b->state->tool;
    int32_t tool = there;
    if (b->has[V_WORD_D]) {
        tool = whole(b->word[V_WORD_D]);
        if (tool == NOT_WHOLE) {
            report(b, F_BAD_INTEGER, (Says){.a = V_WORD_D + 'A'});
            return NAN;
        }
        if (tool == 0)
            tool = there;
    }
    const double diameter_mm = diameter_of(b->machine, tool);
    if (tool == 0)
        report_unless(b, S_DOUBT_TOOL, F_CUTTER_NO_TOOL, (Says){.a = code});
    else if (isnan(diameter_mm))
        report_unless(b, S_DOUBT_TOOL, F_CUTTER_NO_DIAMETER, (Says){.a = code, .b = tool});
    return tool == 0 ? NAN : diameter_mm;
}

/* Find the diameter that a Fanuc's D stands for: the offset of the tool in the spindle, whose number it has. */
static double offset_diameter(Block *b) {
    const int32_t there = b->state->tool, d = b->state->cutter_d;
    if (d == 0)
        return 0.0;
    if (d != there) {
        report_unless(b, S_DOUBT_TOOL, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_D});
        return NAN;
    }
    return tool_diameter(b, V_G41);
}

static double diameter(Block *b, int32_t code) {
    if (b->machine->d_holds)
        return offset_diameter(b);
    if (code == V_G41 || code == V_G42)
        return tool_diameter(b, code);
    if (b->has[V_WORD_D])
        return b->word[V_WORD_D] * b->state->unit_mm;
    report(b, F_CUTTER_NO_D, (Says){.a = code});
    return NAN;
}

/* Keep a diameter that is not that with which the tool in the spindle cuts, until a move is made with it. */
static void compare_with_tool(Block *b, double diameter_mm) {
    const double in_cell_mm = of_tool(b->machine->cutter_diameter_mm, b->state->tool);
    if (fabs(diameter_mm - in_cell_mm) > OTHER_DIAMETER_MM)
        b->state->cutter_other_mm[0] = diameter_mm, b->state->cutter_other_mm[1] = in_cell_mm;
}

/* Tell whether a block names an axis of the plane of compensation. */
static bool names_plane(const Block *b) {
    return b->has[V_WORD_X] || b->has[b->state->plane == V_PLANE_XY ? V_WORD_Y : V_WORD_Z];
}

/* Warn of the other diameter where a block cuts in the plane of compensation. */
void tell_other_diameter(Block *b) {
    State *s = b->state;
    const double *other_mm = s->cutter_other_mm;
    const bool centre = b->has[V_WORD_I] || b->has[V_WORD_J] || b->has[V_WORD_K];
    if (other_mm[0] == other_mm[1] || !(names_plane(b) || centre) || s->motion == V_MOTION_RAPID)
        return;
    report_at(b, s->cutter_line, F_CUTTER_DIFFERS,
              (Says){.a = s->cutter_code, .b = other_mm[0], .c = other_mm[1]});
    s->cutter_other_mm[0] = s->cutter_other_mm[1] = 0.0;
}

/* --- on and off ----------------------------------------------------------------------------------------- */

/* Return the speed of the shift that a block with G40, G41 or G42 alone makes by itself, 0 where it leads across the tool. */
static double speed_of_shift(Block *b) {
    const State *s = b->state;
    const int32_t motion = b->g[V_MOTION] >= 0 ? b->g[V_MOTION] / V_TENFOLD : s->motion;
    const bool along = b->has[V_WORD_Z] || b->has[V_WORD_Y] || b->g[V_NON_MODAL] >= 0;
    double mm_s = INFINITY;
    if (names_plane(b))
        return 0.0;
    if (along || motion > V_MOTION_LINE || s->feed_mode == V_INVERSE_TIME)
        report(b, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_SHIFT_ALONE});
    else if (motion == V_MOTION_LINE && feed_speed(b, s->cutter_radius_mm, &mm_s) != F_OK)
        report_speed(b, feed_speed(b, s->cutter_radius_mm, &mm_s));
    return mm_s;
}

/* G40: the offset goes with the next move, or at once. */
static void turn_off(Block *b) {
    State *s = b->state;
    const bool on = s->cutter_mode & S_CUTTER_ON;
    s->cutter_other_mm[0] = s->cutter_other_mm[1] = 0.0;
    if (on && s->cutter_ways & S_WAY_KONT)
        report(b, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_KONT});
    if (on && compensates(s) && b->machine->shifts_alone && !s->cutter_entered && s->cutter_shift_mm_s != 0.0)
        report(b, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_SHIFT_ALONE});
    end_compensation(b);
    const double mm_s = s->cutter_mode & S_CUTTER_BESIDE && on && b->machine->shifts_alone ? speed_of_shift(b) : 0.0;
    if (mm_s != 0.0)
        shift_back(b, mm_s);
}

/* Turn compensation on; after a fault by a radius of 0, so that what follows is judged by its own faults. */
static void turn_on(Block *b, int32_t code) {
    State *s = b->state;
    if (s->plane == V_PLANE_YZ)
        report_unless(b, S_DOUBT_PLANE, F_CUTTER_PLANE, (Says){.a = code});
    if (s->rotated)
        report(b, F_CUTTER_ROTATED, (Says){.a = code});
    if (is_turned(s) || s->length_code == V_G43_5)
        report(b, F_CUTTER_TURNED, (Says){.a = code});
    if (b->has[V_WORD_L])
        report(b, F_CUTTER_LATHE, (Says){0});
    if (s->cutter_ways & S_WAY_KONT)
        report(b, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_KONT});
    const double diameter_mm = diameter(b, code);
    s->cutter_mode |= S_CUTTER_ON;
    s->cutter_code = code;
    s->cutter_line = b->line;
    s->cutter_side = (code < V_G42 ? 1 : -1) * (diameter_mm < 0.0 ? -1 : 1);
    const bool moves_nothing = isnan(diameter_mm) || s->plane == V_PLANE_YZ || b->machine->d_holds == D_D_IS_WEAR;
    s->cutter_radius_mm = moves_nothing ? 0.0 : 0.5 * fabs(diameter_mm);
    s->cutter_entered = s->cutter_failed = s->cutter_led = 0;
    s->cutter_idle = 0;
    s->cutter_shift_mm_s = b->machine->shifts_alone ? speed_of_shift(b) : 0.0;
    s->cutter_other_mm[0] = s->cutter_other_mm[1] = 0.0;
    if (!isnan(diameter_mm) && b->machine->d_holds != D_D_IS_WEAR)
        compare_with_tool(b, diameter_mm);
}

/* Carry out G40, G41, G42, G41.1 or G42.1 of a block, and refuse what must not stand beside or under them. */
void cutter_compensation(Block *b) {
    const int32_t code = b->g[V_RADIUS_COMPENSATION];
    if (code == V_G40) {
        turn_off(b);
    } else if (code >= 0) {
        b->used[V_WORD_D] |= b->has[V_WORD_D];
        b->used[V_WORD_L] |= b->has[V_WORD_L];
        if (b->state->cutter_mode & S_CUTTER_ON && b->machine->lead && code == b->state->cutter_code)
            return; /* it says what is in force */
        if (b->state->cutter_mode & S_CUTTER_ON)
            refuse_under_compensation(b, code);
        else
            turn_on(b, code);
    }
    refuse_behind_compensation(b);
}
