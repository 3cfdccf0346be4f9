/* The parameters of a program: numbered and named, its own and those that show the state of the machine.

   Numbers and names are LinuxCNC's. What is a length is in the unit in force where it is a position, and in mm
   where it is an offset, as LinuxCNC keeps offsets in the unit of its machine. */

#include "gcode/parameters.h"

#include "gcode/block.h"
#include "gcode/offsets.h"

/* --- numbered ------------------------------------------------------------------------------------------- */

enum {
    FIRST_OF_STATE = 5161,
    HOME_28 = 5161,
    HOME_30 = 5181,
    SHIFT_ON = 5210,
    SHIFT = 5211,
    SYSTEM = 5220,
    FIRST_SYSTEM = 5221,
    OF_A_SYSTEM = 20,
    SYSTEMS = 9,
    LAST_OF_OFFSETS = 5390,
    TOOL = 5400,
    TOOL_OFFSET = 5401,
    OF_A_SYSTEM_ROTATION = 9,
    TOOL_DIAMETER = 5410,
    LAST_OF_TOOL = 5413,
    POSITION = 5420,
    LAST_OF_STATE = 5428
};

static const double *base_mm(const Machine *machine) {
    return machine->state.at->base_mm;
}

/* Return where the tool stands along an axis, in the work offset and the unit in force. */
static double programmed(const Machine *machine, int axis) {
    const State *s = machine->state.at;
    const double tip_mm[3] = {s->x, s->y, s->z};
    return (tip_mm[axis] - base_mm(machine)[axis]) / s->unit_mm;
}

static double of_work_offset(const Machine *machine, int64_t number) {
    const int64_t system = (number - FIRST_SYSTEM) / OF_A_SYSTEM, axis = (number - FIRST_SYSTEM) % OF_A_SYSTEM;
    const int64_t column = axis == OF_A_SYSTEM_ROTATION ? 3 : axis;
    return system < SYSTEMS && column <= 3 && (axis < 3 || column != axis) ? CELL(machine->offsets, system, column) : 0.0;
}

/* Return the diameter of the tool in the spindle, in mm; NaN where it is not declared, or in inches. */
static double diameter_in_spindle(const Machine *machine) {
    const State *s = machine->state.at;
    return s->unit_mm == 1.0 ? diameter_of(machine, s->tool) : NAN;
}

/* Return one of #5161 to #5428, which show the state of the machine. */
static double of_state(const Machine *machine, int64_t number) {
    const State *s = machine->state.at;
    if (number < HOME_28 + 3)
        return s->home_28[number - HOME_28];
    if (number >= HOME_30 && number < HOME_30 + 3)
        return s->home_30[number - HOME_30];
    if (number >= SHIFT && number < SHIFT + 3)
        return s->shift_kept_mm[number - SHIFT];
    if (number == SHIFT - 1)
        return s->shift_mm[0] != 0.0 || s->shift_mm[1] != 0.0 || s->shift_mm[2] != 0.0;
    if (number == SYSTEM)
        return s->work_offset + 1;
    if (number >= FIRST_SYSTEM && number <= LAST_OF_OFFSETS)
        return of_work_offset(machine, number);
    if (number == TOOL)
        return s->tool;
    if (number == TOOL_DIAMETER)
        return diameter_in_spindle(machine);
    if (number >= POSITION && number < POSITION + 3)
        return programmed(machine, (int)(number - POSITION));
    return 0.0;
}

/* Tell whether a parameter shows the state of the machine, which no assignment changes. */
bool is_read_only(int64_t number) {
    return (number >= FIRST_OF_STATE && number <= LAST_OF_OFFSETS) || (number >= TOOL && number <= LAST_OF_TOOL) ||
           (number >= POSITION && number <= LAST_OF_STATE);
}

/* Tell whether a parameter shows the place of the tool while that is beside the programmed one. */
static bool is_beside(const Machine *machine) { return machine->state.at->cutter_mode != 0; }

/* Tell whether a numbered parameter shows what is not known: the diameter, or a place under compensation. */
bool is_of_cutter(const Machine *machine, int64_t number) {
    return (number == TOOL_DIAMETER && isnan(diameter_in_spindle(machine))) || (number >= POSITION && number <= LAST_OF_STATE && is_beside(machine));
}

bool is_name_of_cutter(const Machine *machine, int64_t name) {
    return name >= N_X && name <= N_ABS_Z && is_beside(machine);
}

/* Tell whether a parameter is of a rotary or secondary axis. */
static bool is_of_other_axis(const Machine *machine, int64_t number) {
    enum { AXES = 9, LINEAR_AXES = 3 };
    const int64_t firsts[] = {HOME_28, HOME_30, SHIFT};
    if (number >= POSITION)
        return number >= POSITION + LINEAR_AXES && number <= LAST_OF_STATE;
    if (machine->rotary_axes == 0) /* none has moved: all of them are 0 */
        return false;
    for (int k = 0; k < 3; k++)
        if (number >= firsts[k] + LINEAR_AXES && number < firsts[k] + AXES)
            return true;
    const int64_t axis = (number - FIRST_SYSTEM) % OF_A_SYSTEM;
    return number >= FIRST_SYSTEM && number <= LAST_OF_OFFSETS && axis >= LINEAR_AXES && axis < AXES;
}

/* Tell whether a parameter is a length in the unit of the machine, whatever unit is in force. */
static bool is_in_machine_unit(int64_t number) {
    if (number < HOME_28 || number > LAST_OF_OFFSETS || number == SHIFT_ON || number == SYSTEM)
        return false;
    return number < FIRST_SYSTEM || (number - FIRST_SYSTEM) % OF_A_SYSTEM != OF_A_SYSTEM_ROTATION;
}

/* Tell whether controls differ about where the tool stands: in X and Y, behind a rotation under a shift. */
static bool is_turned(const State *s) { return s->turned_under_shift && !(s->known_x && s->known_y); }

/* Return why the value of a parameter cannot be told: a number of VALUE_FAULTS, KNOWN = it can. */
int fault_of_number(const Machine *machine, int64_t number) {
    if (is_of_other_axis(machine, number))
        return PF_OF_OTHER_AXIS;
    if ((number == POSITION || number == POSITION + 1) && is_turned(machine->state.at))
        return PF_TURNED_UNDER_SHIFT;
    if (number >= TOOL_OFFSET && number <= LAST_OF_TOOL && number != TOOL_DIAMETER)
        return PF_OF_TOOL_TABLE;
    return machine->state.at->unit_mm != 1.0 && is_in_machine_unit(number) ? PF_IN_MACHINE_UNIT : KNOWN;
}

/* The same for a name; its row is given. */
int fault_of_name(const Machine *machine, int64_t name) {
    const State *s = machine->state.at;
    if ((name == N_X || name == N_Y) && is_turned(s))
        return PF_TURNED_UNDER_SHIFT;
    if (name != N_FEED)
        return KNOWN;
    if (s->feed_mode == V_INVERSE_TIME)
        return PF_FEED_OF_TIME;
    return s->feed != 0.0 && s->feed == s->feed_of_other_unit ? PF_FEED_OF_OTHER_UNIT : KNOWN;
}

/* Keep the first place at which a parameter is read that nothing has set. */
void note_unset(const Evaluation *e, int64_t number) {
    State *s = e->machine->state.at;
    if (s->unset_line != 0)
        return;
    s->unset_line = e->line;
    s->unset_parameter = (int32_t)number;
}

/* Keep that the subprogram at hand reads an argument which its call does not give: the highest of its first such call. */
static void note_argument(const Evaluation *e, int64_t number) {
    const Program *p = e->program;
    const Frame *frame = &AT(p->frames, p->course.at->frame);
    if (!frame->has_arguments || (frame->given | frame->assigned) >> number & 1)
        return;
    Subprogram *called = &AT(p->subprograms, frame->subprogram);
    if (number <= called->missing || (called->missing != 0 && called->missing_line != frame->call_line))
        return;
    called->missing = (int32_t)number;
    called->missing_line = frame->call_line;
    called->missing_read = e->line;
    called->missing_given = frame->given;
}

/* Return a parameter's value: 0 where nothing has set it, as in LinuxCNC. */
double numbered_parameter(const Evaluation *e, int64_t number) {
    if (is_read_only(number))
        return of_state(e->machine, number);
    if (number <= P_LOCAL_PARAMETERS && !e->is_condition)
        note_argument(e, number);
    const double value = AT(e->program->parameters, number);
    if (!isnan(value))
        return value;
    note_unset(e, number);
    return 0.0;
}

/* --- names ---------------------------------------------------------------------------------------------- */

static uint8_t plain_character(uint8_t c) { return is_letter(c) ? c | CH_CASE_BIT : c; }

/* Return the row of a name, a new one where there is none; NO_NAME where there is no room. */
static int64_t row_of_name(Program *p, const uint8_t *name, int64_t length) {
    Course *at = p->course.at;
    uint64_t hash = 14695981039346656037u; /* FNV-1a */
    for (int64_t k = 0; k < length; k++)
        hash = (hash ^ name[k]) * 1099511628211u;
    const int64_t slots = p->name_slots.rows;
    int64_t slot = (int64_t)(hash % (uint64_t)slots);
    for (; AT(p->name_slots, slot) > 0; slot = (slot + 1) % slots) {
        const int64_t row = AT(p->name_slots, slot) - 1;
        const ParameterName *known = &AT(p->names, row);
        bool equal = known->hash == (int64_t)hash && known->length == length;
        for (int64_t k = 0; equal && k < length; k++)
            equal = AT(p->pool, known->start + k) == name[k];
        if (equal)
            return row;
    }
    if (at->names >= p->names.rows || at->pool + length > p->pool.rows)
        return NO_NAME;
    for (int64_t k = 0; k < length; k++)
        AT(p->pool, at->pool + k) = name[k];
    AT(p->names, at->names) = (ParameterName){(int64_t)hash, (int32_t)at->pool, (int32_t)length, 0.0, 0};
    at->pool += length;
    AT(p->name_slots, slot) = (int32_t)(++at->names);
    return at->names - 1;
}

/* Return the row of the name <…> that opens at i, and go behind it. */
int64_t name_at(Evaluation *e, int64_t *i) {
    const Bytes text = e->program->text;
    uint8_t name[P_LONGEST_NAME];
    int64_t length = 0, k = *i + 1;
    for (; k < e->end && AT(text, k) != '>'; k++) {
        if (is_blank(AT(text, k)))
            continue;
        if (AT(text, k) == '(' || AT(text, k) == ';') { /* LinuxCNC takes it into the name */
            wrong(e, F_EXPRESSION, PF_NAME_COMMENT, 0.0, k);
            return NO_NAME;
        }
        if (length == P_LONGEST_NAME) {
            wrong(e, F_EXPRESSION, PF_NAME_TOO_LONG, 0.0, *i);
            return NO_NAME;
        }
        name[length++] = plain_character(AT(text, k));
    }
    if (k >= e->end) {
        wrong(e, F_EXPRESSION, PF_NAME_UNCLOSED, 0.0, *i);
        return NO_NAME;
    }
    const int64_t row = row_of_name(e->program, name, length);
    if (row == NO_NAME)
        wrong(e, F_EXPRESSION, PF_TOO_MANY_NAMES, 0.0, *i);
    *i = k + 1;
    return row;
}

/* Give the names that show the state of the machine the first rows; they are the program's text, <a> <b> … */
EXPORT void gcode_set_names(Program *program) {
    Evaluation e = {.program = program, .end = program->text.rows};
    for (int64_t i = 0; i < e.end; i++) /* the end of a line stands between two */
        name_at(&e, &i);
}

/* A name with _ before it is known everywhere, another in its own call of a subprogram only. */
static bool is_global(const Program *p, int64_t name) {
    const ParameterName *row = &AT(p->names, name);
    return row->length > 0 && AT(p->pool, row->start) == '_';
}

static int64_t generation(const Program *p) { return AT(p->frames, p->course.at->frame).generation; }

bool is_name_set(const Evaluation *e, int64_t name) {
    const Program *p = e->program;
    if (name < N_PREDEFINED)
        return true;
    if (is_global(p, name))
        return AT(p->names, name).is_set != 0;
    return CELL(p->local_generation, p->course.at->frame, name) == generation(p);
}

static double of_modes(const State *s, int64_t name) {
    switch (name) {
    case N_MOTION_MODE: return s->motion == V_MOTION_CANCELLED ? V_G80 : s->motion * V_TENFOLD;
    case N_PLANE: return s->plane * V_TENFOLD;
    case N_CCOMP: return s->cutter_mode & S_CUTTER_ON ? s->cutter_code : V_G40;
    case N_METRIC: return s->unit_mm == 1.0;
    case N_IMPERIAL: return s->unit_mm != 1.0;
    case N_ABSOLUTE: return s->absolute != 0;
    case N_INCREMENTAL: return s->absolute == 0;
    case N_INVERSE_TIME: return s->feed_mode == V_INVERSE_TIME;
    case N_UNITS_PER_MINUTE: return s->feed_mode == V_PER_MINUTE;
    case N_UNITS_PER_REV: return s->feed_mode == V_PER_REVOLUTION;
    case N_COORD_SYSTEM:
        return s->work_offset < 6 ? V_G54 + V_TENFOLD * s->work_offset : V_G59 + s->work_offset - 5;
    case N_TOOL_OFFSET: return !isnan(s->length_offset) && s->length_offset != 0.0;
    case N_RETRACT_R_PLANE: return s->retract == V_G99;
    case N_RETRACT_OLD_Z: return s->retract != V_G99;
    case N_SPINDLE_RPM_MODE: return 1.0;
    case N_IJK_ABSOLUTE_MODE: return s->arc_absolute != 0;
    case N_LATHE_RADIUS_MODE: return 1.0;
    }
    return 0.0;
}

static double of_machine(const Machine *machine, int64_t name) {
    const State *s = machine->state.at;
    double tip_mm[3];
    tip_position(s, tip_mm);
    switch (name) {
    case N_SPINDLE_ON: return s->direction != 0;
    case N_SPINDLE_CW: return s->direction > 0;
    case N_MIST: return s->mist;
    case N_FLOOD: return s->flood;
    case N_FEED: return s->feed / s->unit_mm;
    case N_RPM: return fabs(s->rpm);
    case N_CURRENT_TOOL: return s->tool;
    case N_SELECTED_TOOL: return s->selected_tool < 0 ? 0.0 : s->selected_tool;
    case N_X:
    case N_Y:
    case N_Z: return programmed(machine, (int)(name - N_X));
    case N_ABS_X: return tip_mm[0] / s->unit_mm;
    case N_ABS_Y: return tip_mm[1] / s->unit_mm;
    case N_ABS_Z: return (s->z + length_offset_of(s)) / s->unit_mm;
    }
    return 0.0;
}

double named_parameter(const Evaluation *e, int64_t name) {
    const Program *p = e->program;
    const Course *at = p->course.at;
    if (name >= N_PREDEFINED)
        return is_global(p, name) ? AT(p->names, name).value : CELL(p->local_value, at->frame, name);
    switch (name) {
    case N_LINE: return e->line;
    case N_VALUE: return at->return_value;
    case N_VALUE_RETURNED: return (double)at->value_returned;
    case N_CALL_LEVEL: return (double)at->frame;
    }
    return name <= N_LATHE_RADIUS_MODE ? of_modes(e->machine->state.at, name) : of_machine(e->machine, name);
}

/* --- assignments ---------------------------------------------------------------------------------------- */

/* Give the parameters what the line at hand assigns to them: all at once, behind its evaluation. */
void assign(Program *program) {
    Course *at = program->course.at;
    for (int64_t k = 0; k < at->assignments; k++) {
        const Assignment *each = &AT(program->assignments, k);
        if (each->name == NO_NAME) {
            at->changes += AT(program->parameters, each->number) != each->value;
            AT(program->parameters, each->number) = each->value;
            if (each->number <= P_MACRO_LOCALS)
                AT(program->frames, at->frame).assigned |= (int64_t)1 << each->number;
        } else if (is_global(program, each->name)) {
            ParameterName *name = &AT(program->names, each->name);
            at->changes += !name->is_set || name->value != each->value;
            name->value = each->value;
            name->is_set = 1;
        } else {
            double *value = &CELL(program->local_value, at->frame, each->name);
            int64_t *set_in = &CELL(program->local_generation, at->frame, each->name);
            at->changes += *set_in != generation(program) || *value != each->value;
            *value = each->value;
            *set_in = generation(program);
        }
    }
    at->assignments = 0;
}
