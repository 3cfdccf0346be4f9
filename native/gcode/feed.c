/* The speed of a feed move: F per minute, per revolution, or as the inverse of a time. */

#include "gcode/feed.h"

#include "gcode/reporting.h"

static const double SLOWEST = 0.1; /* units/min, LinuxCNC's floor under inverse time */

/* Find the speed of a feed move of the given whole length, or return the finding. */
int feed_speed(const Block *b, double length_mm, double *mm_s) {
    const State *s = b->state;
    if (s->feed_mode == V_INVERSE_TIME) {
        if (!b->has[V_WORD_F])
            return F_NO_INVERSE_TIME;
        if (b->word[V_WORD_F] <= 0.0)
            return F_NO_FEED;
        *mm_s = greater(length_mm * b->word[V_WORD_F], SLOWEST * s->unit_mm) / U_S_PER_MIN;
        return F_OK;
    }
    if (s->feed <= 0.0)
        return F_NO_FEED;
    if (s->feed_mode == V_PER_REVOLUTION) {
        if (s->rpm <= 0.0)
            return F_FEED_PER_REV_STOPPED;
        *mm_s = s->feed * s->rpm / U_S_PER_MIN;
        return F_OK;
    }
    *mm_s = s->feed / U_S_PER_MIN;
    return F_OK;
}

/* Report what is wrong with the feed, once: the moves after it rest on it. */
void report_speed(Block *b, int finding) {
    State *s = b->state;
    if (finding == F_NO_INVERSE_TIME) {
        report_unless(b, S_DOUBT_FEED_MODE, finding, (Says){.a = s->feed_mode_line});
    } else if (finding == F_FEED_PER_REV_STOPPED) {
        report_unless(b, S_DOUBT_SPEED | S_DOUBT_FEED_MODE, finding, (Says){.a = s->feed_mode_line});
        s->doubt |= S_DOUBT_SPEED;
    } else {
        const int32_t dropped = s->feed_mode != V_INVERSE_TIME ? s->feed_mode_line : 0;
        report_unless(b, S_DOUBT_FEED | S_DOUBT_FEED_MODE, finding, (Says){.a = dropped, .b = s->feed_mode});
        s->doubt |= S_DOUBT_FEED;
    }
}
