/* Which motion carries a trigger, and with what delay, so that it acts at an instant. */

#include "core.h"

#include "constants.h"
#include "search.h"

/* Instants closer than this are the same. */
#define TINY_S 1e-9
/* Added to the cycle between triggers of different motions: each motion's start, read from the samples of a
   Motion, may be off by half of it. Delays within one motion are exact. */
#define BETWEEN_S 0.003
/* Part of a ms by which a delay may be off a whole one. */
#define WHOLE_MS 1e-6

enum { NO_MOTION = -1 };

/* Return how many rising numbers are not greater than a number. */
static int64_t rows_up_to(Ints rising, int64_t number) {
    int64_t from = 0, behind = rising.rows;
    while (from < behind) {
        const int64_t middle = from + (behind - from) / 2;
        if (AT(rising, middle) <= number)
            from = middle + 1;
        else
            behind = middle;
    }
    return from;
}

/* Return the last motion that begins at an instant or before. */
static int64_t motion_at(Floats begin, double instant) {
    return count_up_to(begin, begin.rows, instant + TINY_S) - 1;
}

/* Write motion and delay of the latest trigger for each deadline, the last first.

   row: that of each motion; most_waiting triggers may be in view at a time, of in_view motions (0 = any).
   Where the trigger would be before the start of its section, the motion stays NO_MOTION. */
EXPORT void krl_place_latest(Floats deadline, Floats earliest, Ints row, Floats begin, Floats end,
                             double cycle, int64_t most_waiting, int64_t in_view, Ints motion, Ints delay_ms) {
    const int64_t count = deadline.rows;
    double limit = INFINITY;
    int64_t behind = NO_MOTION;
    for (int64_t j = count - 1; j >= 0; j--) {
        double latest = lesser(AT(deadline, j), limit);
        int64_t w = motion_at(begin, latest);
        if (w != behind) {
            latest = lesser(latest, limit - BETWEEN_S);
            w = motion_at(begin, latest);
        }
        const bool crowds = in_view > 0 && j + most_waiting < count;
        const int64_t other = crowds ? AT(motion, j + most_waiting) : NO_MOTION;
        if (other >= 0) { /* they must not be in view at the same time */
            w = least(w, rows_up_to(row, AT(row, other) - in_view) - 1);
            const double apart = w != behind ? BETWEEN_S : 0.0;
            latest = w >= 0 ? lesser(lesser(latest, AT(end, w)), limit - apart) : -INFINITY;
        }
        if (w < 0 || latest < AT(earliest, j) - TINY_S) {
            limit = lesser(latest, AT(earliest, j)) - cycle;
            behind = NO_MOTION;
            continue;
        }
        const double within = (lesser(latest, AT(end, w)) - AT(begin, w)) * U_MS_PER_S;
        const int64_t ms = most(0, (int64_t)floor(within + WHOLE_MS));
        const double fire = AT(begin, w) + (double)ms / U_MS_PER_S;
        if (fire < AT(earliest, j) - TINY_S) {
            limit = AT(earliest, j) - cycle;
            behind = NO_MOTION;
            continue;
        }
        AT(motion, j) = w;
        AT(delay_ms, j) = ms;
        limit = fire - cycle;
        behind = w;
    }
}

/* Move triggers that are too early, or too close to the one before, to the next instant that is free.

   This happens at the start of a section. It ends at the first trigger for which no motion is left. */
EXPORT void krl_delay_at_starts(Floats earliest, Floats begin, Floats end, double cycle, Ints motion,
                                Ints delay_ms) {
    double last = -INFINITY;
    for (int64_t j = 0; j < motion.rows; j++) {
        const int64_t own = AT(motion, j);
        double fire = own >= 0 ? AT(begin, own) + (double)AT(delay_ms, j) / U_MS_PER_S : -INFINITY;
        const double wanted = greater(AT(earliest, j), last + cycle);
        if (fire < wanted - TINY_S) {
            AT(motion, j) = NO_MOTION;
            int64_t w = count_below(end, end.rows, wanted - TINY_S);
            for (; w < end.rows && AT(motion, j) < 0; w++) {
                const double within = (wanted - AT(begin, w)) * U_MS_PER_S;
                const int64_t ms = most(0, (int64_t)ceil(within - WHOLE_MS));
                fire = AT(begin, w) + (double)ms / U_MS_PER_S;
                if (fire <= AT(end, w) + TINY_S) {
                    AT(motion, j) = w;
                    AT(delay_ms, j) = ms;
                }
            }
            if (AT(motion, j) < 0)
                return;
        }
        last = fire;
    }
}
