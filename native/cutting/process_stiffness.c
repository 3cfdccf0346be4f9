/* How the mean force changes where the tip is displaced (cutting/stiffness.py): a loop over samples. */

#include "cutting/slices.h"

/* Write the feed, normal and axial force in N per mm of width of a cylinder's edge at phi. */
static void edge_force(const double *law, double f_z_mm, double phi, double force[3]) {
    const double sine = sin(phi), cosine = cos(phi), chip_mm = f_z_mm * sine;
    double t, r;
    if (law[0] == LAW_KIENZLE) {
        t = law[1] * pow(greater(chip_mm, 0.0), 1.0 - law[2]);
        r = law[3] * t;
        force[2] = law[4] * t;
    } else {
        t = law[1] * chip_mm + law[4];
        r = law[2] * chip_mm + law[5];
        force[2] = law[3] * chip_mm + law[6];
    }
    force[0] = -t * cosine - r * sine;
    force[1] = t * sine - r * cosine;
}

/* Write the change of the mean force of a tooth, per mm of depth, towards the feed normal. Where an arc ends is followed
   over the amplitude to both sides. */
static void side_slope(const double *ends, int64_t count, double diameter_mm, double f_z_mm, const double *law,
                       double slope[3]) {
    const double reach = 2.0 * PROCESS_AMPLITUDE_MM / diameter_mm;
    slope[0] = slope[1] = slope[2] = 0.0;
    for (int64_t end = 0; end < count; end++) {
        const double phi = ends[end];
        if (!(phi > PROCESS_TANGENT_RAD && phi < PI - PROCESS_TANGENT_RAD))
            continue;
        const double turned = acos(greater(cos(phi) - reach, -1.0)) - acos(lesser(cos(phi) + reach, 1.0));
        const double width = (end % 2 ? turned : -turned) / (2.0 * PROCESS_AMPLITUDE_MM) / (2.0 * PI);
        double force[3];
        edge_force(law, f_z_mm, phi, force);
        for (int i = 0; i < 3; i++)
            slope[i] += width * force[i];
    }
}

/* Write the tool axis of a quaternion x, y, z, w, the unit direction of the feed across it, 0 where it is along it, and
   the feed normal. */
static void directions(const double *q, const double *feed_in_base, double axis[3], double feed[3], double normal[3]) {
    axis[0] = 2.0 * (q[0] * q[2] + q[1] * q[3]);
    axis[1] = 2.0 * (q[1] * q[2] - q[0] * q[3]);
    axis[2] = 1.0 - 2.0 * (q[0] * q[0] + q[1] * q[1]);
    double along = 0.0, square = 0.0;
    for (int i = 0; i < 3; i++)
        along += feed_in_base[i] * axis[i];
    for (int i = 0; i < 3; i++) {
        feed[i] = feed_in_base[i] - along * axis[i];
        square += squared(feed[i]);
    }
    const double length = sqrt(square);
    for (int i = 0; i < 3; i++)
        feed[i] = length > 1e-9 ? feed[i] / length : 0.0;
    for (int i = 0; i < 3; i++)
        normal[i] = axis[(i + 1) % 3] * feed[(i + 2) % 3] - axis[(i + 2) % 3] * feed[(i + 1) % 3];
}

/* Write dF/du (n, 9) in N/mm of samples that cut, as `process_stiffness` takes them. */
EXPORT void cutting_process_stiffness(Floats phi_rad, Floats a_p_mm, Floats f_z_mm, Floats force_N, Floats direction,
                                      Floats rotation, double teeth, double diameter_mm, Floats law, Floats change) {
    for (int64_t row = 0; row < change.rows; row++) {
        const double a_p = AT(a_p_mm, row);
        double slope[3], axis[3], feed[3], normal[3];
        side_slope(&CELL(phi_rad, row, 0), phi_rad.columns, diameter_mm, AT(f_z_mm, row), &AT(law, 0), slope);
        directions(&CELL(rotation, row, 0), &CELL(direction, row, 0), axis, feed, normal);
        for (int i = 0; i < 3; i++) {
            const double across = teeth * a_p * (slope[0] * feed[i] + slope[1] * normal[i] - slope[2] * axis[i]);
            const double deeper = -CELL(force_N, row, i) / a_p;
            for (int j = 0; j < 3; j++)
                CELL(change, row, 3 * i + j) = across * normal[j] + deeper * axis[j];
        }
    }
}
