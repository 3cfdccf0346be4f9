/* The nearest triangle of a mesh, by a tree of boxes, and the inside of its surface. */

#include "collision/tree.h"

#include "constants.h"

enum { LEAF = SCENE_LEAF, DEEPEST = 40 };

/* The triangle that was nearest before gives the first bound. A node's children are 2n + 1 and 2n + 2; the
   leaves hold LEAF triangles each, in the order of the triangles. */
double tree_distance(const Tree *tree, const double *segment, int64_t *nearest, double *place) {
    double bound = segment_triangle(segment, &CELL(tree->triangles, tree->triangle + *nearest, 0), place);
    int64_t open[2 * DEEPEST];
    int depth = 0;
    const int64_t inner = ((int64_t)1 << tree->levels) - 1;
    open[depth++] = 0;
    while (depth > 0 && bound > 0.0) {
        const int64_t node = open[--depth];
        const double *box = &CELL(tree->boxes, tree->box + node, 0);
        if (segment_box(segment, box, box + 3, 0) >= bound)
            continue;
        if (node < inner) {
            double far[2];
            for (int child = 0; child < 2; child++) {
                const double *of_child = &CELL(tree->boxes, tree->box + 2 * node + 1 + child, 0);
                far[child] = segment_box(segment, of_child, of_child + 3, 0);
            }
            const int first = far[1] < far[0];
            if (far[!first] < bound)
                open[depth++] = 2 * node + 1 + !first;
            if (far[first] < bound)
                open[depth++] = 2 * node + 1 + first;
            continue;
        }
        const int64_t begin = (node - inner) * LEAF, end = least(begin + LEAF, tree->count);
        for (int64_t each = begin; each < end; each++) {
            double point[3];
            const double far = segment_triangle(segment, &CELL(tree->triangles, tree->triangle + each, 0), point);
            if (far < bound) {
                bound = far;
                *nearest = each;
                copy3(point, place);
            }
        }
    }
    return sqrt(bound);
}

/* The solid angle of all triangles, Van Oosterom & Strackee 1983: 4 pi inside a closed surface, 0 outside. */
bool tree_holds(const Tree *tree, const double *point) {
    const double *box = &CELL(tree->boxes, tree->box, 0);
    for (int k = 0; k < 3; k++)
        if (point[k] < box[k] || point[k] > box[3 + k])
            return false;
    double angle = 0.0;
    for (int64_t each = 0; each < tree->count; each++) {
        const double *corners = &CELL(tree->triangles, tree->triangle + each, 0);
        double a[3], b[3], c[3], across[3];
        minus3(corners, point, a);
        minus3(corners + 3, point, b);
        minus3(corners + 6, point, c);
        const double far_a = sqrt(dot3(a, a)), far_b = sqrt(dot3(b, b)), far_c = sqrt(dot3(c, c));
        cross3(b, c, across);
        const double flat = far_a * far_b * far_c + dot3(a, b) * far_c + dot3(b, c) * far_a + dot3(c, a) * far_b;
        angle += 2.0 * atan2(dot3(a, across), flat);
    }
    return fabs(angle) > 2.0 * PI;
}
