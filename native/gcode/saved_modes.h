/* M70 to M73: modes that are saved and restored; M61 and M62 to M68: tool number and outputs. */

#ifndef GCODE_SAVED_MODES_H
#define GCODE_SAVED_MODES_H

#include "gcode/block.h"

/* Tell whether an M-code is one of LinuxCNC's M61 to M73; there is no M69. */
static inline bool is_own_m(const Machine *machine, int64_t m) {
    return machine->has_m61_to_m73 && m >= V_M61 && m <= V_M73 && (m <= V_M68 || m >= V_M70);
}

void save_modes(Block *b, int32_t m);
bool restore_modes(Block *b);
bool restores_on_return(const Machine *machine);
void forget_modes(Machine *machine);
void set_tool_number(Block *b);
void switch_output(Block *b, int32_t m);

#endif
