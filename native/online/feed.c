/* Direction of feed, from the commanded positions (online/feed.py). */

#include "constants.h"
#include "core.h"

/* Write the feed (n, 3) of positions (n, 3); ring (k, 3) has the last ones, count how many there were. */
EXPORT void online_feed(Floats position_mm, Floats ring, Ints count, Floats direction, Floats feed) {
    for (int64_t i = 0; i < position_mm.rows; i++) {
        const double *position = &CELL(position_mm, i, 0);
        if (AT(count, 0) == 0)
            for (int64_t k = 0; k < ring.rows; k++)
                for (int c = 0; c < 3; c++)
                    CELL(ring, k, c) = position[c];
        double *then = &CELL(ring, AT(count, 0) % ring.rows, 0), moved_2 = 0.0;
        for (int c = 0; c < 3; c++)
            moved_2 += squared(position[c] - then[c]);
        for (int c = 0; c < 3; c++) {
            if (moved_2 >= FEED_LEAST_MM * FEED_LEAST_MM)
                AT(direction, c) = position[c] - then[c];
            then[c] = position[c];
            CELL(feed, i, c) = AT(direction, c);
        }
        AT(count, 0)++;
    }
}
