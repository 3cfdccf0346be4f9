/* M70 to M73: modes that are saved and restored, each level of calls for itself; M61 and M62 to M68: tool number
   and outputs.

   All modes but that of motion come back, as in LinuxCNC; so does the feed, but where the feed mode has changed and
   the feed has not: naming a feed mode drops it. A tool length comes back as G43 or G49 brings it. */

#include "gcode/saved_modes.h"

#include "gcode/cutter_settings.h"
#include "gcode/cycles.h"
#include "gcode/offsets.h"
#include "gcode/reporting.h"
#include "gcode/tool_lengths.h"

static Modes *modes_of(const Machine *machine) { return &AT(machine->saved, machine->state.at->level); }

/* --- saved ---------------------------------------------------------------------------------------------- */

void forget_modes(Machine *machine) { modes_of(machine)->is_saved = modes_of(machine)->restored_on_return = 0; }

/* M70 and M73 save the modes of this level of calls, M71 forgets them. */
void save_modes(Block *b, int32_t m) {
    const State *s = b->state;
    if (m == V_M71) {
        forget_modes(b->machine);
        return;
    }
    *modes_of(b->machine) = (Modes){
        .is_saved = 1,
        .restored_on_return = m == V_M73,
        .unit_mm = s->unit_mm,
        .absolute = s->absolute,
        .arc_absolute = s->arc_absolute,
        .plane = s->plane,
        .feed_mode = s->feed_mode,
        .feed = s->feed,
        .feed_of_other_unit = s->feed_of_other_unit,
        .feed_word = s->feed_word,
        .rpm = s->rpm,
        .direction = s->direction,
        .mist = s->mist,
        .flood = s->flood,
        .length_offset = s->length_offset,
        .offset_tool = s->offset_tool,
        .length_code = s->length_code,
        .exact_stop = s->exact_stop,
        .tolerance = s->tolerance,
        .work_offset = s->work_offset,
        .retract = s->retract,
        .cutter_mode = s->cutter_mode,
    };
}

bool restores_on_return(const Machine *machine) {
    return machine->state.at->level > 0 && modes_of(machine)->restored_on_return;
}

/* --- restored ------------------------------------------------------------------------------------------- */

/* LinuxCNC brings back whether there is a length, and then takes that of the tool in the spindle. */
static double length_brought_back(const Block *b, const Modes *saved) {
    const double now_mm = b->state->length_offset;
    if (isnan(saved->length_offset) || !isnan(now_mm))
        return isnan(saved->length_offset) ? NAN : now_mm;
    const double own_mm = length_of(b->machine, b->state->tool);
    return isnan(own_mm) ? 0.0 : own_mm;
}

static bool is_turning_code(int32_t code) { return code == V_G43_4 || code == V_G43_5; }

/* Tell whether the tool length can come back as it was; else report it. */
static bool has_same_length(Block *b, const Modes *saved) {
    if (b->machine->lengths_from_table)
        return true;
    const double back_mm = length_brought_back(b, saved), was_mm = saved->length_offset;
    const int32_t now = b->state->length_code;
    const bool same_code = now == saved->length_code || (!is_turning_code(now) && !is_turning_code(saved->length_code));
    if (same_code && (back_mm == was_mm || (isnan(back_mm) && isnan(was_mm))))
        return true;
    report(b, FM_RESTORE_LENGTH, (Says){isnan(was_mm) ? 0.0 : was_mm, isnan(back_mm) ? 0.0 : back_mm, 0.0});
    return false;
}

static void restore_feed(State *s, const Modes *saved) {
    const bool dropped =
        s->feed_mode != saved->feed_mode && (s->feed == 0.0 || s->feed_word == saved->feed_word);
    s->feed_mode = saved->feed_mode;
    s->feed = dropped ? 0.0 : saved->feed;
    s->feed_of_other_unit = saved->feed_of_other_unit;
    s->feed_word = saved->feed_word;
}

static void restore_spindle(Block *b, const Modes *saved) {
    State *s = b->state;
    const bool changed = s->direction != saved->direction || (saved->direction && s->rpm != saved->rpm);
    s->rpm = saved->rpm;
    s->direction = saved->direction;
    if (changed)
        event(b, S_EVENT_SPINDLE, s->rpm * s->direction, s->direction > 0 ? V_M3 : s->direction < 0 ? V_M4 : V_M5);
}

/* Each of mist and flood that comes back is a switch of its own; M9 switches both off. */
static void restore_coolant(Block *b, const Modes *saved) {
    State *s = b->state;
    if ((s->mist && !saved->mist) || (s->flood && !saved->flood)) {
        s->mist = s->flood = 0;
        event(b, S_EVENT_COOLANT, V_M9, 0.0);
    }
    if (saved->mist && !s->mist) {
        s->mist = 1;
        event(b, S_EVENT_COOLANT, V_M7, s->mist + 2 * s->flood);
    }
    if (saved->flood && !s->flood) {
        s->flood = 1;
        event(b, S_EVENT_COOLANT, V_M7 + 1, s->mist + 2 * s->flood);
    }
}

static void restore_length(Block *b, const Modes *saved) {
    State *s = b->state;
    if (b->machine->lengths_from_table)
        return;
    if (isnan(s->length_offset) != isnan(saved->length_offset)) {
        set_length_offset(s, saved->length_offset);
        s->offset_tool = isnan(saved->length_offset) ? -1 : b->state->tool;
    }
    s->length_code = saved->length_code;
}

/* M72, and the end of a subprogram behind M73; return false, with a finding, where that cannot be. */
bool restore_modes(Block *b) {
    State *s = b->state;
    const Modes *saved = modes_of(b->machine);
    if (!saved->is_saved) {
        report(b, FM_NOT_SAVED, (Says){0});
        return false;
    }
    if ((s->cutter_mode | saved->cutter_mode) & S_CUTTER_ON) {
        report(b, FM_RESTORE_CUTTER, (Says){0});
        return false;
    }
    if (!has_same_length(b, saved))
        return false;
    s->unit_mm = saved->unit_mm;
    s->absolute = (int8_t)saved->absolute;
    s->arc_absolute = (int8_t)saved->arc_absolute;
    s->plane = saved->plane;
    restore_feed(s, saved);
    restore_spindle(b, saved);
    restore_coolant(b, saved);
    restore_length(b, saved);
    s->exact_stop = (int8_t)saved->exact_stop;
    s->tolerance = saved->tolerance;
    s->retract = saved->retract;
    if (s->work_offset != saved->work_offset) {
        s->work_offset = saved->work_offset;
        take_offsets(b->machine);
    }
    return true;
}

/* --- tool number and outputs ---------------------------------------------------------------------------- */

/* M61 Q: nothing changes the tool, so it must be the one that is in the spindle. */
void set_tool_number(Block *b) {
    State *s = b->state;
    b->used[V_WORD_Q] |= b->has[V_WORD_Q];
    const int32_t tool = b->has[V_WORD_Q] ? whole(b->word[V_WORD_Q]) : NOT_WHOLE;
    if (tool == NOT_WHOLE) {
        report(b, F_BAD_INTEGER, (Says){.a = V_WORD_Q + 'A'});
        s->doubt |= S_DOUBT_TOOL;
        return;
    }
    if (tool != s->tool) {
        report(b, FM_TOOL_NUMBER, (Says){.a = tool, .b = s->tool});
        s->doubt |= S_DOUBT_TOOL;
    }
}

/* Tell whether another code of the block takes a word of an output; else report it. */
static bool shares_words(Block *b, int32_t m) {
    const int32_t motion = b->g[V_MOTION] >= 0 && b->g[V_MOTION] != V_G80 ? b->g[V_MOTION] / V_TENFOLD : b->state->motion;
    const bool by_motion = motion == V_MOTION_ARC_CW || motion == V_MOTION_ARC_CCW || is_cycle(motion);
    const bool moves = b->has[V_WORD_X] || b->has[V_WORD_Y] || b->has[V_WORD_Z] || b->has[V_WORD_I] ||
                       b->has[V_WORD_J] || b->has[V_WORD_K];
    const bool by_code = (b->g[V_NON_MODAL] >= 0 && b->g[V_NON_MODAL] != V_G53) || b->g[V_PATH_CONTROL] == V_G64;
    if (!by_code && !(by_motion && moves))
        return false;
    report(b, FM_IO_BESIDE, (Says){.a = m});
    return true;
}

/* M62 to M65 switch output P, M67 and M68 set output E to Q; in the robot each is the cell's own KRL. */
void switch_output(Block *b, int32_t m) {
    const bool sets_value = m == V_M67 || m == V_M68;
    const int number = sets_value ? V_WORD_E : V_WORD_P;
    if (shares_words(b, m))
        return;
    if ((m == V_M62 || m == V_M63 || m == V_M67) && b->state->cutter_mode & S_CUTTER_ON) {
        refuse_under_compensation(b, -m * V_TENFOLD);
        return;
    }
    b->used[number] |= b->has[number];
    if (sets_value)
        b->used[V_WORD_Q] |= b->has[V_WORD_Q];
    if (!b->has[number] || whole(b->word[number]) == NOT_WHOLE) {
        report(b, FM_IO_WORD, (Says){m, number + 'A', b->has[number] ? b->word[number] : NAN});
        return;
    }
    if (sets_value && !b->has[V_WORD_Q]) {
        report(b, FM_IO_VALUE, (Says){.a = m});
        return;
    }
    event_of_words(b, m);
}
