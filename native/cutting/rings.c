/* Material along a ring of the cutter, before the sweep that is about to cut it.

Loops over bins have no branches, so that the compiler takes several bins at once. */

#include "cutting/rings.h"

#include "cutting/walls.h"

/* Room for rounding in a bound of a sweep's height. */
#define ROUNDING_MM 1e-4

enum { CHUNK = ED_CHUNK }; /* bins that are worked on together; arrays of bins have so many to spare */

/* A range of bins: where the cells stand in memory, and their middles as seen from the axis. */
typedef struct {
    int32_t at[CHUNK];
    float x[CHUNK], y[CHUNK];
} Chunk;

/* The cells about a sample: their size, its place in its own, in cells, and its own in memory; the grid, counted from
   there. */
typedef struct {
    float dx, dy, x, y;
    int64_t at;
    int32_t low_u, high_u, low_v, high_v, stride;
} Ground;

/* A cutter's outline in single precision. */
typedef struct {
    float radius, bottom, corner, arc_radius, arc_top, steep;
} Outline32;

static Ground ground_at(const Grid *grid, const Sample *sample) {
    const double x = (sample->x - grid->x_mm) / grid->dx_mm, y = (sample->y - grid->y_mm) / grid->dy_mm;
    const Cell cell = cell_at(grid, sample->x, sample->y);
    const int64_t rows = grid->height.rows, columns = grid->height.columns;
    return (Ground){.dx = (float)grid->dx_mm,
                    .dy = (float)grid->dy_mm,
                    .x = (float)(x - floor(x)),
                    .y = (float)(y - floor(y)),
                    .at = cell.row * columns + cell.column,
                    .low_u = (int32_t)-cell.column,
                    .high_u = (int32_t)(columns - 1 - cell.column),
                    .low_v = (int32_t)-cell.row,
                    .high_v = (int32_t)(rows - 1 - cell.row),
                    .stride = (int32_t)columns};
}

static Outline32 in_single(const Outline *outline) {
    return (Outline32){(float)outline->radius,
                       (float)outline->bottom,
                       (float)outline->corner,
                       outline->steep > 0.0 ? (float)outline->arc_radius : INFINITY,
                       (float)outline->arc_top,
                       (float)outline->steep};
}

static inline float clamped(float x, float low, float high) {
    x = x > low ? x : low;
    return x < high ? x : high;
}

/* `outline_height` without branches. */
static inline float surface_at(const Outline32 *outline, float r) {
    r = r < outline->radius ? r : outline->radius;
    const float x = clamped(r - outline->bottom, 0.0f, outline->corner);
    const float arc = outline->corner - sqrtf(outline->corner * outline->corner - x * x);
    const float side = outline->arc_top + (r - outline->arc_radius) * outline->steep;
    return r < outline->arc_radius ? arc : side;
}

/* List the cells of CHUNK bins; beyond the grid, those at its border, which are empty. */
static void list_cells(const Ground *ground, const Ring *ring, int64_t first, Chunk *chunk) {
    const Ground on = *ground;
    const float rx = (float)ring->r / on.dx, ry = (float)ring->r / on.dy;
    const float *restrict east = ring->east + first, *restrict north = ring->north + first;
    for (int32_t j = 0; j < CHUNK; j++) {
        const float column = floorf(on.x + rx * east[j]), row = floorf(on.y + ry * north[j]);
        const float x = (column + 0.5f - on.x) * on.dx, y = (row + 0.5f - on.y) * on.dy;
        int32_t u = (int32_t)column, v = (int32_t)row;
        u = u > on.low_u ? u : on.low_u;
        v = v > on.low_v ? v : on.low_v;
        u = u < on.high_u ? u : on.high_u;
        v = v < on.high_v ? v : on.high_v;
        chunk->at[j] = v * on.stride + u;
        chunk->x[j] = x;
        chunk->y[j] = y;
    }
}

/* Write how far the tops of CHUNK bins stand above the cutter's surface.

   A cell's height is that of its middle, so it is compared with the surface there. This is also better for a layer so
   thin that it is parallel to the cutter. */
static void stand_above_cutter(const Outline32 *outline, const Chunk *chunk, float height, const float *restrict tops,
                               float *restrict above) {
    const Outline32 cutter = *outline;
    const float feel = (float)FEEL_MM;
    for (int32_t j = 0; j < CHUNK; j++) {
        const float r = sqrtf(chunk->x[j] * chunk->x[j] + chunk->y[j] * chunk->y[j]);
        const float own = tops[j] - surface_at(&cutter, r), plain = tops[j] - height;
        above[j] = (own <= feel) | (own < 2.0f * fabsf(own - plain)) ? own : plain;
    }
}

/* Lower the tops of CHUNK bins to `Sample.disc`; such a cell has no wall. */
static void lower_to_disc(const Sample *sample, const Chunk *chunk, float *restrict tops) {
    const float x = (float)(sample->x - sample->disc[0]), y = (float)(sample->y - sample->disc[1]);
    const float top = (float)(sample->disc[2] - sample->z), square = (float)squared(sample->outline->bottom - JOINT_MM);
    for (int32_t j = 0; j < CHUNK; j++) {
        const float u = x + chunk->x[j], v = y + chunk->y[j];
        tops[j] = (u * u + v * v < square) & (top < tops[j]) ? top : tops[j];
    }
}

/* Replace the top of a cell with a wall, and what is above the ring, by that of the point's side. */
static void correct_at_wall(const Grid *grid, const Path *path, const Sample *sample, const Ring *ring, int64_t j) {
    const double x = sample->x + ring->r * (double)ring->east[j], y = sample->y + ring->r * (double)ring->north[j];
    const Cell cell = cell_at(grid, x, y);
    if (!is_inside(grid, cell) || CELL(grid->wall, cell.row, cell.column) < 0)
        return;
    const double top = top_at(grid, path, sample, x, y);
    ring->tops[j] = (float)(top - sample->z);
    ring->above[j] = ring->tops[j] - (float)ring->height;
}

void read_cells(const Grid *grid, const Path *path, const Sample *sample, const Ring *ring) {
    const Ground ground = ground_at(grid, sample);
    const Outline32 outline = in_single(sample->outline);
    const Floats32 heights = grid->height;
    const Ints32 walls = grid->wall;
    const double z = sample->z;
    Chunk chunk;
    for (int64_t first = ring->first; first < ring->after; first += CHUNK) {
        float *tops = ring->tops + first;
        int32_t no_wall = -1;
        list_cells(&ground, ring, first, &chunk);
        for (int32_t j = 0; j < CHUNK; j++) {
            const int64_t at = ground.at + chunk.at[j];
            no_wall &= AT(walls, at);
            tops[j] = (float)((double)AT(heights, at) - z);
        }
        if (sample->disc)
            lower_to_disc(sample, &chunk, tops);
        if (ring->above != ring->tops)
            stand_above_cutter(&outline, &chunk, (float)ring->height, tops, ring->above + first);
        if (no_wall >= 0)
            for (int64_t j = first; j < least(first + CHUNK, ring->after); j++)
                if (AT(walls, ground.at + chunk.at[j - first]) >= 0)
                    correct_at_wall(grid, path, sample, ring, j);
    }
}

/* Return whether the sweep may lower anything in a range of bins: no point of it is below its lower end. */
static bool may_lower(const Way *sweep, const Sample *sample, const Ring *ring, Bins bins) {
    const float lowest = (float)(lesser(sweep->a[2], sweep->b[2]) - sample->z - ROUNDING_MM);
    const float above = lowest - (float)ring->height;
    int32_t is_above = 0;
    for (int64_t j = bins.first; j < bins.after; j++)
        is_above |= (ring->tops[j] > lowest) | (ring->above[j] > above);
    return is_above;
}

/* Lower a range of bins, at most CHUNK, by a sweep. */
static void take_off(const Way *sweep, const Sample *sample, const Ring *ring, Bins bins) {
    const Way way = *sweep;
    const Outline outline = *sample->outline;
    const float *east = ring->east + bins.first, *north = ring->north + bins.first;
    const double x = sample->x, y = sample->y, z = sample->z, r = ring->r;
    float cuts[CHUNK], height = (float)ring->height;
    for (int64_t j = 0; j < bins.after - bins.first; j++)
        cuts[j] = (float)(sweep_height(&way, &outline, x + r * (double)east[j], y + r * (double)north[j], 0.0) - z);
    for (int64_t j = bins.first; j < bins.after; j++) {
        const float cut = cuts[j - bins.first];
        ring->tops[j] = ring->tops[j] < cut ? ring->tops[j] : cut;
        ring->above[j] = ring->above[j] < cut - height ? ring->above[j] : cut - height;
    }
}

void take_off_recent(const Sample *sample, const Ring *ring) {
    for (int past = 0; past < sample->recent_count; past++)
        for (int64_t first = ring->first; first < ring->after; first += CHUNK) {
            const Bins bins = {first, least(first + CHUNK, ring->after)};
            if (may_lower(&sample->recent[past], sample, ring, bins))
                take_off(&sample->recent[past], sample, ring, bins);
        }
}
