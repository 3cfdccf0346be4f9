/* Material along a ring of the cutter, before the sweep that is about to cut it. */

#ifndef CUTTING_RINGS_H
#define CUTTING_RINGS_H

#include "cutting/sample.h"

/* Write the height of the cells on a ring; return whether a wall runs through one of them. */
bool tops_on_ring(const Grid *grid, const Sample *sample, const Ring *ring);

/* Write how far the tops stand above the cutter's surface. */
void stand_above_cutter(const Grid *grid, const Sample *sample, const Ring *ring);

/* Replace the tops of cells with a wall, and what is above the level, by those of the point's side. */
void correct_at_walls(const Grid *grid, const Path *path, const Sample *sample, const Ring *ring);

/* Lower tops, and what is above the level, by the sweeps that the field does not show yet. */
void take_off_recent(const Sample *sample, const Ring *ring);

#endif
