/* The force along the cutter's edge at one sample, from the material in front of it.

The edge is divided into bands; the material is read on the rings between them, and between two rings its
thickness changes linearly. An upright band (a cylinder) is read along its rim. Angles phi run from the feed
normal in the sense of rotation; their bins start at -90°, so that the front of the cutter, 0 to 180°, lies in
the middle. */

#ifndef CUTTING_EDGE_H
#define CUTTING_EDGE_H

#include "cutting/arcs.h"
#include "cutting/sample.h"
#include "cutting/slices.h"

/* A row of Cutters.bands: z low and high, r low and high, edge angle, contact width. */
typedef struct {
    double low, high, r_low, r_high, sin_kappa, cos_kappa, width;
} Band;

/* Rows of Work.turn: sine and cosine in the middle of the bins of the rim and of a ring; integrals over a
   ring's bins of 1, sin, cos, sin², sin·cos. */
enum { RIM_SIN, RIM_COS, RING_SIN, RING_COS, BIN_ONE, BIN_SIN, BIN_COS, BIN_SIN_SIN, BIN_SIN_COS };

/* Rows of Work.rows: thickness above a band's lower and upper ring, each with the material's top; engaged
   fraction, of a rim the depth. */
enum { LOWER, LOWER_TOP, UPPER, UPPER_TOP, SHARE };

/* What does not change along a strip. */
typedef struct {
    const Grid *grid;
    const Path *path;
    const Cutters *cutters;
    const Work *work;
    const double *law;
} Strip;

/* Force of a tooth times rad, its moment about the tip, torque. */
typedef struct {
    double feed, normal, axial, about_feed, about_normal, torque;
} Load;

/* What is read at a sample: the load of the chip and that of the edge; depth in mm, extent to the right and left
   of the feed in mm; arcs. */
typedef struct {
    Load chip, edge;
    double a_p_mm, least_mm, most_mm;
    Arcs arcs;
} Reading;

static inline double bin_angle(double bin, int64_t bins) { return -0.25 * TURN + bin * TURN / (double)bins; }

/* Add a force per mm of contact width at a radius and a height: with its moment and the torque. */
static inline void add_load(Load *load, const Force *part, double width, double radius, double z) {
    load->feed += width * part->feed;
    load->normal += width * part->normal;
    load->axial += width * part->axial;
    load->about_feed -= z * width * part->normal;
    load->about_normal += z * width * part->feed;
    load->torque += radius * width * part->tangential;
}

static inline void add_force(Reading *reading, const Parts *parts, double width, double radius, double z) {
    add_load(&reading->chip, &parts->chip, width, radius, z);
    add_load(&reading->edge, &parts->edge, width, radius, z);
}

/* Tabulate sine and cosine in the middle of the bins, and integrals over those of rings. */
void fill_turn(const Work *work, int64_t rim_bins, int64_t ring_bins);

/* Add the force of every band of the edge, and list its arcs. */
void add_bands(const Strip *strip, const Sample *sample, Reading *reading);

/* Add a cylindrical band: its depth may change along the rim in steps, whose places are searched. */
void add_rim(const Strip *strip, const Sample *sample, const Band *band, Reading *reading);

#endif
