/* The columns of words that the scanners write. */

#ifndef GCODE_SCAN_COLUMNS_H
#define GCODE_SCAN_COLUMNS_H

#include "constants.h"
#include "core.h"

static inline void put(Scan *scan, int letter, double value, int64_t line) {
    AT(scan->letter, scan->words) = (uint8_t)letter;
    AT(scan->value, scan->words) = value;
    AT(scan->line, scan->words) = (int32_t)line;
    scan->words++;
}

/* Write a mark, and what was found while there is room. */
static inline void put_mark(Scan *scan, int finding, double found, int64_t line) {
    if (scan->marks < scan->extra.rows)
        AT(scan->extra, scan->marks) = found;
    put(scan, V_MARK, finding, line);
    scan->marks++;
}

/* Write a message whose text is a span of bytes. */
static inline void put_message(Scan *scan, int64_t start, int64_t end, int64_t line) {
    put(scan, '(', (double)scan->messages, line);
    CELL(scan->message_span, scan->messages, 0) = start;
    CELL(scan->message_span, scan->messages, 1) = end;
    scan->messages++;
}

#endif
