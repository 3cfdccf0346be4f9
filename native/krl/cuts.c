/* Where motions are cut so that fewer triggers wait at a time; all places are lengths of path. */

#include "core.h"

#include "search.h"

/* Where each motion may be cut, and how far apart cuts in it must be. */
typedef struct {
    Floats low, high, apart;
} Zones;

/* The cuts so far, in order. */
typedef struct {
    Floats at;
    int64_t count;
} Cuts;

/* Return where between two cuts, left and right, a place in a zone is farthest from both. */
static double middle_of(double left, double right, double begin, double end) {
    if (left >= begin && right <= end)
        return (left + right) / 2.0;
    return left >= begin || (right > end && end - left > right - begin) ? end : begin;
}

/* Return the path farthest from all cuts between start and end, within motions; NaN where it is too near. */
static double farthest(Cuts cuts, double start, double end, Zones zones, int64_t first, int64_t last) {
    double best = NAN, room = 0.0;
    for (int64_t w = first; w <= last; w++) {
        const double a = greater(AT(zones.low, w), start), b = lesser(AT(zones.high, w), end);
        if (a >= b)
            continue;
        const int64_t behind = count_below(cuts.at, cuts.count, b);
        for (int64_t k = count_below(cuts.at, cuts.count, a); k <= behind; k++) {
            const double left = k > 0 ? AT(cuts.at, k - 1) : -INFINITY;
            const double right = k < cuts.count ? AT(cuts.at, k) : INFINITY;
            const double at = middle_of(left, right, a, b), distance = lesser(at - left, right - at);
            if (distance >= AT(zones.apart, w) && distance > room) {
                best = at;
                room = distance;
            }
        }
    }
    return best;
}

/* Return the last path between start and end, within motions, that cuts leave free; NaN without any. */
static double latest(Cuts cuts, double start, double end, Zones zones, int64_t first, int64_t last) {
    for (int64_t w = last; w >= first; w--) {
        const double apart = AT(zones.apart, w);
        double at = lesser(AT(zones.high, w), end);
        int64_t k = count_below(cuts.at, cuts.count, at + apart) - 1;
        for (; k >= 0 && at - AT(cuts.at, k) < apart; k--)
            at = lesser(at, AT(cuts.at, k) - apart);
        if (at > greater(AT(zones.low, w), start))
            return at;
    }
    return NAN;
}

static void insert(Cuts *cuts, double at) {
    const int64_t place = count_below(cuts->at, cuts->count, at);
    for (int64_t i = cuts->count; i > place; i--)
        AT(cuts->at, i) = AT(cuts->at, i - 1);
    AT(cuts->at, place) = at;
    cuts->count++;
}

/* Write paths at which to cut, in order; return how many.

   row: of each trigger; here, before: its path and an earlier one; window: its motion, of those that begin at
   `begin`. A cut lies between two triggers, where a motion may be cut, as far from others as can be. */
EXPORT int64_t krl_cut(Ints row, Floats here, Floats before, Ints window, Floats begin, Floats low,
                       Floats high, Floats apart, int64_t most_waiting, int64_t in_view, Floats cuts_mm) {
    const Zones zones = {low, high, apart};
    Cuts cuts = {cuts_mm, 0};
    for (int64_t first = 0; first + most_waiting < row.rows; first++) {
        const int64_t last = first + most_waiting;
        int64_t missing = in_view - (AT(row, last) - AT(row, first));
        if (missing <= 0)
            continue;
        const double start = (AT(here, first) + AT(here, first + 1)) / 2.0;
        const double end = (AT(here, last - 1) + AT(here, last)) / 2.0, early = AT(before, first);
        missing -= count_below(cuts.at, cuts.count, end) - count_below(cuts.at, cuts.count, start);
        const int64_t earliest = most(count_up_to(begin, begin.rows, early) - 1, 0);
        for (; missing > 0; missing--) {
            double at = farthest(cuts, start, end, zones, AT(window, first), AT(window, last));
            if (isnan(at))
                at = latest(cuts, early, end, zones, earliest, AT(window, last));
            if (isnan(at) || cuts.count == cuts_mm.rows)
                break;
            insert(&cuts, at);
        }
    }
    return cuts.count;
}
