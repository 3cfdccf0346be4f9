/* How far motions that were read back are from the intended ones, in one pass (krl/differences.py). */

#include "constants.h"

#include <float.h>

/* The largest of some sizes, NaN as soon as one is. */
static inline double largest_of(double largest, double size) {
    return size > largest || isnan(size) ? size : largest;
}

static bool is_like_the_one_before(const ReadMotions *read, const Wanted *wanted, int64_t i) {
    for (int c = 0; c < 3; c++)
        if (CELL(read->pose, i, 3 + c) != CELL(read->pose, i - 1, 3 + c))
            return false;
    for (int c = 0; c < 4; c++)
        if (CELL(wanted->rotation, i, c) != CELL(wanted->rotation, i - 1, c))
            return false;
    return AT(wanted->tool, i) == AT(wanted->tool, i - 1);
}

/* Write the first motion of each run, from `first` up to `behind`, in which A, B, C, the intended rotation and
   the tool stay the same; return how many there are. */
EXPORT int64_t krl_rotation_runs(const ReadMotions *read, const Wanted *wanted, int64_t first, int64_t behind,
                                 Ints begins) {
    int64_t count = 0;
    for (int64_t i = first; i < behind; i++)
        if (i == first || !is_like_the_one_before(read, wanted, i))
            AT(begins, count++) = i;
    return count;
}

/* Note a motion at the first free place of a check, if there is one. */
static inline void note(const Noted *noted, int64_t check, int64_t row, double size) {
    const int64_t place = AT(noted->taken, check);
    if (place == noted->row.columns)
        return;
    CELL(noted->row, check, place) = row;
    CELL(noted->size, check, place) = size;
    AT(noted->taken, check)++;
}

/* Put a motion among those that are furthest off: NaN first, then by size, the earlier first of equal ones. */
static inline void rank(const Noted *noted, int64_t row, double size) {
    const double key = isnan(size) ? INFINITY : lesser(size, DBL_MAX);
    int64_t place = AT(noted->worst_count, 0);
    if (place == noted->worst.rows && !(key > AT(noted->worst_key, place - 1)))
        return;
    place = place < noted->worst.rows ? AT(noted->worst_count, 0)++ : place - 1;
    for (; place > 0 && key > AT(noted->worst_key, place - 1); place--) {
        AT(noted->worst, place) = AT(noted->worst, place - 1);
        AT(noted->worst_size, place) = AT(noted->worst_size, place - 1);
        AT(noted->worst_key, place) = AT(noted->worst_key, place - 1);
    }
    AT(noted->worst, place) = row;
    AT(noted->worst_size, place) = size;
    AT(noted->worst_key, place) = key;
}

static inline double distance(const ReadMotions *read, const Wanted *wanted, int64_t i) {
    double sum = 0.0;
    for (int c = 0; c < 3; c++)
        sum += squared(CELL(read->pose, i, c) - CELL(wanted->position_mm, i, c));
    return sqrt(sum);
}

/* Compare the motions from `first` up to `behind`; note what is beyond the limits.

   begins, angle_deg: the runs of `krl_rotation_runs`, and the angle in each. */
EXPORT void krl_compare(const ReadMotions *read, const Wanted *wanted, int64_t first, int64_t behind, Ints begins,
                        Floats angle_deg, const Noted *noted) {
    double *largest = &AT(noted->largest, 0);
    for (int64_t i = first, run = 0; i < behind; i++) {
        while (run + 1 < begins.rows && AT(begins, run + 1) <= i)
            run++;
        const bool is_home = AT(wanted->home, i), is_ptp = AT(wanted->ptp, i);
        const bool is_other = (AT(read->ptp, i) != 0) != is_ptp;
        const double off_mm = is_home ? 0.0 : distance(read, wanted, i);
        const double turned_deg = is_home ? 0.0 : AT(angle_deg, run);
        const double speed = is_ptp ? 0.0 : fabs(AT(read->speed_mm_s, i) - AT(wanted->speed_mm_s, i));
        const double cdis_mm = fabs(AT(read->cdis_mm, i) - AT(wanted->cdis_mm, i));
        const double wait_s = fabs(AT(read->wait_s, i) - AT(wanted->wait_s, i));
        largest[0] = largest_of(largest[0], off_mm);
        largest[1] = largest_of(largest[1], turned_deg);
        largest[2] = largest_of(largest[2], speed);
        rank(noted, i, off_mm);
        if (is_other)
            note(noted, DIFF_OTHER_KIND, i, 0.0);
        if (!(off_mm <= DIFF_POSITION_LIMIT_MM))
            note(noted, isnan(off_mm) ? DIFF_NO_POSITION : DIFF_POSITION, i, isnan(off_mm) ? 0.0 : off_mm);
        if (!(turned_deg <= DIFF_ROTATION_LIMIT_DEG))
            note(noted, isnan(turned_deg) ? DIFF_NO_ROTATION : DIFF_ROTATION, i,
                 isnan(turned_deg) ? 0.0 : turned_deg);
        if (speed > DIFF_SPEED_LIMIT_MM_S)
            note(noted, DIFF_SPEED, i, speed);
        if (isnan(speed) && !is_other)
            note(noted, DIFF_NO_SPEED, i, 0.0);
        if (!(cdis_mm <= DIFF_CDIS_LIMIT_MM))
            note(noted, DIFF_CDIS, i, cdis_mm);
        if (!(wait_s <= DIFF_WAIT_LIMIT_S))
            note(noted, DIFF_WAIT, i, wait_s);
    }
}
