/* The lengths of the arm of robot/kinematics.py, in mm. */

#ifndef ROBOT_ARM_H
#define ROBOT_ARM_H

#include "core.h"

enum { AXES = 6 };

typedef struct {
    double a1, a2, c1, c2, c3, c4;
} Arm;

static inline Arm arm_of(Floats geometry) {
    const Arm arm = {AT(geometry, 0), AT(geometry, 1), AT(geometry, 2),
                     AT(geometry, 3), AT(geometry, 4), AT(geometry, 5)};
    return arm;
}

#endif
