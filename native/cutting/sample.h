/* What is known of one sample while its engagement is read. */

#ifndef CUTTING_SAMPLE_H
#define CUTTING_SAMPLE_H

#include "cutting/slices.h"
#include "cutting/sweep.h"

enum { MOST_RECENT = 8 };

typedef struct {
    double x, y, z;
    double top;    /* no material is higher above the tip */
    double bottom; /* the material's bottom above the tip */
    double fx, fy; /* heading in plan */
    Chip chip;
    bool moves;
    int64_t tool;
    const Outline *outline;
    Way recent[MOST_RECENT]; /* sweeps that the field does not show yet */
    int recent_count;
    const double *disc; /* where the field does not show what the cutter's flat bottom has cut, NULL: nowhere */
} Sample;

/* A range of bins. */
typedef struct {
    int64_t first, after;
} Bins;

/* A ring of the cutter: the circle on which a point of the edge turns, read in bins from `first` on. For each bin its direction in plan, the top of the material above the tip, and how far it
   stands above the ring or the cutter's surface; `tops` and `above` may be the same. */
typedef struct {
    double r, height; /* of the ring, above the tip */
    int64_t first, after;
    const float *east, *north;
    float *tops, *above;
} Ring;

#endif
