/* Vectors of three numbers. */

#ifndef COLLISION_VECTORS_H
#define COLLISION_VECTORS_H

#include "core.h"

static inline double dot3(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void cross3(const double *a, const double *b, double *out) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void minus3(const double *a, const double *b, double *out) {
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

/* out = a + t (b - a). */
static inline void between3(const double *a, const double *b, double t, double *out) {
    for (int k = 0; k < 3; k++)
        out[k] = a[k] + t * (b[k] - a[k]);
}

static inline void copy3(const double *from, double *to) {
    for (int k = 0; k < 3; k++)
        to[k] = from[k];
}

static inline double distance3(const double *a, const double *b) {
    double way[3];
    minus3(a, b, way);
    return sqrt(dot3(way, way));
}

static inline double clamped(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

#endif
