/* Arcs: centre from R, and the chords that replace an arc. */

#include "gcode/arcs.h"

#include "constants.h"

/* From this difference of the radii at start and end on a finding tells it: the chord tolerance. */
static const double RADIUS_WARNING_MM = 0.01;
/* LinuxCNC's bound under G21 and G20, what two (three) decimals of start, end and centre can amount to: times
   the root of 2, 0.02 mm and 0.002 inch. */
#define ROOT_OF_2 1.4142135623730951
static const double SPIRAL_MM = 0.02 * ROOT_OF_2, SPIRAL_INCH_MM = 0.002 * ROOT_OF_2 * U_MM_PER_INCH;
/* Beyond the bound LinuxCNC reads up to 0.1 % of the radius, and never more than 100 times the bound. */
static const double SPIRAL_SHARE = 0.001, SPIRAL_MOST = 100.0;
static const double SMALLEST_CHORD_MM = 1e-9;
/* A sweep this small is a full circle, and a number of chords this little above a whole one is that one. */
static const double SMALLEST_SWEEP_RAD = 1e-9, COUNT_SLACK = 1e-9;

/* Tell whether the radii at start and end fit, by the rule of LinuxCNC (interp_arc.cc). */
Fit radii_fit(double start_mm, double end_mm, double unit_mm) {
    const double difference = fabs(start_mm - end_mm);
    if (difference <= RADIUS_WARNING_MM)
        return FITS;
    const double bound = unit_mm == 1.0 ? SPIRAL_MM : SPIRAL_INCH_MM;
    if (difference > SPIRAL_MOST * bound)
        return MISFIT;
    return difference > bound && difference > SPIRAL_SHARE * larger(start_mm, end_mm) ? MISFIT : SPIRAL;
}

/* Find the centre of an arc given by R, or return the finding; a negative R takes the longer way. */
int centre_from_radius(Point start, Point end, double radius, bool ccw, Point *centre) {
    const double du = end.u - start.u, dv = end.v - start.v;
    const double chord = hypot(du, dv), r = fabs(radius);
    if (chord < SMALLEST_CHORD_MM)
        return F_ARC_R_FULL_CIRCLE;
    double height_squared = r * r - 0.25 * chord * chord;
    if (height_squared < 0.0) {
        if (0.5 * chord - r > SMALLEST_RADIUS_MM)
            return F_ARC_RADIUS_TOO_SMALL;
        height_squared = 0.0;
    }
    double height = sqrt(height_squared);
    if ((radius < 0) == ccw) /* centre on the right of the chord for a long ccw or a short cw arc */
        height = -height;
    *centre = (Point){0.5 * (start.u + end.u) - height * dv / chord,
                      0.5 * (start.v + end.v) + height * du / chord};
    return F_OK;
}

/* Return the signed sweep; equal ends are a full circle, P adds whole turns. */
double sweep_angle(Point start, Point end, Point centre, bool ccw, int64_t turns, double *from_rad) {
    const double full = 2.0 * PI;
    *from_rad = atan2(start.v - centre.v, start.u - centre.u);
    const double to_rad = atan2(end.v - centre.v, end.u - centre.u);
    double sweep = ccw ? to_rad - *from_rad : *from_rad - to_rad;
    while (sweep <= SMALLEST_SWEEP_RAD)
        sweep += full;
    while (sweep > full + SMALLEST_SWEEP_RAD)
        sweep -= full;
    sweep += full * (double)(turns - 1);
    return ccw ? sweep : -sweep;
}

/* Return how many equal chords keep within the tolerance of an arc, MOST_CHORDS + 1 where they are more:
   error = r·(1 - cos(step/2)). */
int64_t chord_count(double radius_mm, double sweep_rad, double tolerance_mm) {
    double step = 0.5 * PI;
    if (tolerance_mm < radius_mm)
        step = smaller(step, 2.0 * acos(1.0 - tolerance_mm / radius_mm));
    const double count = ceil(fabs(sweep_rad) / step - COUNT_SLACK); /* infinite where the step is lost */
    return most(1, (int64_t)smaller(count, MOST_CHORDS + 1));
}
