/* The samples between two nodes.

A stretch is halved until the sample in its middle is nearly what lies between both ends; what is not read then lies
between two samples that are. Where contact begins or ends, or the force jumps, every sample is read. */

#include "cutting/stretch.h"

/* Length of a stretch, in radii, whose middle need not be read where both ends are alike. */
#define SHORT 0.3

enum { MOST_HALVINGS = 16 };

/* Return the share of the way from one sample to another at which a third lies. */
static double share_of_way(const Samples *samples, int64_t begin, int64_t i, int64_t end) {
    const double from_mm = AT(samples->way_mm, begin), length_mm = AT(samples->way_mm, end) - from_mm;
    return length_mm > 0.0 ? (AT(samples->way_mm, i) - from_mm) / length_mm : 0.0;
}

/* Return the sample between two that is the nearest to the middle of the way. */
static int64_t middle_of(const Samples *samples, int64_t begin, int64_t end) {
    const double middle_mm = 0.5 * (AT(samples->way_mm, begin) + AT(samples->way_mm, end));
    int64_t i = begin + 1;
    while (i < end - 1 && AT(samples->way_mm, i) + AT(samples->way_mm, i + 1) <= 2.0 * middle_mm)
        i++;
    return i;
}

static bool is_own(const Reader *reader, int64_t i) {
    return is_in(reader->own, &CELL(reader->samples->position_mm, i, 0));
}

static Known read_at(const Reader *reader, int64_t i) {
    const bool is_written = is_own(reader, i);
    Sample sample = sample_at(reader, i, is_written);
    const Known known = {i, read_node(reader, i, &sample)};
    if (is_written) {
        write_row(reader, &sample, i, &known.node, &known.node, 0.0);
        AT(reader->result->is_read, i) = 1;
    }
    return known;
}

static void write_between(const Reader *reader, const Known *a, const Known *b) {
    for (int64_t i = a->i + 1; i < b->i; i++)
        if (is_own(reader, i)) {
            const Sample sample = sample_at(reader, i, true);
            write_row(reader, &sample, i, &a->node, &b->node, share_of_way(reader->samples, a->i, i, b->i));
        }
}

/* Tell whether what is read in the middle is nearly what lies between both ends. */
static bool is_smooth(const Reader *reader, const Known *a, const Known *middle, const Known *b) {
    const double share = share_of_way(reader->samples, a->i, middle->i, b->i);
    return lies_between(reader, middle->i, &middle->node, &a->node, &b->node, share);
}

/* Tell whether both ends of a short stretch are alike. */
static bool is_level(const Reader *reader, const Known *a, const Known *b) {
    const Samples *samples = reader->samples;
    const double radius = outline_of(reader->strip->path, AT(samples->tool, b->i))->radius;
    return AT(samples->way_mm, b->i) - AT(samples->way_mm, a->i) <= SHORT * radius &&
           lies_between(reader, b->i, &b->node, &a->node, &a->node, 0.0);
}

Known read_stretch(const Reader *reader, Known before, int64_t end) {
    Known ahead[MOST_HALVINGS] = {read_at(reader, end)}; /* read and not yet reached, the nearest one last */
    for (int last = 0; last >= 0;) {
        const Known *next = &ahead[last];
        if (before.i + 1 == next->i || is_level(reader, &before, next)) {
            write_between(reader, &before, next);
        } else {
            const Known middle = read_at(reader, middle_of(reader->samples, before.i, next->i));
            if (last + 1 < MOST_HALVINGS && !is_smooth(reader, &before, &middle, next)) {
                ahead[++last] = middle;
                continue;
            }
            write_between(reader, &before, &middle);
            write_between(reader, &middle, next);
        }
        before = *next;
        last--;
    }
    return before;
}
