/* Everything of a block before its motion, in the order of RS274/NGC. */

#include "gcode/settings.h"

#include "gcode/compensate.h"
#include "gcode/cutter_settings.h"
#include "gcode/offsets.h"
#include "gcode/reporting.h"
#include "gcode/rotary.h"
#include "gcode/saved_modes.h"
#include "gcode/tool_lengths.h"

/* Tell whether an M-code stops or ends the program. */
bool stops(int32_t m) { return m == V_M0 || m == V_M1 || m == V_M2 || m == V_M30 || m == V_M60; }

/* --- feed and speed ------------------------------------------------------------------------------------- */

static void feed_mode(Block *b) {
    State *s = b->state;
    s->feed_mode = b->g[V_FEED_MODE] / V_TENFOLD;
    s->feed = 0.0; /* as LinuxCNC: naming a feed mode drops the feed, even the same mode */
    s->feed_mode_line = b->line;
    s->doubt &= ~(S_DOUBT_FEED_MODE | S_DOUBT_FEED);
}

static void feed(Block *b, double f) {
    State *s = b->state;
    b->used[V_WORD_F] = true;
    if (f < 0.0) {
        report(b, F_NEGATIVE_FEED, (Says){.a = f});
        s->doubt |= S_DOUBT_FEED;
        return;
    }
    s->feed = s->feed_mode == V_INVERSE_TIME ? f : f * s->unit_mm;
    s->feed_word = f;
    s->doubt &= ~S_DOUBT_FEED;
}

static void speed(Block *b, double rpm) {
    State *s = b->state;
    b->used[V_WORD_S] = true;
    if (rpm < 0.0) {
        report(b, F_NEGATIVE_SPEED, (Says){.a = rpm});
        s->doubt |= S_DOUBT_SPEED;
        return;
    }
    const bool changed = s->rpm != rpm;
    s->rpm = rpm;
    s->doubt &= ~S_DOUBT_SPEED;
    if (changed && s->direction != 0)
        event(b, S_EVENT_SPINDLE, rpm * s->direction, s->direction < 0 ? V_M4 : V_M3);
}

/* --- tools and their lengths ---------------------------------------------------------------------------- */

static void select_tool(Block *b, double t) {
    b->used[V_WORD_T] = true;
    const int32_t tool = whole(t);
    if (tool == NOT_WHOLE) {
        report(b, F_BAD_INTEGER, (Says){.a = V_WORD_T + 'A'});
        b->state->doubt |= S_DOUBT_TOOL;
        return;
    }
    b->state->selected_tool = tool;
    b->state->selected_line = b->line;
    b->state->doubt &= ~S_DOUBT_TOOL;
}

static void change_tool(Block *b) {
    State *s = b->state;
    if (s->selected_tool < 0) {
        report_unless(b, S_DOUBT_TOOL, F_TOOL_NOT_SELECTED, (Says){0});
        return;
    }
    if (s->direction != 0) { /* a tool change stops the spindle, with or without M5 */
        s->direction = 0;
        event(b, S_EVENT_SPINDLE, 0.0, S_IMPLIED_M5);
    }
    stand_beside(s);
    s->tool = s->selected_tool;
    event(b, S_EVENT_TOOL, s->tool, 0.0);
    double length_mm = length_of(b->machine, s->tool);
    if (s->tool > 0 && isnan(length_mm)) {
        report(b, F_TOOL_UNDECLARED, (Says){.a = s->tool});
        length_mm = 0.0;
    }
    if (b->machine->lengths_from_table) { /* as if G43 stood here */
        set_length_offset(s, s->tool > 0 ? length_mm : NAN);
        s->offset_tool = s->tool > 0 ? s->tool : -1;
    }
}

/* G43, with H or for the tool in the spindle. */
static void apply_length(Block *b) {
    State *s = b->state;
    const int32_t there = b->state->tool;
    int32_t tool = there;
    if (b->has[V_WORD_H]) {
        b->used[V_WORD_H] = true;
        tool = whole(b->word[V_WORD_H]);
        if (tool == NOT_WHOLE) {
            report(b, F_BAD_INTEGER, (Says){.a = V_WORD_H + 'A'});
            s->doubt |= S_DOUBT_Z;
            return;
        }
        if (tool != there && tool != 0)
            report(b, F_H_DIFFERS, (Says){.a = tool, .b = there});
        if (tool == 0)
            tool = there;
    }
    double length_mm = length_of(b->machine, tool);
    if (isnan(length_mm)) {
        if (tool > 0 && tool != there)
            report(b, F_TOOL_UNDECLARED, (Says){.a = tool});
        length_mm = 0.0;
    }
    set_length_offset(s, length_mm);
    s->offset_tool = tool;
}

static void length_offset(Block *b) {
    const int32_t code = b->g[V_LENGTH_OFFSET];
    if (code >= 0 && !take_length_code(b, code))
        return;
    if (code == V_G43 || code == V_G43_4 || code == V_G43_5) {
        apply_length(b);
    } else if (code == V_G43_1) {
        length_by_words(b);
    } else if (code == V_G43_2) {
        length_added(b);
    } else if (code == V_G49 && !(b->machine->lengths_from_table && b->state->tool > 0)) {
        set_length_offset(b->state, NAN);
        b->state->offset_tool = -1;
    }
}

/* --- M-codes that do not stop the program --------------------------------------------------------------- */

static void spindle(Block *b, int32_t m) {
    State *s = b->state;
    s->direction = m == V_M3 ? 1 : m == V_M4 ? -1 : 0;
    event(b, S_EVENT_SPINDLE, s->rpm * s->direction, m);
}

static void coolant(Block *b, int32_t m) {
    State *s = b->state;
    if (m == V_M7)
        s->mist = 1;
    else if (m == V_M9)
        s->mist = s->flood = 0;
    else
        s->flood = 1;
    event(b, S_EVENT_COOLANT, m, s->mist + 2 * s->flood);
}

/* Tell whether a block has nothing but one M-code. */
static bool is_alone(const Block *b) {
    int count = 0;
    for (int index = 0; index < V_LETTERS; index++)
        count += b->has[index];
    for (int k = 0; k < V_GROUPS; k++)
        count += b->g[k] >= 0;
    for (int k = 0; k < V_M_CODES; k++)
        count += b->m_codes[k] >= 0;
    return count == 1;
}

/* M61 to M73. */
static void own_code(Block *b, int32_t m) {
    if (m == V_M61)
        set_tool_number(b);
    else if (m < V_M70)
        switch_output(b, m);
    else if (m != V_M72)
        save_modes(b, m);
    else if (is_alone(b))
        restore_modes(b);
    else
        report(b, FM_RESTORE_BESIDE, (Says){0});
}

/* One M-code for spindle, coolant or overrides, or one that the cell maps to KRL. */
static void switch_on_or_off(Block *b, int32_t m) {
    if (is_own_m(b->machine, m)) {
        own_code(b, m);
    } else if (m >= V_M3 && m <= V_M5) {
        spindle(b, m);
    } else if (m >= V_M7 && m <= V_M9) {
        coolant(b, m);
    } else if (m >= V_M48 && m <= V_M53) {
        b->used[V_WORD_P] |= b->has[V_WORD_P];
        note(b, S_NOTE_OVERRIDE, m);
    } else {
        b->used[V_WORD_P] |= b->has[V_WORD_P];
        b->used[V_WORD_Q] |= b->has[V_WORD_Q];
        event_of_words(b, m);
    }
}

static void m_codes(Block *b) {
    for (int k = 0; k < V_M_CODES; k++)
        if (b->m_codes[k] == V_M6)
            change_tool(b);
    for (int k = 0; k < V_M_CODES; k++)
        if (b->m_codes[k] >= 0 && b->m_codes[k] != V_M6 && !stops(b->m_codes[k]))
            switch_on_or_off(b, b->m_codes[k]);
}

/* --- modes ---------------------------------------------------------------------------------------------- */

static void plane_and_unit(Block *b) {
    State *s = b->state;
    if (b->g[V_PLANE] >= 0) {
        s->plane = b->g[V_PLANE] / V_TENFOLD;
        s->doubt &= ~S_DOUBT_PLANE;
    }
    if (b->g[V_UNIT] >= 0) {
        const double unit_mm = b->g[V_UNIT] == V_G20 ? U_MM_PER_INCH : 1.0;
        if (unit_mm != s->unit_mm)
            s->feed_of_other_unit = s->feed;
        s->unit_mm = unit_mm;
        s->unit_named = 1;
        s->doubt &= ~S_DOUBT_UNIT;
    }
}

/* G54 to G59.3 are offsets 0 to 8; a G54 that the cell does not state is zero, which is no finding. */
static void select_offset(Block *b, int32_t code) {
    State *s = b->state;
    s->zero_in_doubt = 0;
    s->work_offset = b->offset_code ? b->offset : offset_of_code(code);
    if (!AT(b->machine->offset_known, s->work_offset) && s->work_offset > 0)
        report(b, F_OFFSET_UNKNOWN, (Says){.a = b->offset_code ? b->offset_code : code});
    take_offsets(b->machine);
}

/* G61, G61.1, and G64 with its tolerance P. */
static void path_control(Block *b, int32_t code) {
    State *s = b->state;
    s->exact_stop = code != V_G64;
    s->tolerance = NAN;
    if (code != V_G64)
        return;
    b->used[V_WORD_Q] |= b->has[V_WORD_Q];
    if (!b->has[V_WORD_P])
        return;
    b->used[V_WORD_P] = true;
    if (b->word[V_WORD_P] < 0.0)
        report(b, F_NEGATIVE_TOLERANCE, (Says){.a = b->word[V_WORD_P]});
    else
        s->tolerance = b->word[V_WORD_P] * s->unit_mm;
}

static void distance_modes(Block *b) {
    State *s = b->state;
    if (b->g[V_DISTANCE] >= 0) {
        s->absolute = b->g[V_DISTANCE] == V_G90;
        s->distance_line = b->line;
        s->doubt &= ~S_DOUBT_DISTANCE;
    }
    if (b->g[V_CENTRE] >= 0) {
        s->arc_absolute = b->g[V_CENTRE] == V_G90_1;
        s->doubt &= ~S_DOUBT_CENTRE;
    }
    if (b->g[V_RETRACT] >= 0) {
        s->retract = b->g[V_RETRACT];
        s->retract_line = b->line;
    }
}

/* Take over all modes and values of a block; `used` notes which words have been used. */
void apply_settings(Block *b) {
    if (b->g[V_FEED_MODE] >= 0)
        feed_mode(b);
    if (b->has[V_WORD_F])
        feed(b, b->word[V_WORD_F]);
    if (b->has[V_WORD_S])
        speed(b, b->word[V_WORD_S]);
    if (b->has[V_WORD_T])
        select_tool(b, b->word[V_WORD_T]);
    refuse_before_compensation(b);
    m_codes(b);
    plane_and_unit(b);
    cutter_compensation(b);
    length_offset(b);
    take_tip_code(b);
    if (b->g[V_WORK_OFFSET] >= 0)
        select_offset(b, b->g[V_WORK_OFFSET]);
    if (b->g[V_PATH_CONTROL] >= 0)
        path_control(b, b->g[V_PATH_CONTROL]);
    distance_modes(b);
}
