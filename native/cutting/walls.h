/* Walls inside cells: drawn by the sweeps that leave them, read to a small fraction of a cell.

A cell holds only the height over its middle; where the upright wall of a sweep runs through it, the number of
that sweep is noted in Grid.wall, and a point of the cell is looked up on the side of the wall where it lies.
*/

#ifndef CUTTING_WALLS_H
#define CUTTING_WALLS_H

#include "cutting/sample.h"

/* Return the top of the material at a point: of its cell, or beside the wall that runs through it. */
double height_at(const Grid *grid, const Path *path, double x, double y);

/* The same for the cutter at a sample: where the field does not show what has been cut at its disc, the height of that. */
double top_at(const Grid *grid, const Path *path, const Sample *sample, double x, double y);

/* Return the height on the point's side of the wall that a sweep left in the cell. */
double beside_wall(const Grid *grid, const Path *path, int64_t sweep, Cell cell, double x, double y);

/* Draw the walls that sweep k leaves: both sides, and the round at its end where the next one turns away. */
void draw_walls(const Grid *grid, const Path *path, int64_t k);

#endif
