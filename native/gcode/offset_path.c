/* The path of the tool's centre beside a contour: pieces, and where two of them meet at a corner. */

#include "gcode/offset_path.h"

/* Return what kind of corner a path makes that leaves direction `before` for `after`.

   A path that turns back on itself is an outside corner, unless the tool would go around an arc to get there
   (a cusp between an arc and what touches it). */
Corner corner_between(Point before, Point after, int side, bool cusp_is_inside, double smallest_rad) {
    double away_rad = side * atan2(cross(after, before), dot(after, before));
    if (away_rad < SMALLEST_CORNER_RAD - PI)
        away_rad += 2.0 * PI;
    if (away_rad < -smallest_rad || (cusp_is_inside && away_rad > PI - SMALLEST_CORNER_RAD))
        return INSIDE;
    return away_rad > smallest_rad ? OUTSIDE : SMOOTH;
}

static bool lines_meet(const Piece *a, const Piece *b, Point *at) {
    const double sine = cross(a->along, b->along);
    if (sine == 0.0)
        return false;
    *at = plus(a->at, cross(minus(b->at, a->at), b->along) / sine, a->along);
    return true;
}

/* Of the two points in which a line meets a circle take the one behind (1) or before (-1) the middle. */
static bool line_meets_circle(const Piece *line, const Piece *arc, int which, Point *at) {
    const double along_mm = dot(minus(arc->centre, line->at), line->along);
    const Point foot = plus(line->at, along_mm, line->along);
    const double off_mm = distance(foot, arc->centre);
    if (off_mm > arc->radius_mm)
        return false;
    const double half_mm = sqrt((arc->radius_mm - off_mm) * (arc->radius_mm + off_mm));
    *at = plus(foot, which * half_mm, line->along);
    return true;
}

/* Of the two points in which circles meet take the one left (1) or right (-1) of the line of their centres. */
static bool circles_meet(const Piece *a, const Piece *b, int which, Point *at) {
    const Point between = minus(b->centre, a->centre);
    const double apart_mm = hypot(between.u, between.v), r = a->radius_mm;
    if (apart_mm == 0.0 || r == 0.0)
        return false;
    const double along_mm = 0.5 * (apart_mm + (r - b->radius_mm) * (r + b->radius_mm) / apart_mm);
    if (fabs(along_mm) > r)
        return false;
    const Point towards = {between.u / apart_mm, between.v / apart_mm};
    const double off_mm = sqrt((r - along_mm) * (r + along_mm));
    *at = plus(plus(a->centre, along_mm, towards), which * off_mm, quarter(towards, 1));
    return true;
}

/* Find where two pieces meet so that the path turns towards the tool there; return false where they do not.

   With p the point, a line along d and arcs about c, of turn k, have the directions d and k·(p - c) turned by
   a quarter; the sign of the cross product of the two, which has to be that of the side, chooses the point. */
bool meeting_point(const Piece *before, const Piece *after, int side, Point *at) {
    if (before->turn == 0 && after->turn == 0)
        return lines_meet(before, after, at);
    if (before->turn == 0)
        return line_meets_circle(before, after, side * after->turn, at);
    if (after->turn == 0)
        return line_meets_circle(after, before, -side * before->turn, at);
    return circles_meet(before, after, side * before->turn * after->turn, at);
}

/* Return how far an arc has turned between two of its points, from a little below 0 to a whole turn. */
double angle_past(Point centre, int turn, Point from, Point to) {
    const Point a = minus(from, centre), b = minus(to, centre);
    const double angle = turn * atan2(cross(a, b), dot(a, b));
    return angle < -2.0 * SMALLEST_CORNER_RAD ? angle + 2.0 * PI : angle;
}
