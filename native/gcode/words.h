/* What the scanner makes of odd characters: also for a line that is read when it is executed. */

#ifndef GCODE_WORDS_H
#define GCODE_WORDS_H

#include "gcode/expressions.h"
#include "gcode/numbers.h"

/* Kinds of an item that makes no word: a comment; a line or program number. Other kinds are letters. */
enum { NOTHING = -1, LINE_NUMBER = 0 };

/* What stands at a place: its kind, which goes into the column of letters; a finding and what was found; the
   letter whose value is lost, 0 = none; the place behind. */
typedef struct {
    int kind, finding;
    double found;
    int lost;
    int64_t end;
} Item;

Item odd_word(Bytes text, int64_t i, int letter, const Number *behind, bool first);
Item other_item(Bytes text, int64_t i, bool first);

#endif
