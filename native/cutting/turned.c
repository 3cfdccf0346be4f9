/* Cut a motion whose axis turns out of dexels and read the engagement along it.

The engagement is read at nodes (cutting_mark_turned), before the stock there is cut: the stock lags so far behind the cutter
that what is in front of the edge is thick. Points of the edge that the cutter has already been at since are found from its
poses. Each band of the edge has the chip of its own place on a rigid body that turns, and the force law of slices.h. Between two nodes that agree lies what is between theirs, else every sample is read. */

#include "cutting/edge.h"
#include "cutting/turned.h"

#define NO_CHIP_SHARE 1e-6  /* chip over feed per tooth below which there is none */
#define TAN_HOLLOW 0.035    /* of 2 degrees: a mill is hollow below by 1 to 3, and its bottom free of what it descends to gently */
#define FEEL_OF_NEAR 0.01   /* material that is thinner, as a share of what is near, is rounding */
#define SAME_COSINE 0.9986  /* of 3 degrees: a way that has turned by less is straight */
#define LONG_TURN 0.05      /* rad by which the axis turns at most within a step */
#define EVEN_OF_NEAR 0.015  /* by which a step may pass beside the way, as a share of what is near */
#define SHORT 0.3            /* length of a stretch, in radii, whose middle need not be read where both ends are alike */
#define SHARE_NEAR 0.05     /* of the force: what may lie beside the line between two nodes */

#define SHARE_ALIKE 0.05    /* by which the share of a bin may lie beside the line between two others */
#define CROSSES 0.5         /* change of depth along a stretch, as a share of it, from which on its surface does not graze it */
#define SEARCH_EDGE 0.1     /* of a stretch that is searched: so far from its ends it is read */

/* Bins from one that is read in any case to the next, and those of which one in the middle may speak for all. */
enum { MOST_MET = 12, SEARCHES = 3, FAR_BINS = 8, NEAR_BINS = 4, COLLISION_BINS = 32, NUMBERS = 6 };

/* Along `$BASE`: force and moment about the tip of a tooth times rad, torque. */
typedef struct {
    double of[NUMBERS], torque;
} Sum;

/* What is read at a sample: of the chip at 1 mm a tooth, of the edge; area of contact. */
typedef struct {
    Sum chip, edge;
    double a_p_mm, a_e_mm, area_mm2, phi_rad[2 * RD_ARCS];
    int64_t arc_count;
} Contact;

_Static_assert(sizeof(Contact) == TU_CONTACT_NUMBERS * sizeof(double), "a contact has that many numbers");

typedef struct {
    const Stock *stock;
    const Turned *points;
    const Cutters *cutters;
    const double *law;
    const Work *work;
    double near_mm;
} Turning;

/* How far a motion has come: the last point up to which the stock is cut, the last that is read (-1: none). */
typedef struct {
    int64_t cut, read;
} Progress;

_Static_assert(sizeof(Progress) == TU_PROGRESS * sizeof(int64_t), "and how far it has come that many");

/* A sample while it is read: its pose, feed normal to the axis, across it, and what was cut since. */
typedef struct {
    int64_t i, tool;
    Pose pose;
    double forward[3], across[3], feed_mm;
    const Body *body;
    int64_t met[MOST_MET], met_count;
} Place;

/* Return the largest feed per tooth along the edge. */
static double feed_of(const Turned *points, int64_t i) {
    const double top = body_of(points, AT(points->tool, i))->top;
    return length3(row3(points->feed_mm, i)) + top * length3(row3(points->swing, i));
}

static bool is_straight(const double *a, const double *b) {
    return dot3(a, b) >= SAME_COSINE * sqrt(dot3(a, a) * dot3(b, b));
}

/* Tell whether the tool moves otherwise at two points, so that nothing may be interpolated between them. */
static bool differs(const Turned *points, int64_t i, int64_t j) {
    return AT(points->tool, i) != AT(points->tool, j) || AT(points->rapid, i) != AT(points->rapid, j) ||
           (feed_of(points, i) == 0.0) != (feed_of(points, j) == 0.0) ||
           !is_straight(row3(points->feed_mm, i), row3(points->feed_mm, j)) ||
           !is_straight(row3(points->axis, i), row3(points->axis, j));
}

/* Mark the points of a way that are read in any case and between which it is cut: where it passes multiples of apart_mm (a row
   a tool), turns by 3 degrees, or changes; points that only shape it; all of a rapid. The first one is marked. */
EXPORT void cutting_mark_turned(const Turned *points, Floats apart_mm, Bools node) {
    int64_t last = 0;
    AT(node, 0) = 1;
    for (int64_t i = 1; i < node.rows; i++) {
        const double apart = AT(apart_mm, AT(points->tool, i));
        const bool is_new = differs(points, last, i);
        if (is_new)
            AT(node, i - 1) = 1;
        AT(node, i) = is_new || AT(points->rapid, i) || !AT(points->wanted, i) || AT(points->first, i) ||
                      floor(AT(points->way_mm, i) / apart) != floor(AT(points->way_mm, i - 1) / apart);
        last = AT(node, i) ? i : AT(node, i - 1) ? i - 1 : last;
    }
}

bool cut_way(const Stock *stock, const Turned *points, int64_t from, int64_t to, int32_t stamp, double *removed_mm) {
    const Body *body = body_of(points, AT(points->tool, to));
    const double longest = AT(points->longest_mm, AT(points->tool, to));
    Step step = {.from = pose_of(points, from)};
    minus3(row3(points->position_mm, to), step.from.tip, step.way);
    minus3(row3(points->axis, to), step.from.axis, step.turn);
    const double moved = length3(step.way) + body->top * length3(step.turn), turned = length3(step.turn);
    const int64_t count = most((int64_t)ceil(greater(moved / longest, turned / LONG_TURN)), 1);
    for (int64_t part = 0; part < count; part++) {
        Step piece = {.from = pose_at(&step, (double)part / (double)count),
                      .follows = part > 0 || !AT(points->first, from),
                      .stamp = stamp};
        const Pose end = pose_at(&step, (double)(part + 1) / (double)count);
        minus3(end.tip, piece.from.tip, piece.way);
        minus3(end.axis, piece.from.axis, piece.turn);
        if (!cut_out(stock, body, &piece, removed_mm))
            return false;
    }
    return true;
}

static double turned_between(const Turned *points, int64_t from, int64_t to) {
    return distance3(row3(points->axis, from), row3(points->axis, to));
}

/* Tell whether the nodes between two are so near a single step from one to the other that it may cut all the way. */
static bool is_one_step(const Turning *turning, int64_t from, int64_t to) {
    const Turned *points = turning->points;
    const int64_t tool = AT(points->tool, to);
    const double top = body_of(points, tool)->top, turn = turned_between(points, from, to);
    const double way = distance3(row3(points->position_mm, from), row3(points->position_mm, to)), whole = way + top * turn;
    if (AT(points->rapid, to) || whole > AT(points->longest_mm, tool) || turn > LONG_TURN)
        return false;
    for (int64_t k = from + 1; k < to; k++) {
        if (!AT(points->node, k))
            continue;
        const double passed = distance3(row3(points->position_mm, from), row3(points->position_mm, k)) +
                              top * turned_between(points, from, k);
        if (!(passed < whole))
            return false;
        double tip[3], axis[3];
        between3(row3(points->position_mm, from), row3(points->position_mm, to), passed / whole, tip);
        between3(row3(points->axis, from), row3(points->axis, to), passed / whole, axis);
        if (distance3(tip, row3(points->position_mm, k)) + top * distance3(axis, row3(points->axis, k)) >
            EVEN_OF_NEAR * turning->near_mm)
            return false;
    }
    return true;
}

/* Cut up to the last node that is not after a place on the way, in steps as long as may be: what might become longer waits,
   unless all is to be cut. Returns false where a ray has no room. */
static bool follow(const Turning *turning, double way_mm, int64_t last, Progress *progress, Floats rapid_mm) {
    const Turned *points = turning->points;
    for (;;) {
        int64_t to = -1;
        bool may_grow = way_mm < INFINITY;
        for (int64_t next = progress->cut + 1; next <= last; next++) {
            if (!AT(points->node, next))
                continue;
            if (AT(points->way_mm, next) > way_mm)
                break;
            const bool extends = !AT(points->first, next) && is_one_step(turning, progress->cut, next);
            if (to < 0 || extends)
                to = next;
            if (!extends) {
                may_grow = false;
                break;
            }
        }
        if (to < 0 || may_grow)
            return true;
        double removed[3] = {0.0, 0.0, 0.0};
        if (!AT(points->first, to) && !cut_way(turning->stock, points, progress->cut, to, 0, removed))
            return false;
        if (AT(points->rapid, to))
            AT(rapid_mm, to) = greater(AT(rapid_mm, to), lesser(removed[0], lesser(removed[1], removed[2])));
        progress->cut = to;
    }
}

/* Note the poses since the last cut from which the way has turned. */
static void list_met(const Turning *turning, int64_t cut, Place *place) {
    const Turned *points = turning->points;
    const double met_mm = AT(points->way_mm, place->i) - place->feed_mm;
    const int64_t stride = most((place->i - cut + MOST_MET - 1) / MOST_MET, 1);
    place->met_count = 0;
    for (int64_t k = cut; k < place->i && AT(points->way_mm, k) <= met_mm && place->met_count < MOST_MET; k += stride)
        if (!is_straight(row3(points->feed_mm, k), row3(points->feed_mm, place->i)) ||
            !is_straight(row3(points->axis, k), row3(points->axis, place->i)))
            place->met[place->met_count++] = k;
}

static Place place_at(const Turning *turning, int64_t i, int64_t cut) {
    const Turned *points = turning->points;
    Place place = {.i = i, .tool = AT(points->tool, i), .pose = pose_of(points, i), .feed_mm = feed_of(points, i)};
    place.body = body_of(points, place.tool);
    const double *feed = row3(points->feed_mm, i), *axis = place.pose.axis, *swing = row3(points->swing, i);
    double side[3], size = 0.0;
    for (int trial = 0; trial < 3 && !(size > 1e-6 * place.feed_mm && size > 0.0); trial++) {
        /* of a tool that sinks or turns on the spot, where its edge goes; else any direction */
        const double *along = trial == 0 ? feed : swing;
        double any[3] = {fabs(axis[0]) < 0.9, fabs(axis[0]) >= 0.9, 0.0};
        const double *from = trial == 2 ? any : along, up = dot3(from, axis);
        for (int k = 0; k < 3; k++)
            side[k] = from[k] - up * axis[k];
        size = length3(side);
    }
    for (int k = 0; k < 3; k++)
        place.forward[k] = side[k] / size;
    cross3(axis, place.forward, place.across);
    list_met(turning, cut, &place);
    return place;
}

/* Return how deep in material the point of the edge at a radius, a height and a bin is. */
static float depth_on(const Turning *turning, const Place *place, double radius, double height, int64_t bin) {
    const double ahead = radius * (double)CELL(turning->work->turn, RING_SIN, bin);
    const double aside = radius * (double)CELL(turning->work->turn, RING_COS, bin);
    double at[3];
    for (int k = 0; k < 3; k++)
        at[k] = place->pose.tip[k] + height * place->pose.axis[k] + ahead * place->forward[k] + aside * place->across[k];
    double depth = depth_at(turning->stock, at, turning->near_mm);
    for (int64_t m = 0; m < place->met_count && depth > 0.0; m++) {
        const Pose pose = pose_of(turning->points, place->met[m]);
        depth = lesser(depth, outside_at(place->body, &pose, at));
    }
    return (float)(depth - FEEL_OF_NEAR * turning->near_mm);
}

/* A band of the edge while it is read: depths on its rings, NaN where they are not read yet; shares of its bins that are engaged;
   its own feed, in bins turned by an angle from those of the sample. */
typedef struct {
    const Band *band;
    float *lower, *upper, *share;
    double forward[3], across[3], sine, cosine;
    double swing, offset, least; /* its chip, swing·sin phi + offset, and the least there is, as shares of the sample's feed */
} Edge;

/* Write the chip of a band; return false where it has none.

   The tool moves as a rigid body. A point of the edge has the chip n·(v + w x p), n = sin kappa·e - cos kappa·axis, p =
   z·axis + r·e; with w = axis x turn that is e·(sin kappa·v + (sin kappa·z + cos kappa·r)·turn) - cos kappa·axis·v. So on a
   ball only the velocity of its middle counts, and on a bottom, which sinks where the tool leans to, the turn alone. */
static bool set_feed(const Turning *turning, const Place *place, Edge *edge) {
    const double *feed = row3(turning->points->feed_mm, place->i), *swing = row3(turning->points->swing, place->i);
    const Band *band = edge->band;
    const double *axis = place->pose.axis, height = 0.5 * (band->low + band->high), radius = 0.5 * (band->r_low + band->r_high);
    const double lever = band->sin_kappa * height + band->cos_kappa * radius, up = dot3(feed, axis), about = dot3(swing, axis);
    for (int k = 0; k < 3; k++)
        edge->forward[k] = band->sin_kappa * (feed[k] - up * axis[k]) + lever * (swing[k] - about * axis[k]);
    const double aside = length3(edge->forward);
    edge->swing = aside / place->feed_mm;
    edge->offset = -band->cos_kappa * up / place->feed_mm;
    const double level = sqrt(greater(dot3(feed, feed) - up * up, 0.0)) / place->feed_mm;
    edge->least = band->sin_kappa > 0.0 ? NO_CHIP_SHARE : greater(NO_CHIP_SHARE, TAN_HOLLOW * level);
    if (!(edge->swing + edge->offset > edge->least))
        return false;
    if (edge->swing > NO_CHIP_SHARE)
        for (int k = 0; k < 3; k++)
            edge->forward[k] /= aside;
    else
        copy3(place->forward, edge->forward);
    cross3(axis, edge->forward, edge->across);
    edge->cosine = dot3(edge->forward, place->forward);
    edge->sine = dot3(edge->forward, place->across);
    return true;
}

/* Return the depth on the lower (false) or the upper ring of a band. */
static float ring_depth(const Turning *turning, const Place *place, const Edge *edge, bool is_upper, int64_t bin) {
    const Band *band = edge->band;
    float *known = is_upper ? &edge->upper[bin] : &edge->lower[bin];
    if (isnan(*known))
        *known = depth_on(turning, place, is_upper ? band->r_high : band->r_low, is_upper ? band->high : band->low, bin);
    return *known;
}

/* Return the share of a band that is engaged in a bin: where the material ends between its rings is searched, until the surface
   is near on both sides and passes between them, or for so many times. */
static double share_of(const Turning *turning, const Place *place, const Edge *edge, int64_t bin) {
    const Band *band = edge->band;
    const float first = ring_depth(turning, place, edge, false, bin), last = ring_depth(turning, place, edge, true, bin);
    if ((first > 0.0f) == (last > 0.0f))
        return first > 0.0f ? 1.0 : 0.0;
    const double known_mm = (1.0 - 2.0 * FEEL_OF_NEAR) * turning->near_mm;
    const double length_mm = hypot(band->high - band->low, band->r_high - band->r_low);
    double low = 0.0, high = 1.0, at_low = first, at_high = last;
    for (int search = 0; search < SEARCHES; search++) {
        const bool is_known = greater(fabs(at_low), fabs(at_high)) < known_mm;
        if (is_known && fabs(at_low - at_high) > CROSSES * (high - low) * length_mm)
            break;
        const double share = is_known ? 0.5 : clamped(at_low / (at_low - at_high), SEARCH_EDGE, 1.0 - SEARCH_EDGE);
        const double middle = low + share * (high - low);
        const double here = depth_on(turning, place, band->r_low + middle * (band->r_high - band->r_low),
                                     band->low + middle * (band->high - band->low), bin);
        if ((here > 0.0) == (first > 0.0f)) {
            low = middle;
            at_low = here;
        } else {
            high = middle;
            at_high = here;
        }
    }
    const double border = low + (high - low) * at_low / (at_low - at_high);
    return first > 0.0f ? border : 1.0 - border;
}

/* Tell whether both bins have material on both rings of a band, or both none, and so far around that it is the same in between. */
static bool is_plain(const Edge *edge, int64_t a, int64_t b, double apart_rad) {
    const bool is_in = edge->lower[a] > 0.0f;
    return is_in == (edge->upper[a] > 0.0f) && is_in == (edge->lower[b] > 0.0f) && is_in == (edge->upper[b] > 0.0f) &&
           fabs(edge->lower[a]) + fabs(edge->lower[b]) > apart_rad * edge->band->r_low &&
           fabs(edge->upper[a]) + fabs(edge->upper[b]) > apart_rad * edge->band->r_high;
}

/* Write the shares of the bins between two that are read: in the middle it is read, and so on by halves, until what lies around
   leaves no other, or a near one in the middle lies between its neighbours. */
static void fill_shares(const Turning *turning, const Place *place, const Edge *edge, int64_t a, int64_t b) {
    if (b - a < 2)
        return;
    float *share = edge->share;
    const int64_t bins = AT(turning->cutters->ring_bins, place->tool), middle = (a + b) / 2;
    bool is_even = is_plain(edge, a, b, (double)(b - a) * TURN / (double)bins);
    if (!is_even) {
        share[middle] = (float)share_of(turning, place, edge, middle);
        const bool is_engaged = share[a] > 0.0f && share[middle] > 0.0f && share[b] > 0.0f;
        is_even = b - a <= NEAR_BINS && is_engaged && fabs(share[middle] - 0.5 * (share[a] + share[b])) < SHARE_ALIKE;
    }
    if (!is_even) {
        fill_shares(turning, place, edge, a, middle);
        fill_shares(turning, place, edge, middle, b);
        return;
    }
    for (int64_t j = a + 1; j < b; j++)
        share[j] = share[a] + (share[b] - share[a]) * (float)(j - a) / (float)(b - a);
}

/* Write the shares of a run of bins. */
static void read_shares(const Turning *turning, const Place *place, const Edge *edge, int64_t first, int64_t after) {
    edge->share[first] = (float)share_of(turning, place, edge, first);
    for (int64_t at = first, next; at + 1 < after; at = next) {
        next = least(at + FAR_BINS, after - 1);
        edge->share[next] = (float)share_of(turning, place, edge, next);
        fill_shares(turning, place, edge, at, next);
    }
}

static void add_along(const Force *part, double width, double height, double radius, const Edge *edge,
                      const double *axis, Sum *sum) {
    double aside[3], about[3];
    for (int k = 0; k < 3; k++)
        aside[k] = width * (part->feed * edge->forward[k] + part->normal * edge->across[k]);
    cross3(axis, aside, about);
    const double torque = width * radius * part->tangential;
    for (int k = 0; k < 3; k++) {
        sum->of[k] += aside[k] - width * part->axial * axis[k];
        sum->of[3 + k] += height * about[k] + torque * axis[k];
    }
    sum->torque += torque;
}

/* Return integrals over bins as seen from a feed that is turned from theirs. */
static Integrals turned_by(const Integrals *bins, double sine, double cosine) {
    const double cos_cos = bins->one - bins->sin_sin, both = sine * cosine;
    return (Integrals){.one = bins->one,
                       .sin = bins->sin * cosine + bins->cos * sine,
                       .cos = bins->cos * cosine - bins->sin * sine,
                       .sin_sin = bins->sin_sin * cosine * cosine + 2.0 * bins->sin_cos * both + cos_cos * sine * sine,
                       .sin_cos = bins->sin_cos * (cosine * cosine - sine * sine) + (cos_cos - bins->sin_sin) * both};
}

/* Tell whether an edge moves towards material in a bin. */
static bool cuts(const Turning *turning, const Edge *edge, int64_t bin) {
    const double sine = CELL(turning->work->turn, RING_SIN, bin), cosine = CELL(turning->work->turn, RING_COS, bin);
    return (sine * edge->cosine + cosine * edge->sine) * edge->swing + edge->offset > edge->least;
}

/* Add the force of a band; mark the bins in which it is engaged. */
static void add_edge(const Turning *turning, const Place *place, Edge *edge, Contact *contact, double *most_mm,
                     double *least_mm) {
    const Band *band = edge->band;
    const Floats32 turn = turning->work->turn;
    const int64_t bins = AT(turning->cutters->ring_bins, place->tool);
    const double width = band->width, radius = 0.5 * (band->r_low + band->r_high);
    const Facet facet = facet_at(band->sin_kappa, band->cos_kappa, 1.0, edge->swing, edge->offset);
    const bool is_linear = turning->law[0] == LAW_LINEAR_EDGE;
    Integrals sums = {0.0, 0.0, 0.0, 0.0, 0.0};
    Parts parts = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
    double engaged = 0.0;
    for (int64_t j = 0, end; j < bins; j = end) {
        const bool is_in = cuts(turning, edge, j);
        for (end = j + 1; end < bins && cuts(turning, edge, end) == is_in;)
            end++;
        if (is_in)
            read_shares(turning, place, edge, j, end);
        for (int64_t k = j; k < end && !is_in; k++)
            edge->share[k] = 0.0f;
    }
    for (int64_t j = 0; j < bins; j++) {
        const double share = edge->share[j], cosine = CELL(turn, RING_COS, j);
        if (!(share > 0.0))
            continue;
        const double top = edge->upper[j] > 0.0f ? 1.0 : share;
        engaged += share;
        contact->a_p_mm = greater(contact->a_p_mm, band->low + top * (band->high - band->low));
        *most_mm = greater(*most_mm, band->r_high * cosine);
        *least_mm = lesser(*least_mm, band->r_high * cosine);
        CELL(turning->work->reach, 0, j) = 1.0f;
        if (!is_linear) {
            const double from = bin_angle((double)j, bins) + atan2(edge->sine, edge->cosine);
            Parts one = {{0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}};
            add_arc_force(from, from + TURN / (double)bins, &facet, turning->law, &one);
            const Force *force = &one.chip;
            parts.chip.feed += share * force->feed;
            parts.chip.normal += share * force->normal;
            parts.chip.axial += share * force->axial;
            parts.chip.tangential += share * force->tangential;
            continue;
        }
        sums.one += share * (double)CELL(turn, BIN_ONE, j);
        sums.sin += share * (double)CELL(turn, BIN_SIN, j);
        sums.cos += share * (double)CELL(turn, BIN_COS, j);
        sums.sin_sin += share * (double)CELL(turn, BIN_SIN_SIN, j);
        sums.sin_cos += share * (double)CELL(turn, BIN_SIN_COS, j);
    }
    if (engaged == 0.0)
        return;
    if (is_linear) {
        const Integrals own = turned_by(&sums, edge->sine, edge->cosine);
        add_linear_edge(&own, &facet, turning->law, &parts);
    }
    const double height = 0.5 * (band->low + band->high);
    add_along(&parts.chip, width, height, radius, edge, place->pose.axis, &contact->chip);
    add_along(&parts.edge, width, height, radius, edge, place->pose.axis, &contact->edge);
    contact->area_mm2 += engaged * TURN / (double)bins * radius * width;
}

/* List the arcs of the bins that are marked. */
static void list_bins(const Turning *turning, int64_t bins, Contact *contact) {
    Arcs arcs = {.count = 0};
    int64_t open_at = -1;
    for (int64_t j = 0; j <= bins; j++) {
        const bool is_engaged = j < bins && CELL(turning->work->reach, 0, j) > 0.0f;
        if (is_engaged && open_at < 0)
            open_at = j;
        if (!is_engaged && open_at >= 0) {
            put_arc(&arcs, bin_angle((double)open_at, bins), bin_angle((double)j, bins));
            open_at = -1;
        }
    }
    write_union(&arcs, contact->phi_rad, RD_ARCS);
    contact->arc_count = arcs.count;
}

static void forget(float *depths, int64_t bins) {
    for (int64_t j = 0; j < bins; j++)
        depths[j] = NAN;
}

/* Read the engagement at a sample. */
static Contact read_contact(const Turning *turning, int64_t i, int64_t cut) {
    Contact contact = {.arc_count = 0};
    const Turned *points = turning->points;
    if (!(feed_of(points, i) > 0.0))
        return contact;
    const Place place = place_at(turning, i, cut);
    const double *tip = place.pose.tip, *axis = place.pose.axis, flat = sqrt(greater(1.0 - axis[2] * axis[2], 0.0));
    const int64_t bins = AT(turning->cutters->ring_bins, place.tool), used = AT(turning->cutters->used, place.tool);
    double most_mm = -INFINITY, least_mm = INFINITY;
    const double up = 0.5 * place.body->top;
    const double highest = highest_near(turning->stock, tip[0] + up * axis[0], tip[1] + up * axis[1],
                                        place.body->radius + up * flat); /* beside all of the edge */
    Edge edge = {.lower = &CELL(turning->work->rows, LOWER, 0), .upper = &CELL(turning->work->rows, UPPER, 0),
                 .share = &CELL(turning->work->rows, SHARE, 0)};
    for (int64_t j = 0; j < bins; j++)
        CELL(turning->work->reach, 0, j) = 0.0f;
    forget(edge.upper, bins);
    for (int64_t b = 0; b < used; b++) {
        edge.band = (const Band *)&CELL(turning->cutters->bands, place.tool, b * ED_BAND_COLUMNS);
        float *free_row = edge.lower;
        edge.lower = edge.upper;
        edge.upper = free_row;
        forget(edge.upper, bins);
        const double middle = 0.5 * (edge.band->low + edge.band->high), half = edge.band->high - middle;
        const double wide = edge.band->r_high + half;
        const double lowest = tip[2] + middle * axis[2] - half * fabs(axis[2]) - edge.band->r_high * flat;
        const double x = tip[0] + middle * axis[0], y = tip[1] + middle * axis[1];
        if (highest <= lowest || highest_near(turning->stock, x, y, wide) <= lowest || !set_feed(turning, &place, &edge))
            continue;
        add_edge(turning, &place, &edge, &contact, &most_mm, &least_mm);
    }
    if (contact.area_mm2 > 0.0) {
        contact.a_e_mm = most_mm - least_mm;
        list_bins(turning, bins, &contact);
    }
    return contact;
}

/* Return how far material reaches up the middle of a tool from its tip. */
static double core_of(const Turning *turning, int64_t i) {
    const Pose pose = pose_of(turning->points, i);
    const double step = 0.5 * turning->near_mm, most_mm = body_of(turning->points, AT(turning->points->tool, i))->top;
    double up = 0.0;
    for (; up < most_mm; up += step) {
        double at[3];
        for (int k = 0; k < 3; k++)
            at[k] = pose.tip[k] + (up + step) * pose.axis[k];
        if (!(depth_at(turning->stock, at, turning->near_mm) > 0.0))
            break;
    }
    return up;
}

/* A row of Cutters.above: what stands above the edge, from where to where on the axis; radius 0 = not checked. */
typedef struct {
    double radius, low, high;
} Above;

/* Return how deep a cylinder about the axis is in material: from its wall, or from its lower end. */
static double overlap_of(const Turning *turning, const Pose *pose, const Above *above, double inner) {
    const double step = turning->near_mm, flat = sqrt(greater(1.0 - squared(pose->axis[2]), 0.0));
    double worst = 0.0;
    for (double up = above->low; up <= above->high; up += step) {
        double middle[3], side[3] = {fabs(pose->axis[0]) < 0.9, fabs(pose->axis[0]) >= 0.9, 0.0}, front[3];
        for (int k = 0; k < 3; k++)
            middle[k] = pose->tip[k] + up * pose->axis[k];
        if (highest_near(turning->stock, middle[0], middle[1], above->radius) <= middle[2] - above->radius * flat)
            continue;
        cross3(pose->axis, side, front);
        const double size = length3(front);
        for (int k = 0; k < 3; k++)
            front[k] /= size;
        cross3(pose->axis, front, side);
        for (int bin = 0; bin < COLLISION_BINS; bin++) {
            const double ahead = cos(TURN * bin / COLLISION_BINS), aside = sin(TURN * bin / COLLISION_BINS);
            double in = above->radius;
            for (; in > inner; in -= step) {
                double at[3];
                for (int k = 0; k < 3; k++)
                    at[k] = middle[k] + in * (ahead * front[k] + aside * side[k]);
                if (!(depth_at(turning->stock, at, turning->near_mm) > 0.0))
                    break;
            }
            worst = greater(worst, lesser(above->radius - in, up - above->low + step));
        }
    }
    return worst;
}

/* Write what is known of a sample beside its contact. */
static void write_beside(const Turning *turning, int64_t i, bool is_node, const Result *result) {
    const Turned *points = turning->points;
    const double *feed = row3(points->feed_mm, i), *axis = row3(points->axis, i), up = dot3(feed, axis);
    const double aside = sqrt(greater(dot3(feed, feed) - up * up, 0.0));
    const int64_t tool = AT(points->tool, i);
    AT(result->ramp_rad, i) = up == 0.0 ? 0.0 : atan2(-up, aside);
    if (up < 0.0)
        AT(result->centre_mm, i) = core_of(turning, i);
    const Above *above = (const Above *)&CELL(turning->cutters->above, tool, 0);
    const Pose pose = pose_of(points, i);
    for (int part = 0; part < 2 && is_node; part++)
        if (above[part].radius > body_of(points, tool)->radius)
            CELL(result->overlap_mm, i, 1 + part) =
                overlap_of(turning, &pose, &above[part], body_of(points, tool)->radius);
}

static double mixed(double a, double b, double share) { return a + share * (b - a); }

/* Write the row of a sample that lies a share of the way from one reading to another. */
static void write_contact(const Turning *turning, int64_t i, const Contact *a, const Contact *b, double share,
                          const Result *result, Floats area_mm2) {
    const Contact *nearest = share > 0.5 ? b : a;
    const double feed_mm = feed_of(turning->points, i);
    if (nearest->arc_count == 0)
        return;
    for (int64_t k = 0; k < 2 * nearest->arc_count; k++)
        CELL(result->phi_rad, i, k) =
            a->arc_count == b->arc_count ? mixed(a->phi_rad[k], b->phi_rad[k], share) : nearest->phi_rad[k];
    AT(result->a_p_mm, i) = mixed(a->a_p_mm, b->a_p_mm, share);
    AT(result->a_e_mm, i) = mixed(a->a_e_mm, b->a_e_mm, share);
    AT(area_mm2, i) = mixed(a->area_mm2, b->area_mm2, share);
    if (!(feed_mm > 0.0))
        return;
    const double per_turn = AT(turning->cutters->teeth, AT(turning->points->tool, i)) / TURN;
    const double scale = feed_scale(turning->law, feed_mm);
    for (int k = 0; k < 3; k++) {
        CELL(result->force_N, i, k) = per_turn * (scale * mixed(a->chip.of[k], b->chip.of[k], share) +
                                                  mixed(a->edge.of[k], b->edge.of[k], share));
        CELL(result->moment_Nmm, i, k) = per_turn * (scale * mixed(a->chip.of[3 + k], b->chip.of[3 + k], share) +
                                                     mixed(a->edge.of[3 + k], b->edge.of[3 + k], share));
    }
    AT(result->torque_Nmm, i) = per_turn * (scale * mixed(a->chip.torque, b->chip.torque, share) +
                                            mixed(a->edge.torque, b->edge.torque, share));
}

/* Tell whether what is read at a sample is nearly what lies between two others. */
static bool lies_between(const Turning *turning, int64_t i, const Contact *here, const Contact *a, const Contact *b,
                         double share) {
    if (here->arc_count != a->arc_count || a->arc_count != b->arc_count)
        return false;
    const double scale = feed_scale(turning->law, greater(feed_of(turning->points, i), 1e-6));
    double off = 0.0, whole = 0.0;
    for (int k = 0; k < 3; k++) {
        const double force = scale * here->chip.of[k] + here->edge.of[k];
        const double line =
            scale * mixed(a->chip.of[k], b->chip.of[k], share) + mixed(a->edge.of[k], b->edge.of[k], share);
        off += squared(force - line);
        whole += squared(force);
    }
    return off <= squared(SHARE_NEAR) * whole;
}

/* Tell whether both ends of a short stretch are alike. */
static bool is_level(const Turning *turning, int64_t i, const Contact *a, int64_t j, const Contact *b) {
    const Turned *points = turning->points;
    return AT(points->way_mm, j) - AT(points->way_mm, i) <= SHORT * body_of(points, AT(points->tool, j))->radius &&
           lies_between(turning, j, b, a, a, 0.0);
}

/* Write the rows after one reading up to another: the middle one is read, and so on by halves until it lies between. */
static void read_between(const Turning *turning, int64_t cut, int64_t i, const Contact *a, int64_t j, const Contact *b,
                         const Result *result, Floats area_mm2) {
    if (j - i < 2)
        return;
    if (is_level(turning, i, a, j, b)) {
        for (int64_t k = i + 1; k < j; k++)
            write_contact(turning, k, a, b, (double)(k - i) / (double)(j - i), result, area_mm2);
        return;
    }
    const int64_t middle = (i + j) / 2;
    const double share = (double)(middle - i) / (double)(j - i);
    const Contact here = read_contact(turning, middle, cut);
    AT(result->is_read, middle) = 1;
    write_contact(turning, middle, &here, &here, 0.0, result, area_mm2);
    if (!lies_between(turning, middle, &here, a, b, share)) {
        read_between(turning, cut, i, a, middle, &here, result, area_mm2);
        read_between(turning, cut, middle, &here, j, b, result, area_mm2);
        return;
    }
    for (int64_t k = i + 1; k < j; k++) {
        if (k < middle)
            write_contact(turning, k, a, &here, (double)(k - i) / (double)(middle - i), result, area_mm2);
        if (k > middle)
            write_contact(turning, k, &here, b, (double)(k - middle) / (double)(j - middle), result, area_mm2);
    }
}

/* Cut points one after the other up to the last node, and write the rows of all of them behind the last that was read; where
   the motion `ends`, that node is the last point, and all is cut. rapid_mm: how deep rapids cut on the way to points; area_mm2: the area
   of contact. Returns false where a ray has no room: it is then to be called again, with more. */
EXPORT int64_t cutting_turned(const Dexels *dexels, const Turned *points, const Cutters *cutters, Floats law,
                              const Work *work, double near_mm, int64_t ends, Ints progress_so_far,
                              Floats contact_so_far, Floats rapid_mm, Floats area_mm2, const Result *result) {
    const Stock stock = stock_of(dexels);
    const Turning turning = {&stock, points, cutters, law.at, work, near_mm};
    Progress *progress = (Progress *)&AT(progress_so_far, 0);
    Contact last = *(const Contact *)&AT(contact_so_far, 0);
    int64_t tool = -1, count = points->way_mm.rows;
    for (int64_t end = progress->read + 1; end < count; end++) {
        if (!AT(points->node, end))
            continue;
        const int64_t begin = progress->read, first = most(begin, 0);
        if (AT(points->tool, end) != tool) {
            tool = AT(points->tool, end);
            fill_turn(work, AT(cutters->ring_bins, tool), AT(cutters->ring_bins, tool));
        }
        /* the stock lags behind the first sample that is read, but not across a change of tool */
        int64_t changed = begin < 0 ? 0 : end;
        while (changed > progress->cut && !AT(points->first, changed))
            changed--;
        if (!follow(&turning, INFINITY, changed - 1, progress, rapid_mm))
            return 0;
        if (changed > progress->cut && AT(points->first, changed))
            progress->cut = changed;
        if (!follow(&turning, AT(points->way_mm, least(begin + 1, end)) - AT(cutters->lag_mm, tool), first, progress, rapid_mm))
            return 0;
        const Contact here = read_contact(&turning, end, progress->cut);
        AT(result->is_read, end) = 1;
        write_contact(&turning, end, &here, &here, 0.0, result, area_mm2);
        if (begin >= 0)
            read_between(&turning, progress->cut, begin, &last, end, &here, result, area_mm2);
        for (int64_t i = begin + 1; i <= end; i++)
            write_beside(&turning, i, i == end, result);
        last = here;
        progress->read = end;
        *(Contact *)&AT(contact_so_far, 0) = last;
    }
    return !ends || follow(&turning, INFINITY, count - 1, progress, rapid_mm);
}
