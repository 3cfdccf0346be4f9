/* The bodies of the arm and on its flange: capsules, each end in the frame of its link. */

#ifndef COLLISION_LINKS_H
#define COLLISION_LINKS_H

#include "collision/vectors.h"
#include "constants.h"
#include "robot/arm.h"

typedef double Ends[6];

/* Angles of the joints, then how far a rail has taken the robot root, along the axes of the root at rest. */
enum { STANCE = AXES + 3 };
typedef double Stance[STANCE];

/* Write where the ends of all bodies are in the robot root at rest; `ends` has a row for each body. */
void place_bodies(const double *stance, const Arm *arm, const Bodies *bodies, Ends *ends);

/* Write where the ends of a pair of bodies are, one row for each; the second where it is no obstacle. */
void place_two(const double *stance, const Arm *arm, const Bodies *bodies, const int32_t *pair, Ends *ends);

#endif
