/* What the interpreter hands over beside rows: findings, consequences, notes and events. */

#include "gcode/reporting.h"

static bool is_warning(int32_t number) {
    static const int32_t warnings[] = F_WARNINGS;
    for (size_t k = 0; k < sizeof warnings / sizeof *warnings; k++)
        if (warnings[k] == number)
            return true;
    return false;
}

/* Keep a finding of a line, unless its block has been reported already. */
void report_at(Block *block, int32_t line, int32_t number, Says says) {
    Counts *counts = block->counts;
    if (counts->mute)
        return;
    const FoundView raised = block->machine->raised;
    const bool warning = is_warning(number);
    counts->errors += !warning;
    const int64_t room = warning ? raised.rows / 2 : raised.rows; /* warnings never crowd out an error */
    if (counts->findings < room)
        AT(raised, counts->findings++) = (Found){number, line, says.a, says.b, says.c};
    else
        counts->dropped++;
}

/* Keep a finding of this block. */
void report(Block *block, int32_t number, Says says) { report_at(block, block->line, number, says); }

/* Tell whether what is found now rests on state in doubt; if so, count it as a consequence. */
bool rests_on_doubt(Block *block, int32_t doubt) {
    if (!(block->state->doubt & doubt))
        return false;
    if (!block->counts->mute)
        block->counts->consequences++;
    return true;
}

/* Keep a finding, unless it rests on state in doubt. */
void report_unless(Block *block, int32_t doubt, int32_t number, Says says) {
    if (!rests_on_doubt(block, doubt))
        report(block, number, says);
}

/* Count a block with something harmless; the first is kept with its line. */
void note(Block *block, int which, int32_t word) {
    State *s = block->state;
    if (s->note_count[which] == 0) {
        s->note_line[which] = block->line;
        s->note_word[which] = word;
    }
    s->note_count[which]++;
}

/* Keep an event at the row where the tool stands. */
void event(Block *block, int32_t kind, double a, double b) {
    const int64_t row = block->counts->rows - 1;
    const double dwell_s = AT(block->machine->rows.dwell_s, row);
    AT(block->machine->events, block->counts->events++) = (Event){row, kind, block->line, a, b, dwell_s, NAN, NAN};
}

static double word_or_none(const Block *block, int index) { return block->has[index] ? block->word[index] : NAN; }

/* Keep an M-code that the cell maps to KRL, with its words. */
void event_of_words(Block *block, int32_t m) {
    event(block, S_EVENT_M, m, word_or_none(block, V_WORD_P));
    Event *made = &AT(block->machine->events, block->counts->events - 1);
    made->q = word_or_none(block, V_WORD_Q);
    made->e = word_or_none(block, V_WORD_E);
}
