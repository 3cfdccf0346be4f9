/* Polar words: @ is the distance from the zero of the programmed coordinates, ^ the angle from X in degrees. */

#include "gcode/polar.h"

#include "gcode/offsets.h"
#include "gcode/reporting.h"

static const double POLAR_ZERO_MM = 1e-9; /* nearer to the zero there is no direction */

/* Move a programmed point as the polar words say; what is not named stays, G91 adds. */
void polar_point(const Block *b, double programmed_mm[2]) {
    const State *s = b->state;
    const bool has_radius = b->has[V_WORD_RADIUS], has_angle = b->has[V_WORD_ANGLE];
    double radius_mm = hypot(programmed_mm[1], programmed_mm[0]);
    double angle_rad = atan2(programmed_mm[1], programmed_mm[0]);
    if (has_radius)
        radius_mm = b->word[V_WORD_RADIUS] * s->unit_mm + (s->absolute ? 0.0 : radius_mm);
    if (has_angle)
        angle_rad = b->word[V_WORD_ANGLE] * U_RAD_PER_DEG + (s->absolute ? 0.0 : angle_rad);
    programmed_mm[0] = radius_mm * cos(angle_rad);
    programmed_mm[1] = radius_mm * sin(angle_rad);
}

/* Tell whether the polar words of a block that moves have a meaning; report it where they have none. */
bool polar_is_sound(Block *b) {
    const State *s = b->state;
    const double tip_mm[3] = {s->x, s->y, s->z};
    double here_mm[3];
    const bool both = b->has[V_WORD_RADIUS] && b->has[V_WORD_ANGLE];
    b->used[V_WORD_RADIUS] = b->used[V_WORD_ANGLE] = true;
    programmed_of(b, tip_mm, here_mm);
    const bool at_zero = hypot(here_mm[0], here_mm[1]) < POLAR_ZERO_MM;
    if (s->plane != V_PLANE_XY)
        report_unless(b, S_DOUBT_PLANE, FP_PLANE, (Says){.a = s->plane});
    else if (b->has[V_WORD_X] || b->has[V_WORD_Y])
        report(b, FP_WITH_AXIS, (Says){.a = b->has[V_WORD_X] ? 'X' : 'Y'});
    else if (b->g[V_NON_MODAL] == V_G53)
        report(b, FP_G53, (Says){0});
    else if (at_zero && !(both && s->absolute))
        report_unless(b, S_DOUBT_X | S_DOUBT_Y, FP_AT_ZERO, (Says){0});
    else
        return true;
    return false;
}

/* Note X and Y as programmed, if both polar words state them or both were known. */
void learn_polar(State *s, const Block *b) {
    const int32_t of_both = S_DOUBT_X | S_DOUBT_Y;
    const bool stated = s->absolute && b->has[V_WORD_RADIUS] && b->has[V_WORD_ANGLE];
    s->known_x = s->known_y = stated || (s->known_x && s->known_y);
    if (!stated && s->doubt & of_both)
        s->doubt |= of_both;
    else if (stated && !(s->doubt & (S_DOUBT_UNIT | S_DOUBT_DISTANCE)))
        s->doubt &= ~of_both;
}
