/* The words of a dialect's block become those of the core. */

#ifndef GCODE_DIALECT_WORDS_H
#define GCODE_DIALECT_WORDS_H

#include "gcode/block.h"

void take_dialect_mark(Block *b, uint8_t c, double value);
bool take_via(Block *b, int axis, double value);
bool take_component(Block *b, int axis, double value);
void say_of_word(Block *b, int index);
int32_t core_code(Block *b, int64_t written, bool *good);
bool to_core_words(Block *b);

#endif
