/* Loops that change nothing: they have no end.

   A program has no memory but its modes and position, its parameters, its repeats and calls, and its tables of
   offsets. Where it comes back to a word with all of them as they were, it will do so for ever. Compared with
   the visit before 1, 2, 4, ... jumps backwards (R. P. Brent's way to find a cycle), so that a loop within a
   loop is seen as well. What changes on the way is counted, not compared: a loop that undoes its changes is
   left to the count of the lines. */

#include "gcode/laps.h"

#include <string.h>

/* Return the state without what only tells of the way so far. */
static State without_records(const State *state) {
    State s = *state;
    s.blocks = s.cutter_rows_removed = s.held_events = s.arc_end_rows = 0;
    s.arcs = s.misfits = s.misfits_other_centre = s.misfits_reversed = s.misfits_exchanged = s.spirals = 0;
    s.largest_mm = s.spiral_start = s.spiral_end = 0.0;
    s.spiral_line = 0;
    memset(s.held_rows, 0, sizeof s.held_rows);
    memset(s.note_count, 0, sizeof s.note_count);
    memset(s.note_line, 0, sizeof s.note_line);
    memset(s.note_word, 0, sizeof s.note_word);
    memset(s.moved_mm, 0, sizeof s.moved_mm);
    return s;
}

/* Tell whether a jump back to a word finds all as it was at an earlier one. */
bool repeats_itself(Run *run, int64_t word) {
    Course *at = run->course;
    const State *state = run->machine->state.at;
    State *kept = run->program->lap.at;
    if (at->lap_word == word && at->lap_frame == at->frame && at->lap_changes == at->changes) {
        const State here = without_records(state);
        if (memcmp(&here, kept, sizeof here) == 0)
            return true;
    }
    if (++at->laps < at->laps_until)
        return false;
    at->laps_until = 2 * at->laps;
    at->lap_word = word;
    at->lap_frame = at->frame;
    at->lap_changes = at->changes;
    *kept = without_records(state);
    return false;
}
