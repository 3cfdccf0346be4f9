/* CYCLE81 and CYCLE82 of a Sinumerik, at once or behind each move (MCALL).

   CYCLE81(RTP, RFP, SDIS, DP, DPR): rapid to RFP + SDIS, feed to the depth, rapid to RTP; CYCLE82 waits DTB seconds
   at the depth. DP is absolute, DPR counts from RFP down (SINUMERIK 840D, Programming Guide Cycles, 2.1). Newer
   controls have _GMODE, _DMODE and _AMODE behind: 0, or 10 for a dwell in seconds and the depth as above. */

#include "gcode/siemens_cycles.h"

#include "gcode/compensate.h"
#include "gcode/cutter_settings.h"
#include "gcode/cycles.h"
#include "gcode/feed.h"
#include "gcode/motion.h"
#include "gcode/reporting.h"

enum { RTP, RFP, SDIS, DP, DPR, DTB, GMODE, DMODE, AMODE };
enum { START, BOTTOM, END, DWELL };
static const double AS_BEFORE = 10.0, SAME_DEPTH = 1e-9;

static bool refuse(Block *b, int reason) {
    report(b, F_DIALECT_STATEMENT, (Says){.a = reason});
    return true;
}

static bool is_stated(const Block *b, int k) { return k < b->arguments && !isnan(b->argument[k]); }

static double or_zero(const Block *b, int k) { return is_stated(b, k) ? b->argument[k] : 0.0; }

/* Tell whether the arguments behind the depths say nothing but what is read. */
static bool are_further_plain(const Block *b) {
    const bool dwells = b->cycle == V_CYCLE_DWELL ? or_zero(b, DTB) >= 0.0 : or_zero(b, DTB) == 0.0;
    const double display = or_zero(b, DMODE), counting = or_zero(b, AMODE);
    return dwells && or_zero(b, GMODE) == 0.0 && (display == 0.0 || display == AS_BEFORE) &&
           (counting == 0.0 || counting == AS_BEFORE);
}

/* Find heights (mm) and dwell of the cycle of a block; return false where they are not as they are read. */
static bool take_heights(const Block *b, double to[4]) {
    const double unit_mm = b->state->unit_mm, reference = or_zero(b, RFP), start = reference + or_zero(b, SDIS);
    const double by_relative = reference - or_zero(b, DPR);
    const double depth = is_stated(b, DPR) ? by_relative : or_zero(b, DP);
    const bool two = is_stated(b, DP) && is_stated(b, DPR) && fabs(b->argument[DP] - by_relative) > SAME_DEPTH;
    const bool stated = is_stated(b, RTP) && is_stated(b, RFP) && (is_stated(b, DP) || is_stated(b, DPR));
    to[START] = start * unit_mm;
    to[BOTTOM] = depth * unit_mm;
    to[END] = or_zero(b, RTP) * unit_mm;
    to[DWELL] = or_zero(b, DTB);
    const double largest_mm = greater(greater(fabs(to[START]), fabs(to[BOTTOM])), fabs(to[END]));
    return stated && !two && largest_mm <= FAR_MM && or_zero(b, SDIS) >= 0.0 && or_zero(b, DPR) >= 0.0 && depth < reference &&
           or_zero(b, RTP) >= start && are_further_plain(b);
}

/* Drill a hole where the tool stands; return false where there is no room for its rows. */
static bool drill(Block *b, int32_t cycle, const double mm[4]) {
    State *s = b->state;
    if (s->cutter_mode & S_CUTTER_ON) {
        refuse_under_compensation(b, s->cutter_code);
        return true;
    }
    Cycle c = cycle_of(b);
    c.motion = cycle;
    c.r = mm[START] / s->unit_mm;
    c.bottom = mm[BOTTOM] / s->unit_mm;
    c.clear = c.level = mm[END] / s->unit_mm;
    c.dwell_s = mm[DWELL];
    c.r_known = c.level_known = true;
    const int finding = s->feed_mode == V_INVERSE_TIME ? F_NO_INVERSE_TIME : feed_speed(b, 0.0, &c.mm_s);
    if (finding != F_OK) {
        report_speed(b, finding);
        return true;
    }
    return drill_here(b, &c);
}

static bool stands_alone(const Block *b) {
    for (int index = 0; index < V_LETTERS; index++)
        if (b->has[index])
            return false;
    for (int group = 0; group < V_GROUPS; group++)
        if (b->g[group] >= 0)
            return false;
    return b->m_codes[0] < 0 && !b->corner && !b->tip;
}

/* Carry out a block with a cycle or MCALL: drill, or keep what is drilled behind each move that follows. */
bool cycle_call(Block *b) {
    State *s = b->state;
    double mm[4];
    if (!stands_alone(b))
        return refuse(b, DR_REASON_CYCLE_BESIDE);
    if (b->modal)
        s->modal_call = b->cycle;
    if (!b->cycle)
        return b->modal || refuse(b, DR_REASON_CYCLE_BESIDE);
    if (!take_heights(b, mm))
        return refuse(b, DR_REASON_HEIGHTS);
    if (!b->modal)
        return drill(b, b->cycle, mm);
    for (int k = 0; k < 4; k++)
        s->modal_mm[k] = mm[k];
    return true;
}

/* Drill behind a move under MCALL; return false where there is no room. */
bool modal_cycle(Block *b) {
    const State *s = b->state;
    if (s->modal_call && b->g[V_NON_MODAL] == V_G53)
        return refuse(b, DR_REASON_MODAL_ZERO);
    return !s->modal_call || drill(b, s->modal_call, s->modal_mm);
}
