/* Distances of a segment from a segment, a triangle and a box, all exact. */

#include "collision/shapes.h"

/* Squared lengths below this are points; also the square of the sine below which lines are parallel. */
static const double NOTHING = 1e-24;

/* Lumelsky's order of cases: the foot on one line is clamped, then the other's, then the first's again. */
double segment_segment(const double *segment, const double *other, double *place) {
    double d1[3], d2[3], r[3], near1[3], near2[3];
    minus3(segment + 3, segment, d1);
    minus3(other + 3, other, d2);
    minus3(segment, other, r);
    const double a = dot3(d1, d1), e = dot3(d2, d2), f = dot3(d2, r);
    double s = 0.0, t = 0.0;
    if (a <= NOTHING) {
        t = e <= NOTHING ? 0.0 : clamped(f / e, 0.0, 1.0);
    } else {
        const double c = dot3(d1, r);
        if (e <= NOTHING) {
            s = clamped(-c / a, 0.0, 1.0);
        } else {
            const double b = dot3(d1, d2), denominator = a * e - b * b;
            if (denominator > NOTHING * a * e)
                s = clamped((b * f - c * e) / denominator, 0.0, 1.0);
            t = (b * s + f) / e;
            if (t < 0.0) {
                t = 0.0;
                s = clamped(-c / a, 0.0, 1.0);
            } else if (t > 1.0) {
                t = 1.0;
                s = clamped((b - c) / a, 0.0, 1.0);
            }
        }
    }
    between3(segment, segment + 3, s, near1);
    between3(other, other + 3, t, near2);
    copy3(near2, place);
    minus3(near1, near2, r);
    return dot3(r, r);
}

/* Tell whether a point of a triangle's plane lies inside it; `normal` is not of length 1. */
static bool is_inside(const double *point, const double *corners, const double *normal) {
    for (int k = 0; k < 3; k++) {
        const double *from = corners + 3 * k, *to = corners + 3 * ((k + 1) % 3);
        double side[3], way[3], across[3];
        minus3(to, from, side);
        minus3(point, from, way);
        cross3(side, way, across);
        if (dot3(across, normal) < 0.0)
            return false;
    }
    return true;
}

/* A segment is nearest to a triangle where it crosses it, at one of its ends above the inside, or at a side. */
double segment_triangle(const double *segment, const double *corners, double *place) {
    double side1[3], side2[3], normal[3], way[3], point[3];
    minus3(corners + 3, corners, side1);
    minus3(corners + 6, corners, side2);
    cross3(side1, side2, normal);
    const double square = dot3(normal, normal);
    double least = INFINITY;
    if (square > 0.0) {
        double height[2];
        for (int end = 0; end < 2; end++) {
            minus3(segment + 3 * end, corners, way);
            height[end] = dot3(way, normal);
        }
        if ((height[0] < 0.0) != (height[1] < 0.0)) {
            between3(segment, segment + 3, height[0] / (height[0] - height[1]), point);
            if (is_inside(point, corners, normal)) {
                copy3(point, place);
                return 0.0;
            }
        }
        for (int end = 0; end < 2; end++) {
            const double far = height[end] * height[end] / square;
            if (far >= least)
                continue;
            for (int k = 0; k < 3; k++)
                point[k] = segment[3 * end + k] - height[end] / square * normal[k];
            if (is_inside(point, corners, normal)) {
                least = far;
                copy3(point, place);
            }
        }
    }
    for (int k = 0; k < 3; k++) {
        double edge[6];
        copy3(corners + 3 * k, edge);
        copy3(corners + 3 * ((k + 1) % 3), edge + 3);
        const double far = segment_segment(segment, edge, point);
        if (far < least) {
            least = far;
            copy3(point, place);
        }
    }
    return least;
}

/* How far a coordinate is beyond a slab, with its sign. */
static double beyond(double x, double low, double high) { return x < low ? x - low : x > high ? x - high : 0.0; }

/* Half the derivative along the segment, at t, of the squared distance from the box. */
static double slope_at(const double *from, const double *way, double t, const double *low, const double *high) {
    double slope = 0.0;
    for (int k = 0; k < 3; k++)
        slope += beyond(from[k] + t * way[k], low[k], high[k]) * way[k];
    return slope;
}

/* The squared distance is convex along the segment, and between the planes of the sides a parabola: its slope
   rises, and in the stretch where it changes its sign it is a straight line. */
double segment_box(const double *segment, const double *low, const double *high, double *place) {
    double way[3];
    minus3(segment + 3, segment, way);
    double from = 0.0, to = 1.0;
    double slope_from = slope_at(segment, way, 0.0, low, high), slope_to = slope_at(segment, way, 1.0, low, high);
    double t = 0.0;
    if (slope_from < 0.0) {
        t = 1.0;
        if (slope_to > 0.0) {
            for (int k = 0; k < 6; k++) {
                const int axis = k >> 1;
                if (way[axis] == 0.0)
                    continue;
                const double at = ((k & 1 ? high[axis] : low[axis]) - segment[axis]) / way[axis];
                if (at <= from || at >= to)
                    continue;
                const double slope = slope_at(segment, way, at, low, high);
                if (slope < 0.0) {
                    from = at;
                    slope_from = slope;
                } else {
                    to = at;
                    slope_to = slope;
                }
            }
            t = from + (to - from) * (slope_from / (slope_from - slope_to));
        }
    }
    double square = 0.0;
    for (int k = 0; k < 3; k++) {
        const double x = segment[k] + t * way[k], far = beyond(x, low[k], high[k]);
        square += far * far;
        if (place)
            place[k] = x - far;
    }
    return square;
}
