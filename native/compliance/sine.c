/* The chain's sine and cosine for columns of angles, so that a test can compare them with the library's. */

#include "compliance/sine.h"

EXPORT void compliance_sin_cos(Floats angle_rad, Floats sine, Floats cosine) {
    for (int64_t i = 0; i < angle_rad.rows; i++)
        sin_cos(AT(angle_rad, i), &AT(sine, i), &AT(cosine, i));
}

EXPORT void compliance_sin_cos_near_zero(Floats angle_rad, Floats sine, Floats cosine) {
    for (int64_t i = 0; i < angle_rad.rows; i++) {
        AT(sine, i) = sin_near_zero(AT(angle_rad, i));
        AT(cosine, i) = cos_near_zero(AT(angle_rad, i));
    }
}
