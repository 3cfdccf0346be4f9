/* The samples between two nodes. */

#ifndef CUTTING_STRETCH_H
#define CUTTING_STRETCH_H

#include "cutting/node.h"

/* A sample that is read, and what. */
typedef struct {
    int64_t i;
    Node node;
} Known;

/* Read the samples after one that is read up to the next node, `end`, and write the rows of the strip's own. Returns
   what is read at `end`. */
Known read_stretch(const Reader *reader, Known before, int64_t end);

#endif
