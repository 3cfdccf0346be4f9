/* Operators with memory along time: play, lag, second-order mode, limited drive, reversals (effects/operators.py). */

#include "core.h"

/* An angle that goes back by less is no reversal: it lies within the noise and rounding of an encoder. */
static const double REVERSAL_RAD = 1e-5;
static const double PLATEAU_RAD = 1e-7;

/* Write the play operator (m) of values (m). */
EXPORT void effects_play(Floats values, double half_width, Floats out) {
    double y = values.rows > 0 ? AT(values, 0) : 0.0;
    for (int64_t i = 0; i < values.rows; i++) {
        y = lesser(greater(y, AT(values, i) - half_width), AT(values, i) + half_width);
        AT(out, i) = y;
    }
}

/* Return the slope at a sample: a central difference, at the first sample as a parabola begins. */
static double slope_at(Floats values, Floats time_s, int64_t i) {
    const int64_t last = values.rows - 1, a = most(i - 1, 0), b = least(i + 1, last);
    double slope = 0.0;
    if (AT(time_s, b) > AT(time_s, a))
        slope = (AT(values, b) - AT(values, a)) / (AT(time_s, b) - AT(time_s, a));
    if (i == 0 && last > 1 && AT(time_s, 2) > AT(time_s, 1) && AT(time_s, 1) > AT(time_s, 0))
        slope = 2.0 * slope - (AT(values, 2) - AT(values, 0)) / (AT(time_s, 2) - AT(time_s, 0));
    return slope;
}

/* Return what a lag keeps of a rise 6·u·(1 - u) in a step u = 0 ... 1 of a time constants. */
static double of_bulge(double a) {
    if (a < 0.05) /* the closed form cancels there */
        return 1.0 - a * (0.5 - a * (0.15 - a / 30.0));
    return 6.0 * (a - 2.0 + (a + 2.0) * exp(-a)) / (a * a * a);
}

/* Write tau·y' + y = x for values (m), from rest. */
EXPORT void effects_lag(Floats values, Floats time_s, double tau_s, Floats out) {
    double behind = 0.0, slope = 0.0; /* y - x, x' */
    for (int64_t i = 0; i < values.rows; i++) {
        const double before = slope, dt = i > 0 ? AT(time_s, i) - AT(time_s, i - 1) : 0.0;
        slope = slope_at(values, time_s, i);
        if (dt > 0.0) {
            const double kept = exp(-dt / tau_s);
            const double gone = tau_s * (1.0 - kept);
            behind = behind * kept - before * gone - (slope - before) * (tau_s - tau_s * gone / dt);
            /* so that the slopes add up to the rise: else what changes from sample to sample goes through */
            behind -= (AT(values, i) - AT(values, i - 1) - dt * (slope + before) / 2.0) * of_bulge(dt / tau_s);
        }
        AT(out, i) = AT(values, i) + behind;
    }
}

/* Return the second derivative at a sample: that of the parabola through it and its neighbours, 0 at the ends. */
static double bend_at(Floats values, Floats time_s, int64_t i) {
    if (i < 1 || i + 1 >= values.rows)
        return 0.0;
    const double before = AT(time_s, i) - AT(time_s, i - 1), after = AT(time_s, i + 1) - AT(time_s, i);
    if (!(before > 0.0 && after > 0.0))
        return 0.0;
    const double rise = (AT(values, i + 1) - AT(values, i)) / after;
    return 2.0 * (rise - (AT(values, i) - AT(values, i - 1)) / before) / (before + after);
}

/* Of a loop's time constant, a step of its integration at most. */
static const double SHORT_STEP = 0.1;
/* Of the limit, what is kept for braking while it catches up: the rest the command may take. */
static const double KEPT = 0.2;

/* Write what follows values (m) with an acceleration within ± limit; w is the gain of the loop.

What is integrated is the distance behind: it stays exactly 0 as long as nothing is cut off. A speed of w/2
times the distance is critically damped; without the second bound, sqrt(2·a·distance), a loop at its limit
would not brake in time and swing ever further. */
EXPORT void effects_limited(Floats values, Floats time_s, double limit, double w, Floats out) {
    double behind = 0.0, speed = 0.0, wanted = 0.0;
    for (int64_t i = 0; i < values.rows; i++) {
        const double before = wanted, dt = i > 0 ? AT(time_s, i) - AT(time_s, i - 1) : 0.0;
        wanted = bend_at(values, time_s, i);
        const int64_t steps = 1 + (int64_t)lesser(dt * w / SHORT_STEP, 1e4);
        const double step = dt / (double)steps;
        for (int64_t k = 0; k < steps && dt > 0.0; k++) {
            const double demanded = before + (wanted - before) * ((double)k + 0.5) / (double)steps;
            const double distance = fabs(behind);
            const double back = lesser(w / 2.0 * distance, sqrt(2.0 * KEPT * limit * distance));
            const double asked = demanded + 2.0 * w * (speed + (behind < 0.0 ? -back : back));
            speed += step * (demanded - greater(lesser(asked, limit), -limit));
            behind += step * speed;
        }
        AT(out, i) = AT(values, i) - behind;
    }
}

/* Write y'' + 2·zeta·w·y' + w²·y = w²·x for values (m), from rest at the first one. */
EXPORT void effects_second_order(Floats values, Floats time_s, double w, double zeta, Floats out) {
    const double decay = zeta * w, ringing = w * sqrt(1.0 - zeta * zeta);
    double y = values.rows > 0 ? AT(values, 0) : 0.0, speed = 0.0;
    for (int64_t i = 0; i < values.rows; i++) {
        if (i > 0) {
            const double dt = AT(time_s, i) - AT(time_s, i - 1);
            const double slope = dt > 0.0 ? (AT(values, i) - AT(values, i - 1)) / dt : 0.0;
            /* the particular solution for x + slope·t is that line, 2·zeta/w·slope behind */
            const double start = AT(values, i - 1) - 2.0 * zeta / w * slope;
            const double free = y - start, free_speed = speed - slope;
            const double part = (free_speed + decay * free) / ringing;
            const double shrunk = exp(-decay * dt), c = cos(ringing * dt), s = sin(ringing * dt);
            y = start + slope * dt + shrunk * (free * c + part * s);
            speed = slope + shrunk * ((part * ringing - decay * free) * c - (free * ringing + decay * part) * s);
        }
        AT(out, i) = y;
    }
}

/* Return the time of the extreme value at a sample: the vertex of the parabola through its neighbours. */
static double vertex(Floats q_rad, Floats time_s, int64_t at) {
    if (at == 0 || at + 1 >= q_rad.rows)
        return AT(time_s, at);
    const double before = AT(q_rad, at) - AT(q_rad, at - 1), after = AT(q_rad, at) - AT(q_rad, at + 1);
    if (fabs(before) < PLATEAU_RAD || before * after <= 0.0)
        return AT(time_s, at);
    const double part = 0.5 * (before - after) / (before + after);
    return AT(time_s, at) + part * (AT(time_s, at + 1) - AT(time_s, at));
}

/* What is written from one reversal to the next: the direction, and the time since it began. */
typedef struct {
    double sense, began_s;
    int64_t first;
} Run;

static void write_run(Run run, int64_t end, Floats time_s, Floats direction, Floats since_s) {
    for (int64_t i = run.first; i < end; i++) {
        AT(direction, i) = run.sense;
        AT(since_s, i) = greater(AT(time_s, i) - run.began_s, 0.0);
    }
}

/* Write the direction of motion (m) and the time (m) since it last reversed. */
EXPORT void effects_since_reversal(Floats q_rad, Floats time_s, Floats direction, Floats since_s) {
    if (q_rad.rows == 0)
        return;
    Run run = {0.0, -INFINITY, 0};
    double extreme = AT(q_rad, 0), low = extreme, high = extreme;
    int64_t at = 0; /* the last sample at the extreme value */
    for (int64_t i = 1; i < q_rad.rows; i++) {
        const double q = AT(q_rad, i);
        if (run.sense == 0.0) { /* not yet known which way it goes */
            low = lesser(low, q);
            high = greater(high, q);
            if (high - low < REVERSAL_RAD)
                continue;
            run.sense = q == high ? 1.0 : -1.0;
            extreme = q;
            at = i;
            continue;
        }
        const double ahead = run.sense * (q - extreme);
        if (ahead > 0.0)
            extreme = q;
        if (ahead > -PLATEAU_RAD)
            at = i;
        if (ahead < -REVERSAL_RAD) {
            write_run(run, at + 1, time_s, direction, since_s);
            run.first = at + 1;
            run.began_s = vertex(q_rad, time_s, at);
            run.sense = -run.sense;
            extreme = q;
            at = i;
        }
    }
    write_run(run, q_rad.rows, time_s, direction, since_s);
}
