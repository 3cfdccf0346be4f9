/* Material along a ring of the cutter, before the sweep that is about to cut it. */

#ifndef CUTTING_RINGS_H
#define CUTTING_RINGS_H

#include "cutting/sample.h"

/* Write the height of the cells on a ring, and how far they stand above the cutter; where a wall runs through a cell,
   those of the point's side. */
void read_cells(const Grid *grid, const Path *path, const Sample *sample, const Ring *ring);

/* Lower tops, and what is above the ring, by the sweeps that the field does not show yet. */
void take_off_recent(const Sample *sample, const Ring *ring);

#endif
