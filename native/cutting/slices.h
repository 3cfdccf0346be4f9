/* Force of one tooth while it sweeps an arc, per mm of engaged edge: the integral behind all means.

The angle phi runs from the feed normal in the sense of rotation of a right-hand cutter (clockwise seen from
the holder): the tooth stands at (sin phi, cos phi) in (feed, normal). The edge angle kappa is 90° on a
cylinder and 0 on a flat bottom; gamma is the angle of descent. The chip is the feed seen along the outward
normal of the edge, h = f_z·(sin phi·sin kappa·cos gamma + cos kappa·sin gamma), cut at 0. After Altintas,
Manufacturing Automation, 2nd ed. 2012, ch. 2 (linear edge forces), with the edge angle as in Engin and
Altintas 2001 (general end mills). */

#ifndef CUTTING_SLICES_H
#define CUTTING_SLICES_H

#include "constants.h"
#include "core.h"

/* Feed per tooth along the velocity in mm, and the angle of descent. */
typedef struct {
    double f_z_mm, sin_gamma, cos_gamma;
} Chip;

/* Feed, normal and axial force (holder to tip) and tangential force. */
typedef struct {
    double feed, normal, axial, tangential;
} Force;

/* A force in two parts: that of the chip, which grows with the feed per tooth (`feed_scale`), and that of the edge,
   which rubs whatever the feed. */
typedef struct {
    Force chip, edge;
} Parts;

static inline Force total_of(const Parts *parts) {
    const Force chip = parts->chip, edge = parts->edge;
    return (Force){chip.feed + edge.feed, chip.normal + edge.normal, chip.axial + edge.axial,
                   chip.tangential + edge.tangential};
}

/* Return how the force of the chip grows with the feed per tooth: linear edge forces with the feed itself, Kienzle's with
   feed^(1 - mc). */
static inline double feed_scale(const double *law, double f_z_mm) {
    return law[0] == LAW_LINEAR_EDGE ? f_z_mm : pow(f_z_mm, 1.0 - law[2]);
}

/* Integrals of 1, sin phi, cos phi, sin² phi and sin phi·cos phi over an arc. */
typedef struct {
    double one, sin, cos, sin_sin, sin_cos;
} Integrals;

typedef enum { NO_CHIP, WHOLE_TURN, PART_OF_TURN } Engaged;

/* An edge at an angle kappa under a feed: its chip h = swing·sin phi + offset, and where it is not negative:
   from `start` to `stop`, every turn. */
typedef struct {
    double sin_kappa, cos_kappa, swing_mm, offset_mm, start, stop;
    Engaged engaged;
} Facet;

Facet facet_of(double sin_kappa, double cos_kappa, const Chip *chip);

/* The same of a chip f_z_mm·(swing·sin phi + offset). */
Facet facet_at(double sin_kappa, double cos_kappa, double f_z_mm, double swing, double offset);

/* Add the integral over phi, from phi_a to phi_b (at most one turn), of the force on one tooth per mm of
   contact width, N·rad/mm. An empty or NaN arc adds nothing. The contact width is dz/sin kappa; the mean over
   a revolution is teeth/(2·pi)·width times this. law: as `cutting.law.law_array` makes it. */
void add_arc_force(double phi_a, double phi_b, const Facet *facet, const double *law, Parts *out);

/* The same of linear edge forces, dF_q = (K_qc·h + K_qe)·db, from integrals over an arc on which the chip is
   not negative. */
void add_linear_edge(const Integrals *arc, const Facet *facet, const double *law, Parts *out);

#endif
