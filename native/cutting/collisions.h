/* Shank and holder beside the cutter. */

#ifndef CUTTING_COLLISIONS_H
#define CUTTING_COLLISIONS_H

#include "cutting/edge.h"

/* Note how far shank and holder reach into material beside the cutter. */
void collide(const Strip *strip, const Sample *sample, double *overlap_mm);

#endif
