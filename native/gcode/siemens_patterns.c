/* HOLES1, HOLES2 and CYCLE801 of a Sinumerik: the places at which a modal cycle drills.

   HOLES1(SPCA, SPCO, STA1, FDIS, DBH, NUM) is a row from a point on, at an angle: the first hole after FDIS, the others DBH
   apart, begun at the end that is nearer. HOLES2(CPA, CPO, RAD, STA1, INDA, NUM) is a circle from an angle on, INDA 0 a whole
   one. CYCLE801(SPCA, SPCO, STA, DIS1, DIS2, NUM1, NUM2) is a grid that is gone to and fro along the smaller distance, from the
   side that is nearer (SINUMERIK 840D, Programming Guide Cycles, drilling patterns). Between the holes the tool moves at rapid
   speed, with an exact stop. */

#include "gcode/siemens_patterns.h"

#include "gcode/cycle_words.h"
#include "gcode/expressions.h"
#include "gcode/offset_path.h"
#include "gcode/reporting.h"
#include "gcode/rows.h"
#include "gcode/siemens_cycles.h"

enum { MOST_HOLES = 10000, POINTS_OF_GRID = 7, POINTS = 6 };

/* Holes in two directions from a point, or on a circle where there is a step in angle; programmed units, degrees. */
typedef struct {
    Point from, along, across;
    double radius, begin_deg, step_deg;
    int64_t inner, outer;
    bool inner_back, outer_back;
} Pattern;

bool is_pattern(int32_t cycle) { return cycle == V_CYCLE_ROW || cycle == V_CYCLE_CIRCLE || cycle == V_CYCLE_GRID; }

static double argument(const Block *b, int k) { return k < b->arguments && !isnan(b->argument[k]) ? b->argument[k] : 0.0; }

/* Return an argument as a number of holes, NOT_WHOLE where it is none. */
static int64_t holes(const Block *b, int k) {
    const int32_t count = whole(fabs(argument(b, k)));
    return count > 0 && count <= MOST_HOLES ? count : NOT_WHOLE;
}

static Point towards(double deg) { return (Point){cosine(deg), sine(deg)}; }

/* HOLES1 and CYCLE801, seen from where the tool stands. */
static bool take_grid(const Block *b, Point here, Pattern *p) {
    const bool row = b->cycle == V_CYCLE_ROW;
    const double first = row ? fabs(argument(b, 3)) : 0.0, d1 = fabs(argument(b, row ? 4 : 3)), d2 = row ? 0.0 : fabs(argument(b, 4));
    const int64_t n1 = holes(b, 5), n2 = row ? 1 : holes(b, 6);
    const Point u = towards(argument(b, 2)), v = quarter(u, 1), from = plus((Point){argument(b, 0), argument(b, 1)}, first, u);
    const double at_u = dot(minus(here, from), u), at_v = dot(minus(here, from), v);
    const bool back_u = at_u > 0.5 * d1 * (double)(n1 - 1), back_v = at_v > 0.5 * d2 * (double)(n2 - 1);
    const bool along_u = row || d1 <= d2;
    const Point step_u = {d1 * u.u, d1 * u.v}, step_v = {d2 * v.u, d2 * v.v};
    *p = along_u ? (Pattern){from, step_u, step_v, 0, 0, 0, n1, n2, back_u, back_v}
                 : (Pattern){from, step_v, step_u, 0, 0, 0, n2, n1, back_v, back_u};
    return n1 > 0 && n2 > 0 && n1 * n2 <= MOST_HOLES;
}

static bool take_circle(const Block *b, Pattern *p) {
    static const double FULL_DEG = 360.0;
    const int64_t count = holes(b, 5);
    const double stated_deg = argument(b, 4), step_deg = stated_deg != 0.0 ? stated_deg : FULL_DEG / (double)count;
    *p = (Pattern){.from = {argument(b, 0), argument(b, 1)}, .radius = fabs(argument(b, 2)), .begin_deg = argument(b, 3),
                   .step_deg = step_deg, .inner = count, .outer = 1};
    return count > 0 && p->radius > 0.0 && fabs(step_deg) * (double)(count - 1) < FULL_DEG;
}

/* Return the hole at a place of the order in which they are drilled. */
static Point hole_of(const Pattern *p, int64_t row, int64_t k) {
    const bool back = p->inner_back != (row % 2 == 1);
    const double i = (double)(back ? p->inner - 1 - k : k), j = (double)(p->outer_back ? p->outer - 1 - row : row);
    if (p->radius > 0.0)
        return plus(p->from, p->radius, towards(p->begin_deg + p->step_deg * (double)k));
    return plus(plus(p->from, i, p->along), j, p->across);
}

/* Tell whether the block has what is read: holes in G17 under G90, from a known place, and nothing behind the arguments. */
static bool is_read(const Block *b, Pattern *p) {
    const State *s = b->state;
    const double tip_mm[3] = {s->x, s->y, s->z};
    double here_mm[3];
    programmed_of(b, tip_mm, here_mm);
    for (int k = b->cycle == V_CYCLE_GRID ? POINTS_OF_GRID : POINTS; k < b->arguments; k++)
        if (argument(b, k) != 0.0)
            return false;
    if (s->plane != V_PLANE_XY || !s->absolute || !s->known_x || !s->known_y || !s->modal_call)
        return false;
    return b->cycle == V_CYCLE_CIRCLE ? take_circle(b, p) : take_grid(b, (Point){here_mm[0] / s->unit_mm, here_mm[1] / s->unit_mm}, p);
}

/* Drill a hole of the modal cycle at each place of the pattern; return false where there is no room. */
bool drill_pattern(Block *b) {
    State *s = b->state;
    Pattern p;
    const int64_t errors = b->counts->errors;
    if (b->modal || !is_read(b, &p)) {
        report(b, F_DIALECT_STATEMENT, (Says){.a = DR_REASON_PATTERN});
        return true;
    }
    for (int64_t row = 0; row < p.outer; row++)
        for (int64_t k = 0; k < p.inner && b->counts->errors == errors; k++) {
            const int8_t exact_stop = s->exact_stop;
            const Point at = hole_of(&p, row, k);
            Cycle c = cycle_of(b);
            if (!has_cycle_room(b, 1, 0))
                return false;
            c.u_mm = at.u * s->unit_mm;
            c.v_mm = at.v * s->unit_mm;
            s->exact_stop = 1;
            go_along(b, &c, c.height, c.height_known, RAPID_MM_S);
            s->exact_stop = exact_stop;
            if (!modal_cycle(b))
                return false;
        }
    return true;
}
