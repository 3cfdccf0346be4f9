/* The words of one block, sorted: values by letter, G-codes by modal group, M-codes. */

#ifndef GCODE_BLOCK_WORDS_H
#define GCODE_BLOCK_WORDS_H

#include "gcode/block.h"

/* A block to be left out, one that is understood, one that has been reported and is only followed. */
typedef enum { LEFT_OUT, GOOD, FAULTY } BlockKind;

BlockKind gather(Block *block, const Words *words, int64_t from, int64_t to, int32_t *doubt);

#endif
