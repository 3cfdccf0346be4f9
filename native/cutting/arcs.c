/* Arcs of engagement of one sample: listed, joined, written. */

#include "cutting/arcs.h"

/* Arcs that are closer in rad touch. */
#define TOUCHING_RAD 1e-9

/* Sort arcs and join those that touch. */
static void merge(Arcs *arcs) {
    Arc *at = arcs->at;
    for (int64_t k = 1; k < arcs->count; k++) {
        const Arc arc = at[k];
        int64_t place = k;
        for (; place > 0 && at[place - 1].a > arc.a; place--)
            at[place] = at[place - 1];
        at[place] = arc;
    }
    int64_t left = 0;
    for (int64_t k = 1; k < arcs->count; k++) {
        if (at[k].a <= at[left].b + TOUCHING_RAD)
            at[left].b = greater(at[left].b, at[k].b);
        else
            at[++left] = at[k];
    }
    arcs->count = left + 1;
}

void put_arc(Arcs *arcs, double a, double b) {
    if (arcs->count > 0 && arcs->at[arcs->count - 1].b == a) {
        arcs->at[arcs->count - 1].b = b;
        return;
    }
    if (arcs->count == MOST_ARCS)
        merge(arcs);
    if (arcs->count < MOST_ARCS)
        arcs->at[arcs->count++] = (Arc){a, b};
}

static void drop_narrowest(Arcs *arcs) {
    Arc *at = arcs->at;
    int64_t narrowest = 0;
    for (int64_t k = 1; k < arcs->count; k++)
        if (at[k].b - at[k].a < at[narrowest].b - at[narrowest].a)
            narrowest = k;
    arcs->count--;
    for (int64_t k = narrowest; k < arcs->count; k++)
        at[k] = at[k + 1];
}

void write_union(Arcs *arcs, double *phi_rad, int64_t most_written) {
    merge(arcs);
    while (arcs->count > most_written)
        drop_narrowest(arcs);
    for (int64_t k = 0; k < arcs->count; k++) {
        phi_rad[2 * k] = arcs->at[k].a;
        phi_rad[2 * k + 1] = arcs->at[k].b;
    }
}
