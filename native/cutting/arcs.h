/* Arcs of engagement of one sample. */

#ifndef CUTTING_ARCS_H
#define CUTTING_ARCS_H

#include "core.h"

enum { MOST_ARCS = 64 };

typedef struct {
    double a, b;
} Arc;

typedef struct {
    int64_t count;
    Arc at[MOST_ARCS];
} Arcs;

/* List an arc in rad. */
void put_arc(Arcs *arcs, double a, double b);

/* Write the union of the arcs as pairs, the widest `most_written` of them. */
void write_union(Arcs *arcs, double *phi_rad, int64_t most_written);

#endif
