/* Lower a height field below the sweeps of a cutter. */

#ifndef CUTTING_REMOVAL_H
#define CUTTING_REMOVAL_H

#include "cutting/sweep.h"

/* Tell whether sweep k leaves to the next one what is below the flat bottom of the cutter at its end, because that one
   cuts deeper there. It has to be one that every reading behind sweep k knows of: no longer than the field lags. */
bool leaves_disc(const Path *path, int64_t k, double lag_mm);

/* Lower the field, which lags so far behind what is read, below the sweep that ends at sample k; return the height a
   rapid has cut off, else 0. */
double remove_sweep(const Grid *grid, const Path *path, int64_t k, double lag_mm);

#endif
