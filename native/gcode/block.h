/* What the interpreter works on: the machine, which goes on from block to block, and the block at hand. */

#ifndef GCODE_BLOCK_H
#define GCODE_BLOCK_H

#include "constants.h"
#include "core.h"

/* The columns of the words, as in gcode2krl/gcode/words.py. */
typedef struct {
    Bytes letter;
    Floats value, extra;
    Ints32 line;
} Words;

/* One block, its words sorted: values by letter, G-codes by modal group and M-codes, -1 = none. */
typedef struct {
    Machine *machine;
    State *state;
    Counts *counts;
    int32_t line, motion_before; /* the motion mode that the blocks before have left */
    bool has[V_LETTERS], used[V_LETTERS];
    double word[V_LETTERS];
    int32_t g[V_GROUPS], m_codes[V_M_CODES];
    uint8_t next_word;                        /* what a dialect says of the next word, 0 = nothing */
    int32_t pointless, absolute, incremental; /* bits of the letters of which it has been said */
    int32_t shortest, forward, backward;      /* the same, of the way of rotary axes */
    uint8_t shift;                            /* TRANS or ATRANS, 0 = neither */
    uint8_t tip;                              /* TRAORI or TRAFOOF, 0 = neither */
    double vector[V_ROTARY_AXES];             /* a Sinumerik's tool vector, A3 first */
    int32_t vector_named;                     /* bits of its components that the block has */
    int32_t harmless;                         /* a code that says nothing, ten times */
    int32_t unit_again;                       /* G70 or G71, ten times */
    bool exact_once;                          /* an exact stop of this block alone */
    uint8_t corner;                           /* CORNER_… to the next block, 0 = none */
    double corner_value;
    int32_t offset_code, offset;              /* G505 to G599 or G54.1, ten times, 0 = none; its place */
    uint8_t turn;                             /* TURN_… of this block, 0 = none */
    bool turn_stated;
    double turned_deg;                        /* RPL= */
    uint8_t named_arc;                        /* ARC_VIA or ARC_TANGENT, 0 = neither */
    double via[3];                            /* I1= J1= K1= */
    int32_t via_named;                        /* bits of those that the block has */
    int32_t cycle;                            /* number of a Sinumerik's cycle, 0 = none */
    bool modal;                               /* MCALL */
    int32_t arguments;                        /* of the cycle, NaN = left out */
    double argument[V_CYCLE_ARGUMENTS];
    double turn_deg[V_ROTARY_AXES]; /* where the rotary words lead, once they have been read */
} Block;

static const int OTHER_AXES[] = V_OTHER_AXES;
enum { OTHER_AXES_COUNT = sizeof OTHER_AXES / sizeof *OTHER_AXES };

enum { NOT_WHOLE = -1 };

static inline double of_tool(Floats diameter_mm, int32_t tool) {
    return tool >= 0 && tool < diameter_mm.rows ? AT(diameter_mm, tool) : NAN;
}

/* Return the diameter by which a tool is compensated, NaN where it is not declared. */
static inline double diameter_of(const Machine *machine, int32_t tool) {
    return of_tool(machine->tool_diameter_mm, tool);
}

/* Return the value of a word as a whole number 0…99999, or NOT_WHOLE. */
static inline int32_t whole(double value) {
    static const double SLACK = 1e-6, LARGEST = 99999.0;
    const double nearest = rint(value);
    return fabs(value - nearest) > SLACK || nearest < 0.0 || nearest > LARGEST ? NOT_WHOLE : (int32_t)nearest;
}

/* Tool length offset in force, 0 under G49. */
static inline double length_offset_of(const State *s) {
    return isnan(s->length_offset) ? 0.0 : s->length_offset;
}

/* Tell whether moves are shifted: compensation by a radius of 0 is on and moves nothing. */
static inline bool compensates(const State *s) {
    return s->cutter_mode & S_CUTTER_ON && s->cutter_radius_mm > 0.0;
}

#endif
