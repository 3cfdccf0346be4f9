/* Lengths that a program gives to tools: G43.1, G43.2, G10 L1, L10 and L11. */

#include "gcode/tool_lengths.h"

#include "gcode/offsets.h"
#include "gcode/reporting.h"
#include "gcode/rotary.h"

enum { FIXTURE = 8 }; /* G59.3, in which G10 L11 measures */
static const double LENGTH_SLACK_MM = 1e-3; /* rounding of a length in three decimals */

double length_of(const Machine *machine, int32_t tool) {
    return tool >= 0 && tool < machine->tool_length_mm.rows ? AT(machine->tool_length_mm, tool) : NAN;
}

/* G43, G49: the machine stands still, so the tip's coordinate moves by the difference. */
void set_length_offset(State *s, double length_mm) {
    const double old = length_offset_of(s), new = isnan(length_mm) ? 0.0 : length_mm;
    if (new != old) {
        s->z -= new - old;
        s->known_z = 0;
        if (is_turned(s))
            s->known_x = s->known_y = 0; /* the tip moves along the tool, not along Z */
    }
    s->length_offset = length_mm;
}

/* The robot's $TOOL has the declared length, whatever the program says. */
static void report_other_length(Block *b, int32_t tool, double length_mm) {
    const double declared_mm = length_of(b->machine, tool);
    if (tool > 0 && !isnan(declared_mm) && fabs(length_mm - declared_mm) > LENGTH_SLACK_MM)
        report(b, FO_LENGTH_DIFFERS, (Says){tool, length_mm, declared_mm});
}

/* Tell whether X and Y words leave the tool in its axis; report the first that does not. */
static bool is_along_tool(Block *b) {
    for (int axis = 0; axis < 2; axis++) {
        const int index = V_WORD_X + axis;
        if (!b->has[index] || b->word[index] == 0.0)
            continue;
        report(b, FO_TOOL_ACROSS, (Says){.a = index + 'A', .b = b->word[index]});
        b->state->doubt |= S_DOUBT_POSITION;
        return false;
    }
    return true;
}

/* The length in force is given by the program for the tool in the spindle. */
static void take_length(Block *b, double length_mm) {
    const int32_t tool = b->state->tool;
    report_other_length(b, tool, length_mm);
    set_length_offset(b->state, length_mm);
    b->state->offset_tool = tool;
}

/* G43.1: the length is the word Z, without it that in force. */
void length_by_words(Block *b) {
    if (is_along_tool(b))
        take_length(b, b->has[V_WORD_Z] ? b->word[V_WORD_Z] * b->state->unit_mm : length_offset_of(b->state));
}

/* G43.2: the length of another tool is added to that in force. */
void length_added(Block *b) {
    const bool has = b->has[V_WORD_X] || b->has[V_WORD_Y] || b->has[V_WORD_Z];
    const int32_t tool = b->has[V_WORD_H] ? whole(b->word[V_WORD_H]) : 0;
    b->used[V_WORD_H] = true;
    b->state->doubt |= has || !b->has[V_WORD_H] ? S_DOUBT_Z : 0;
    if (has)
        report(b, FO_ADDED_BY_WORDS, (Says){0});
    else if (!b->has[V_WORD_H])
        report(b, FO_ADDED_WITHOUT_H, (Says){0});
    else if (tool == NOT_WHOLE)
        report(b, F_BAD_INTEGER, (Says){.a = V_WORD_H + 'A'});
    else {
        const double length_mm = length_of(b->machine, tool);
        if (tool > 0 && isnan(length_mm))
            report(b, F_TOOL_UNDECLARED, (Says){.a = tool});
        take_length(b, length_offset_of(b->state) + (isnan(length_mm) ? 0.0 : length_mm));
    }
}

/* Return the length at which the tool that stands here reaches the word Z: in the work offset in force, or
   (L11) in G59.3 without the shift. */
static double length_by_position(const Block *b, int32_t l) {
    const State *s = b->state;
    const double nose_mm = s->z + length_offset_of(s), word_mm = b->word[V_WORD_Z] * s->unit_mm;
    if (l == V_L_TOOL_FROM_FIXTURE)
        return nose_mm - CELL(b->machine->offsets, FIXTURE, 2) - word_mm;
    return nose_mm - s->base_mm[2] - word_mm;
}

/* G10 L1 gives a tool its length, L10 and L11 by where it stands; R, the radius, is that of the cell's tool. */
void set_tool(Block *b, int32_t l, int32_t tool) {
    State *s = b->state;
    if (tool == NOT_WHOLE || tool == 0) {
        report(b, FO_WRONG_TOOL, (Says){.a = l});
        return;
    }
    if (isnan(length_of(b->machine, tool))) {
        report(b, FO_TOOL_UNDECLARED, (Says){.a = l, .b = tool});
        return;
    }
    if (!b->has[V_WORD_Z] && !b->has[V_WORD_R] && !b->has[V_WORD_X] && !b->has[V_WORD_Y]) {
        report(b, FO_NO_LENGTH, (Says){.a = l});
        return;
    }
    if (!is_along_tool(b) || !b->has[V_WORD_Z])
        return;
    if (l != V_L_TOOL && !s->known_z)
        report_unless(b, S_DOUBT_POSITION, FO_FROM_UNKNOWN,
                      (Says){.a = V_G10, .b = (double)(1 << V_WORD_Z)});
    const double length_mm = l == V_L_TOOL ? b->word[V_WORD_Z] * s->unit_mm : length_by_position(b, l);
    report_other_length(b, tool, length_mm);
    AT(b->machine->tool_length_mm, tool) = length_mm;
}
