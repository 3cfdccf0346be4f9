/* The pilot force as the program announces it, and whether it may be used (online/pilot_gate.py). */

#include "constants.h"
#include "search.h"

/* The knots of a sidecar: when they are, how long before they are announced, their forces (k, 3). */
typedef struct {
    Floats time_s, lead_s, force_N;
} Knots;

/* Take the next knot; close the gate if it is another one or comes at another time. */
static void take_knot(double now_s, double knot, Knots knots, double *state) {
    const int64_t k = (int64_t)state[PILOT_NEXT];
    if (knot != state[PILOT_NEXT] || k >= knots.time_s.rows) { /* a NaN too */
        state[PILOT_STARTED] = 0.0;
        state[PILOT_REASON] = PILOT_GATE_ORDER;
        return;
    }
    const double planned_s = AT(knots.time_s, k) - AT(knots.lead_s, k);
    if (state[PILOT_SYNCED] == 0.0) {
        state[PILOT_REAL] = now_s;
        state[PILOT_PLANNED] = planned_s;
    }
    const double took_s = now_s - state[PILOT_REAL], expected_s = planned_s - state[PILOT_PLANNED];
    if (fabs(took_s - expected_s) > PILOT_SPEED_SHARE * expected_s + PILOT_JITTER_S) {
        state[PILOT_STARTED] = 0.0;
        state[PILOT_REASON] = PILOT_GATE_SPEED;
        return;
    }
    if (expected_s >= PILOT_PROOF_S) {
        state[PILOT_PROVEN] = 1.0;
        state[PILOT_REAL] = now_s;
        state[PILOT_PLANNED] = planned_s;
    }
    state[PILOT_SYNCED] = 1.0;
    state[PILOT_OFFSET] = now_s + AT(knots.lead_s, k) - AT(knots.time_s, k);
    state[PILOT_NEXT] += 1.0;
}

/* Forget the place in the program once the robot has stood still: pauses are not predicted. */
static void watch_rest(const double *position_mm, double now_s, double *state) {
    double moved_2 = 0.0;
    for (int c = 0; c < 3; c++) {
        moved_2 += squared(position_mm[c] - state[PILOT_POSITION + c]);
        state[PILOT_POSITION + c] = position_mm[c];
    }
    if (moved_2 > PILOT_REST_MM * PILOT_REST_MM)
        state[PILOT_STILL] = now_s;
    if (now_s - state[PILOT_STILL] > PILOT_REST_S)
        state[PILOT_SYNCED] = 0.0;
}

/* Write the polyline at a time: linear between knots, zero before the first and after the last. */
static void force_at(double now_s, Knots knots, double *force) {
    const int64_t k = count_up_to(knots.time_s, knots.time_s.rows, now_s);
    const bool is_between = 0 < k && k < knots.time_s.rows;
    for (int c = 0; c < 3; c++) {
        force[c] = 0.0;
        if (is_between) {
            const double start_s = AT(knots.time_s, k - 1);
            const double share = (now_s - start_s) / (AT(knots.time_s, k) - start_s);
            const double start_N = CELL(knots.force_N, k - 1, c);
            force[c] = start_N + share * (CELL(knots.force_N, k, c) - start_N);
        }
    }
}

/* Return why no knot of this program counts: another program, another speed or mode; 0 where one does. */
static int refused(double checksum, double wanted, double override_percent, double t1) {
    if (checksum != wanted) /* a NaN too */
        return PILOT_GATE_CHECKSUM;
    if (override_percent != 100.0)
        return PILOT_GATE_OVERRIDE;
    return t1 != 0.0 ? PILOT_GATE_MODE : 0;
}

/* Wait for the first knot of a program that starts. */
static void start(double *state) {
    state[PILOT_STARTED] = 1.0;
    state[PILOT_NEXT] = state[PILOT_PROVEN] = state[PILOT_SYNCED] = 0.0;
    state[PILOT_REASON] = PILOT_GATE_UNPROVEN;
}

/* Write the force (n, 3) of the pilot, where it is known, and why not; the first columns are what the
   controller reports, see pilot_gate.py. */
EXPORT void online_track(Floats time_s, Floats position_mm, Floats knot, Floats checksum,
                         Floats override_percent, Floats t1, Floats knot_time_s, Floats knot_lead_s,
                         Floats knot_force_N, double wanted, double lead_s, Floats state, Floats force_N,
                         Bools known, Ints reason) {
    const Knots knots = {knot_time_s, knot_lead_s, knot_force_N};
    double *own = &AT(state, 0);
    for (int64_t i = 0; i < time_s.rows; i++) {
        watch_rest(&CELL(position_mm, i, 0), AT(time_s, i), own);
        const int wrong = refused(AT(checksum, i), wanted, AT(override_percent, i), AT(t1, i));
        if (wrong) {
            own[PILOT_REASON] = wrong;
            own[PILOT_STARTED] = 0.0;
        } else if (AT(knot, i) == PILOT_NO_KNOT_YET) {
            start(own);
        } else if (own[PILOT_STARTED] > 0.0 && AT(knot, i) != own[PILOT_NEXT] - 1.0) {
            take_knot(AT(time_s, i), AT(knot, i), knots, own);
        }
        if (own[PILOT_STARTED] == 0.0 || own[PILOT_PROVEN] == 0.0) {
            AT(reason, i) = (int64_t)own[PILOT_REASON];
        } else if (own[PILOT_SYNCED] == 0.0) {
            AT(reason, i) = PILOT_GATE_STANDS;
        } else {
            AT(reason, i) = PILOT_GATE_OPEN;
            AT(known, i) = true;
            const int64_t following = least((int64_t)own[PILOT_NEXT], knots.time_s.rows - 1);
            const double now_s = AT(time_s, i) + lead_s - own[PILOT_OFFSET];
            force_at(lesser(now_s, AT(knots.time_s, following)), knots, &CELL(force_N, i, 0));
        }
    }
}
