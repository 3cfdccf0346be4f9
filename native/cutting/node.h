/* The engagement at one sample: read, compared with others, written. */

#ifndef CUTTING_NODE_H
#define CUTTING_NODE_H

#include "cutting/edge.h"

enum { MOST_WRITTEN = RD_ARCS };

/* What is read at a sample: load of the chip at 1 mm a tooth and of the edge, depth, width and arcs. */
typedef struct {
    Load chip, edge;
    double a_p_mm, a_e_mm, phi_rad[2 * MOST_WRITTEN];
    int64_t arc_count;
} Node;

/* A range of coordinates along an axis. */
typedef struct {
    int64_t axis;
    double low, high;
} Range;

static inline bool is_in(Range range, const double *position) {
    return range.low <= position[range.axis] && position[range.axis] < range.high;
}

/* What a strip reads and writes: rows of the samples whose coordinate is its own; the last point of the path whose
   sweep the field shows. */
typedef struct {
    const Strip *strip;
    const Samples *samples;
    const Result *result;
    Range own;
    int64_t lag;
} Reader;

/* Return a sample with its place and heading, and note what is known without reading the edge if it is the strip's
   own. */
Sample sample_at(const Reader *reader, int64_t i, bool is_own);

/* Read the engagement at sample i. */
Node read_node(const Reader *reader, int64_t i, Sample *sample);

/* Write the row of a sample that lies a share of the way from one node to another. */
void write_row(const Reader *reader, const Sample *sample, int64_t i, const Node *a, const Node *b, double share);

/* Tell whether what is read at sample i is nearly what lies a share of the way between two other nodes: all in the air,
   or as many arcs in about the same places, and nearly the same force. */
bool lies_between(const Reader *reader, int64_t i, const Node *node, const Node *a, const Node *b, double share);

#endif
